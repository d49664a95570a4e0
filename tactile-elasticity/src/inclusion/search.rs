//! Search for an inclusion.

use super::covariance::{Meshed, Observed};
use super::estimate::InclusionEstimate;
use super::fit::{DRAFTED, Fit, NEARLY_SETTLED, Prior, Problem, starts};
use super::forward::Forward;
use super::hypothesis::Hypothesis;
use super::parameters::{Coordinate, Parameters};
use super::profiles::{PressureProfile, check};
use super::specimen::{SensorErrors, Specimen};
use crate::ElasticityError;
use crate::error::Quantity;
use crate::fem::{Guide, Interface, Kinematics};
use core::ops::ControlFlow;

/// Part of the guide's radius within which pressures are used: further out the singular rim rules,
/// where meshes disagree by percents.
const REACH: f64 = 0.75;
/// Fewer rings do not show an inclusion's shape.
const MIN_RINGS: usize = 8;
/// Elements along an eighth of the inclusion's circumference: of the starts, of the best start's fit, of
/// what corrects that fit. The last one's pressure is within 0.1 % of twice as many.
const FINENESS: [usize; 3] = [2, 3, 5];
/// Difference of log evidence above which one assumption is clearly better: 20 to 1.
const CLEAR_EVIDENCE: f64 = 3.0;
/// Starts that are fitted, of the grid's best.
const FITTED_STARTS: usize = 3;

/// What a search is doing.
///
/// ```
/// use tactile_elasticity::inclusion::SearchProgress;
///
/// let progress = SearchProgress { done: 3, expected: 30 };
/// assert!(progress.done < progress.expected);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SearchProgress {
    /// Solutions so far.
    pub done: usize,
    /// About how many there will be.
    pub expected: usize,
}

/// Finds a spherical inclusion in a block from the pressure on a guide's face at some approaches.
///
/// Maximum a posteriori over ln D, ln d, ln E₁, ln E₀, the block's height, ν and the approaches' zero by
/// Levenberg–Marquardt on finite-strain finite elements from several starts; errors by Laplace's
/// approximation; an inclusion's probability from the evidence with and without one.
///
/// ```no_run
/// use tactile_elasticity::fem::{Guide, Layer, Material};
/// use core::ops::ControlFlow;
/// use tactile_elasticity::inclusion::{
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
/// let errors = search.expected_errors(&lump, &[1.5e-3, 3e-3], &radii_m, 1.0)?;
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
            // Per interface: a plain fit, the grid, three coarse fits, a fine one.
            expected: interfaces.len() * 55,
            progress,
            cancelled: false,
        };
        let mut drafts = Vec::new();
        for interface in interfaces {
            drafts.extend(self.draft(&observed, &approaches_m, interface, &mut counter));
        }
        let best = (drafts.iter().map(Draft::evidence))
            .max_by(|a, b| a.0.total_cmp(&b.0))
            .unwrap_or((0.0, 0.0));
        let mut hypotheses = Vec::new();
        let mut is_unsolved = false;
        for draft in drafts {
            if best.0 - draft.evidence().0 < HOPELESS_EVIDENCE + HOPELESS_MISFIT * best.1 {
                let found = self.hypothesis(&observed, &approaches_m, draft, &mut counter);
                is_unsolved |= found.is_none();
                hypotheses.extend(found);
            }
        }
        if counter.cancelled {
            return Err(ElasticityError::Cancelled);
        }
        hypotheses.sort_by(|a, b| b.evidence().total_cmp(&a.evidence()));
        let mut hypotheses = hypotheses.into_iter();
        let best = hypotheses.next().ok_or(ElasticityError::NoSolution)?;
        // An assumption that could not be solved may have been the right one.
        let is_uncertain = is_unsolved
            || (hypotheses.next())
                .is_some_and(|other| best.evidence() - other.evidence() < CLEAR_EVIDENCE);
        Ok(best.estimate(&observed, is_uncertain))
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
            poisson_ratio: self.specimen.poisson_ratio(),
        }
    }

    /// What is known of the block; `guess` of its modulus counts where nobody has said it.
    pub(crate) fn block_priors(&self, guess: f64) -> Vec<Prior> {
        let [height, zero, poisson] = self.specimen.known();
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

    /// The best fits on the coarsest mesh; `None` where none could be solved.
    fn draft(
        &self,
        observed: &Observed,
        approaches_m: &[f64],
        interface: Interface,
        counter: &mut Counter<'_>,
    ) -> Option<Draft> {
        let guess = self.stiffness(observed, approaches_m);
        let coarsest = self.forward(observed, approaches_m, interface, FINENESS[0]);
        let mut problem = Problem {
            forward: coarsest.clone(),
            measured: observed.values.clone(),
            factor: (observed.covariance(&self.sensor, interface, Meshed::Coarsely)).cholesky()?,
            priors: self.block_priors(guess),
            correction: Vec::new(),
        };
        let (_, start) = problem.scaled_start(&self.plain_block(guess))?;
        let plain = problem.fit(start, DRAFTED, || counter.step())?;
        if counter.cancelled {
            return None;
        }
        problem
            .priors
            .extend(self.lump_priors(plain.parameters.block_modulus_pa));
        problem.forward.kinematics = Kinematics::Linear;
        let mut grid = Vec::new();
        for start in starts(&plain.parameters, self.guide.radius_m()) {
            if !counter.step() {
                return None;
            }
            grid.extend(problem.scaled_start(&start));
        }
        grid.sort_by(|a, b| a.0.total_cmp(&b.0));
        problem.forward = coarsest;
        let lump = (grid.iter().take(FITTED_STARTS))
            .filter_map(|(_, start)| problem.fit(*start, DRAFTED, || counter.step()))
            .max_by(|a, b| a.evidence.total_cmp(&b.evidence));
        Some(Draft {
            problem,
            interface,
            plain,
            lump,
        })
    }

    /// A draft's fits on the answer's mesh; `None` where the plain block's could not be solved.
    fn hypothesis(
        &self,
        observed: &Observed,
        approaches_m: &[f64],
        draft: Draft,
        counter: &mut Counter<'_>,
    ) -> Option<Hypothesis> {
        let Draft {
            mut problem,
            interface,
            plain,
            lump,
        } = draft;
        let forward = |fineness| self.forward(observed, approaches_m, interface, fineness);
        let [_, fitted, answers] = FINENESS.map(forward);
        let covariance = observed.covariance(&self.sensor, interface, Meshed::Finely);
        problem.factor = covariance.cholesky()?;
        let with_lump = core::mem::take(&mut problem.priors);
        problem.priors = with_lump[..with_lump.len() - LUMP_COORDINATES].to_vec();
        let plain = problem.refined(&answers, plain, || counter.step())?;
        problem.priors = with_lump;
        problem.forward = fitted;
        let lump = lump
            .and_then(|fit| problem.fit(fit.parameters, NEARLY_SETTLED, || counter.step()))
            .and_then(|fit| problem.refined(&answers, fit, || counter.step()));
        Some(Hypothesis {
            interface,
            plain,
            lump,
        })
    }

    /// Modulus of a plain block by the mean pressure over the mean strain: right within a factor of
    /// three, from which the fit of ln E₀ converges.
    fn stiffness(&self, observed: &Observed, approaches_m: &[f64]) -> f64 {
        let rings = observed.radii_m.len();
        let last = observed.frames - 1;
        let pressures = &observed.values[last * rings..observed.frames * rings];
        let mean = pressures.iter().sum::<f64>() / rings as f64;
        let strain = approaches_m[last] / self.specimen.height_m();
        // Below a pascal there is no contact; the fit will say so by its misfit.
        (0.5 * mean / strain).max(1.0)
    }
}

struct Counter<'a> {
    done: usize,
    expected: usize,
    progress: &'a mut dyn FnMut(SearchProgress) -> ControlFlow<()>,
    cancelled: bool,
}

impl Counter<'_> {
    /// Reports a solution; `false` where the search is to end.
    fn step(&mut self) -> bool {
        if self.cancelled {
            return false;
        }
        self.done += 1;
        self.expected = self.expected.max(self.done);
        let progress = SearchProgress {
            done: self.done,
            expected: self.expected,
        };
        self.cancelled |= (self.progress)(progress).is_break();
        !self.cancelled
    }
}

/// ln D, ln d and ln E₁, the last of the coordinates.
const LUMP_COORDINATES: usize = 3;
/// Difference of log evidence on the coarsest mesh beyond which an assumption about the face is given up:
/// this and a part of the better one's misfit, most of which is the mesh's.
const HOPELESS_EVIDENCE: f64 = 25.0;
const HOPELESS_MISFIT: f64 = 0.3;

/// The best fits on the coarsest mesh under one assumption about the face.
struct Draft {
    problem: Problem,
    interface: Interface,
    plain: Fit,
    lump: Option<Fit>,
}

impl Draft {
    /// Evidence and misfit of the better fit.
    fn evidence(&self) -> (f64, f64) {
        let fits = [Some(&self.plain), self.lump.as_ref()]
            .into_iter()
            .flatten();
        let both = fits.map(|fit| (fit.evidence, fit.misfit));
        both.fold((f64::NEG_INFINITY, 0.0), |best, fit| {
            if fit.0 > best.0 { fit } else { best }
        })
    }
}
