//! First fits without an inclusion, and whether one can be ruled out.

use super::InclusionSearch;
use super::covariance::{Observed, Resolution};
use super::fit::{DRAFTED, Fit, Problem, SETTLED};
use super::forward::Forward;
use super::parameters::Parameters;
use super::progress::Counter;
use super::score::Score;
use super::starts::{Start, starts};
use tactile_fem::{Interface, Kinematics};

/// Elements along an eighth of the inclusion's circumference, of a plain block's first fit and of the grid.
const FINENESS: usize = 2;
/// χ² of the first fit over its degrees of freedom up to which the block may be plain. The meshes' errors bring plain blocks by
/// CalculiX to 1.5, under the wrong assumption about the face to 2.2; what an inclusion adds above 2 needs no test.
const DOUBTFUL: f64 = 2.0;

/// Elements along an eighth of the inclusion's circumference for the answer. Of bonded blocks the pressure is within 0.05 %
/// of a mesh of ten; five leave waves of 0.1 % above a wide shallow inclusion, which move its size and depth by one bound, and where
/// the face slides χ² by up to ten, enough to take it for one that sticks. On an inclusion that hardly shows the noise errs by
/// more than five elements do.
pub(super) fn answer_fineness(is_certain: bool) -> usize {
    if is_certain { 7 } else { 5 }
}

/// A plain block under one assumption about the face.
pub(super) struct Plain {
    /// Of the first fits.
    pub(super) problem: Problem,
    pub(super) interface: Interface,
    pub(super) fit: Fit,
    /// The fit on the answer's mesh and what inclusions promise to add to it, where the block may be plain.
    pub(super) settled: Option<(Fit, Score)>,
    pub(super) grid: Vec<Start>,
}

impl Plain {
    /// Whether inclusions can be ruled out, were the face as assumed.
    pub(super) fn is_plain(&self) -> bool {
        (self.settled.as_ref()).is_some_and(|(_, score)| score.is_plain())
    }

    /// Starts with their pressures scaled to those observed, the best first.
    pub(super) fn starts(&self) -> Vec<Parameters> {
        let mut scaled: Vec<(f64, Parameters)> = (self.grid.iter())
            .filter_map(|start| (self.problem).scaled_start(&start.parameters, &start.predicted))
            .collect();
        scaled.sort_by(|a, b| a.0.total_cmp(&b.0));
        scaled.into_iter().map(|(_, start)| start).collect()
    }
}

impl InclusionSearch {
    /// The fit of a plain block; `None` where it could not be solved.
    pub(super) fn plain(
        &self,
        observed: &Observed,
        approaches_m: &[f64],
        interface: Interface,
        counter: &mut Counter<'_>,
    ) -> Option<Plain> {
        let guess = self.stiffness(observed, approaches_m);
        let forward = self.forward(observed, approaches_m, interface, FINENESS);
        let problem = Problem {
            forward: forward.clone(),
            measured: observed.values.clone(),
            factor: (observed.covariance(self.sensor(), interface, Resolution::FirstFits))
                .cholesky()?,
            priors: self.block_priors(guess),
        };
        let block = self.plain_block(guess);
        let (_, start) = problem.scaled_start(&block, &forward.predict(&block)?)?;
        let fit = problem.fit(start, DRAFTED, || counter.step())?;
        let linear = Forward {
            kinematics: Kinematics::Linear,
            ..forward
        };
        // A plain block that fits an inclusion's pressures is bent out of what is known of it; starts are not.
        let known = self.plain_block(fit.parameters.block_modulus_pa);
        let grid = starts(&linear, &known, counter)?;
        let settled = if fit.misfit < DOUBTFUL * observed.values.len() as f64 {
            self.settled(&problem, &fit, observed, &grid, counter)
        } else {
            None
        };
        Some(Plain {
            problem,
            interface,
            fit,
            settled,
            grid,
        })
    }

    /// The plain block's fit on the answer's mesh, and what inclusions promise to add to it.
    fn settled(
        &self,
        problem: &Problem,
        plain: &Fit,
        observed: &Observed,
        grid: &[Start],
        counter: &mut Counter<'_>,
    ) -> Option<(Fit, Score)> {
        let interface = problem.forward.interface;
        let covariance = observed.covariance(self.sensor(), interface, Resolution::Answer);
        let problem = Problem {
            forward: Forward {
                fineness: answer_fineness(false),
                ..problem.forward.clone()
            },
            measured: problem.measured.clone(),
            factor: covariance.cholesky()?,
            priors: problem.priors.clone(),
        };
        let fit = problem.fit(plain.parameters, SETTLED, || counter.step())?;
        let score = Score::new(&problem, &fit, grid)?;
        Some((fit, score))
    }

    /// Modulus of a plain block by the mean pressure over the mean strain: right within a factor of
    /// three, from which the fit of ln E₀ converges.
    fn stiffness(&self, observed: &Observed, approaches_m: &[f64]) -> f64 {
        let rings = observed.radii_m.len();
        let last = observed.frames - 1;
        let pressures = &observed.values[last * rings..observed.frames * rings];
        let mean = pressures.iter().sum::<f64>() / rings as f64;
        let strain = approaches_m[last] / self.specimen().height_m();
        // Below a pascal there is no contact; the fit will say so by its misfit.
        (0.5 * mean / strain).max(1.0)
    }
}
