//! Estimators and their results.

use super::warning::Warning;
use crate::error::ElasticityError;
use crate::modulus::LoadSeries;
use std::sync::Arc;
use tactile_core::Interval;

/// Estimates Young's modulus from a series of loads.
///
/// An estimator holds what is known of the object; what was measured, with its errors, comes with the
/// [`LoadSeries`]. One estimator therefore serves any number of series, and a boxed or shared one is an estimator as well.
///
/// ```
/// use tactile_elasticity::modulus::{Estimate, HertzSphere, LoadSeries, LoadState, ModulusEstimator};
/// // A rigid ball of 5 mm on a sample of 30 kPa.
/// let loads: Vec<_> = [0.01, 0.02, 0.04]
///     .map(|f| {
///         let a = (0.75 * f * 0.005 / (30e3 / 0.75f64)).cbrt();
///         LoadState { contact_radius_m: Some(Estimate::new(a, 1e-6)), ..LoadState::new(Estimate::new(f, 1e-4)) }
///     })
///     .to_vec();
/// let estimator: Box<dyn ModulusEstimator> = Box::new(HertzSphere::new(0.005, 0.5)?);
/// let modulus = estimator.estimate(&LoadSeries::new(loads))?;
/// assert!((modulus.youngs_modulus_pa - 30e3).abs() < 1e-6);
/// assert!(modulus.interval_95.contains(30e3));
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
pub trait ModulusEstimator {
    /// Young's modulus of the sample with its error.
    ///
    /// # Errors
    /// [`ElasticityError`] where the loads do not determine it.
    fn estimate(&self, series: &LoadSeries) -> Result<ModulusEstimate, ElasticityError>;

    /// Which estimator this is.
    ///
    /// ```
    /// use tactile_elasticity::modulus::{EstimatorKind, ModulusEstimator, PaperRatio};
    ///
    /// let estimator: Box<dyn ModulusEstimator> = Box::new(PaperRatio::default());
    /// assert_eq!(estimator.kind(), EstimatorKind::PaperRatio);
    /// ```
    fn kind(&self) -> EstimatorKind;

    /// Whether it uses the loads' strains. Without them a caller can leave out surfaces, matches and warps.
    ///
    /// ```
    /// use tactile_elasticity::modulus::{HertzSphere, ModulusEstimator, PaperRatio};
    ///
    /// let estimators: [Box<dyn ModulusEstimator>; 2] = [Box::new(PaperRatio::default()), Box::new(HertzSphere::new(3e-3, 0.5)?)];
    /// assert_eq!(estimators.map(|e| e.needs_strain()), [true, false]);
    /// # Ok::<(), tactile_elasticity::ElasticityError>(())
    /// ```
    fn needs_strain(&self) -> bool {
        true
    }
}

impl<E: ModulusEstimator + ?Sized> ModulusEstimator for Box<E> {
    fn estimate(&self, series: &LoadSeries) -> Result<ModulusEstimate, ElasticityError> {
        (**self).estimate(series)
    }

    fn kind(&self) -> EstimatorKind {
        (**self).kind()
    }

    fn needs_strain(&self) -> bool {
        (**self).needs_strain()
    }
}

impl<E: ModulusEstimator + ?Sized> ModulusEstimator for Arc<E> {
    fn estimate(&self, series: &LoadSeries) -> Result<ModulusEstimate, ElasticityError> {
        (**self).estimate(series)
    }

    fn kind(&self) -> EstimatorKind {
        (**self).kind()
    }

    fn needs_strain(&self) -> bool {
        (**self).needs_strain()
    }
}

/// The estimators, by name.
///
/// ```
/// use tactile_elasticity::modulus::EstimatorKind;
///
/// assert_eq!(EstimatorKind::PaperRatio.to_string(), "stress over mean strain");
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
#[allow(missing_docs)]
pub enum EstimatorKind {
    PaperRatio,
    StressStrainRegression,
    HertzSphere,
    SphereOnWaveguide,
    /// A soft ball on a rigid flat, at finite strain.
    SphereOnFlat,
    /// A soft ball on what its table of contacts was made for.
    TabulatedContact,
    SphereBetweenPlates,
    TipOnBall,
    FlatPunch,
    Cone,
    /// A sphere on a half-space; what touches sticks.
    SphereWithoutSlip,
    FlatPunchWithoutSlip,
    ConeWithoutSlip,
    LayerPublishedSeries,
    LayerCorrectedSeries,
    LayerIntegralEquation,
    FreeLayerIntegralEquation,
    TataraSphere,
    /// The best of several by Akaike's criterion.
    BestOf,
    /// An estimator from outside this crate, by its name.
    Other(&'static str),
}

impl core::fmt::Display for EstimatorKind {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::PaperRatio => "stress over mean strain",
            Self::StressStrainRegression => "regression of stress on strain",
            Self::HertzSphere => "Hertz sphere",
            Self::SphereOnWaveguide => "sphere on a layered waveguide",
            Self::SphereOnFlat => "sphere on a rigid flat, finite strain",
            Self::TabulatedContact => "sphere, tabulated contacts",
            Self::TipOnBall => "rigid tip on a ball on a plate",
            Self::SphereBetweenPlates => "Hertz sphere between two bodies",
            Self::FlatPunch => "flat punch",
            Self::Cone => "cone",
            Self::SphereWithoutSlip => "sphere without slip",
            Self::FlatPunchWithoutSlip => "flat punch without slip",
            Self::ConeWithoutSlip => "cone without slip",
            Self::LayerPublishedSeries => "sphere on a layer, published series",
            Self::LayerCorrectedSeries => "sphere on a layer, corrected series",
            Self::LayerIntegralEquation => "sphere on a layer, integral equation",
            Self::FreeLayerIntegralEquation => "sphere on a sliding layer, integral equation",
            Self::TataraSphere => "Tatara's sphere",
            Self::BestOf => "best of several",
            Self::Other(name) => name,
        })
    }
}

/// Young's modulus with its error, its fit and its warnings.
///
/// ```
/// use tactile_elasticity::contact::HertzContact;
/// use tactile_elasticity::modulus::{Estimate, HertzSphere, LoadSeries, LoadState, ModulusEstimate, ModulusEstimator, Warning};
///
/// let contact = HertzContact::from_force(0.05_f64, 3e-3, 40e3)?;
/// let load = LoadState {
///     contact_radius_m: Some(Estimate::new(contact.contact_radius_m, 1e-6)),
///     ..LoadState::new(Estimate::new(0.05, 1e-4))
/// };
/// let modulus: ModulusEstimate = HertzSphere::new(3e-3, 0.5)?.estimate(&LoadSeries::new([load]))?;
/// assert!(modulus.interval_95.contains(30e3));
/// // The number stands, with the warning that a/R = 0.47 is much.
/// assert!(matches!(modulus.warnings[0], Warning::LargeContact { load: 0, ratio, .. } if ratio > 0.4));
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct ModulusEstimate {
    /// E of the sample.
    pub youngs_modulus_pa: f64,
    /// Its standard error, to first order.
    pub standard_error_pa: f64,
    /// 95 % confidence interval, not symmetric where E depends on the data non-linearly.
    pub interval_95: Interval,
    /// Which estimator.
    pub estimator: EstimatorKind,
    /// Per load, in the order given.
    pub loads: Vec<LoadDiagnostics>,
    /// How the data agree with the law.
    pub fit: FitStatistics,
    /// Where the estimator's assumptions fail.
    pub warnings: Vec<Warning>,
}

/// What one load contributed.
///
/// ```
/// use tactile_elasticity::contact::HertzContact;
/// use tactile_elasticity::modulus::{Estimate, HertzSphere, LoadSeries, LoadState, ModulusEstimator};
///
/// // The second load carries nothing but its force.
/// let contact = HertzContact::from_force(1e-3_f64, 5e-3, 40e3)?;
/// let force = LoadState::new(Estimate::new(1e-3, 1e-5));
/// let loads = [LoadState { contact_radius_m: Some(Estimate::new(contact.contact_radius_m, 1e-6)), ..force }, force];
/// let modulus = HertzSphere::new(5e-3, 0.5)?.estimate(&LoadSeries::new(loads))?;
/// assert!(modulus.loads[0].used && !modulus.loads[1].used);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct LoadDiagnostics {
    /// True when the load carried what the estimator needs.
    pub used: bool,
    /// a/R, measured, or by the law from what was measured.
    pub contact_ratio: Option<f64>,
    /// The modulus this load alone would give.
    pub youngs_modulus_pa: Option<f64>,
    /// Residual over its standard deviation.
    pub standardized_residual: Option<f64>,
}

impl LoadDiagnostics {
    pub(crate) fn unused() -> Self {
        Self {
            used: false,
            contact_ratio: None,
            youngs_modulus_pa: None,
            standardized_residual: None,
        }
    }
}

/// How a law fits the data. Smaller information criteria are better; they compare laws on the same data only.
///
/// ```
/// use tactile_elasticity::contact::HertzContact;
/// use tactile_elasticity::modulus::{Estimate, HertzSphere, LoadSeries, LoadState, ModulusEstimator};
///
/// let loads: Vec<LoadState> = [1e-3, 2e-3, 4e-3]
///     .into_iter()
///     .map(|force| {
///         let contact = HertzContact::from_force(force, 5e-3, 40e3)?;
///         let radius = Estimate::new(contact.contact_radius_m, 1e-6);
///         Ok(LoadState { contact_radius_m: Some(radius), ..LoadState::new(Estimate::new(force, 1e-5)) })
///     })
///     .collect::<Result<_, tactile_elasticity::ElasticityError>>()?;
/// let fit = HertzSphere::new(5e-3, 0.5)?.estimate(&LoadSeries::new(loads))?.fit;
/// assert_eq!((fit.observations, fit.parameters), (3, 1));
/// assert!(fit.chi_squared < 1e-12);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct FitStatistics {
    /// Number of observations.
    pub observations: usize,
    /// Number of fitted parameters.
    pub parameters: usize,
    /// Σ (residual/σ)², or the residuals' own sum where no σ was given.
    pub chi_squared: f64,
    /// Akaike's criterion with the small-sample correction; infinite with too few observations.
    pub aicc: f64,
    /// Schwarz's criterion.
    pub bic: f64,
}

impl FitStatistics {
    pub(crate) fn new(
        observations: usize,
        parameters: usize,
        chi_squared: f64,
        minus_two_log_likelihood: f64,
    ) -> Self {
        let (n, k) = (observations as f64, parameters as f64);
        let correction = if n > k + 1.0 {
            2.0 * k * (k + 1.0) / (n - k - 1.0)
        } else {
            f64::INFINITY
        };
        Self {
            observations,
            parameters,
            chi_squared: chi_squared,
            aicc: (minus_two_log_likelihood + 2.0 * k + correction),
            bic: (minus_two_log_likelihood + k * n.ln()),
        }
    }
}
