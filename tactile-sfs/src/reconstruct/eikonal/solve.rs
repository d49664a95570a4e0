//! Sweeps until nothing changes: one branch, or both and a choice between them.

use super::{Branch, Eikonal, boundary, frontal, oblique};
use crate::{Scalar, StopReason, Workspace};

/// Passes along an expected front before sweeps in four directions, which any front is reached by.
const MARCHES: usize = 3;

/// How one branch was solved.
#[derive(Clone, Copy)]
pub(super) struct Outcome<T> {
    /// Whether it is the convex branch.
    pub(super) convex: bool,
    pub(super) stop: StopReason,
    pub(super) sweeps: usize,
    /// Largest change of the last sweeps, in pixels.
    pub(super) change: T,
}

impl<T: Scalar> Eikonal<T> {
    /// Solves the branch asked for, or both and keeps the better.
    pub(super) fn choose(&self, workspace: &mut Workspace<T>, known_inside: bool) -> Outcome<T> {
        let first = self.solve(workspace, self.branch != Branch::Concave);
        if self.branch != Branch::Auto || !known_inside || first.stop == StopReason::Cancelled {
            return first;
        }
        workspace.eikonal.keep();
        let second = self.solve(workspace, false);
        let sweeps = first.sweeps + second.sweeps;
        if workspace.eikonal.kept_is_better(&self.lighting) {
            workspace.eikonal.restore();
            return Outcome { sweeps, ..first };
        }
        Outcome { sweeps, ..second }
    }

    /// Solves one branch into the buffers' values; under frontal light twice, the second time with the directions of the
    /// first.
    fn solve(&self, workspace: &mut Workspace<T>, convex: bool) -> Outcome<T> {
        let grid = &mut workspace.eikonal;
        // A fitted profile tells the directions of a convex surface; any other is solved once to measure them.
        grid.corrected = convex && grid.directed;
        let corrected = grid.corrected;
        let first = self.sweep(workspace, convex, 0);
        if corrected || !self.lighting.is_frontal() || first.stop != StopReason::Converged {
            return first;
        }
        frontal::measure_directions(&mut workspace.eikonal);
        workspace.eikonal.corrected = true;
        self.sweep(workspace, convex, first.sweeps)
    }

    /// Sweeps until nothing changes; the first solve along the expected front before. (With the corrected slopes the least of all values that a
    /// node ever had is kept, which depends on the order by some 10⁻³ of the height: sweeps alone.)
    fn sweep(&self, workspace: &mut Workspace<T>, convex: bool, done: usize) -> Outcome<T> {
        boundary::start(&mut workspace.eikonal, convex);
        let light = self.lighting.direction();
        let mut outcome = Outcome {
            convex,
            stop: StopReason::IterationLimit,
            sweeps: done,
            change: T::infinity(),
        };
        let grid = &workspace.eikonal;
        let marched = convex && !grid.front.nodes.is_empty();
        for _ in 0..if marched {
            self.max_sweeps.min(MARCHES)
        } else {
            0
        } {
            outcome.sweeps += 1;
            if !frontal::march(&mut workspace.eikonal, self.tolerance) {
                outcome.change = T::zero();
                outcome.stop = StopReason::Converged;
                return outcome;
            }
        }
        while outcome.sweeps < done + self.max_sweeps {
            let buffers = &mut workspace.eikonal;
            outcome.change = T::zero();
            for order in 0..4 {
                let change = if self.lighting.is_frontal() {
                    frontal::sweep(buffers, order, self.tolerance)
                } else {
                    oblique::sweep(buffers, light, convex, order, self.tolerance)
                };
                outcome.change = outcome.change.max(change);
            }
            outcome.sweeps += 4;
            if outcome.change <= self.tolerance {
                outcome.stop = StopReason::Converged;
                break;
            }
            if let Some(stop) =
                workspace.report(outcome.sweeps, done + self.max_sweeps, outcome.change)
            {
                outcome.stop = stop;
                break;
            }
        }
        outcome
    }
}
