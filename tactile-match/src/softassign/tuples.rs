//! A start for sets that differ by a large affine map, on which local tuples of points agree.
//!
//! A model point with D of its neighbours and a target point with D of its own determine an affine
//! map. The correct pair of tuples maps the model point's other neighbours onto targets; a wrong
//! pair does so only by chance. From the tuples with the most hits the map is refitted over growing
//! neighbourhoods, as long as most of their points hit. Second moments and centroids are not used,
//! so cropping and outliers do no harm [after Fischler & Bolles, *Random sample consensus*, CACM 24
//! (1981), with all local tuples in place of a sample].

use super::cells::Cells;
use super::{mean, squared_distance};
use crate::Watch;
use nalgebra::{SMatrix, SVector};
use std::ops::ControlFlow;

/// Number of model points tried, spread over the inner half, the most central first.
const SEEDS: usize = 12;
/// Neighbours of a model point on which a map is tested, and of a target that form tuples, for each
/// dimension.
const TESTED: usize = 10;
const OFFERED: usize = 5;
/// A hit is a target within this distance, in spacings.
const GATE: f64 = 0.3;
/// Working memory of the start.
#[derive(Clone, Debug, Default)]
pub(super) struct Tuples<const D: usize> {
    targets: Cells<D>,
    order: Vec<(f64, usize)>,
    seeds: Vec<usize>,
    near: Vec<(f64, usize)>,
    offsets: Vec<SVector<f64, D>>,
    offered: Vec<SVector<f64, D>>,
}

impl<const D: usize> Tuples<D> {
    /// Moves the model to `base` by the map. Returns `false` if no tuples agree. `limited` excludes
    /// rotations beyond about 60°.
    pub(super) fn find(
        &mut self,
        (model, target): (&[[f64; D]], &[[f64; D]]),
        spacing: f64,
        limited: bool,
        still: &[f64; D],
        base: &mut Vec<[f64; D]>,
        watch: Watch<'_>,
    ) -> ControlFlow<(), bool> {
        let is_degenerate = spacing.is_nan() || spacing <= 0.0;
        if is_degenerate || model.len().min(target.len()) < 2 * TESTED * D {
            return ControlFlow::Continue(false);
        }
        self.targets.build(target, 2.0 * spacing);
        self.choose_seeds(model);
        let mut best: Option<(f64, Local<D>)> = None;
        for s in 0..self.seeds.len() {
            let seed = self.seeds[s];
            let tuple = self.best_tuple((model, target), seed, spacing, limited, still, watch)?;
            let Some(map) = tuple else {
                continue;
            };
            let Some((grown, map)) = self.grow(model, target, seed, map, spacing) else {
                continue;
            };
            if best.as_ref().is_none_or(|(b, _)| grown > *b) {
                best = Some((grown, map));
            }
            // Half of the model in one affine piece leaves no doubt.
            if grown >= 0.5 * model.len() as f64 {
                break;
            }
        }
        let Some((_, map)) = best else {
            return ControlFlow::Continue(false);
        };
        base.clear();
        base.extend(model.iter().map(|p| map.apply(p)));
        ControlFlow::Continue(true)
    }

    fn choose_seeds(&mut self, model: &[[f64; D]]) {
        let centre = mean(model);
        self.order.clear();
        let by_distance = model
            .iter()
            .enumerate()
            .map(|(i, p)| (squared_distance(p, &centre), i));
        self.order.extend(by_distance);
        self.order
            .sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let step = (model.len() / 2 / SEEDS).max(1);
        self.seeds.clear();
        let inner = self.order.iter().step_by(step).take(SEEDS);
        self.seeds.extend(inner.map(|&(_, i)| i));
    }

    /// The `count` points nearest to `place`, nearest first.
    fn nearest(&mut self, points: &[[f64; D]], place: &[f64; D], count: usize) {
        self.near.clear();
        let distances = points
            .iter()
            .enumerate()
            .map(|(i, p)| (squared_distance(p, place), i));
        self.near.extend(distances);
        let count = count.min(points.len());
        let by_distance =
            |a: &(f64, usize), b: &(f64, usize)| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
        if count < self.near.len() {
            self.near.select_nth_unstable_by(count, by_distance);
            self.near.truncate(count);
        }
        self.near.sort_unstable_by(by_distance);
    }

    /// The local map with the most hits among the neighbours of a seed, over all targets and tuples
    /// of their neighbours.
    fn best_tuple(
        &mut self,
        (model, target): (&[[f64; D]], &[[f64; D]]),
        seed: usize,
        spacing: f64,
        limited: bool,
        still: &[f64; D],
        watch: Watch<'_>,
    ) -> ControlFlow<(), Option<Local<D>>> {
        let from = SVector::from(model[seed]);
        self.nearest(model, &model[seed], TESTED * D + 1);
        self.offsets.clear();
        let others = self.near.iter().filter(|&&(_, i)| i != seed);
        self.offsets
            .extend(others.map(|&(_, i)| SVector::from(model[i]) - from));
        let Some((basis, inverse)) = best_basis(&self.offsets) else {
            return ControlFlow::Continue(None);
        };
        // Required fraction of hits: among the tested neighbours, and among more neighbours after a
        // refit.
        let wanted = (0.7 * self.offsets.len() as f64) as usize;
        let mut best = Best::new(wanted);
        // Misfits within a tenth of a spacing per point count as equal.
        let equal = 0.01 * spacing * spacing * self.offsets.len() as f64;
        for j in 0..target.len() {
            watch()?;
            let to = SVector::from(target[j]);
            self.near.clear();
            let mut radius = 2.0 * spacing;
            for _ in 0..3 {
                self.near.clear();
                let near = &mut self.near;
                self.targets
                    .within(&target[j], radius, |i, square| near.push((square, i)));
                if self.near.len() > OFFERED * D {
                    break;
                }
                radius *= 1.5;
            }
            self.near
                .sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            self.near.dedup();
            self.near.retain(|&(_, i)| i != j);
            self.near.truncate(OFFERED * D);
            self.offered.clear();
            self.offered.extend(
                self.near
                    .iter()
                    .map(|&(_, i)| SVector::from(target[i]) - to),
            );
            let count = self.offered.len();
            if count < D {
                continue;
            }
            for choice in choices::<D>(count) {
                if (1..D).any(|axis| choice[..axis].contains(&choice[axis])) {
                    continue;
                }
                let mut linear = SMatrix::<f64, D, D>::zeros();
                for axis in 0..D {
                    linear += self.offered[choice[axis]] * inverse.row(axis);
                }
                if !plausible(&linear, limited) {
                    continue;
                }
                let (hits, misfit) = self.hits(&linear, &to, &basis, best.hits, spacing);
                if hits > best.hits || (hits == best.hits && misfit < best.misfit + equal) {
                    best.consider(hits, misfit, Local { linear, from, to }, still, equal);
                }
            }
        }
        ControlFlow::Continue(best.map)
    }

    /// Number of neighbours that the map puts onto a target, and the sum of their squared
    /// distances. Stops early if `wanted` is out of reach.
    fn hits(
        &self,
        linear: &SMatrix<f64, D, D>,
        to: &SVector<f64, D>,
        basis: &[usize; D],
        wanted: usize,
        spacing: f64,
    ) -> (usize, f64) {
        let (mut hits, mut misfit) = (D, 0.0);
        let total = self.offsets.len();
        for (at, offset) in self.offsets.iter().enumerate() {
            if basis.contains(&at) {
                continue;
            }
            let place: [f64; D] = (to + linear * offset).into();
            let mut least = f64::INFINITY;
            self.targets.within(&place, GATE * spacing, |_, square| {
                least = least.min(square)
            });
            if least.is_finite() {
                hits += 1;
                misfit += least;
            } else if hits + (total - at) <= wanted {
                return (0, f64::INFINITY);
            }
        }
        (hits, misfit)
    }

    /// Refits the map over growing neighbourhoods of the seed. Returns the final number of hits.
    fn grow(
        &mut self,
        model: &[[f64; D]],
        target: &[[f64; D]],
        seed: usize,
        mut map: Local<D>,
        spacing: f64,
    ) -> Option<(f64, Local<D>)> {
        let mut grown = None;
        let mut count = TESTED * D;
        loop {
            count = count.min(model.len());
            self.nearest(model, &model[seed], count);
            let (mut hits, mut inside) = (0.0, 0.0);
            let mut means = [SVector::<f64, D>::zeros(); 2];
            let mut gram = SMatrix::<f64, D, D>::identity() * 1e-9;
            let mut cross = SMatrix::<f64, D, D>::zeros();
            for pass in 0..2 {
                for &(_, i) in &self.near {
                    let image = map.apply(&model[i]);
                    let Some(j) = self.targets.nearest(&image, GATE * spacing) else {
                        // A point without any target nearby is occluded and does not count as a
                        // miss.
                        if pass == 0 && self.targets.nearest(&image, 1.5 * spacing).is_some() {
                            inside += 1.0;
                        }
                        continue;
                    };
                    let (p, q) = (SVector::from(model[i]), SVector::from(target[j]));
                    if pass == 0 {
                        (hits, inside) = (hits + 1.0, inside + 1.0);
                        means[0] += p;
                        means[1] += q;
                    } else {
                        let (p, q) = (p - means[0], q - means[1]);
                        gram += p * p.transpose();
                        cross += q * p.transpose();
                    }
                }
                if pass == 0 {
                    if hits < 0.6 * inside || hits < 2.0 * D as f64 {
                        return grown;
                    }
                    means = means.map(|m| m / hits);
                }
            }
            map = Local {
                linear: cross * gram.try_inverse()?,
                from: means[0],
                to: means[1],
            };
            grown = Some((hits, map));
            if count == model.len() {
                return grown;
            }
            count *= 2;
        }
    }
}

// Affine maps about a pair of points: their construction, and which of them are plausible.

/// Local maps with stretches outside this range are rejected.
const STRETCH: [f64; 2] = [0.4, 2.5];

/// An affine map about a pair of points.
#[derive(Clone, Copy)]
struct Local<const D: usize> {
    linear: SMatrix<f64, D, D>,
    from: SVector<f64, D>,
    to: SVector<f64, D>,
}

impl<const D: usize> Local<D> {
    /// Mean square motion of a model of radius one about its centre, which `still` places among the
    /// targets.
    fn motion(&self, still: &[f64; D]) -> f64 {
        let turned = (self.linear - SMatrix::identity()).norm_squared() / D as f64;
        let centre = self.to - self.linear * self.from - SVector::from(*still);
        turned + centre.norm_squared()
    }

    /// The image of a point.
    fn apply(&self, p: &[f64; D]) -> [f64; D] {
        (self.linear * (SVector::from(*p) - self.from) + self.to).into()
    }
}

/// The best local map so far: the one with the most hits, and among equals the one with the
/// smallest residual. Among maps that differ only by rounding (as in a lattice), it is the one with
/// the least motion.
struct Best<const D: usize> {
    hits: usize,
    misfit: f64,
    motion: f64,
    map: Option<Local<D>>,
}

impl<const D: usize> Best<D> {
    fn new(hits: usize) -> Self {
        Self {
            hits,
            misfit: f64::INFINITY,
            motion: f64::INFINITY,
            map: None,
        }
    }

    fn consider(&mut self, hits: usize, misfit: f64, map: Local<D>, still: &[f64; D], equal: f64) {
        let motion = map.motion(still);
        let clearly = hits > self.hits || misfit < self.misfit - equal;
        if clearly || motion < self.motion {
            let least = if clearly {
                misfit
            } else {
                misfit.min(self.misfit)
            };
            *self = Self {
                hits,
                misfit: least,
                motion,
                map: Some(map),
            };
        }
    }
}

/// The D offsets to nearest neighbours that span the largest volume for their size, and the inverse
/// of their matrix.
fn best_basis<const D: usize>(
    offsets: &[SVector<f64, D>],
) -> Option<([usize; D], SMatrix<f64, D, D>)> {
    let count = offsets.len().min(2 * D + 2);
    let mut best = (0.0, None);
    for chosen in choices::<D>(count) {
        // Each choice in one order only.
        if chosen.windows(2).any(|pair| pair[0] >= pair[1]) {
            continue;
        }
        let mut columns = SMatrix::<f64, D, D>::zeros();
        let mut size = 1.0;
        for (axis, &at) in chosen.iter().enumerate() {
            columns.set_column(axis, &offsets[at]);
            size *= offsets[at].norm();
        }
        let Some(inverse) = columns.try_inverse() else {
            continue;
        };
        // Close neighbours are more likely to be visible together, so the spanned volume is divided
        // by the lengths.
        let volume = volume(&columns).abs() / size;
        if volume > best.0 {
            best = (volume, Some((chosen, inverse)));
        }
    }
    best.1
}

pub(super) fn volume<const D: usize>(m: &SMatrix<f64, D, D>) -> f64 {
    match D {
        2 => m[(0, 0)] * m[(1, 1)] - m[(0, 1)] * m[(1, 0)],
        3 => {
            m[(0, 0)] * (m[(1, 1)] * m[(2, 2)] - m[(1, 2)] * m[(2, 1)])
                - m[(0, 1)] * (m[(1, 0)] * m[(2, 2)] - m[(1, 2)] * m[(2, 0)])
                + m[(0, 2)] * (m[(1, 0)] * m[(2, 1)] - m[(1, 1)] * m[(2, 0)])
        }
        _ => 1.0,
    }
}

/// All choices of D among `count`, repetitions and all orders included.
fn choices<const D: usize>(count: usize) -> impl Iterator<Item = [usize; D]> {
    std::iter::successors((count > 0).then_some([0; D]), move |last| {
        let mut next = *last;
        for place in &mut next {
            *place += 1;
            if *place < count {
                return Some(next);
            }
            *place = 0;
        }
        None
    })
}

/// Whether a body could follow a local map: no reflection, no stretch out of range, and no large
/// rotation if rotations are limited.
fn plausible<const D: usize>(linear: &SMatrix<f64, D, D>, limited: bool) -> bool {
    let [low, high] = STRETCH;
    let squares = low * low..=high * high;
    for k in 0..D {
        let (column, row) = (
            linear.column(k).norm_squared(),
            linear.row(k).norm_squared(),
        );
        let along = linear[(k, k)];
        if limited && (along < 0.0 || along * along < 0.25 * column) {
            return false;
        }
        if !(squares.contains(&column) && squares.contains(&row)) {
            return false;
        }
    }
    volume(linear) > low.powi(D as i32 - 1)
}

#[cfg(test)]
mod tests;
