//! Mending: runs from the best answer so far, where parts of it went astray.
use super::super::{AnnealedSoftassign, SoftassignWorkspace};
use super::complete::{COMPLETE, MANY};
use super::{Pace, REHEAT, SCALES};
use std::ops::ControlFlow;

/// Most times that the patterns of so many points are looked at, and the temperature that follows, in spacings.
const PATTERNS: usize = 3;
const PATTERN_SIGMA: f64 = 0.3;

impl AnnealedSoftassign {
    /// Mends parts that went astray: by the patterns of the points in a dense set, by a reheat elsewhere.
    pub(super) fn mend<const D: usize>(
        &self,
        ws: &mut SoftassignWorkspace<D>,
        observe: &mut dyn FnMut(usize, f64) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        if ws.model.len().min(ws.target.len()) >= MANY {
            self.follow_patterns(ws, observe)?;
            if self.is_done(ws) {
                return ControlFlow::Continue(());
            }
        }
        self.reheat(ws, REHEAT.sigma, observe)
    }

    /// Short runs from where the patterns of a dense set put it, as long as each matches more points.
    fn follow_patterns<const D: usize>(
        &self,
        ws: &mut SoftassignWorkspace<D>,
        observe: &mut dyn FnMut(usize, f64) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        let points = ws.model.len().min(ws.target.len()) as f64;
        for _ in 0..PATTERNS {
            let before = (ws.best.matched, ws.best.sigma);
            ws.state.copy_from(&ws.best);
            if !ws.patterns.propose(&ws.state.warped, &ws.target) {
                break;
            }
            let sets = (&*ws.model, &*ws.target);
            ws.consensus.fit(
                &mut ws.annealer,
                SCALES,
                sets,
                &ws.patterns.pairs,
                &mut ws.state,
            );
            let sigma = PATTERN_SIGMA * ws.patterns.spacing;
            self.refine(ws, Pace { sigma, ..REHEAT }, observe)?;
            let (matched, sigma) = (ws.best.matched, ws.best.sigma);
            if matched >= COMPLETE * points
                || (matched < 1.01 * before.0 && sigma > 0.99 * before.1)
            {
                break;
            }
        }
        ControlFlow::Continue(())
    }

    /// A short run from the best answer so far: warm enough to mend parts that went astray.
    pub(super) fn reheat<const D: usize>(
        &self,
        ws: &mut SoftassignWorkspace<D>,
        sigma: f64,
        observe: &mut dyn FnMut(usize, f64) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        ws.state.copy_from(&ws.best);
        self.refine(ws, Pace { sigma, ..REHEAT }, observe)
    }
}
