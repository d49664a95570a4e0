//! Which estimator the loads speak for.

use super::{
    BondedLayer, EstimatorKind, HertzSphere, LayerTheory, LoadState, ModulusEstimate,
    ModulusEstimator, SphereBetweenPlates, SphereOnWaveguide, TataraSphere,
};
use crate::contact::{Bond, Waveguide};
use crate::error::ElasticityError;
use crate::scalar::widen;
use crate::selection::{SelectionReason, akaike_weights, rank};
use nalgebra::RealField;

/// Estimators by name, boxed for a choice at run time.
///
/// ```
/// use tactile_elasticity::modulus::{Candidates, HertzSphere, TataraSphere};
///
/// let candidates: Candidates<f64> =
///     vec![Box::new(TataraSphere::new(3e-3, 0.5)?), Box::new(HertzSphere::new(3e-3, 0.5)?)];
/// assert_eq!(candidates[0].kind().to_string(), "Tatara's sphere");
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
pub type Candidates<T> = Vec<Box<dyn ModulusEstimator<T>>>;

/// All estimators tried on the same loads, the best first.
///
/// ```
/// use tactile_elasticity::contact::HertzContact;
/// use tactile_elasticity::modulus::*;
///
/// // One load cannot tell laws apart: the most general candidate is the answer.
/// let contact = HertzContact::from_force(1e-3_f64, 5e-3, 40e3)?;
/// let load = LoadState::new(Estimate::new(1e-3, 1e-5)).with_contact_radius(Estimate::new(contact.contact_radius_m, 1e-6));
/// let candidates: Candidates<f64> =
///     vec![Box::new(TataraSphere::new(5e-3, 0.5)?), Box::new(HertzSphere::new(5e-3, 0.5)?)];
/// let selection: ModulusSelection<f64> = select_estimator(&candidates, &[load])?;
/// assert_eq!(selection.chosen().estimator, EstimatorKind::TataraSphere);
/// assert!(selection.left_out.is_empty());
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct ModulusSelection<T> {
    /// Estimates; the first is the chosen one, the others follow by their criterion. Each carries its warnings.
    pub estimates: Vec<ModulusEstimate<T>>,
    /// Akaike weights of the estimates, in their order.
    pub weights: Vec<f64>,
    /// Why the first was chosen.
    pub reason: SelectionReason,
    /// Estimators without an answer, or with one from other observations than the most general candidate's: these cannot be compared.
    pub left_out: Vec<EstimatorKind>,
}

impl<T> ModulusSelection<T> {
    /// The chosen estimate.
    pub fn chosen(&self) -> &ModulusEstimate<T> {
        &self.estimates[0]
    }
}

/// Estimates with every candidate and chooses by Akaike's criterion: among those within 2 of the best, the first in the list,
/// so give the most general theory first.
///
/// The criterion is that of [`FitStatistics`](super::FitStatistics): AICc, or AIC where the loads are too few for the correction.
/// Loads of one size cannot tell laws apart: the first candidate is then the answer, with the reason
/// [`SelectionReason::MostGeneral`].
///
/// # Errors
/// The first candidate's, where none has an answer; [`ElasticityError::TooFewLoads`] without candidates.
///
/// ```
/// use tactile_elasticity::contact::Bond;
/// use tactile_elasticity::modulus::{Estimate, EstimatorKind, LoadState, select_estimator, sphere_on_sample};
/// // A ball of 5 mm on a deep sample of 30 kPa: δ³ᐟ² = 3F/(4E*√R).
/// let loads = [0.002, 0.01, 0.05].map(|f: f64| {
///     let d = (0.75 * f / (40e3 * 0.005f64.sqrt())).powf(2.0 / 3.0);
///     LoadState::new(Estimate::exact(f)).with_indentation(Estimate::new(d, 0.003 * d))
/// });
/// // Against a layer of 1 mm, glued or sliding:
/// let selection = select_estimator(&sphere_on_sample(0.005, 0.5, Some(1e-3))?, &loads)?;
/// assert_eq!(selection.chosen().estimator, EstimatorKind::HertzSphere);
/// assert!((selection.chosen().youngs_modulus_pa - 30e3).abs() < 1.0 && selection.weights[0] > 0.99);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
pub fn select_estimator<T: RealField + Copy>(
    candidates: &[Box<dyn ModulusEstimator<T>>],
    loads: &[LoadState<T>],
) -> Result<ModulusSelection<T>, ElasticityError> {
    let (mut estimates, mut left_out, mut first_error) = (Vec::new(), Vec::new(), None);
    for candidate in candidates {
        match candidate.estimate(loads) {
            Ok(estimate) => estimates.push(estimate),
            Err(error) => {
                left_out.push(candidate.kind());
                first_error.get_or_insert(error);
            }
        }
    }
    let Some(observations) = estimates.first().map(|e| e.fit.observations) else {
        return Err(first_error.unwrap_or(ElasticityError::TooFewLoads {
            expected: 1,
            found: 0,
        }));
    };
    let (mut estimates, others): (Vec<_>, Vec<_>) = estimates
        .into_iter()
        .partition(|e| e.fit.observations == observations);
    left_out.extend(others.iter().map(|e| e.estimator));
    let criteria: Vec<f64> = estimates.iter().map(criterion).collect();
    let (order, reason) = rank(&criteria);
    let weights = akaike_weights(order.iter().map(|&k| criteria[k]));
    let mut taken: Vec<_> = estimates.drain(..).map(Some).collect();
    let estimates = order.iter().filter_map(|&k| taken[k].take()).collect();
    Ok(ModulusSelection {
        estimates,
        weights,
        reason,
        left_out,
    })
}

/// AICc; where the loads are too few for it, AIC from χ², which differs by a constant between laws of the same loads.
fn criterion<T: RealField + Copy>(estimate: &ModulusEstimate<T>) -> f64 {
    let fit = &estimate.fit;
    let corrected = widen(fit.aicc);
    if corrected.is_finite() {
        corrected
    } else {
        widen(fit.chi_squared) + 2.0 * fit.parameters as f64
    }
}

/// A rigid sphere of radius R (m) on a sample with Poisson ratio ν: Hertz, and with a thickness h (m) the layer's integral equation,
/// glued to its rigid base or sliding on it.
///
/// # Errors
/// [`ElasticityError::NotPositive`], [`ElasticityError::PoissonRatio`].
///
/// ```
/// use tactile_elasticity::modulus::sphere_on_sample;
///
/// // Bonded layer, sliding layer, half-space; without a thickness the last alone.
/// assert_eq!(sphere_on_sample(5e-3_f64, 0.5, Some(2e-3))?.len(), 3);
/// assert_eq!(sphere_on_sample(5e-3_f64, 0.5, None)?.len(), 1);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
pub fn sphere_on_sample<T: RealField + Copy>(
    radius_m: T,
    poisson_ratio: T,
    thickness_m: Option<T>,
) -> Result<Candidates<T>, ElasticityError> {
    let mut candidates: Candidates<T> = Vec::new();
    for bond in [Bond::Bonded, Bond::Free]
        .into_iter()
        .filter(|_| thickness_m.is_some())
    {
        let (h, theory) = (
            thickness_m.unwrap_or(radius_m),
            LayerTheory::IntegralEquation,
        );
        candidates.push(Box::new(BondedLayer::new(
            radius_m,
            h,
            poisson_ratio,
            bond,
            theory,
        )?));
    }
    candidates.push(Box::new(HertzSphere::new(radius_m, poisson_ratio)?));
    Ok(candidates)
}

/// A soft sphere of radius R (m) and Poisson ratio ν, the sample, pressed by a rigid plate onto a waveguide: the waveguide as a
/// layer of finite depth, Tatara's large deformation, and Hertz with one and with two contacts.
///
/// # Errors
/// [`ElasticityError::NotPositive`], [`ElasticityError::PoissonRatio`].
///
/// ```
/// use tactile_elasticity::contact::{Layer, Waveguide};
/// use tactile_elasticity::modulus::{EstimatorKind, sphere_as_sample};
///
/// let gel = Waveguide::new(vec![Layer { thickness_m: 10e-3, youngs_modulus_pa: 50e3_f64, poisson_ratio: 0.5 }])?;
/// let kinds: Vec<_> = sphere_as_sample(3e-3, 0.5, &gel)?.iter().map(|c| c.kind()).collect();
/// assert_eq!((kinds[0], kinds.len()), (EstimatorKind::SphereOnWaveguide, 4));
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
pub fn sphere_as_sample<T: RealField + Copy>(
    radius_m: T,
    poisson_ratio: T,
    waveguide: &Waveguide<T>,
) -> Result<Candidates<T>, ElasticityError> {
    Ok(vec![
        Box::new(SphereOnWaveguide::new(
            radius_m,
            poisson_ratio,
            waveguide,
            Bond::Bonded,
        )?),
        Box::new(TataraSphere::new(radius_m, poisson_ratio)?.with_waveguide(waveguide)),
        Box::new(SphereBetweenPlates::new(radius_m, poisson_ratio)?.with_waveguide(waveguide)),
        Box::new(HertzSphere::new(radius_m, poisson_ratio)?.with_waveguide(waveguide)),
    ])
}
