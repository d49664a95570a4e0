//! Where a run of the search starts, and the base and warped positions that it starts from.

use super::super::{AnnealedSoftassign, Rotation, SoftassignWorkspace, starts};
use super::SCALES;
use nalgebra::SMatrix;

/// Where a run starts.
#[derive(Clone, Copy, Debug)]
pub(super) enum Start<const D: usize> {
    /// The centroids on each other.
    Centred,
    /// The best answer so far.
    Best,
    /// The best answer so far, put right by the local patterns of a dense set.
    Patterns,
    /// The pairs of relaxation labelling.
    Labelling,
    /// The second moments on each other, after a rotation.
    Moments(SMatrix<f64, D, D>),
    /// The affine map that local tuples of points agree on.
    Tuples,
}

impl AnnealedSoftassign {
    /// Puts `ws.state` to a start: base and warped positions. False where the sets do not have such a start.
    pub(super) fn place<const D: usize>(
        &self,
        ws: &mut SoftassignWorkspace<D>,
        start: Start<D>,
    ) -> bool {
        let (model, target) = (&*ws.model, &*ws.target);
        let state = &mut ws.state;
        match start {
            Start::Best => {
                state.copy_from(&ws.best);
                return true;
            }
            Start::Patterns => {
                state.copy_from(&ws.best);
                if !ws.patterns.propose(&state.warped, target) {
                    return false;
                }
                let pairs = &ws.patterns.pairs;
                ws.consensus
                    .fit(&mut ws.annealer, SCALES, (model, target), pairs, state);
                return true;
            }
            Start::Centred | Start::Labelling => starts::centred(model, target, &mut state.base),
            Start::Moments(rotation) => {
                starts::moments(model, target, &rotation, &mut state.base);
            }
            Start::Tuples => {
                let limited = self.rotation == Rotation::Limited;
                if !ws.tuples.find(model, target, ws.spacing, limited) {
                    return false;
                }
                ws.tuples.apply(model, &mut state.base);
            }
        }
        state.warped.clone_from(&state.base);
        if matches!(start, Start::Labelling) {
            ws.correspondence.find(&state.base, target);
            let pairs = &ws.correspondence.pairs;
            ws.consensus
                .fit(&mut ws.annealer, SCALES, (model, target), pairs, state);
        }
        true
    }
}
