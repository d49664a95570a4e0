//! The paper's modulus: stress over mean strain, equation (31).

use super::estimate::{LoadDiagnostics, ModulusEstimate, ModulusEstimator};
use super::kind::EstimatorKind;
use super::load::{LoadSeries, LoadState, validated};
use super::statistics::{CommonMean, Covariance, LogErrors, common_mean, fewest, total};
use super::warning::Warning;
use crate::error::{ElasticityError, Quantity};
use tactile_core::statistics::{effective_degrees_of_freedom, quantile_95};
use tactile_core::{Estimate, Interval};

/// Strain beyond which one modulus no longer describes a rubber.
pub(crate) const LINEAR_STRAIN: f64 = 0.1;

/// What the strain of a load is counted from.
///
/// ```
/// use tactile_elasticity::modulus::{
///     Estimate, LoadSeries, LoadState, ModulusEstimator, PaperRatio, StrainReference,
/// };
///
/// // Two pressed frames: the strain between them belongs to the difference of their stresses.
/// let load = |force, strain| LoadState {
///     contact_area_m2: Some(Estimate::exact(1e-4)),
///     mean_strain: Some(Estimate::exact(strain)),
///     ..LoadState::new(Estimate::new(force, 1e-4))
/// };
/// let loads = LoadSeries::new([load(0.7, 0.0), load(1.2, 0.05)]);
/// let modulus = PaperRatio::default()
///     .with_reference(StrainReference::FirstLoad)
///     .estimate(&loads)?;
/// assert!((modulus.youngs_modulus_pa - (1.2 - 0.7) / 1e-4 / 0.05_f64).abs() < 1e-6);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum StrainReference {
    /// The unloaded object: stress is counted from zero.
    #[default]
    Unloaded,
    /// The first load, as when two pressed frames are matched: stress is counted from there, and
    /// its own strain, where it has one, is taken from all others.
    FirstLoad,
}

/// E = S_zz / ⟨e_zz⟩, equation (31): right where the loading is uniaxial.
///
/// On a sphere it is biased by construction. Hertz's pressure p₀√(1 − r²/a²), read as the shading
/// of a surface, is a hemisphere of radius a ∝ (FR/E*)^⅓, whose apparent strain between two loads,
/// ½((F₂/F₁)^⅔ − 1), does not depend on E at all. The modulus enters through the mean pressure
/// F/(πa²) ∝ (E*/R)^⅔ F^⅓ alone. Give the sphere's radius to be told so, and use
/// [`HertzSphere`](super::HertzSphere) for a number.
///
/// Several loads are averaged with the weights of their relative errors.
///
/// ```
/// use tactile_elasticity::modulus::{
///     Estimate, LoadSeries, LoadState, ModulusEstimator, PaperRatio, SharedErrors,
///     StrainReference, Warning,
/// };
///
/// let load = LoadState {
///     contact_area_m2: Some(Estimate::exact(1e-4)),
///     contact_radius_m: Some(Estimate::exact(5.64e-3)),
///     mean_strain: Some(Estimate::new(0.02, 1e-4)),
///     ..LoadState::new(Estimate::new(0.12, 0.001))
/// };
/// let series = LoadSeries::new([load]);
/// let plain = PaperRatio::default()
///     .with_reference(StrainReference::Unloaded)
///     .estimate(&series)?;
/// assert!((plain.youngs_modulus_pa - 60e3_f64).abs() < 1e-6);
///
/// // Errors that loads share come with the series; on a sphere the ratio is biased, and says so.
/// let series = series.with_shared_errors(SharedErrors {
///     force_scale: 0.01,
///     ..SharedErrors::default()
/// })?;
/// let careful = PaperRatio::default()
///     .with_sphere_radius(3e-3)?
///     .estimate(&series)?;
/// assert!(careful.standard_error_pa > plain.standard_error_pa);
/// assert!(
///     careful
///         .warnings
///         .iter()
///         .any(|w| matches!(w, Warning::RatioOnSphere { .. }))
/// );
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PaperRatio {
    reference: StrainReference,
    sphere_radius_m: Option<f64>,
}

impl PaperRatio {
    /// With strain counted from `reference`. By default from the unloaded state.
    pub fn with_reference(mut self, reference: StrainReference) -> Self {
        self.reference = reference;
        self
    }

    /// The object is a sphere of this radius (m): the bias is warned of, with a/R.
    ///
    /// # Errors
    /// [`ElasticityError::NotPositive`].
    pub fn with_sphere_radius(mut self, radius_m: f64) -> Result<Self, ElasticityError> {
        self.sphere_radius_m = Some(Quantity::Radius.positive(radius_m)?);
        Ok(self)
    }

    /// The first load's own strain, where strains are counted from an earlier state but the ratio
    /// from the first load.
    fn first_strain(&self, loads: &[LoadState]) -> Estimate {
        let first = loads.first().and_then(|load| load.mean_strain);
        first
            .filter(|_| self.reference == StrainReference::FirstLoad)
            .unwrap_or(Estimate::exact(0.0))
    }

    fn ratios(&self, loads: &[LoadState]) -> Result<Vec<Ratio>, ElasticityError> {
        let mut ratios = Vec::new();
        let from_first = self.reference == StrainReference::FirstLoad;
        let base = if from_first {
            loads.first().map(|l| stress(0, l)).transpose()?
        } else {
            None
        };
        let first_strain = self.first_strain(loads);
        for (load, state) in loads.iter().enumerate().skip(usize::from(from_first)) {
            let Some(strain) = state.mean_strain else {
                continue;
            };
            let strain = validated(strain, Quantity::Strain)?.value - first_strain.value;
            let stress_pa = stress(load, state)?.value - base.map_or(0.0, |b| b.value);
            if stress_pa == 0.0 && from_first {
                return Err(ElasticityError::EqualLoads);
            }
            if strain == 0.0 {
                return Err(ElasticityError::ZeroStrain);
            }
            if stress_pa * strain <= 0.0 {
                return Err(ElasticityError::OppositeSigns { stress_pa, strain });
            }
            ratios.push(Ratio {
                load,
                stress_pa,
                strain,
            });
        }
        if ratios.is_empty() {
            let expected = if from_first { 2 } else { 1 };
            return Err(ElasticityError::TooFewLoads {
                expected,
                found: loads.len().min(expected - 1),
            });
        }
        Ok(ratios)
    }

    /// Covariances of the ln E, from forces, areas, strains and the scale of all stresses, each
    /// with its degrees of freedom.
    ///
    /// d ln E = (dS_i − dS_0)/(S_i − S_0) − de_i/e_i with dS = dF/A − S dA/A. What the first load's
    /// stress errs by, all ratios share.
    fn sources(&self, series: &LoadSeries, ratios: &[Ratio]) -> [LogErrors; 4] {
        let loads = series.loads();
        let areas: Vec<_> = loads.iter().map(LoadState::area).collect();
        let area_of = |k: usize| areas[k].map_or(1.0, |a| a.value);
        let from_first = self.reference == StrainReference::FirstLoad;
        let own = |i: usize| ratios[i].load;
        let none = Covariance::none(ratios.iter().map(|r| r.load));

        // Change of ln E of ratio i with the force, and with the area, of load k.
        let by_force = |i: usize, k: usize| 1.0 / (ratios[i].stress_pa * area_of(k));
        let by_area = |i: usize, k: usize| {
            loads[k].force_n.value / (ratios[i].stress_pa * area_of(k).powi(2))
        };
        let force_error = |k: usize| loads[k].force_n.standard_error;
        let area_error = |k: usize| areas[k].map_or(0.0, |a| a.standard_error);
        let forces = match series.force_covariance() {
            Some(given) => none.clone().with_given(|i, j| {
                let (k, l) = (own(i), own(j));
                let of_pair = |k: usize, l: usize| by_force(i, k) * by_force(j, l) * given[(k, l)];
                let about_first = if from_first {
                    of_pair(0, 0) - of_pair(k, 0) - of_pair(0, l)
                } else {
                    0.0
                };
                of_pair(k, l) + about_first
            }),
            None => {
                let forces = none
                    .clone()
                    .with_own(|i| by_force(i, own(i)) * force_error(own(i)));
                if from_first {
                    forces.with_shared(|i| by_force(i, 0) * force_error(0))
                } else {
                    forces
                }
            }
        };
        // The scale of the forces comes from the calibration that their own errors come from.
        let forces = forces.with_shared(|_| series.shared_errors().force_scale);
        let mut of_areas = none
            .clone()
            .with_own(|i| by_area(i, own(i)) * area_error(own(i)));
        if from_first {
            of_areas = of_areas.with_shared(|i| by_area(i, 0) * area_error(0));
        }
        let scale = none.clone().with_shared(|_| series.size_scale_error());
        let strains = match series.strain_covariance() {
            Some(given) => none
                .with_given(|i, j| given[(own(i), own(j))] / (ratios[i].strain * ratios[j].strain)),
            None => {
                let first = self.first_strain(loads).standard_error;
                none.with_own(|i| {
                    loads[own(i)].mean_strain.map_or(0.0, |e| e.standard_error) / ratios[i].strain
                })
                .with_shared(|i| first / ratios[i].strain)
            }
        };
        let degrees = |of: &dyn Fn(usize) -> Option<Estimate>| {
            let estimates = (0..loads.len()).filter_map(of);
            fewest(estimates.map(|e| e.degrees_of_freedom))
        };
        [
            (forces, degrees(&|k| Some(loads[k].force_n))),
            (of_areas, degrees(&|k| areas[k])),
            (strains, degrees(&|k| loads[k].mean_strain)),
            (scale, None),
        ]
    }

    fn warnings(
        &self,
        loads: &[LoadState],
        diagnostics: &[LoadDiagnostics],
        mean: &CommonMean,
    ) -> Vec<Warning> {
        let mut warnings = strain_warnings(loads);
        let on_sphere = |(load, d): (usize, &LoadDiagnostics)| {
            Some(Warning::RatioOnSphere {
                load,
                ratio: d.contact_ratio?,
            })
        };
        warnings.extend(diagnostics.iter().enumerate().filter_map(on_sphere));
        warnings.extend(mean.warnings(true));
        warnings
    }

    fn diagnose(
        &self,
        loads: &[LoadState],
        ratios: &[Ratio],
        mean: &CommonMean,
    ) -> Vec<LoadDiagnostics> {
        let mut diagnostics = vec![LoadDiagnostics::default(); loads.len()];
        for (d, state) in diagnostics.iter_mut().zip(loads) {
            let ratio = self
                .sphere_radius_m
                .zip(state.contact_radius_m)
                .map(|(radius, a)| a.value / radius);
            d.contact_ratio = ratio;
        }
        for (r, &residual) in ratios.iter().zip(&mean.standardized_residuals) {
            diagnostics[r.load].used = true;
            diagnostics[r.load].youngs_modulus_pa = Some(r.log().exp());
            diagnostics[r.load].standardized_residual = Some(residual);
        }
        diagnostics
    }
}

struct Ratio {
    load: usize,
    stress_pa: f64,
    strain: f64,
}

impl Ratio {
    fn log(&self) -> f64 {
        (self.stress_pa / self.strain).ln()
    }
}

/// Mean stress of a load with its error. The area must be above zero.
pub(crate) fn stress(load: usize, state: &LoadState) -> Result<Estimate, ElasticityError> {
    let force = validated(state.force_n, Quantity::Force)?;
    let quantity = if state.contact_area_m2.is_some() {
        Quantity::ContactArea
    } else {
        Quantity::ContactRadius
    };
    if let Some(radius) = state
        .contact_radius_m
        .filter(|_| state.contact_area_m2.is_none())
    {
        quantity.positive(radius.value)?;
    }
    let missing = ElasticityError::Missing {
        load,
        quantity: Quantity::ContactArea,
    };
    let area = validated(state.area().ok_or(missing)?, quantity)?;
    quantity.positive(area.value)?;
    let value = force.value / area.value;
    let standard_error = (force.standard_error / area.value).hypot(value * area.relative_error());
    let parts = [force, area].map(|e| (e.relative_error().powi(2), e.degrees_of_freedom));
    let mut stress = Estimate::new(value, standard_error);
    stress.degrees_of_freedom = effective_degrees_of_freedom(&parts);
    Ok(stress)
}

impl ModulusEstimator for PaperRatio {
    fn estimate(&self, series: &LoadSeries) -> Result<ModulusEstimate, ElasticityError> {
        let loads = series.loads();
        let ratios = self.ratios(loads)?;
        let sources = self.sources(series, &ratios);
        let logs: Vec<f64> = ratios.iter().map(Ratio::log).collect();
        let mean = common_mean(&logs, &total(&sources))?;
        let reach = quantile_95(mean.degrees_from(&sources)) * mean.standard_error;
        let modulus = mean.mean.exp();
        let diagnostics = self.diagnose(loads, &ratios, &mean);
        Ok(ModulusEstimate {
            youngs_modulus_pa: modulus,
            standard_error_pa: (modulus * mean.standard_error),
            interval_95: Interval::new(
                (mean.mean - reach).exp(),
                reach.is_finite().then(|| (mean.mean + reach).exp()),
            ),
            estimator: EstimatorKind::PaperRatio,
            warnings: self.warnings(loads, &diagnostics, &mean),
            loads: diagnostics,
            fit: mean.fit_statistics(),
        })
    }

    fn kind(&self) -> EstimatorKind {
        EstimatorKind::PaperRatio
    }
}

/// Loads whose strain is beyond the linear law.
pub(crate) fn strain_warnings(loads: &[LoadState]) -> Vec<Warning> {
    (loads.iter().enumerate())
        .filter_map(|(load, state)| state.mean_strain.map(|e| (load, e.value)))
        .filter(|(_, strain)| strain.abs() > LINEAR_STRAIN)
        .map(|(load, strain)| Warning::LargeStrain {
            load,
            strain,
            limit: LINEAR_STRAIN,
        })
        .collect()
}
