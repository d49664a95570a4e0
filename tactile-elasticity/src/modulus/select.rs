//! The choice among estimators by how they fit the loads.

use super::contact::{
    BondedLayer, HertzSphere, SphereBetweenPlates, SphereOnWaveguide, TataraSphere,
};
use super::estimate::{EstimatorKind, ModulusEstimate, ModulusEstimator};
use super::law::LayerTheory;
use super::load::LoadSeries;
use crate::contact::{Bond, Waveguide};
use crate::error::ElasticityError;
use std::sync::Arc;

/// All estimators tried on the same loads, the best first.
///
/// ```
/// use tactile_elasticity::contact::HertzContact;
/// use tactile_elasticity::modulus::*;
///
/// // One load cannot tell laws apart: the most general candidate is the answer.
/// let contact = HertzContact::from_force(1e-3_f64, 5e-3, 40e3)?;
/// let load = LoadState {
///     contact_radius_m: Some(Estimate::new(contact.contact_radius_m, 1e-6)),
///     ..LoadState::new(Estimate::new(1e-3, 1e-5))
/// };
/// let candidates = BestOf::new(TataraSphere::new(5e-3, 0.5)?).or(HertzSphere::new(5e-3, 0.5)?);
/// let selection: ModulusSelection = candidates.select(&LoadSeries::new([load]))?;
/// assert_eq!(selection.chosen().estimator, EstimatorKind::TataraSphere);
/// assert!(selection.left_out.is_empty());
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct ModulusSelection {
    /// Estimates. The first is the chosen one, the others follow by their criterion. Each carries
    /// its warnings.
    pub estimates: Vec<ModulusEstimate>,
    /// Akaike weights of the estimates, in their order.
    pub weights: Vec<f64>,
    /// Why the first was chosen.
    pub reason: SelectionReason,
    /// Estimators without an answer, or with one from other observations than the most general
    /// candidate's: these cannot be compared.
    pub left_out: Vec<EstimatorKind>,
}

impl ModulusSelection {
    /// The chosen estimate.
    pub fn chosen(&self) -> &ModulusEstimate {
        &self.estimates[0]
    }
}

/// Estimates with every candidate and chooses by Akaike's criterion: among those within 2 of the
/// best, the first given, so give the most general theory first. An estimator itself:
/// [`estimate`](ModulusEstimator::estimate) gives the chosen estimate.
///
/// The criterion is that of [`FitStatistics`](super::FitStatistics): AICc, or AIC where the loads
/// are too few for the correction. Loads of one size cannot tell laws apart: the first candidate is
/// then the answer, with the reason [`SelectionReason::MostGeneral`].
///
/// ```
/// use tactile_elasticity::modulus::{
///     BestOf, Estimate, EstimatorKind, LoadSeries, LoadState, ModulusEstimator,
/// };
/// // A ball of 5 mm on a deep sample of 30 kPa: δ³ᐟ² = 3F/(4E*√R).
/// let loads = [0.002, 0.01, 0.05].map(|f: f64| {
///     let d = (0.75 * f / (40e3 * 0.005f64.sqrt())).powf(2.0 / 3.0);
///     LoadState {
///         indentation_m: Some(Estimate::new(d, 0.003 * d)),
///         ..LoadState::new(Estimate::exact(f))
///     }
/// });
/// let series = LoadSeries::new(loads);
/// // Against a layer of 1 mm, bonded or sliding:
/// let estimator = BestOf::sphere_on_sample(0.005, 0.5, Some(1e-3))?;
/// let selection = estimator.select(&series)?;
/// assert_eq!(selection.chosen().estimator, EstimatorKind::HertzSphere);
/// assert!(
///     (selection.chosen().youngs_modulus_pa - 30e3).abs() < 1.0 && selection.weights[0] > 0.99
/// );
/// assert_eq!(estimator.estimate(&series)?, *selection.chosen());
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Clone)]
pub struct BestOf {
    candidates: Vec<Candidate>,
}

type Candidate = Arc<dyn ModulusEstimator + Send + Sync>;

impl core::fmt::Debug for BestOf {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let kinds = self.candidates.iter().map(|c| c.kind());
        f.debug_list().entries(kinds).finish()
    }
}

impl BestOf {
    /// One candidate, the most general.
    pub fn new(candidate: impl ModulusEstimator + Send + Sync + 'static) -> Self {
        Self {
            candidates: vec![Arc::new(candidate)],
        }
    }

    /// Another candidate, less general than those before.
    pub fn or(mut self, candidate: impl ModulusEstimator + Send + Sync + 'static) -> Self {
        self.candidates.push(Arc::new(candidate));
        self
    }

    /// A rigid sphere of radius R (m) on a sample with Poisson ratio ν: Hertz, and with a thickness
    /// h (m) the layer's integral equation, bonded to its rigid base or sliding on it.
    ///
    /// # Errors
    /// [`ElasticityError::NotPositive`], [`ElasticityError::PoissonRatio`].
    pub fn sphere_on_sample(
        radius_m: f64,
        poisson_ratio: f64,
        thickness_m: Option<f64>,
    ) -> Result<Self, ElasticityError> {
        let half_space = HertzSphere::new(radius_m, poisson_ratio)?;
        let Some(thickness_m) = thickness_m else {
            return Ok(Self::new(half_space));
        };
        let layer = |bond| {
            let theory = LayerTheory::IntegralEquation;
            BondedLayer::new(radius_m, thickness_m, poisson_ratio, bond, theory)
        };
        Ok(Self::new(layer(Bond::Bonded)?)
            .or(layer(Bond::Free)?)
            .or(half_space))
    }

    /// A soft sphere of radius R (m) and Poisson ratio ν, the sample, pressed by a rigid plate onto
    /// a waveguide: the waveguide as a layer of finite depth, Tatara's large deformation, and Hertz
    /// with one and with two contacts.
    ///
    /// # Errors
    /// [`ElasticityError::NotPositive`], [`ElasticityError::PoissonRatio`].
    ///
    /// ```
    /// use tactile_elasticity::contact::{HertzContact, Layer, Waveguide};
    /// use tactile_elasticity::modulus::{
    ///     BestOf, Estimate, EstimatorKind, LoadSeries, LoadState, ModulusEstimator,
    /// };
    ///
    /// let gel = Waveguide::new(vec![Layer {
    ///     thickness_m: 10e-3,
    ///     youngs_modulus_pa: 50e3_f64,
    ///     poisson_ratio: 0.5,
    /// }])?;
    /// let contact = HertzContact::from_force(1e-3, 3e-3, 30e3)?;
    /// let load = LoadState {
    ///     contact_radius_m: Some(Estimate::new(contact.contact_radius_m, 1e-6)),
    ///     ..LoadState::new(Estimate::new(1e-3, 1e-5))
    /// };
    /// let modulus =
    ///     BestOf::sphere_as_sample(3e-3, 0.5, &gel)?.estimate(&LoadSeries::new([load]))?;
    /// assert_eq!(modulus.estimator, EstimatorKind::SphereOnWaveguide);
    /// # Ok::<(), tactile_elasticity::ElasticityError>(())
    /// ```
    pub fn sphere_as_sample(
        radius_m: f64,
        poisson_ratio: f64,
        waveguide: &Waveguide,
    ) -> Result<Self, ElasticityError> {
        let layered = SphereOnWaveguide::new(radius_m, poisson_ratio, waveguide, Bond::Bonded)?;
        let tatara = TataraSphere::new(radius_m, poisson_ratio)?;
        let two_contacts = SphereBetweenPlates::new(radius_m, poisson_ratio)?;
        let hertz = HertzSphere::new(radius_m, poisson_ratio)?;
        Ok(Self::new(layered)
            .or(tatara.with_waveguide(waveguide))
            .or(two_contacts.with_waveguide(waveguide))
            .or(hertz.with_waveguide(waveguide)))
    }

    /// All estimates, the chosen one first.
    ///
    /// # Errors
    /// The first candidate's, where none has an answer.
    pub fn select(&self, series: &LoadSeries) -> Result<ModulusSelection, ElasticityError> {
        let (mut estimates, mut left_out, mut first_error) = (Vec::new(), Vec::new(), None);
        for candidate in &self.candidates {
            match candidate.estimate(series) {
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
        let (estimates, others): (Vec<_>, Vec<_>) = estimates
            .into_iter()
            .partition(|e| e.fit.observations == observations);
        left_out.extend(others.iter().map(|e| e.estimator));
        let criteria: Vec<f64> = estimates.iter().map(criterion).collect();
        let (order, reason) = rank(&criteria);
        let weights = akaike_weights(order.iter().map(|&k| criteria[k]));
        Ok(ModulusSelection {
            estimates: in_order(estimates, &order),
            weights,
            reason,
            left_out,
        })
    }
}

impl ModulusEstimator for BestOf {
    fn estimate(&self, series: &LoadSeries) -> Result<ModulusEstimate, ElasticityError> {
        // The chosen estimate is the first.
        Ok(self.select(series)?.estimates.swap_remove(0))
    }

    fn kind(&self) -> EstimatorKind {
        EstimatorKind::BestOf
    }

    fn needs_strain(&self) -> bool {
        self.candidates.iter().any(|c| c.needs_strain())
    }
}

/// AICc. Where the loads are too few for it, AIC from χ², which differs by a constant between laws
/// of the same loads.
fn criterion(estimate: &ModulusEstimate) -> f64 {
    let fit = &estimate.fit;
    let corrected = fit.aicc;
    if corrected.is_finite() {
        corrected
    } else {
        fit.chi_squared + 2.0 * fit.parameters as f64
    }
}

/// Why a law was chosen.
///
/// ```
/// use tactile_elasticity::curve::SelectionReason;
///
/// let says = |reason| match reason {
///     SelectionReason::BetterFit { margin } if margin > 10.0 => "decisive",
///     SelectionReason::BetterFit { .. } => "likely",
///     SelectionReason::MostGeneral { .. } => "the data cannot tell",
///     _ => "no choice",
/// };
/// assert_eq!(says(SelectionReason::MostGeneral { behind: 1.2 }), "the data cannot tell");
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub enum SelectionReason {
    /// It was asked for.
    Asked,
    /// No other law applies.
    OnlyCandidate,
    /// Its AICc is lower than the next by this much.
    BetterFit {
        /// The margin. 10 is decisive.
        margin: f64,
    },
    /// Others fit as well (within 2 of the best AICc, by this much). This is the most general
    /// theory among them.
    MostGeneral {
        /// How far its AICc is above the best.
        behind: f64,
    },
}

// AICc differences up to this one are no evidence (Burnham & Anderson 2002).
const NO_EVIDENCE: f64 = 2.0;

/// Candidates (the most general first) in the order of preference: the first that is within 2 of
/// the lowest criterion, then the others, ascending. The list must not be empty.
pub fn rank(criteria: &[f64]) -> (Vec<usize>, SelectionReason) {
    let lowest = criteria.iter().copied().fold(f64::INFINITY, f64::min);
    let chosen = criteria
        .iter()
        .position(|c| *c <= lowest + NO_EVIDENCE)
        .unwrap_or(0);
    let mut others: Vec<usize> = (0..criteria.len()).filter(|&k| k != chosen).collect();
    others.sort_by(|&i, &j| criteria[i].total_cmp(&criteria[j]));
    let reason = match others.first().map(|&k| criteria[k] - criteria[chosen]) {
        None => SelectionReason::OnlyCandidate,
        Some(margin) if margin > NO_EVIDENCE => SelectionReason::BetterFit { margin },
        Some(_) => SelectionReason::MostGeneral {
            behind: criteria[chosen] - lowest,
        },
    };
    others.insert(0, chosen);
    (others, reason)
}

/// The items in an order that names each once.
pub fn in_order<A>(items: Vec<A>, order: &[usize]) -> Vec<A> {
    let mut taken: Vec<_> = items.into_iter().map(Some).collect();
    order.iter().filter_map(|&k| taken[k].take()).collect()
}

/// exp(−Δ/2), divided by their sum (Akaike weights).
pub fn akaike_weights(criteria: impl Iterator<Item = f64> + Clone) -> Vec<f64> {
    let lowest = criteria.clone().fold(f64::INFINITY, f64::min);
    let likelihood: Vec<f64> = criteria.map(|c| (-0.5 * (c - lowest)).exp()).collect();
    let total: f64 = likelihood.iter().sum();
    likelihood.iter().map(|l| l / total).collect()
}
