//! Search for an inclusion.

use super::covariance::Observed;
use super::drafts::Draft;
use super::estimate::InclusionEstimate;
use super::fit::Prior;
use super::forward::Forward;
use super::hypothesis::Hypothesis;
use super::parameters::{Coordinate, LARGEST_POISSON_RATIO, Parameters};
use super::plain::Plain;
use super::profiles::{PressureProfile, check};
use super::progress::{Counter, SearchProgress};
use super::specimen::{SensorErrors, Specimen};
use crate::error::Quantity;
use core::ops::ControlFlow;
use tactile_elasticity::ElasticityError;
use tactile_fem::{Guide, Interface, Kinematics};

/// Part of the guide's radius within which pressures are used: further out the singular rim rules,
/// where meshes disagree by percents.
const REACH: f64 = 0.75;
/// Fewer rings do not show an inclusion's shape.
const MIN_RINGS: usize = 8;
/// Difference of log evidence above which one assumption about the face is clearly better: 20 to 1 and three times as much again for
/// what the finite elements err by on a sliding face, which the covariance knows by its size alone. Two frames on soft tissue by
/// CalculiX preferred the wrong one by up to 13, beside a poor fit (`inclusion_study` on the scenes of `evidence/inclusion_scenes.py`); the price is
/// intervals that hold under both where the right one leads by less. Where the better one leaves more than the errors explain, differences
/// count as much less (K. P. Burnham & D. R. Anderson, *Model Selection and Multimodel Inference* (2002), §2.5).
const CLEAR_EVIDENCE: f64 = 12.0;
/// Difference of log evidence beyond which another assumption about the face is not fitted to the end.
const RIVAL_EVIDENCE: f64 = 16.0;

/// Finds a spherical inclusion in a block from the pressure on a guide's face at some approaches.
///
/// Maximum a posteriori over ln D, ln d, ln E₁, ln E₀, the block's height, ν and the approaches' zero by
/// Levenberg–Marquardt on finite-strain finite elements from several starts, once a score test says that an inclusion would explain
/// more than the plain block; intervals by following the posterior along ln E₁; an inclusion's probability from the evidence with
/// and without one.
///
/// ```no_run
/// use tactile_fem::{Guide, Layer, Material};
/// use core::ops::ControlFlow;
/// use tactile_inclusion::{
///     AssumedInclusion, InclusionSearch, PressureProfile, SensorErrors, Specimen,
/// };
///
/// # fn example(radii_m: Vec<f64>, frames: Vec<PressureProfile>) -> Result<(), tactile_elasticity::ElasticityError> {
/// let layer = Layer { thickness_m: 10e-3, material: Material::new(60e3, 0.495)? };
/// let guide = Guide::new(vec![layer], 16e-3)?;
/// let search = InclusionSearch::new(Specimen::new(30e-3, 40e-3)?, guide)?;
/// // A sensor whose calibration is twice as good as usual.
/// let search = search.with_sensor_errors(SensorErrors { common: 1.5e-3, ..SensorErrors::default() })?;
/// // Would two frames tell enough of a small lump?
/// let lump = AssumedInclusion { diameter_m: 8e-3, depth_m: 4e-3, youngs_modulus_pa: 40e3, block_modulus_pa: 5e3 };
/// let errors = search.expected_errors(&lump, &[1.5e-3, 3e-3], &radii_m, &vec![1.0; radii_m.len()])?;
/// println!("its diameter would be known within {:.0} %", 100.0 * errors.diameter);
/// let estimate = search.search_with_progress(&radii_m, &frames, &mut |progress| {
///     println!("{} of {}", progress.done, progress.expected);
///     ControlFlow::Continue(())
/// })?;
/// if let (true, Some(inclusion)) = (estimate.found, &estimate.inclusion) {
///     println!("{:?}", inclusion.diameter_m);
/// }
/// # Ok(())
/// # }
/// ```
#[derive(Debug, Clone)]
pub struct InclusionSearch {
    specimen: Specimen,
    guide: Guide,
    sensor: SensorErrors,
}

impl InclusionSearch {
    /// A block under a guide, with [`SensorErrors::default`].
    ///
    /// # Errors
    /// A block that is no wider than the guide.
    pub fn new(specimen: Specimen, guide: Guide) -> Result<Self, ElasticityError> {
        if specimen.radius_m() <= guide.radius_m() {
            return Err(ElasticityError::OutOfRange {
                quantity: Quantity::Radius,
                found: specimen.radius_m(),
                limit: guide.radius_m(),
            });
        }
        Ok(Self {
            specimen,
            guide,
            sensor: SensorErrors::default(),
        })
    }

    /// Sets the sensor's smooth errors.
    ///
    /// # Errors
    /// Negative or NaN; a correlation length or a force error of zero.
    pub fn with_sensor_errors(mut self, errors: SensorErrors) -> Result<Self, ElasticityError> {
        self.sensor = errors.checked()?;
        Ok(self)
    }

    /// The inclusion that explains ring means at `radii_m` (metres, ascending) best; rings beyond three
    /// quarters of the guide's radius are not used. Some 100 finite-element solutions.
    ///
    /// # Errors
    /// No frame; approaches that do not grow; lengths that differ; values that are not finite; fewer
    /// than eight rings within reach; [`ElasticityError::NoSolution`] where the approaches are beyond
    /// what the block's finite elements bear.
    pub fn search(
        &self,
        radii_m: &[f64],
        frames: &[PressureProfile],
    ) -> Result<InclusionEstimate, ElasticityError> {
        self.search_with_progress(radii_m, frames, &mut |_| ControlFlow::Continue(()))
    }

    /// As [`Self::search`]; `progress` hears of every solution and may end the search.
    ///
    /// # Errors
    /// Those of [`Self::search`]; [`ElasticityError::Cancelled`].
    pub fn search_with_progress(
        &self,
        radii_m: &[f64],
        frames: &[PressureProfile],
        progress: &mut dyn FnMut(SearchProgress) -> ControlFlow<()>,
    ) -> Result<InclusionEstimate, ElasticityError> {
        check(radii_m, frames)?;
        let observed = self.observed(radii_m, frames)?;
        let approaches_m: Vec<f64> = frames.iter().map(|frame| frame.approach_m).collect();
        let interfaces = self.specimen.interfaces();
        let mut counter = Counter {
            done: 0,
            // Per interface: a plain fit, the grid, two first fits, the answer's.
            expected: interfaces.len() * 55,
            progress,
            cancelled: false,
        };
        let plains: Vec<Plain> = (interfaces.into_iter())
            .filter_map(|face| self.plain(&observed, &approaches_m, face, &mut counter))
            .collect();
        // Where the plain block that fits better needs no inclusion, one would make up for a wrong assumption about the face.
        let best = (plains.iter()).max_by(|a, b| a.fit.evidence.total_cmp(&b.fit.evidence));
        let is_plain = best.is_some_and(Plain::is_plain);
        let mut drafts: Vec<Draft> = Vec::new();
        for plain in plains {
            drafts.push(if is_plain || plain.is_plain() {
                Draft::plain(plain)
            } else {
                self.draft(
                    &observed,
                    &approaches_m,
                    plain,
                    drafts.first(),
                    &mut counter,
                )
            });
        }
        drafts.sort_by(|a, b| b.evidence().total_cmp(&a.evidence()));
        let hopeless = drafts.first().map_or(f64::NEG_INFINITY, Draft::hopeless);
        drafts.retain(|draft| draft.evidence() > hopeless);
        let mut hypotheses: Vec<Hypothesis> = Vec::new();
        let mut is_unsolved = false;
        for draft in drafts {
            let needed = (hypotheses.first())
                .map_or(f64::NEG_INFINITY, |best| best.evidence() - RIVAL_EVIDENCE);
            let found = self.hypothesis(&observed, &approaches_m, draft, needed, &mut counter);
            is_unsolved |= found.is_none();
            hypotheses.extend(found);
        }
        let best = (hypotheses.iter()).map(Hypothesis::evidence);
        let needed = best.fold(f64::NEG_INFINITY, f64::max) - RIVAL_EVIDENCE;
        for hypothesis in &mut hypotheses {
            if hypothesis.evidence() > needed {
                hypothesis.follow(|| counter.step());
            }
        }
        if counter.cancelled {
            return Err(ElasticityError::Cancelled);
        }
        hypotheses.sort_by(|a, b| b.evidence().total_cmp(&a.evidence()));
        let mut hypotheses = hypotheses.into_iter();
        let best = hypotheses.next().ok_or(ElasticityError::NoSolution)?;
        let clear = CLEAR_EVIDENCE * best.inflation(&observed);
        let rival = (hypotheses.next()).filter(|other| best.evidence() - other.evidence() < clear);
        Ok(best.estimate(&observed, rival.as_ref(), is_unsolved))
    }

    fn observed(
        &self,
        radii_m: &[f64],
        frames: &[PressureProfile],
    ) -> Result<Observed, ElasticityError> {
        let used = self.rings_within_reach(radii_m)?;
        let mut values = Vec::new();
        let mut white = Vec::new();
        for frame in frames {
            values.extend(used.iter().map(|&k| frame.pressure_pa[k]));
            white.extend(used.iter().map(|&k| frame.standard_error_pa[k]));
        }
        let area = core::f64::consts::PI * self.guide.radius_m().powi(2);
        for frame in frames {
            let mean = frame.pressure_pa.iter().sum::<f64>() / frame.pressure_pa.len() as f64;
            let expected = mean * area;
            values.push(frame.force_n.unwrap_or(expected));
            // A force that is not known weighs nothing.
            white.push(if frame.force_n.is_some() {
                0.0
            } else {
                1e3 * expected.abs()
            });
        }
        Ok(Observed {
            radii_m: used.iter().map(|&k| radii_m[k]).collect(),
            values,
            white,
            frames: frames.len(),
        })
    }

    pub(crate) fn forward(
        &self,
        observed: &Observed,
        approaches_m: &[f64],
        interface: Interface,
        fineness: usize,
    ) -> Forward {
        Forward {
            guide: self.guide.clone(),
            block_radius_m: self.specimen.radius_m(),
            interface,
            approaches_m: approaches_m.to_vec(),
            radii_m: observed.radii_m.clone(),
            fineness,
            kinematics: Kinematics::Finite,
        }
    }

    pub(crate) fn plain_block(&self, block_modulus_pa: f64) -> Parameters {
        Parameters {
            block_modulus_pa,
            lump: None,
            zero_m: 0.0,
            height_m: self.specimen.height_m(),
            poisson_ratio: self.specimen.poisson_ratio().min(LARGEST_POISSON_RATIO),
        }
    }

    /// What is known of the block; `guess` of its modulus counts where nobody has said it.
    pub(crate) fn block_priors(&self, guess: f64) -> Vec<Prior> {
        let [height, zero, (poisson_ratio, error)] = self.specimen.known();
        let poisson = (poisson_ratio.min(LARGEST_POISSON_RATIO), error);
        // Three decades each way.
        let modulus = self.specimen.block_modulus().unwrap_or((guess.ln(), 3.5));
        vec![
            Prior::new(Coordinate::BlockModulus, modulus),
            Prior::new(Coordinate::Zero, zero),
            Prior::new(Coordinate::Height, height),
            Prior::new(Coordinate::PoissonRatio, poisson),
        ]
    }

    /// Sizes, depths and contrasts that a face of this radius can see: D from 0.2 to 2 radii, d from
    /// 0.06 to 1.5, E₁ from 0.4 to 47 times E₀, as 95 % ranges.
    pub(crate) fn lump_priors(&self, block_modulus_pa: f64) -> [Prior; 3] {
        let face = self.guide.radius_m();
        [
            Prior::new(Coordinate::Diameter, ((0.65 * face).ln(), 0.6)),
            Prior::new(Coordinate::Depth, ((0.3 * face).ln(), 0.8)),
            Prior::new(
                Coordinate::LumpModulus,
                ((4.5 * block_modulus_pa).ln(), 1.2),
            ),
        ]
    }

    pub(crate) fn sensor(&self) -> &SensorErrors {
        &self.sensor
    }

    pub(crate) fn specimen(&self) -> &Specimen {
        &self.specimen
    }

    /// Indices of the rings within reach.
    pub(crate) fn rings_within_reach(
        &self,
        radii_m: &[f64],
    ) -> Result<Vec<usize>, ElasticityError> {
        let limit = REACH * self.guide.radius_m();
        let used: Vec<usize> = (0..radii_m.len())
            .filter(|&k| radii_m[k] <= limit)
            .collect();
        if used.len() < MIN_RINGS {
            return Err(ElasticityError::LengthMismatch {
                quantity: Quantity::Samples,
                expected: MIN_RINGS,
                found: used.len(),
            });
        }
        Ok(used)
    }
}
