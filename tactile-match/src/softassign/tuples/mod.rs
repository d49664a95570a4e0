//! A start for sets that an affine map takes far: local tuples of points agree on it.
//!
//! A model point with D of its neighbours, and a target point with D of its own, determine an affine map. The right pair of tuples puts
//! the model point's other neighbours onto targets, a wrong one does so by chance alone. From the tuples with most hits the map is refitted
//! over larger and larger neighbourhoods, as long as most of them hit. Neither second moments nor centroids enter, so that cropping and
//! outliers do no harm [after Fischler & Bolles, *Random sample consensus*, CACM 24 (1981), with all local tuples in place of a sample].

mod local;

use super::cells::Cells;
use local::{Local, best_basis, plausible};
use nalgebra::{SMatrix, SVector};

/// Model points tried, nearest the centre first and spread over the inner half.
const SEEDS: usize = 12;
/// Neighbours of a model point that a map is tested on, and of a target that tuples are made of, for every dimension.
const TESTED: usize = 10;
const OFFERED: usize = 5;
/// A hit is a target within this many spacings.
const GATE: f64 = 0.3;
/// Shares of hits: of the neighbours tested, and of a larger neighbourhood after a refit.
const HITS: f64 = 0.7;
const GROWN_HITS: f64 = 0.6;
/// Memory of the start, and the map found.
#[derive(Clone, Debug)]
pub(crate) struct Tuples<const D: usize> {
    targets: Cells<D>,
    order: Vec<(f64, usize)>,
    seeds: Vec<usize>,
    near: Vec<(f64, usize)>,
    offsets: Vec<SVector<f64, D>>,
    offered: Vec<SVector<f64, D>>,
    linear: SMatrix<f64, D, D>,
    from: SVector<f64, D>,
    to: SVector<f64, D>,
}

impl<const D: usize> Default for Tuples<D> {
    fn default() -> Self {
        Self {
            targets: Cells::default(),
            order: Vec::new(),
            seeds: Vec::new(),
            near: Vec::new(),
            offsets: Vec::new(),
            offered: Vec::new(),
            linear: SMatrix::identity(),
            from: SVector::zeros(),
            to: SVector::zeros(),
        }
    }
}

impl<const D: usize> Tuples<D> {
    /// The map, applied to the model.
    pub(crate) fn apply(&self, model: &[[f64; D]], base: &mut Vec<[f64; D]>) {
        let map = Local {
            linear: self.linear,
            from: self.from,
            to: self.to,
        };
        base.clear();
        base.extend(model.iter().map(|p| map.apply(p)));
    }

    /// Looks for the map; false where no tuples agree. `limited` leaves out rotations beyond some 60°.
    pub(crate) fn find(
        &mut self,
        model: &[[f64; D]],
        target: &[[f64; D]],
        spacing: f64,
        limited: bool,
    ) -> bool {
        let is_degenerate = spacing.is_nan() || spacing <= 0.0;
        if is_degenerate || model.len().min(target.len()) < 2 * TESTED * D {
            return false;
        }
        self.targets.build(target, 2.0 * spacing);
        self.choose_seeds(model);
        let mut best: Option<(f64, Local<D>)> = None;
        for s in 0..self.seeds.len() {
            let seed = self.seeds[s];
            let Some(map) = self.best_tuple(model, target, seed, spacing, limited) else {
                continue;
            };
            let Some((grown, map)) = self.grow(model, target, seed, map, spacing) else {
                continue;
            };
            if best.as_ref().is_none_or(|(b, _)| grown > *b) {
                best = Some((grown, map));
            }
            // Half the model in one affine piece leaves no doubt.
            if grown >= 0.5 * model.len() as f64 {
                break;
            }
        }
        let Some((_, map)) = best else { return false };
        (self.linear, self.from, self.to) = (map.linear, map.from, map.to);
        true
    }

    fn choose_seeds(&mut self, model: &[[f64; D]]) {
        let centre = super::frame::mean(model);
        self.order.clear();
        let by_distance = model
            .iter()
            .enumerate()
            .map(|(i, p)| (squared(p, &centre), i));
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
            .map(|(i, p)| (squared(p, place), i));
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

    /// The local map with most hits among the neighbours of a seed, over all targets and tuples of their neighbours.
    fn best_tuple(
        &mut self,
        model: &[[f64; D]],
        target: &[[f64; D]],
        seed: usize,
        spacing: f64,
        limited: bool,
    ) -> Option<Local<D>> {
        let from = SVector::from(model[seed]);
        self.nearest(model, &model[seed], TESTED * D + 1);
        self.offsets.clear();
        let others = self.near.iter().filter(|&&(_, i)| i != seed);
        self.offsets
            .extend(others.map(|&(_, i)| SVector::from(model[i]) - from));
        let (basis, inverse) = best_basis(&self.offsets)?;
        let wanted = (HITS * self.offsets.len() as f64) as usize;
        let mut best = (wanted, f64::INFINITY, None);
        for j in 0..target.len() {
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
            for code in 0..count.pow(D as u32) {
                let mut rest = code;
                let mut images = SMatrix::<f64, D, D>::zeros();
                let mut used = [usize::MAX; D];
                let mut distinct = true;
                for axis in 0..D {
                    let choice = rest % count;
                    rest /= count;
                    distinct &= !used[..axis].contains(&choice);
                    used[axis] = choice;
                    images.set_column(axis, &self.offered[choice]);
                }
                if !distinct {
                    continue;
                }
                let linear = images * inverse;
                if !plausible(&linear, limited) {
                    continue;
                }
                let (hits, misfit) = self.hits(&linear, &to, &basis, best.0, spacing);
                if hits > best.0 || (hits == best.0 && misfit < best.1) {
                    best = (hits, misfit, Some(Local { linear, from, to }));
                }
            }
        }
        best.2
    }

    /// Neighbours that a map puts onto a target, with the sum of their squared distances; given up when `wanted` is out of reach.
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

    /// Refits the map over larger and larger neighbourhoods of the seed; the number of points it hits at the end.
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
                        // A place without any target about is out of sight, not a miss.
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
                    if hits < GROWN_HITS * inside || hits < 2.0 * D as f64 {
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

fn squared<const D: usize>(a: &[f64; D], b: &[f64; D]) -> f64 {
    (0..D).map(|k| (a[k] - b[k]).powi(2)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A number of (−1, 1), without pattern.
    fn scatter(i: usize, k: usize) -> f64 {
        2.0 * ((i * i) as f64 * 0.618_033_988_75 + (i * (k + 1)) as f64 * 0.754_877_666_25).fract()
            - 1.0
    }

    /// A jittered grid stretched by 1.7 and cropped to where it was, with one outlier in ten.
    #[test]
    fn a_stretched_and_cropped_grid_is_put_onto_its_targets() {
        let model: Vec<[f64; 2]> = (0..225)
            .map(|i| {
                let cell = [(i % 15) as f64, (i / 15) as f64];
                [0, 1].map(|k| (cell[k] - 7.0 + 0.3 * scatter(i, k)) * 0.15)
            })
            .collect();
        let moved = |p: &[f64; 2]| [1.7 * p[0], p[1] + 0.1 * p[0]];
        let mut target: Vec<[f64; 2]> = model
            .iter()
            .map(moved)
            .filter(|p| p[0].abs() < 1.1)
            .collect();
        let kept = target.len();
        target
            .extend((0..kept / 10).map(|i| [1.1 * scatter(i + 400, 0), 1.1 * scatter(i + 400, 1)]));
        let mut tuples = Tuples::default();
        assert!(tuples.find(&model, &target, 0.12, true));
        let mut base = Vec::new();
        tuples.apply(&model, &mut base);
        for (p, b) in model.iter().zip(&base) {
            let truth = moved(p);
            // Well below the spacing: the fit is to exact pairs, and a few outliers that were hit.
            assert!(
                (b[0] - truth[0]).hypot(b[1] - truth[1]) < 0.05,
                "{p:?}: {b:?}"
            );
        }
    }
}
