//! The paper's modulus: stress over mean strain, equation (31).

use super::estimate::{
    EstimatorKind, FitStatistics, Interval, LoadDiagnostics, ModulusEstimate, ModulusEstimator,
};
use super::load::{Estimate, LoadState};
use super::statistics::{common_mean, quantile_95};
use super::warning::Warning;
use crate::error::{ElasticityError, Quantity, not_negative, positive};
use crate::scalar::{narrow, widen};
use nalgebra::{DMatrix, RealField};

/// Strain beyond which one modulus no longer describes a rubber.
pub(crate) const LINEAR_STRAIN: f64 = 0.1;

/// What the strain of a load is counted from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum StrainReference {
    /// The unloaded object: stress is counted from zero.
    #[default]
    Unloaded,
    /// The first load, as when two pressed frames are matched: stress is counted from there.
    FirstLoad,
}

/// E = S_zz / ⟨e_zz⟩, equation (31): right where the loading is uniaxial.
///
/// On a sphere it is biased by construction. Hertz's pressure p₀√(1 − r²/a²), read as the shading of a surface,
/// is a hemisphere of radius a ∝ (FR/E*)^⅓, whose apparent strain between two loads, ½((F₂/F₁)^⅔ − 1), does not depend on E at
/// all; the modulus enters through the mean pressure F/(πa²) ∝ (E*/R)^⅔ F^⅓ alone. Give the sphere's radius to be told so,
/// and use [`HertzSphere`](super::HertzSphere) for a number.
///
/// Several loads are averaged with the weights of their relative errors.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PaperRatio {
    reference: StrainReference,
    sphere_radius_m: Option<f64>,
    stress_scale_error: f64,
}

impl PaperRatio {
    /// With strain counted from the unloaded state.
    pub fn new() -> Self {
        Self::default()
    }

    /// With strain counted from `reference`.
    pub fn with_reference(mut self, reference: StrainReference) -> Self {
        self.reference = reference;
        self
    }

    /// The object is a sphere of this radius (m): the bias is warned of, with a/R.
    ///
    /// # Errors
    /// [`ElasticityError::NotPositive`].
    pub fn with_sphere_radius<T: RealField + Copy>(mut self, radius_m: T) -> Result<Self, ElasticityError> {
        self.sphere_radius_m = Some(positive(widen(radius_m), Quantity::Radius)?);
        Ok(self)
    }

    /// Relative error that all stresses share (the slope of one calibration).
    ///
    /// # Errors
    /// [`ElasticityError::Negative`].
    pub fn with_stress_scale_error<T: RealField + Copy>(
        mut self,
        relative: T,
    ) -> Result<Self, ElasticityError> {
        self.stress_scale_error = not_negative(widen(relative), Quantity::StandardError)?;
        Ok(self)
    }

    fn ratios(&self, loads: &[LoadState<f64>]) -> Result<Vec<Ratio>, ElasticityError> {
        let mut ratios = Vec::new();
        let from_first = self.reference == StrainReference::FirstLoad;
        let base = if from_first { loads.first().map(|l| stress(0, l)).transpose()? } else { None };
        for (load, state) in loads.iter().enumerate().skip(usize::from(from_first)) {
            let Some(strain) = state.mean_strain else { continue };
            let strain = strain.validated(Quantity::Strain)?;
            let mut s = stress(load, state)?;
            if let Some(base) = base {
                s = Estimate {
                    value: s.value - base.value,
                    standard_error: s.standard_error.hypot(base.standard_error),
                };
            }
            if s.value == 0.0 && from_first {
                return Err(ElasticityError::EqualLoads);
            }
            if strain.value == 0.0 {
                return Err(ElasticityError::ZeroStrain);
            }
            if s.value * strain.value <= 0.0 {
                return Err(ElasticityError::OppositeSigns { stress_pa: s.value, strain: strain.value });
            }
            ratios.push(Ratio {
                load,
                log: (s.value / strain.value).ln(),
                variance: s.relative_error().powi(2) + strain.relative_error().powi(2),
            });
        }
        if ratios.is_empty() {
            let expected = if from_first { 2 } else { 1 };
            return Err(ElasticityError::TooFewLoads { expected, found: loads.len().min(expected - 1) });
        }
        Ok(ratios)
    }
}

struct Ratio {
    load: usize,
    log: f64,
    variance: f64,
}

/// Mean stress of a load with its error; the area must be above zero.
pub(crate) fn stress(load: usize, state: &LoadState<f64>) -> Result<Estimate<f64>, ElasticityError> {
    let force = state.force_n.validated(Quantity::Force)?;
    let (area, relative) = match (state.contact_area_m2, state.contact_radius_m) {
        (Some(area), _) => {
            let area = area.validated(Quantity::ContactArea)?;
            (positive(area.value, Quantity::ContactArea)?, area.relative_error())
        }
        (None, Some(a)) => {
            let a = a.validated(Quantity::ContactRadius)?;
            positive(a.value, Quantity::ContactRadius)?;
            (std::f64::consts::PI * a.value * a.value, 2.0 * a.relative_error())
        }
        (None, None) => return Err(ElasticityError::Missing { load, quantity: Quantity::ContactArea }),
    };
    let value = force.value / area;
    Ok(Estimate { value, standard_error: (force.standard_error / area).hypot(value * relative) })
}

impl<T: RealField + Copy> ModulusEstimator<T> for PaperRatio {
    fn estimate(&self, loads: &[LoadState<T>]) -> Result<ModulusEstimate<T>, ElasticityError> {
        let loads: Vec<_> = loads.iter().map(LoadState::widened).collect();
        let ratios = self.ratios(&loads)?;
        let shared = self.stress_scale_error.powi(2);
        let covariance = DMatrix::from_fn(ratios.len(), ratios.len(), |i, j| {
            shared + if i == j { ratios[i].variance } else { 0.0 }
        });
        let logs: Vec<f64> = ratios.iter().map(|r| r.log).collect();
        let mean = common_mean(&logs, &covariance)?;
        let reach = quantile_95(mean.degrees) * mean.standard_error;
        let modulus = mean.mean.exp();
        let mut diagnostics = vec![LoadDiagnostics::unused(); loads.len()];
        for (i, r) in ratios.iter().enumerate() {
            diagnostics[r.load].used = true;
            diagnostics[r.load].youngs_modulus_pa = Some(narrow(r.log.exp()));
            diagnostics[r.load].standardized_residual = Some(narrow(mean.standardized_residuals[i]));
        }
        let mut warnings = strain_warnings(&loads);
        for (load, state) in loads.iter().enumerate() {
            if let (Some(radius), Some(a)) = (self.sphere_radius_m, state.contact_radius_m) {
                let ratio = narrow(a.value / radius);
                diagnostics[load].contact_ratio = Some(ratio);
                warnings.push(Warning::RatioOnSphere { load, ratio });
            }
        }
        warnings.extend(mean.excess.map(|x| Warning::ExcessScatter { reduced_chi_squared: narrow(x) }));
        if mean.standard_error.is_infinite() {
            warnings.push(Warning::NoErrorEstimate);
        }
        Ok(ModulusEstimate {
            youngs_modulus_pa: narrow(modulus),
            standard_error_pa: narrow(modulus * mean.standard_error),
            interval_95: Interval {
                lower: narrow((mean.mean - reach).exp()),
                upper: reach.is_finite().then(|| narrow((mean.mean + reach).exp())),
            },
            estimator: EstimatorKind::PaperRatio,
            loads: diagnostics,
            fit: FitStatistics::new(ratios.len(), 1, mean.chi_squared, mean.minus_two_log_likelihood),
            warnings,
        })
    }

    fn kind(&self) -> EstimatorKind {
        EstimatorKind::PaperRatio
    }
}

/// Loads whose strain is beyond the linear law.
pub(crate) fn strain_warnings<T: RealField + Copy>(loads: &[LoadState<f64>]) -> Vec<Warning<T>> {
    (loads.iter().enumerate())
        .filter_map(|(load, state)| state.mean_strain.map(|e| (load, e.value)))
        .filter(|(_, strain)| strain.abs() > LINEAR_STRAIN)
        .map(|(load, strain)| Warning::LargeStrain {
            load,
            strain: narrow(strain),
            limit: narrow(LINEAR_STRAIN),
        })
        .collect()
}
