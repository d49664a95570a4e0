//! Whether a search is over.
use super::super::{AnnealedSoftassign, SoftassignWorkspace, finish};
use super::REHEAT;

/// So many points that an incomplete exact answer is not worth a second try.
pub(super) const MANY: usize = 500;
/// Residuals of so many points below this many spacings leave no doubt: one point aside, they would be larger.
const PLAIN: f64 = 0.15;
/// Share of the smaller set that an exact answer should match.
pub(super) const COMPLETE: f64 = 0.98;
/// Share of the smaller set that a noisy answer should match.
const EXPLAINED: f64 = 0.9;

const PLAIN_GAIN: f64 = 1.2;

/// Soft partners that spread no more than this, relative to the temperature, are decided. About points well apart they spread by 0.05, where a part lies
/// aside by 0.12 to 0.6: at 0.2, three of 324 noisy scenes kept such a part, at 0.1 one does (`--example peer_cases`). Where noise hides
/// single points they spread as far; a second run has to end in the same answer then.
const DECIDED: f64 = 0.1;

/// With this gain and decided partners no part lies aside, however small the residuals: the patterns of 600 noisy scenes of 150 to 360 points moved
/// none then.
const EVIDENT_GAIN: f64 = 1.4;

/// Share of residuals that may be larger than the noise of the others explains: single outliers, but no part of the set.
const STRAGGLERS: f64 = 0.03;

/// The same where the data are clean and the set is dense: the points at the edge of a part that lies one point aside.
const CLEAN_STRAGGLERS: f64 = 0.01;

/// Soft partners spread so far, relative to the temperature, leave no point its own.
const NO_PARTNERS: f64 = 0.8;

impl AnnealedSoftassign {
    /// Whether no further start can do better.
    pub(super) fn is_done<const D: usize>(&self, ws: &SoftassignWorkspace<D>) -> bool {
        self.is_certain(ws) || self.is_explained(ws)
    }

    /// Whether not even a part can lie aside.
    pub(super) fn is_certain<const D: usize>(&self, ws: &SoftassignWorkspace<D>) -> bool {
        self.is_exact(ws) || self.is_plain(ws)
    }

    /// Whether the residuals of a dense set are so far below its spacing, for nearly all points, that no part can lie aside.
    fn is_plain<const D: usize>(&self, ws: &SoftassignWorkspace<D>) -> bool {
        let points = ws.model.len().min(ws.target.len());
        points >= MANY
            && ws.best.sigma <= PLAIN * ws.patterns.spacing
            && ws.best.matched >= 0.8 * points as f64
            && ws.best.tail <= CLEAN_STRAGGLERS
    }

    /// Whether noise explains the residuals: they are clearly below the spacing of the targets, for nearly all points, and so is the spread of
    /// the soft partners.
    fn is_explained<const D: usize>(&self, ws: &SoftassignWorkspace<D>) -> bool {
        let points = ws.model.len().min(ws.target.len());
        let wanted = if finish::are_unequal(ws.model.len(), ws.target.len()) {
            PLAIN_GAIN
        } else {
            finish::TELLING
        };
        points < MANY
            && ws.gain().is_some_and(|gain| gain >= wanted)
            && ws.best.matched >= EXPLAINED * points as f64
            && ws.best.tail <= STRAGGLERS
            && (ws.best.ambiguity <= DECIDED || ws.confirmed)
    }

    /// Whether noise explains the residuals and nothing is left for local patterns to find.
    pub(super) fn is_evident<const D: usize>(&self, ws: &SoftassignWorkspace<D>) -> bool {
        self.is_explained(ws) && ws.gain().is_some_and(|gain| gain >= EVIDENT_GAIN)
    }

    /// Whether the best run so far explains nearly every point of the smaller set to rounding.
    pub(in super::super) fn is_exact<const D: usize>(&self, ws: &SoftassignWorkspace<D>) -> bool {
        let points = ws.model.len().min(ws.target.len());
        let wanted = if ws.starts == 1 || points < MANY {
            COMPLETE
        } else {
            0.8
        };
        ws.best.sigma <= finish::CLEAN
            && ws.best.matched >= wanted * points as f64
            && (ws.best.tail <= CLEAN_STRAGGLERS || points < MANY)
    }

    /// Whether noise seems to hide which point is which, so that the points' surroundings tell nothing: the best answer is undecided at the
    /// temperature of a second try.
    pub(super) fn is_hidden<const D: usize>(&self, ws: &SoftassignWorkspace<D>) -> bool {
        ws.best.ambiguity >= NO_PARTNERS && ws.best.sigma >= 0.999 * REHEAT.sigma
    }
}
