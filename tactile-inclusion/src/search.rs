//! Search for an inclusion: fits under each assumption about the face are compared.

use crate::covariance::Observed;
use crate::estimate::{InclusionEstimate, InclusionWarning};
use crate::first_fits::{FirstFits, HomogeneousFit};
use crate::forward::Forward;
use crate::hypothesis::{Assessed, Hypothesis};
use crate::inclusion_search::InclusionSearch;
use crate::progress::Counter;
use crate::scan::Scan;
use crate::tissue_block::{PressureProfile, check};
use core::ops::ControlFlow;
use tactile_core::Progress;
use tactile_elasticity::ElasticityError;
use tactile_fem::Interface;

/// Difference by which following the ridges may change that of the log-evidence of two assumptions
/// about the face. In blocks of `evidence/inclusion_scenes.py` it is at most 1.
const RIDGE_EVIDENCE: f64 = 2.0;

impl InclusionSearch {
    /// The inclusion that best fits ring means at `radii_m` (metres, ascending). Rings outside
    /// three quarters of the guide's radius are not used. It takes about 100 finite-element
    /// solutions.
    ///
    /// # Errors
    /// An error if there is no frame, approaches do not increase, lengths differ, values are not
    /// finite, or fewer than eight rings are within reach. [`ElasticityError::NoSolution`] if the
    /// approaches are too large for the finite elements of the block.
    pub fn search(
        &self,
        radii_m: &[f64],
        frames: &[PressureProfile],
    ) -> Result<InclusionEstimate, ElasticityError> {
        self.search_with_progress(radii_m, frames, &mut |_| ControlFlow::Continue(()))
    }

    /// Like [`Self::search`]. `progress` is called for each solution and may stop the search.
    ///
    /// # Errors
    /// Those of [`Self::search`], and [`ElasticityError::Cancelled`].
    pub fn search_with_progress(
        &self,
        radii_m: &[f64],
        frames: &[PressureProfile],
        progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
    ) -> Result<InclusionEstimate, ElasticityError> {
        check(radii_m, frames)?;
        let observed = self.observed(radii_m, frames)?;
        let approaches_m: Vec<f64> = frames.iter().map(|frame| frame.approach_m).collect();
        self.search_observed(&observed, &approaches_m, progress)
    }

    /// Like [`Self::search_with_progress`], from whole faces: the inclusion may lie off the axis.
    /// The scan has one or several presses at positions of a block that is much wider than the
    /// guide. There is one posterior over all of them, with one inclusion or two. The deviation of
    /// each press from its stated position is fitted, and each press has its own error of the
    /// approach zero. The position of the inclusion is given in the coordinates of the presses.
    ///
    /// Only positions under the used part of a press's face are searched. The result has two
    /// inclusions if a single one does not fit within the errors and two do. The time grows with
    /// the third power of the number of cells. A fifteenth of the face radius resolves the pressure
    /// of a single press, and an eighth is narrow enough for five presses. The force is not used.
    ///
    /// # Errors
    /// Those of [`Self::search_with_progress`], and errors if there is no press, approaches differ
    /// between presses, or the position error is negative or NaN.
    pub fn search_scan(
        &self,
        scan: &Scan,
        progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
    ) -> Result<InclusionEstimate, ElasticityError> {
        let (observed, approaches_m) = self.observed_scan(scan)?;
        self.search_observed(&observed, &approaches_m, progress)
    }

    fn search_observed(
        &self,
        observed: &Observed,
        approaches_m: &[f64],
        progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
    ) -> Result<InclusionEstimate, ElasticityError> {
        let interfaces = self.specimen().interfaces();
        // Per contact condition: a homogeneous fit, the grid, two first fits and the final fit.
        let mut counter = Counter::new(interfaces.len() * 55, progress);
        let (mut hypotheses, mut is_unsolved) =
            self.hypotheses(observed, approaches_m, &interfaces, &mut counter);
        let pair = self.pair(observed, approaches_m, &hypotheses, &mut counter);
        if let Some(pair) = pair.filter(|_| !counter.cancelled) {
            return Ok(pair);
        }
        let contradicting = (hypotheses.first().filter(|_| interfaces.len() == 1))
            .and_then(|stated| self.contradicting(observed, stated, &mut counter));
        if let Some(other) = contradicting {
            let (others, _) = self.hypotheses(observed, approaches_m, &[other], &mut counter);
            is_unsolved |= others.is_empty();
            hypotheses.extend(others);
        }
        if let Some((best, rivals)) = hypotheses.split_first_mut() {
            best.follow(|| counter.step());
            let needed = best.rival_evidence(observed) - RIDGE_EVIDENCE;
            let is_needed = |rival: &&mut Hypothesis| {
                contradicting.is_some() || rival.better().converged && rival.evidence() > needed
            };
            for rival in rivals.iter_mut().filter(is_needed) {
                rival.follow(|| counter.step());
            }
        }
        if counter.cancelled {
            return Err(ElasticityError::Cancelled);
        }
        hypotheses.sort_by(|a, b| b.evidence().total_cmp(&a.evidence()));
        let mut hypotheses = hypotheses.into_iter();
        let best = hypotheses.next().ok_or(ElasticityError::NoSolution)?;
        let needed = best.rival_evidence(observed);
        let rival = (hypotheses.next())
            .filter(|other| contradicting.is_some() || other.evidence() > needed);
        let mut found = best.estimate(observed, rival.as_ref(), is_unsolved);
        if contradicting.is_some() {
            (found.warnings).retain(|warning| *warning != InclusionWarning::UncertainInterface);
            found.warnings.push(InclusionWarning::ContradictedInterface);
        }
        Ok(found)
    }

    /// The face that is not assumed, if its values are clearly more likely than those of the fit.
    fn contradicting(
        &self,
        observed: &Observed,
        assumed: &Hypothesis,
        counter: &mut Counter<'_>,
    ) -> Option<Interface> {
        let other = match assumed.interface {
            Interface::Bonded => Interface::Frictionless,
            Interface::Frictionless => Interface::Bonded,
        };
        let fit = assumed.better();
        let forward = Forward {
            interface: other,
            ..assumed.problem.forward.clone()
        };
        let values = counter.step().then(|| {
            let forward = forward.with_plain(&fit.parameters)?;
            forward.predict(&fit.parameters)
        });
        let log_odds = Assessed::new(&assumed.problem, &fit.normal)?.log_odds(&values??);
        (log_odds > assumed.clear_evidence(observed)).then_some(other)
    }

    /// The best fits under each assumption about the face, the most likely first, and whether the
    /// fits of one failed.
    fn hypotheses(
        &self,
        observed: &Observed,
        approaches_m: &[f64],
        interfaces: &[Interface],
        counter: &mut Counter<'_>,
    ) -> (Vec<Hypothesis>, bool) {
        let blocks: Vec<HomogeneousFit> = (interfaces.iter())
            .filter_map(|face| self.homogeneous(observed, approaches_m, *face, counter))
            .collect();
        // If the better-fitting homogeneous block needs no inclusion, an inclusion in the other
        // would compensate for a wrong assumption about the face.
        let best = (blocks.iter()).max_by(|a, b| a.fit.evidence.total_cmp(&b.fit.evidence));
        let is_homogeneous = best.is_some_and(HomogeneousFit::is_homogeneous);
        let mut candidates: Vec<FirstFits> = Vec::new();
        for homogeneous in blocks {
            candidates.push(if is_homogeneous || homogeneous.is_homogeneous() {
                FirstFits::homogeneous(homogeneous)
            } else {
                self.first_fits(
                    observed,
                    approaches_m,
                    homogeneous,
                    candidates.first(),
                    counter,
                )
            });
        }
        candidates.sort_by(|a, b| b.evidence().total_cmp(&a.evidence()));
        if let [best, other] = &candidates[..]
            && other.is_hopeless(best)
        {
            candidates.pop();
        }
        let mut hypotheses: Vec<Hypothesis> = Vec::new();
        let mut is_unsolved = false;
        for first_fits in candidates {
            let needed = (hypotheses.first()).map_or(f64::NEG_INFINITY, |best| {
                best.rival_evidence(observed) - RIDGE_EVIDENCE
            });
            let found = self.hypothesis(observed, approaches_m, first_fits, needed, counter);
            is_unsolved |= found.is_none();
            hypotheses.extend(found);
        }
        hypotheses.sort_by(|a, b| b.evidence().total_cmp(&a.evidence()));
        (hypotheses, is_unsolved)
    }
}
