//! Local patterns: the warped neighbours of a point identify its target. Also contains the robust
//! fit of doubtful pairs.

use super::problem::Problem;
use super::run::{Annealer, Run};
use super::search::SCALES;
use super::{difference, squared_distance};
use crate::Watch;
use crate::gaussian_process::{Axes, Prior, PriorScales};
use nalgebra::{SMatrix, SVector};
use std::f64::consts::TAU;
use std::ops::ControlFlow;

/// Working memory of the start.
#[derive(Clone, Debug, Default)]
pub(super) struct LocalPatterns<const D: usize> {
    /// Cells for finding candidates and the targets of neighbours.
    pub targets: Cells<D>,
    pub gated: Cells<D>,
    pub model: Cells<D>,
    pub offsets: Vec<[f64; D]>,
    pub distances: Vec<(f64, usize)>,
    pub candidates: Vec<usize>,
    pub best: Vec<Candidate>,
    /// The likeliest target of each model point, with the probability that it is correct.
    pub pairs: Vec<(usize, f64)>,
    pub spacing: f64,
}

// A start for dense sets: the warped neighbours of a point identify its target.
//
// Once the temperature is below the spacing of the points, a part of a dense set that is shifted by
// one point stays there: points are matched one by one, and each finds a neighbour's target nearby.
// The pattern of the neighbours, however, fits only at the correct target, and the more clearly the
// less regular the set is. For each model point i and each target j in reach, the neighbours are
// placed about `tⱼ` as the warp has them about `yᵢ`, and a small affine correction is fitted. The
// remaining distance to the targets there is the misfit of the candidate.

/// Neighbours per point, for each dimension.
const NEIGHBOURS: usize = 4;
/// Maximum distance of a neighbour's target from its expected position, in spacings.
const GATE: f64 = 0.45;

/// The target that the pattern of a model point fits best.
#[derive(Clone, Copy, Debug)]
pub(super) struct Candidate {
    target: usize,
    misfit: f64,
    /// Misfit at the second-best target.
    second: f64,
}

impl<const D: usize> LocalPatterns<D> {
    /// Finds `pairs` for some model rows, in their order, for model points that a first warp has
    /// moved to `warped`. `spacing` is that of the targets. Candidates are at most `reach` away. Returns `false` if the sets have no
    /// meaningful spacing.
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

// Points in hashed square cells, so that a search by distance examines only nearby points.

/// Beyond this number of cells from the origin all cells are one: such coordinates are as good as
/// infinite.
const MAX_CELLS: f64 = 1e9;
/// Stands for "no point".
const NONE: u32 = u32::MAX;

/// Square cells that fill space.
#[derive(Clone, Copy, Debug, Default)]
struct Grid {
    /// Reciprocal side of a cell.
    per_side: f64,
}

impl Grid {
    /// Cells of this side, which is positive and finite.
    fn new(side: f64) -> Self {
        Self {
            per_side: side.recip(),
        }
    }

    /// Index of a coordinate's cell along its axis.
    #[inline]
    fn cell(self, coordinate: f64) -> i64 {
        let place = (coordinate * self.per_side).clamp(-MAX_CELLS, MAX_CELLS);
        // Rounds down by hand: `floor` is a function call if the code is not compiled for newer
        // instructions.
        let towards_zero = place as i64;
        towards_zero - i64::from(towards_zero as f64 > place)
    }

    /// Calls `visit` with each cell that intersects a box of half width `radius` about `place`.
    #[inline]
    fn for_each_cell<const D: usize>(
        self,
        place: &[f64; D],
        radius: f64,
        mut visit: impl FnMut(&[i64; D]),
    ) {
        let low = place.map(|c| self.cell(c - radius));
        let high = place.map(|c| self.cell(c + radius));
        let mut cell = low;
        loop {
            visit(&cell);
            let Some(axis) = (0..D).find(|&k| cell[k] < high[k]) else {
                return;
            };
            cell[axis] += 1;
            cell[..axis].copy_from_slice(&low[..axis]);
        }
    }

    /// Index of the chain of a cell. `chains` is a power of two.
    #[inline]
    fn chain<const D: usize>(cell: &[i64; D], chains: usize) -> usize {
        let mixed = cell.iter().fold(0_u64, |hash, &c| {
            (hash ^ c as u64)
                .wrapping_mul(0x9e37_79b9_7f4a_7c15)
                .rotate_left(29)
        });
        (mixed ^ (mixed >> 32)) as usize & (chains - 1)
    }
}

/// Chains of points by the hash of their cell. Cells with the same hash share a chain, and
/// distances separate their points.
#[derive(Clone, Debug, Default)]
pub(super) struct Cells<const D: usize> {
    points: Vec<[f64; D]>,
    grid: Grid,
    heads: Vec<u32>,
    next: Vec<u32>,
}

impl<const D: usize> Cells<D> {
    /// Stores points in cells of this side, which is positive and finite. `O(I)`.
    pub(super) fn build(&mut self, points: &[[f64; D]], side: f64) {
        self.points.clear();
        self.points.extend_from_slice(points);
        self.grid = Grid::new(side);
        self.heads.clear();
        self.heads
            .resize((2 * points.len()).next_power_of_two(), NONE);
        self.next.clear();
        for (i, p) in points.iter().enumerate() {
            let cell = p.map(|c| self.grid.cell(c));
            let head = Grid::chain(&cell, self.heads.len());
            self.next.push(self.heads[head]);
            self.heads[head] = i as u32;
        }
    }

    /// Calls `visit` with row and squared distance of each point within `radius` of `place`, in
    /// unspecified order. A point is visited twice if two of the cells share a chain.
    pub(super) fn within(&self, place: &[f64; D], radius: f64, mut visit: impl FnMut(usize, f64)) {
        self.grid.for_each_cell(place, radius, |cell| {
            let mut row = self.heads[Grid::chain(cell, self.heads.len())];
            while row != NONE {
                let square = squared_distance(&self.points[row as usize], place);
                if square <= radius * radius {
                    visit(row as usize, square);
                }
                row = self.next[row as usize];
            }
        });
    }

    /// The point nearest to `place`, if one is within `radius`.
    pub(super) fn nearest(&self, place: &[f64; D], radius: f64) -> Option<usize> {
        let mut best = (f64::INFINITY, None);
        self.within(place, radius, |row, square| {
            if square < best.0 {
                best = (square, Some(row));
            }
        });
        best.1
    }
}

// A warp from doubtful pairs: a robust fit keeps the pairs that agree.

/// Rounds of the fit. The first half uses a nearly affine warp.
const FIT_ROUNDS: usize = 12;

/// Working memory of the fit.
#[derive(Clone, Debug, Default)]
pub(super) struct Consensus<const D: usize> {
    prior: Prior,
    weights: Vec<f64>,
    trust: Vec<f64>,
    wanted: Axes<D>,
}

impl<const D: usize> Consensus<D> {
    /// Robust regression of the likeliest pairs, a target and probability for each model point. The
    /// result is in `run.warped`. Pairs far from the common warp lose weight from round to round.
    pub(super) fn fit(
        &mut self,
        annealer: &mut Annealer<D>,
        problem: &Problem<D>,
        model: &[[f64; D]],
        pairs: &[(usize, f64)],
        run: &mut Run<D>,
    ) {
        self.prior.build(
            model,
            PriorScales {
                bending: 0.05,
                ..SCALES
            },
        );
        self.take(&problem.target, pairs, &run.base);
        let mut variance = 1.0;
        for round in 0..FIT_ROUNDS {
            let prior = if round < FIT_ROUNDS / 2 {
                &self.prior
            } else {
                &annealer.prior
            };
            annealer
                .regression
                .fit(prior, &self.weights, &self.wanted, f64::max(variance, 1e-4));
            variance = self.reweigh(&annealer.regression.displacement, variance, problem.volume);
        }
        for (i, warped) in run.warped.iter_mut().enumerate() {
            *warped =
                std::array::from_fn(|k| run.base[i][k] + annealer.regression.displacement.0[k][i]);
        }
    }

    /// Stores the displacements of the pairs and their weights.
    fn take(&mut self, target: &[[f64; D]], pairs: &[(usize, f64)], base: &[[f64; D]]) {
        let stride = self.prior.stride;
        let rows = pairs.iter().zip(base);
        self.wanted
            .fill(stride, rows.map(|((j, _), b)| difference(&target[*j], b)));
        self.trust.clear();
        self.trust
            .extend(pairs.iter().map(|(_, trust)| trust.clamp(0.05, 0.95)));
        self.weights.clone_from(&self.trust);
        self.weights.resize(stride, 0.0);
    }

    /// Computes new weights from the residuals. Returns the residual variance of the pairs that
    /// agree, at least half of the last one.
    fn reweigh(&mut self, displacement: &Axes<D>, last: f64, volume: f64) -> f64 {
        let square = |i: usize| {
            (0..D)
                .map(|k| (displacement.0[k][i] - self.wanted.0[k][i]).powi(2))
                .sum::<f64>()
        };
        let weight: f64 = self.weights.iter().sum();
        let sum: f64 = (0..self.trust.len())
            .map(|i| self.weights[i] * square(i))
            .sum();
        let variance = (sum / (D as f64 * weight.max(1e-9)))
            .max(0.5 * last)
            .clamp(1e-6, last);
        let outlier = (TAU * variance).powf(0.5 * D as f64) / volume;
        for (i, &trust) in self.trust.iter().enumerate() {
            let agree = (-0.5 * square(i) / variance).exp() * trust;
            self.weights[i] = agree / (agree + (1.0 - trust) * outlier).max(f64::MIN_POSITIVE);
        }
        variance
    }
}

#[cfg(test)]
mod tests;
