//! First fits under one assumption about the face, and the answer's from them.

use super::InclusionSearch;
use super::covariance::{Observed, Resolution};
use super::fit::{DRAFTED, Fit, Problem, SETTLED};
use super::hypothesis::{Hypothesis, LEAST_GAIN};
use super::parameters::{LumpParameters, Parameters};
use super::progress::Counter;
use crate::fem::{Interface, Kinematics};

/// Elements along an eighth of the inclusion's circumference: of the grid of starts, of the first fits.
const FINENESS: [usize; 2] = [2, 3];
/// Starts that are fitted. With tempered errors most end in one optimum; a third adds a quarter of the time.
const FITTED_STARTS: usize = 2;
/// ln D, ln d and ln E₁, the last of the coordinates.
const LUMP_COORDINATES: usize = 3;
/// Difference of the first fits' log evidence beyond which a block is not plain.
const CERTAIN_EVIDENCE: f64 = 50.0;

/// Elements along an eighth of the inclusion's circumference for the answer. Of bonded blocks the pressure is within 0.05 %
/// of a mesh of ten; five leave waves of 0.1 % above a wide shallow inclusion, which move its size and depth by one bound. A
/// face that slides takes three to four solutions for one, and its rim errs by more than five elements do; so does the
/// noise on an inclusion that hardly shows.
fn answer_fineness(interface: Interface, is_certain: bool) -> usize {
    match interface {
        Interface::Bonded if is_certain => 7,
        _ => 5,
    }
}

/// The best first fits under one assumption about the face.
///
/// Their covariance has the coarse mesh's error in it: without, the objective is as rough as that, and fits
/// end far from the truth.
pub(super) struct Draft {
    problem: Problem,
    interface: Interface,
    plain: Fit,
    lump: Option<Fit>,
}

impl Draft {
    fn better(&self) -> &Fit {
        match &self.lump {
            Some(lump) if lump.evidence > self.plain.evidence => lump,
            _ => &self.plain,
        }
    }

    /// Log evidence of the better fit.
    pub(super) fn evidence(&self) -> f64 {
        self.better().evidence
    }

    /// Misfit of the better fit.
    pub(super) fn misfit(&self) -> f64 {
        self.better().misfit
    }

    /// Parameters of the fit with an inclusion.
    pub(super) fn with_lump(&self) -> Option<&Parameters> {
        self.lump.as_ref().map(|fit| &fit.parameters)
    }
}

impl InclusionSearch {
    /// The best first fits, from the grid's best starts and from `another`; `None` where none could be solved.
    pub(super) fn draft(
        &self,
        observed: &Observed,
        approaches_m: &[f64],
        interface: Interface,
        another: Option<&Parameters>,
        counter: &mut Counter<'_>,
    ) -> Option<Draft> {
        let guess = self.stiffness(observed, approaches_m);
        let coarsest = self.forward(observed, approaches_m, interface, FINENESS[0]);
        let mut problem = Problem {
            forward: coarsest.clone(),
            measured: observed.values.clone(),
            factor: (observed.covariance(self.sensor(), interface, Resolution::FirstFits))
                .cholesky()?,
            priors: self.block_priors(guess),
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
        for start in starts(&plain.parameters, self.guide().radius_m()) {
            if !counter.step() {
                return None;
            }
            grid.extend(problem.scaled_start(&start));
        }
        grid.sort_by(|a, b| a.0.total_cmp(&b.0));
        problem.forward = self.forward(observed, approaches_m, interface, FINENESS[1]);
        let best = grid.iter().map(|(_, start)| start);
        let lump = (another.into_iter().chain(best).take(FITTED_STARTS))
            .filter_map(|start| problem.fit(*start, DRAFTED, || counter.step()))
            .max_by(|a, b| a.evidence.total_cmp(&b.evidence));
        Some(Draft {
            problem,
            interface,
            plain,
            lump,
        })
    }

    /// A draft's fits on the answer's mesh; `None` where the plain block's could not be solved.
    pub(super) fn hypothesis(
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
        let with_lump = core::mem::take(&mut problem.priors);
        let gain = (lump.as_ref()).map_or(f64::NEG_INFINITY, |lump| lump.evidence - plain.evidence);
        let is_certain = gain > CERTAIN_EVIDENCE;
        let fineness = answer_fineness(interface, is_certain);
        problem.forward = self.forward(observed, approaches_m, interface, fineness);
        let covariance = observed.covariance(self.sensor(), interface, Resolution::Answer);
        problem.factor = covariance.cholesky()?;
        let plain = if is_certain {
            plain
        } else {
            problem.priors = with_lump[..with_lump.len() - LUMP_COORDINATES].to_vec();
            problem.fit(plain.parameters, SETTLED, || counter.step())?
        };
        problem.priors = with_lump;
        let ending = if is_certain {
            SETTLED
        } else {
            SETTLED.below(plain.objective() - LEAST_GAIN)
        };
        let lump = lump.and_then(|fit| problem.fit(fit.parameters, ending, || counter.step()));
        Some(Hypothesis {
            problem,
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
        let strain = approaches_m[last] / self.specimen().height_m();
        // Below a pascal there is no contact; the fit will say so by its misfit.
        (0.5 * mean / strain).max(1.0)
    }
}

/// Starts: diameters and depths that a face of this radius can see, in a block of this height.
fn starts(plain: &Parameters, face_radius_m: f64) -> Vec<Parameters> {
    let mut starts = Vec::new();
    for diameter in [0.35, 0.65, 1.05] {
        for depth in [0.15, 0.3, 0.55] {
            for contrast in [2.5, 8.0] {
                let lump = LumpParameters {
                    diameter_m: diameter * face_radius_m,
                    depth_m: depth * face_radius_m,
                    youngs_modulus_pa: contrast * plain.block_modulus_pa,
                };
                if lump.diameter_m + lump.depth_m < 0.95 * plain.height_m {
                    starts.push(Parameters {
                        lump: Some(lump),
                        ..*plain
                    });
                }
            }
        }
    }
    starts
}
