//! Estimators and their results.

use super::kind::EstimatorKind;
use super::load::LoadSeries;
use super::warning::Warning;
use crate::error::ElasticityError;
use std::ops::Deref;
use tactile_core::{Interval, Uncertain};

/// Estimates Young's modulus from a series of loads.
///
/// An estimator holds the prior knowledge of the object. The measurements and their errors come
/// with the [`LoadSeries`], so one estimator serves any number of series. A boxed or shared
/// estimator also implements the trait.
///
/// ```
/// use tactile_elasticity::modulus::{
///     Estimate, HertzSphere, LoadSeries, LoadState, ModulusEstimator,
/// };
/// // A rigid ball of 5 mm on a sample of 30 kPa.
/// let loads: Vec<_> = [0.01, 0.02, 0.04]
///     .map(|f| {
///         let a = (0.75 * f * 0.005 / (30e3 / 0.75f64)).cbrt();
///         LoadState::new(Estimate::new(f, 1e-4)).with_radius(Estimate::new(a, 1e-6))
///     })
///     .to_vec();
/// let estimator: Box<dyn ModulusEstimator> = Box::new(HertzSphere::new(0.005, 0.5)?);
/// let modulus = estimator.estimate(&LoadSeries::new(loads))?;
/// assert!((modulus.youngs_modulus_pa - 30e3).abs() < 1e-6);
/// assert!(modulus.interval_95.contains(30e3));
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
pub trait ModulusEstimator: Send + Sync {
    /// Young's modulus of the sample with its error.
    ///
    /// # Errors
    /// [`ElasticityError`] if the loads do not determine the modulus.
    fn estimate(&self, series: &LoadSeries) -> Result<ModulusEstimate, ElasticityError>;

    /// The kind of the estimator.
    ///
    /// ```
    /// use tactile_elasticity::modulus::{EstimatorKind, ModulusEstimator, PaperRatio};
    ///
    /// let estimator: Box<dyn ModulusEstimator> = Box::new(PaperRatio::default());
    /// assert_eq!(estimator.kind(), EstimatorKind::PaperRatio);
    /// ```
    fn kind(&self) -> EstimatorKind;

    /// Whether the estimator uses the strains of the loads. If not, a caller can skip surfaces,
    /// matches and warps.
    ///
    /// ```
    /// use tactile_elasticity::modulus::{HertzSphere, ModulusEstimator, PaperRatio};
    ///
    /// let estimators: [Box<dyn ModulusEstimator>; 2] = [
    ///     Box::new(PaperRatio::default()),
    ///     Box::new(HertzSphere::new(3e-3, 0.5)?),
    /// ];
    /// assert_eq!(estimators.map(|e| e.needs_strain()), [true, false]);
    /// # Ok::<(), tactile_elasticity::ElasticityError>(())
    /// ```
    fn needs_strain(&self) -> bool {
        true
    }

    /// Whether the result takes the guide of the series' [bodies](LoadSeries::bodies) into account.
    /// If a result from contacts alone does not, a pipeline adds the caution
    /// [`Warning::GuideIgnored`]. A user-defined estimator that uses the guide of the series
    /// returns `true`.
    ///
    /// ```
    /// use tactile_elasticity::contact::Body;
    /// use tactile_elasticity::modulus::{HertzSphere, ModulusEstimator};
    ///
    /// let completed = HertzSphere::new(3e-3, 0.5)?;
    /// let on_steel = completed.clone().with_other_body(Body::rigid());
    /// assert!(completed.counts_guide() && !on_steel.counts_guide());
    /// # Ok::<(), tactile_elasticity::ElasticityError>(())
    /// ```
    fn counts_guide(&self) -> bool {
        false
    }
}

/// Implements the trait for boxed, shared and borrowed estimators.
impl<P: Deref<Target: ModulusEstimator> + Send + Sync> ModulusEstimator for P {
    fn estimate(&self, series: &LoadSeries) -> Result<ModulusEstimate, ElasticityError> {
        (**self).estimate(series)
    }

    fn kind(&self) -> EstimatorKind {
        (**self).kind()
    }

    fn needs_strain(&self) -> bool {
        (**self).needs_strain()
    }

    fn counts_guide(&self) -> bool {
        (**self).counts_guide()
    }
}

/// Young's modulus with its error, its fit and its warnings.
///
/// ```
/// use tactile_elasticity::contact::HertzContact;
/// use tactile_elasticity::modulus::{
///     Estimate, HertzSphere, LoadSeries, LoadState, ModulusEstimate, ModulusEstimator, Warning,
/// };
///
/// let contact = HertzContact::from_force(0.05_f64, 3e-3, 40e3)?;
/// let load = LoadState::new(Estimate::new(0.05, 1e-4))
///     .with_radius(Estimate::new(contact.contact_radius_m, 1e-6));
/// let modulus: ModulusEstimate =
///     HertzSphere::new(3e-3, 0.5)?.estimate(&LoadSeries::new([load]))?;
/// assert!(modulus.interval_95.contains(30e3));
/// // The value is valid, with the warning that a/R = 0.47 is large.
/// assert!(
///     matches!(modulus.warnings[0], Warning::LargeContact { load: 0, ratio, .. } if ratio > 0.4)
/// );
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct ModulusEstimate {
    /// E of the sample.
    pub youngs_modulus_pa: f64,
    /// Standard error, to first order.
    pub standard_error_pa: f64,
    /// The same modulus with its error by source.
    pub by_source: Uncertain,
    /// 95 % confidence interval. It is asymmetric if E depends non-linearly on the data.
    pub interval_95: Interval,
    /// The estimator.
    pub estimator: EstimatorKind,
    /// Diagnostics per load, in the order given.
    pub loads: Vec<LoadDiagnostics>,
    /// Agreement of the data with the law.
    pub fit: FitStatistics,
    /// Violated assumptions of the estimator.
    pub warnings: Vec<Warning>,
}

impl ModulusEstimate {
    /// Creates the result of a user-defined estimator: E in pascals, as an
    /// [`Estimate`](tactile_core::Estimate) or as a number with its error by source. The interval
    /// is symmetric, by Student's t if the error has degrees of freedom, and its lower end is not
    /// negative.
    ///
    /// ```
    /// use tactile_elasticity::modulus::{Estimate, EstimatorKind, ModulusEstimate};
    ///
    /// let modulus_pa = Estimate::new(62e3, 2e3).with_degrees_of_freedom(4.0);
    /// let estimate = ModulusEstimate::new(EstimatorKind::Other("stiffness"), modulus_pa);
    /// assert!((estimate.interval_95.lower - (62e3 - 2.776 * 2e3)).abs() < 1.0);
    /// assert!(estimate.loads.is_empty() && estimate.warnings.is_empty());
    /// ```
    pub fn new(estimator: EstimatorKind, youngs_modulus_pa: impl Into<Uncertain>) -> Self {
        let by_source = youngs_modulus_pa.into();
        let total = by_source.total();
        let interval = total.interval_95();
        Self {
            youngs_modulus_pa: total.value,
            standard_error_pa: total.standard_error,
            by_source,
            interval_95: Interval::new(interval.lower.max(0.0), interval.upper),
            estimator,
            loads: Vec::new(),
            fit: FitStatistics::new(1, 1, 0.0),
            warnings: Vec::new(),
        }
    }
}

/// Contribution of one load.
///
/// ```
/// use tactile_elasticity::contact::HertzContact;
/// use tactile_elasticity::modulus::{
///     Estimate, HertzSphere, LoadSeries, LoadState, ModulusEstimator,
/// };
///
/// // The second load has only a force.
/// let contact = HertzContact::from_force(1e-3_f64, 5e-3, 40e3)?;
/// let force = LoadState::new(Estimate::new(1e-3, 1e-5));
/// let loads = [
///     force.with_radius(Estimate::new(contact.contact_radius_m, 1e-6)),
///     force,
/// ];
/// let modulus = HertzSphere::new(5e-3, 0.5)?.estimate(&LoadSeries::new(loads))?;
/// assert!(modulus.loads[0].used && !modulus.loads[1].used);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct LoadDiagnostics {
    /// Whether the load has the quantities that the estimator needs.
    pub used: bool,
    /// a/R, measured or derived by the law.
    pub contact_ratio: Option<f64>,
    /// The modulus from this load alone.
    pub youngs_modulus_pa: Option<f64>,
    /// Residual over its standard deviation.
    pub standardized_residual: Option<f64>,
}

/// Agreement of the data with a law.
///
/// ```
/// use tactile_elasticity::contact::HertzContact;
/// use tactile_elasticity::modulus::{
///     Estimate, HertzSphere, LoadSeries, LoadState, ModulusEstimator,
/// };
///
/// let loads: Vec<LoadState> = [1e-3, 2e-3, 4e-3]
///     .into_iter()
///     .map(|force| {
///         let contact = HertzContact::from_force(force, 5e-3, 40e3)?;
///         let radius = Estimate::new(contact.contact_radius_m, 1e-6);
///         Ok(LoadState::new(Estimate::new(force, 1e-5)).with_radius(radius))
///     })
///     .collect::<Result<_, tactile_elasticity::ElasticityError>>()?;
/// let fit = HertzSphere::new(5e-3, 0.5)?
///     .estimate(&LoadSeries::new(loads))?
///     .fit;
/// assert_eq!((fit.observations, fit.parameters), (3, 1));
/// assert!(fit.chi_squared < 1e-12);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct FitStatistics {
    /// Number of observations.
    pub observations: usize,
    /// Number of fitted parameters.
    pub parameters: usize,
    /// Σ (residual/σ)², or the sum of squared residuals if no σ was given.
    pub chi_squared: f64,
}

impl FitStatistics {
    /// Computes the statistics from the numbers of observations and parameters, and χ².
    pub(crate) fn new(observations: usize, parameters: usize, chi_squared: f64) -> Self {
        Self {
            observations,
            parameters,
            chi_squared,
        }
    }
}
