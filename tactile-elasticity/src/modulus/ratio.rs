//! The paper's modulus: stress over mean strain, equation (31).

use super::estimate::{LoadDiagnostics, ModulusEstimate, ModulusEstimator};
use super::kind::EstimatorKind;
use super::load::{LoadSeries, LoadState, validated};
use super::statistics::{CommonMean, CommonTo, Covariance, common_mean};
use super::warning::Warning;
use crate::error::{ElasticityError, Quantity};
use tactile_core::statistics::quantile_95;
use tactile_core::{Interval, Source, Uncertain};

/// Strain above which a single modulus no longer describes a rubber.
pub(crate) const LINEAR_STRAIN: f64 = 0.1;

/// Origin of the strain of a load.
///
/// ```
/// use tactile_elasticity::modulus::{
///     Estimate, LoadSeries, LoadState, ModulusEstimator, PaperRatio, StrainReference,
/// };
///
/// // Two pressed frames: the strain between them belongs to the difference of their stresses.
/// let load = |force, strain| LoadState::new(Estimate::new(force, 1e-4))
///     .with_area(Estimate::exact(1e-4))
///     .with_strain(Estimate::exact(strain));
/// let loads = LoadSeries::new([load(0.7, 0.0), load(1.2, 0.05)]);
/// let modulus = PaperRatio::default()
///     .with_reference(StrainReference::FirstLoad)
///     .estimate(&loads)?;
/// assert!((modulus.youngs_modulus_pa - (1.2 - 0.7) / 1e-4 / 0.05_f64).abs() < 1e-6);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum StrainReference {
    /// The unloaded object: stress is counted from zero.
    #[default]
    Unloaded,
    /// The first load, for example if two pressed frames are matched: stress is counted from there.
    /// If the first load has a strain, it is subtracted from all others.
    FirstLoad,
}

/// E = S_zz / ⟨e_zz⟩, equation (31): correct under uniaxial load.
///
/// On a sphere it is biased by construction. Hertz's pressure p₀√(1 − r²/a²), interpreted as the
/// shading of a surface, is a hemisphere of radius a ∝ (FR/E*)^⅓. Its apparent strain between two
/// loads, ½((F₂/F₁)^⅔ − 1), does not depend on E at all. The modulus enters only through the mean
/// pressure F/(πa²) ∝ (E*/R)^⅔ F^⅓. State the radius of the sphere to get a warning, and use
/// [`HertzSphere`](super::HertzSphere) for the modulus.
///
/// Several loads are averaged with the weights of their relative errors.
///
/// ```
/// use tactile_elasticity::modulus::{
///     Estimate, LoadSeries, LoadState, ModulusEstimator, PaperRatio, Warning,
/// };
///
/// let load = LoadState::new(Estimate::new(0.12, 0.001))
///     .with_area(Estimate::exact(1e-4))
///     .with_radius(Estimate::exact(5.64e-3))
///     .with_strain(Estimate::new(0.02, 1e-4));
/// let series = LoadSeries::new([load]);
/// let plain = PaperRatio::default().estimate(&series)?;
/// assert!((plain.youngs_modulus_pa - 60e3_f64).abs() < 1e-6);
///
/// // On a sphere the ratio is biased, which gives a warning.
/// let on_sphere = PaperRatio::default().with_sphere_radius(3e-3)?.estimate(&series)?;
/// let biased = |w: &Warning| matches!(w, Warning::RatioOnSphere { .. });
/// assert!(on_sphere.warnings.iter().any(biased));
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PaperRatio {
    reference: StrainReference,
    sphere_radius_m: Option<f64>,
}

impl PaperRatio {
    /// Sets the origin of strain. The default is the unloaded state.
    pub fn with_reference(mut self, reference: StrainReference) -> Self {
        self.reference = reference;
        self
    }

    /// States that the object is a sphere of this radius (m), so that results carry a warning about
    /// the bias, with a/R.
    /// # Errors
    /// [`ElasticityError::NotPositive`].
    pub fn with_sphere_radius(mut self, radius_m: f64) -> Result<Self, ElasticityError> {
        self.sphere_radius_m = Some(Quantity::Radius.positive(radius_m)?);
        Ok(self)
    }

    fn ratios(&self, loads: &[LoadState]) -> Result<Ratios, ElasticityError> {
        let mut ratios = Vec::new();
        let from_first = self.reference == StrainReference::FirstLoad;
        let (mut first_stress, mut first_strain) = (Uncertain::exact(0.0), Uncertain::exact(0.0));
        if let (true, Some(first)) = (from_first, loads.first()) {
            first_stress = stress(0, first)?;
            // The strain of the first load, if strains are counted from an earlier state.
            first_strain = first.mean_strain.unwrap_or(first_strain);
        }
        for (load, state) in loads.iter().enumerate().skip(usize::from(from_first)) {
            let Some(strain) = state.mean_strain else {
                continue;
            };
            // The noise of the first load is common to all ratios.
            let own = |number: Uncertain| number.without(Source::Noise);
            let strain = validated(strain, Quantity::Strain)? - own(first_strain);
            let stress = stress(load, state)? - own(first_stress);
            let (stress_pa, strain_value) = (stress.value, strain.value);
            if stress_pa == 0.0 && from_first {
                return Err(ElasticityError::EqualLoads);
            }
            if strain_value == 0.0 {
                return Err(ElasticityError::ZeroStrain);
            }
            if stress_pa * strain_value <= 0.0 {
                return Err(ElasticityError::OppositeSigns {
                    stress_pa,
                    strain: strain_value,
                });
            }
            ratios.push(Ratio {
                load,
                log_modulus: (stress / strain).map(f64::ln, f64::recip),
                stress_pa,
                strain: strain_value,
            });
        }
        if ratios.is_empty() {
            let expected = if from_first { 2 } else { 1 };
            return Err(ElasticityError::TooFewLoads {
                expected,
                found: loads.len().min(expected - 1),
            });
        }
        Ok(Ratios {
            ratios,
            first_stress,
            first_strain,
        })
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
            diagnostics[r.load].youngs_modulus_pa = Some(r.log_modulus.value.exp());
            diagnostics[r.load].standardized_residual = Some(residual);
        }
        diagnostics
    }
}

struct Ratio {
    load: usize,
    /// ln E, without the noise of the first load.
    log_modulus: Uncertain,
    stress_pa: f64,
    strain: f64,
}

/// Ratios with their origin.
struct Ratios {
    ratios: Vec<Ratio>,
    first_stress: Uncertain,
    first_strain: Uncertain,
}

impl Ratios {
    /// d ln E = (dSᵢ − dS₀)/(Sᵢ − S₀) − (deᵢ − de₀)/(eᵢ − e₀).
    fn mean(&self) -> Result<CommonMean, ElasticityError> {
        let ratios = &self.ratios;
        let numbers: Vec<_> = ratios.iter().map(|r| r.log_modulus).collect();
        let logs: Vec<f64> = numbers.iter().map(|log| log.value).collect();
        let first = |of: &Uncertain| (of.part(Source::Noise), of.degrees_of_freedom(Source::Noise));
        let (stress, stress_degrees) = first(&self.first_stress);
        let (strain, strain_degrees) = first(&self.first_strain);
        let by_stress = |i: usize| stress / ratios[i].stress_pa;
        let by_strain = |i: usize| strain / ratios[i].strain;
        let covariance = Covariance::of(&numbers, ratios.iter().map(|r| r.load))
            .with(Source::Noise, CommonTo::All, stress_degrees, by_stress)
            .with(Source::Noise, CommonTo::All, strain_degrees, by_strain);
        common_mean(&logs, &covariance)
    }
}

/// Mean stress of a load with its error. The area must be above zero.
pub(crate) fn stress(load: usize, state: &LoadState) -> Result<Uncertain, ElasticityError> {
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
    Ok(force / area)
}

impl ModulusEstimator for PaperRatio {
    fn estimate(&self, series: &LoadSeries) -> Result<ModulusEstimate, ElasticityError> {
        let loads = series.loads();
        let ratios = self.ratios(loads)?;
        let mean = ratios.mean()?;
        let log = mean.mean.total();
        let reach = quantile_95(log.degrees_of_freedom) * log.standard_error;
        let by_source = mean.mean.map(f64::exp, f64::exp);
        let diagnostics = self.diagnose(loads, &ratios.ratios, &mean);
        Ok(ModulusEstimate {
            youngs_modulus_pa: by_source.value,
            standard_error_pa: by_source.standard_error(),
            by_source,
            interval_95: Interval::new(
                (log.value - reach).exp(),
                reach.is_finite().then(|| (log.value + reach).exp()),
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

/// Warnings for loads whose strain is outside the range of the linear law.
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
