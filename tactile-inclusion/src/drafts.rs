//! First fits under one assumption about the face, and the answer's from them.

use super::InclusionSearch;
use super::covariance::{Observed, Resolution};
use super::fit::{DRAFTED, Fit, Problem, SETTLED};
use super::hypothesis::{BLOCK_COORDINATES, Hypothesis, LEAST_GAIN};
use super::plain::{Plain, answer_fineness};
use super::progress::Counter;
use super::score::Score;
use tactile_fem::Interface;

/// Elements along an eighth of the inclusion's circumference in the first fits with an inclusion.
const FINENESS: usize = 3;
/// Starts that are fitted. With tempered errors most end in one optimum; a third adds a quarter of the time.
const FITTED_STARTS: usize = 2;
/// Difference of the first fits' log evidence beyond which a block is not plain.
const CERTAIN_EVIDENCE: f64 = 50.0;

/// Difference of the first fits' log evidence beyond which an assumption about the face is given up: this
/// and a part of the better one's misfit, most of which is the mesh's.
const HOPELESS_EVIDENCE: f64 = 25.0;
const HOPELESS_MISFIT: f64 = 0.05;

/// The best first fits under one assumption about the face.
///
/// Their covariance has the coarse mesh's error in it: without, the objective is as rough as that, and fits
/// end far from the truth.
pub(super) struct Draft {
    problem: Problem,
    interface: Interface,
    plain: Fit,
    /// The plain block's fit on the answer's mesh, where it may be one.
    settled: Option<Fit>,
    score: Option<Score>,
    lump: Option<Fit>,
}

impl Draft {
    /// Without an inclusion.
    pub(super) fn plain(plain: Plain) -> Self {
        let (settled, score) = plain.settled.unzip();
        Self {
            problem: plain.problem,
            interface: plain.interface,
            plain: plain.fit,
            settled,
            score,
            lump: None,
        }
    }

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

    /// Log evidence of the first fits below which another assumption about the face is given up.
    pub(super) fn hopeless(&self) -> f64 {
        self.evidence() - HOPELESS_EVIDENCE - HOPELESS_MISFIT * self.better().misfit
    }
}

impl InclusionSearch {
    /// The best first fits with an inclusion, from the grid's best starts and from what fits best under `another` assumption.
    pub(super) fn draft(
        &self,
        observed: &Observed,
        approaches_m: &[f64],
        plain: Plain,
        another: Option<&Draft>,
        counter: &mut Counter<'_>,
    ) -> Draft {
        let starts = plain.starts();
        let mut draft = Draft::plain(plain);
        let modulus = draft.plain.parameters.block_modulus_pa;
        let problem = &mut draft.problem;
        problem.priors.extend(self.lump_priors(modulus));
        problem.forward = self.forward(observed, approaches_m, draft.interface, FINENESS);
        let best = another.and_then(|another| Some((another, another.lump.as_ref()?)));
        let ending = best.map_or(DRAFTED, |(another, lump)| {
            DRAFTED.below(problem.objective_at(another.hopeless(), lump.volume))
        });
        let best = best.map(|(_, lump)| &lump.parameters);
        draft.lump = (best.into_iter().chain(&starts).take(FITTED_STARTS))
            .filter_map(|start| problem.fit(*start, ending, || counter.step()))
            .max_by(|a, b| a.evidence.total_cmp(&b.evidence));
        draft
    }

    /// A draft's fits on the answer's mesh, in full where their log evidence exceeds `needed`; `None` where the plain
    /// block's could not be solved.
    pub(super) fn hypothesis(
        &self,
        observed: &Observed,
        approaches_m: &[f64],
        draft: Draft,
        needed: f64,
        counter: &mut Counter<'_>,
    ) -> Option<Hypothesis> {
        let Draft {
            mut problem,
            interface,
            plain,
            settled,
            score,
            lump,
        } = draft;
        let with_lump = core::mem::take(&mut problem.priors);
        let gain = (lump.as_ref()).map_or(f64::NEG_INFINITY, |lump| lump.evidence - plain.evidence);
        let is_certain = gain > CERTAIN_EVIDENCE;
        let fineness = answer_fineness(is_certain);
        problem.forward = self.forward(observed, approaches_m, interface, fineness);
        let covariance = observed.covariance(self.sensor(), interface, Resolution::Answer);
        problem.factor = covariance.cholesky()?;
        let plain = match settled {
            Some(settled) => settled,
            None if is_certain => plain,
            None => {
                problem.priors = with_lump[..BLOCK_COORDINATES].to_vec();
                problem.fit(plain.parameters, SETTLED, || counter.step())?
            }
        };
        problem.priors = with_lump;
        let ending = if is_certain {
            SETTLED
        } else {
            SETTLED.below(plain.objective() - LEAST_GAIN)
        };
        let lump = lump.and_then(|fit| {
            let ending = ending.below(problem.objective_at(needed, fit.volume));
            problem.fit(fit.parameters, ending, || counter.step())
        });
        Some(Hypothesis {
            problem,
            interface,
            plain,
            score,
            lump,
            marginal: None,
        })
    }
}
