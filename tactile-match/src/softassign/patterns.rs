//! A start for dense sets: the warped neighbours of a point identify its target.
//!
//! Once the temperature is below the spacing of the points, a part of a dense set that is shifted by
//! one point stays there: points are matched one by one, and each finds a neighbour's target nearby.
//! The pattern of the neighbours, however, fits only at the correct target, and the more clearly the
//! less regular the set is. For each model point i and each target j in reach, the neighbours are
//! placed about `tⱼ` as the warp has them about `yᵢ`, and a small affine correction is fitted. The
//! remaining distance to the targets there is the misfit of the candidate.

use super::cells::Cells;
use super::difference;
use crate::Watch;
use nalgebra::{SMatrix, SVector};
use std::ops::ControlFlow;

/// Working memory of the start.
#[derive(Clone, Debug, Default)]
pub(super) struct LocalPatterns<const D: usize> {
    /// Cells for finding candidates and the targets of neighbours.
    targets: Cells<D>,
    gated: Cells<D>,
    model: Cells<D>,
    offsets: Vec<[f64; D]>,
    distances: Vec<(f64, usize)>,
    candidates: Vec<usize>,
    best: Vec<Candidate>,
    /// The likeliest target of each model point, with the probability that it is correct.
    pub pairs: Vec<(usize, f64)>,
    spacing: f64,
}

/// Largest distance of targets with which the pattern of a point is compared, in radii of the
/// model.
pub(super) const MAX_PATTERN_REACH: f64 = 0.25;

/// Neighbours per point, for each dimension.
const NEIGHBOURS: usize = 4;
/// Maximum distance of a neighbour's target from its expected position, in spacings.
const GATE: f64 = 0.45;

/// The target that the pattern of a model point fits best.
#[derive(Clone, Copy, Debug)]
struct Candidate {
    target: usize,
    misfit: f64,
    /// Misfit at the second-best target.
    second: f64,
}

impl<const D: usize> LocalPatterns<D> {
    /// Finds `pairs` for some model rows, in their order, for model points that a first warp has
    /// moved to `warped`. `spacing` is that of the targets. Candidates are at most `reach` away.
    /// Returns `false` if the sets have no meaningful spacing.
    pub(super) fn propose(
        &mut self,
        rows: impl Iterator<Item = usize>,
        (warped, target): (&[[f64; D]], &[[f64; D]]),
        spacing: f64,
        reach: f64,
        watch: Watch<'_>,
    ) -> ControlFlow<(), bool> {
        self.spacing = spacing;
        if !(self.spacing > 0.0 && self.spacing < reach) {
            return ControlFlow::Continue(false);
        }
        // Side of the cells for the search of candidates, in spacings.
        self.targets.build(target, 2.0 * self.spacing);
        self.gated.build(target, 2.0 * GATE * self.spacing);
        self.model.build(warped, 2.0 * self.spacing);
        self.best.clear();
        for i in rows {
            watch()?;
            self.look_around(warped, i);
            let best = self.best_candidate(warped, target, i, reach);
            self.best.push(best);
        }
        self.weigh();
        ControlFlow::Continue(true)
    }

    /// Finds the nearest neighbours of model point `i`, as offsets from it.
    fn look_around(&mut self, warped: &[[f64; D]], i: usize) {
        let near = &mut self.distances;
        let wanted = NEIGHBOURS * D;
        let mut radius = 2.0 * self.spacing;
        // Doubles the radius until there are enough neighbours. An isolated point uses fewer.
        for _ in 0..4 {
            near.clear();
            self.model
                .within(&warped[i], radius, |a, square| near.push((square, a)));
            near.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            near.dedup();
            if near.len() > wanted {
                break;
            }
            radius *= 2.0;
        }
        near.retain(|&(_, a)| a != i);
        near.truncate(wanted);
        self.offsets.clear();
        self.offsets.extend(
            near.iter()
                .map(|&(_, a)| difference(&warped[a], &warped[i])),
        );
    }

    /// The candidate with the smallest misfit for model point `i`.
    fn best_candidate(
        &mut self,
        warped: &[[f64; D]],
        target: &[[f64; D]],
        i: usize,
        reach: f64,
    ) -> Candidate {
        let candidates = &mut self.candidates;
        candidates.clear();
        self.targets
            .within(&warped[i], reach, |j, _| candidates.push(j));
        candidates.sort_unstable();
        candidates.dedup();
        let mut best = Candidate {
            target: 0,
            misfit: f64::INFINITY,
            second: f64::INFINITY,
        };
        for &j in &self.candidates {
            let misfit = self.misfit(target, j);
            if misfit < best.misfit {
                best = Candidate {
                    target: j,
                    misfit,
                    second: best.misfit,
                };
            } else if misfit < best.second {
                best.second = misfit;
            }
        }
        best
    }

    /// Sum of squared distances between the expected neighbours about target `j`, slightly
    /// deformed, and the targets there.
    fn misfit(&self, target: &[[f64; D]], j: usize) -> f64 {
        // Misfits above this fraction of the largest possible one are not corrected.
        let hopeless = 0.75 * (GATE * self.spacing).powi(2) * self.offsets.len() as f64;
        let (mut misfit, mut bend) = self.bent(&target[j], target, &SMatrix::zeros());
        // Alternates finding the neighbours' targets and fitting the affine correction.
        for _ in 0..2 {
            if misfit > hopeless {
                break;
            }
            (misfit, bend) = self.bent(&target[j], target, &bend);
        }
        misfit
    }

    /// The misfit about `centre` if the offsets of the neighbours are deformed by `bend`, and the
    /// deformation that fits the targets found.
    fn bent(
        &self,
        centre: &[f64; D],
        target: &[[f64; D]],
        bend: &SMatrix<f64, D, D>,
    ) -> (f64, SMatrix<f64, D, D>) {
        let gate = GATE * self.spacing;
        let mut misfit = 0.0;
        let mut outer = SMatrix::<f64, D, D>::zeros();
        // Weight of the prior of no correction, in squared spacings.
        let mut gram = SMatrix::<f64, D, D>::identity() * (0.3 * self.spacing * self.spacing);
        for offset in &self.offsets {
            let offset = SVector::from(*offset);
            let place = SVector::from(*centre) + offset + bend * offset;
            let Some(found) = self.gated.nearest(&place.into(), gate) else {
                misfit += gate * gate;
                continue;
            };
            let rest = SVector::from(target[found]) - place;
            misfit += rest.norm_squared();
            outer += (rest + bend * offset) * offset.transpose();
            gram += offset * offset.transpose();
        }
        (
            misfit,
            outer * gram.try_inverse().unwrap_or_else(SMatrix::zeros),
        )
    }

    /// Converts misfits into probabilities. The noise level is set by the typical best misfit.
    fn weigh(&mut self) {
        let values = (NEIGHBOURS * D * D) as f64;
        self.distances.clear();
        self.distances
            .extend(self.best.iter().map(|best| (best.misfit, 0)));
        let place = self.distances.len() / 4;
        let typical = self
            .distances
            .select_nth_unstable_by(place, |a, b| a.0.total_cmp(&b.0))
            .1
            .0;
        // Resolution of misfits, in spacings.
        let variance = (typical / values).max((2e-3 * self.spacing).powi(2));
        self.pairs.clear();
        let pair = |best: &Candidate| {
            let trust = if best.misfit.is_finite() {
                1.0 / (1.0 + (-0.5 * (best.second - best.misfit) / variance).exp())
            } else {
                0.0
            };
            // A misfit of three times the typical one is rejected.
            let fits = (-0.5 * best.misfit / (9.0 * variance * values)).exp();
            (best.target, trust * fits)
        };
        self.pairs.extend(self.best.iter().map(pair));
    }
}
