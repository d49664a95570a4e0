//! The model of the warp: a Gaussian-process prior, the regression under it, and the average over
//! its scales.

use super::kernels::{LANES, Stripe, TOGETHER, cholesky, combine, normal_equations, solve, whiten};
use super::{Axes, PriorScales, Regression, Request, State};
use tactile_core::vectorised;

// The prior on warps: a Gaussian process, kept as a low-rank factor.
//
// A displacement field is a priori an affine field plus a smooth one,
// `cov(u(x), u(x')) = τ² exp(−|x − x'|²/2ℓ²) + τₐ² (1 + x·x')` for each axis. Smooth kernels have
// few modes: the pivoted Cholesky factor `K ≈ L Lᵀ` reaches the wanted accuracy with 20 to 40
// columns whatever the number of points, so that a weighted fit costs `O(I r²)`.

/// Largest number of columns kept.
const MAX_RANK: usize = 64;

/// Variance that the factor leaves out of sets of up to [`DENSE`] points, relative to the largest:
/// a thousandth of a radius.
const LEFT_OUT: f64 = 1e-6;
/// Denser sets resolve less than that: a sixtieth of their spacing.
const DENSE: f64 = 1700.0;

/// The factor `L` of the prior covariance at the model points, column by column.
#[derive(Clone, Debug, Default)]
pub(super) struct Prior {
    /// Length of a column: the number of points, padded.
    pub(super) stride: usize,
    columns: Vec<f64>,
    /// Largest variance left out before every column.
    left: Vec<f64>,
    pivots: Vec<usize>,
    diagonal: Vec<f64>,
    /// What it was built for: the same again costs nothing.
    points: Vec<f64>,
    scales: PriorScales,
}

impl Prior {
    /// Factors the covariance at `points` (in the frame's units): `O(I r²)`.
    pub(super) fn build<const D: usize>(&mut self, points: &[[f64; D]], scales: PriorScales) {
        let n = points.len();
        if self.scales == scales && self.points == points.as_flattened() {
            return;
        }
        self.scales = scales;
        self.points.clear();
        self.points.extend_from_slice(points.as_flattened());
        let gaussian = -0.5 / scales.length.powi(2);
        let (bending, affine) = (scales.bending.powi(2), scales.affine.powi(2));
        let covariance = |a: &[f64; D], b: &[f64; D]| {
            let (mut square, mut dot) = (0.0, 1.0);
            for k in 0..D {
                square += (a[k] - b[k]).powi(2);
                dot += a[k] * b[k];
            }
            bending * (gaussian * square).exp() + affine * dot
        };
        self.diagonal.clear();
        self.diagonal
            .extend(points.iter().map(|p| covariance(p, p)));
        self.columns.clear();
        self.stride = n.next_multiple_of(LANES);
        self.columns.reserve(MAX_RANK.min(n) * self.stride);
        self.pivots.clear();
        self.left.clear();
        // Variance left out, relative to the largest: less as the points are denser.
        let denser = (DENSE / n as f64).powf(2.0 / D as f64).min(1.0);
        let floor = LEFT_OUT * denser * self.diagonal.iter().fold(0.0_f64, |m, &d| m.max(d));
        while self.pivots.len() < MAX_RANK.min(n) {
            let pivot = largest(&self.diagonal);
            if self.diagonal[pivot] <= floor {
                break;
            }
            self.left.push(self.diagonal[pivot]);
            self.append_column(points, pivot, &covariance);
        }
    }

    fn append_column<const D: usize>(
        &mut self,
        points: &[[f64; D]],
        pivot: usize,
        covariance: &impl Fn(&[f64; D], &[f64; D]) -> f64,
    ) {
        let root = self.diagonal[pivot].sqrt();
        let start = self.columns.len();
        self.columns
            .extend(points.iter().map(|p| covariance(p, &points[pivot])));
        self.columns.resize(start + self.stride, 0.0);
        let (earlier, new) = self.columns.split_at_mut(start);
        let diagonal = &mut self.diagonal;
        let stride = self.stride;
        vectorised(
            #[inline(always)]
            || {
                for column in earlier.chunks_exact(stride) {
                    let f = column[pivot];
                    for (v, c) in new.iter_mut().zip(column) {
                        *v -= f * c;
                    }
                }
                for (value, left) in new.iter_mut().zip(diagonal.iter_mut()) {
                    *value /= root;
                    *left = (*left - *value * *value).max(0.0);
                }
            },
        );
        self.diagonal[pivot] = 0.0;
        self.pivots.push(pivot);
    }

    /// Columns that matter beside noise of variance `noise`.
    fn rank_beside(&self, noise: f64) -> usize {
        // Variance left out that the noise hides, relative to the noise's.
        self.left.partition_point(|&left| left > 0.01 * noise)
    }

    /// Column `p` of the factor.
    fn column(&self, p: usize) -> &[f64] {
        &self.columns[p * self.stride..(p + 1) * self.stride]
    }
}

/// Index of the first largest value.
fn largest(values: &[f64]) -> usize {
    (1..values.len()).fold(0, |best, i| if values[i] > values[best] { i } else { best })
}

// Coordinates kept as one padded array an axis.

impl<const D: usize> Axes<D> {
    /// Takes `rows`, padded to `stride`.
    pub(super) fn fill(&mut self, stride: usize, rows: impl Iterator<Item = [f64; D]>) {
        self.0.iter_mut().for_each(Vec::clear);
        for row in rows {
            self.0
                .iter_mut()
                .zip(row)
                .for_each(|(axis, value)| axis.push(value));
        }
        self.0.iter_mut().for_each(|axis| axis.resize(stride, 0.0));
    }
}

// The warp that the soft matches ask for: weighted regression under the prior.
//
// With targets `zᵢ`, weights `wᵢ` and noise variance σ², the displacement is `u = L c`,
// `(Lᵀ W L + σ² 1) c = Lᵀ W z`; its variance at point i is `vᵢ = σ² Lᵢ (Lᵀ W L + σ² 1)⁻¹ Lᵢᵀ`. What
// the other points say about point i follows without another fit: with the leverage
// `hᵢ = wᵢ vᵢ/σ²`, the prediction that leaves i out is `(uᵢ − hᵢ zᵢ)/(1 − hᵢ)`.

impl<const D: usize> Regression<D> {
    /// Fits `targets` (displacements, one array an axis) with `weights`, both padded with zeros, at
    /// noise variance `noise`, in the modes that are not lost in it: `O(I r² + r³)`.
    pub(super) fn fit(&mut self, prior: &Prior, weights: &[f64], targets: &Axes<D>, noise: f64) {
        let r = prior.rank_beside(noise);
        (self.rank, self.noise) = (r, noise);
        self.gram.resize(r * r, 0.0);
        self.weighted.resize(prior.stride, 0.0);
        let column = |p: usize| prior.column(p);
        vectorised(
            #[inline(always)]
            || {
                normal_equations(
                    column,
                    r,
                    weights,
                    &targets.0,
                    &mut self.weighted,
                    &mut self.gram,
                    &mut self.solution,
                );
                for p in 0..r {
                    self.gram[p * r + p] += noise;
                }
                cholesky(&mut self.gram, r);
                solve(&self.gram, r, &mut self.solution);
                combine(
                    column,
                    &self.solution,
                    &mut self.displacement.0,
                    prior.stride,
                );
            },
        );
        self.log_det = (0..r)
            .map(|p| 2.0 * self.gram[p * r + p].ln() - noise.ln())
            .sum();
    }

    /// Sets displacement and variance of every padded row. No penalty, no determinant.
    pub(super) fn set(&mut self, padded: usize, row: impl Fn(usize) -> ([f64; D], f64)) {
        self.solution.clear();
        self.whitened.clear();
        self.log_det = 0.0;
        self.variance.clear();
        self.displacement.0.iter_mut().for_each(Vec::clear);
        for i in 0..padded {
            let (displacement, variance) = row(i);
            self.variance.push(variance);
            for (axis, value) in self.displacement.0.iter_mut().zip(displacement) {
                axis.push(value);
            }
        }
    }

    /// Computes the variances of the last fit: `O(I r²)`. Keeps what
    /// [`covariance`](Self::covariance) needs if `with_covariances`.
    pub(super) fn variances(&mut self, prior: &Prior, with_covariances: bool) {
        let (r, stride, noise) = (self.rank, prior.stride, self.noise);
        let blocks = stride / LANES;
        let stripes = blocks.div_ceil(TOGETHER);
        let kept = if with_covariances { stripes } else { 1 };
        self.variance.clear();
        self.variance.resize(stride, 0.0);
        self.whitened.resize(kept * r, Stripe::default());
        let Self {
            gram,
            whitened,
            variance,
            ..
        } = self;
        let columns = &prior.columns.as_chunks::<LANES>().0[..r * blocks];
        vectorised(
            #[inline(always)]
            || {
                for (s, sums) in variance.chunks_mut(TOGETHER * LANES).enumerate() {
                    let place = if with_covariances { s * r } else { 0 };
                    let stripe = &mut whitened[place..place + r];
                    whiten(columns, blocks, gram, r, stripe, s * TOGETHER);
                    for column in stripe {
                        for (v, sum) in column.as_flattened().iter().zip(&mut *sums) {
                            *sum += v * v * noise;
                        }
                    }
                }
            },
        );
    }

    /// Covariance of the displacements of two points, along one axis, after
    /// [`variances`](Self::variances) with covariances: `O(r)`. None of rigid fits.
    pub(super) fn covariance(&self, a: usize, b: usize) -> f64 {
        let rows = |i: usize| {
            let first = i / (TOGETHER * LANES) * self.rank;
            let stripe = self.whitened.iter().skip(first).take(self.rank);
            stripe.map(move |column| column.as_flattened()[i % (TOGETHER * LANES)])
        };
        self.noise * rows(a).zip(rows(b)).map(|(a, b)| a * b).sum::<f64>()
    }

    /// `Σ |c|²`, twice the prior's energy of the warp.
    pub(super) fn penalty(&self) -> f64 {
        self.solution.iter().flatten().map(|c| c * c).sum()
    }
}

// The scales of the prior, averaged over by their evidence.
//
// With the soft matches fixed (weights `wᵢ`, targets `zᵢ`, noise σ²) the model is linear,
// `z = A c + noise`, with `A = [τ Lₛ, τₐ X]`: the factor of the unit Gaussian kernel of length ℓ,
// and the affine functions. For one ℓ the factor and the Gram matrix `G = [Lₛ X]ᵀ W [Lₛ X]` are
// computed once; every amplitude τ then costs one Cholesky factorisation of `D G D + σ² 1`, `D` the
// diagonal of amplitudes. Its evidence is
//
// `−ln p = (Σ wᵢ|zᵢ|² − cᵀ D b)/2σ² + (d/2) ln det(1 + D G D/σ²)`, `b = [Lₛ X]ᵀ W z`.

/// Lengths ℓ over which the warp may bend, in radii of the model, and amplitudes τ at the first of
/// them: a factor √2 and 2 apart, about what the evidence of a hundred points tells apart.
const LENGTHS: [f64; 4] = [1.2, 1.7, 2.4, 3.4];
pub(super) const AMPLITUDES: [f64; 5] = [0.35, 0.2, 0.1, 0.05, 0.025];

/// Memory of the average.
#[derive(Clone, Debug, Default)]
pub(super) struct ScaleAverage<const D: usize> {
    /// The smooth part of every length.
    smooth: [Prior; LENGTHS.len()],
    /// The energy of every scale in the last average.
    energies: Vec<f64>,
    /// The affine functions 1, x, y, …, column by column.
    affine: Vec<f64>,
    gram: Vec<f64>,
    factor: Vec<f64>,
    moments: Vec<[f64; D]>,
    solution: Vec<[f64; D]>,
    weighted: Vec<f64>,
    displacement: Axes<D>,
    /// Sums over all scales by their evidence, relative to the least energy: of the displacements,
    /// of their squares, of the weights.
    mean: Axes<D>,
    square: Vec<f64>,
    total: f64,
    least: f64,
    /// Variance of the displacements between the scales, along one axis.
    pub(super) spread: Vec<f64>,
}

impl<const D: usize> ScaleAverage<D> {
    /// Replaces `state.warped` by the mean over all scales of the warps that the soft matches ask
    /// for, each weighted by its evidence. Returns the scales of most evidence. `O(I r²)` for every
    /// length. Where `likely`, only scales that had some evidence in the last average.
    pub(super) fn average(
        &mut self,
        request: Request<'_, D>,
        model: &[[f64; D]],
        state: &mut State<D>,
        variance: f64,
        affine: f64,
        likely: bool,
    ) -> PriorScales {
        if !likely {
            self.energies.clear();
            self.energies.resize(LENGTHS.len() * AMPLITUDES.len(), 0.0);
        }
        // Scales whose evidence is so many units of the logarithm below the best do not count:
        // together less than a hundredth.
        let limit = self.energies.iter().copied().fold(f64::INFINITY, f64::min) + 8.0;
        let mut best = PriorScales::default();
        self.clear(model.len());
        for (l, length) in LENGTHS.into_iter().enumerate() {
            let scales = l * AMPLITUDES.len();
            let of_length = &self.energies[scales..scales + AMPLITUDES.len()];
            if of_length.iter().all(|&energy| energy > limit) {
                continue;
            }
            self.prepare(request, model, l, variance);
            for (a, amplitude) in AMPLITUDES.into_iter().enumerate() {
                if self.energies[scales + a] > limit {
                    continue;
                }
                let bending = amplitude * length / LENGTHS[0];
                let energy = self.fit(request, bending, affine, variance);
                self.energies[scales + a] = energy;
                if energy < self.least {
                    best = PriorScales {
                        length,
                        bending,
                        affine,
                    };
                }
                let weight = self.weigh(energy);
                // Below this the mean does not change by a thousandth of the noise.
                if weight > 1e-4 {
                    self.add(l, bending, affine, weight);
                }
            }
        }
        self.place(state);
        best
    }

    /// Forgets all sums.
    pub(super) fn clear(&mut self, points: usize) {
        (self.total, self.least) = (0.0, f64::INFINITY);
        for axis in self.mean.0.iter_mut().chain([&mut self.square]) {
            axis.clear();
            axis.resize(points, 0.0);
        }
    }

    /// The weight of a scale by its energy. What was summed so far is made relative to the least.
    fn weigh(&mut self, energy: f64) -> f64 {
        if energy < self.least {
            let fade = if self.least.is_finite() {
                (energy - self.least).exp()
            } else {
                0.0
            };
            self.total *= fade;
            for axis in self.mean.0.iter_mut().chain([&mut self.square]) {
                axis.iter_mut().for_each(|v| *v *= fade);
            }
            self.least = energy;
        }
        let weight = (self.least - energy).exp();
        self.total += weight;
        weight
    }

    /// Adds the positions of a state to the sums, by its energy.
    pub(super) fn add_state(&mut self, state: &State<D>) {
        let weight = self.weigh(state.energy);
        for (i, (warped, base)) in state.warped.iter().zip(&state.base).enumerate() {
            for k in 0..D {
                let moved = warped[k] - base[k];
                self.mean.0[k][i] += weight * moved;
                self.square[i] += weight * moved * moved;
            }
        }
    }

    /// Puts the points at the mean of what was summed, and sets `spread`.
    pub(super) fn place(&mut self, state: &mut State<D>) {
        self.spread.clear();
        for (i, warped) in state.warped.iter_mut().enumerate() {
            let mut square = self.square[i] / self.total;
            for k in 0..D {
                let mean = self.mean.0[k][i] / self.total;
                warped[k] = state.base[i][k] + mean;
                square -= mean * mean;
            }
            self.spread.push((square / D as f64).max(0.0));
        }
    }

    /// Factor and Gram matrix of one length.
    fn prepare(&mut self, request: Request<'_, D>, model: &[[f64; D]], l: usize, noise: f64) {
        let length = LENGTHS[l];
        let unit = PriorScales {
            length,
            bending: 1.0,
            affine: 0.0,
        };
        self.smooth[l].build(model, unit);
        let stride = self.smooth[l].stride;
        self.affine.clear();
        self.affine
            .extend((0..stride).map(|i| f64::from(i < model.len())));
        for k in 0..D {
            self.affine.extend(model.iter().map(|p| p[k]));
            self.affine.resize((k + 2) * stride, 0.0);
        }
        // Modes that the noise hides at the largest amplitude are hidden at all.
        let largest = AMPLITUDES[0] * length / LENGTHS[0];
        let count = self.smooth[l].rank_beside(noise / (largest * largest)) + D + 1;
        self.gram.resize(count * count, 0.0);
        self.weighted.resize(stride, 0.0);
        let Self {
            smooth: priors,
            affine,
            gram,
            moments,
            weighted,
            ..
        } = self;
        let column = |p: usize| column_of(&priors[l], affine, count - D - 1, p);
        vectorised(
            #[inline(always)]
            || {
                normal_equations(
                    column,
                    count,
                    request.weights,
                    &request.displacements.0,
                    weighted,
                    gram,
                    moments,
                );
            },
        );
    }

    /// The energy of one amplitude. Leaves the coefficients in `solution`.
    fn fit(&mut self, request: Request<'_, D>, bending: f64, affine: f64, noise: f64) -> f64 {
        let count = self.moments.len();
        let smooth = count - D - 1;
        let amplitude = |p: usize| if p < smooth { bending } else { affine };
        self.factor.clone_from(&self.gram);
        for p in 0..count {
            for q in 0..=p {
                self.factor[p * count + q] *= amplitude(p) * amplitude(q);
            }
            self.factor[p * count + p] += noise;
        }
        self.solution.clear();
        let scaled = self.moments.iter().enumerate();
        self.solution
            .extend(scaled.map(|(p, m)| m.map(|v| v * amplitude(p))));
        let Self {
            factor, solution, ..
        } = self;
        vectorised(
            #[inline(always)]
            || {
                cholesky(factor, count);
                solve(factor, count, solution);
            },
        );
        let explained: f64 = (0..count)
            .map(|p| {
                (0..D)
                    .map(|k| solution[p][k] * self.moments[p][k])
                    .sum::<f64>()
                    * amplitude(p)
            })
            .sum();
        let log_det: f64 = (0..count)
            .map(|p| 2.0 * factor[p * count + p].ln() - noise.ln())
            .sum();
        let squares: f64 = request
            .displacements
            .0
            .iter()
            .map(|z| {
                z.iter()
                    .zip(request.weights)
                    .map(|(z, w)| w * z * z)
                    .sum::<f64>()
            })
            .sum();
        0.5 * ((squares - explained) / noise + D as f64 * log_det)
    }

    /// Adds the displacements of the present coefficients to the mean.
    fn add(&mut self, l: usize, bending: f64, affine: f64, weight: f64) {
        let stride = self.smooth[l].stride;
        let smooth = self.moments.len() - D - 1;
        let Self {
            smooth: priors,
            affine: functions,
            solution,
            displacement,
            mean,
            square,
            ..
        } = self;
        let column = |p: usize| column_of(&priors[l], functions, smooth, p);
        for (p, c) in solution.iter_mut().enumerate() {
            let amplitude = if p < smooth { bending } else { affine };
            *c = c.map(|c| c * amplitude);
        }
        vectorised(
            #[inline(always)]
            || {
                combine(column, solution, &mut displacement.0, stride);
                for (sum, axis) in mean.0.iter_mut().zip(&displacement.0) {
                    for ((sum, square), u) in sum.iter_mut().zip(square.iter_mut()).zip(axis) {
                        *sum += weight * u;
                        *square += weight * u * u;
                    }
                }
            },
        );
    }
}

/// Column `p` of `[Lₛ X]`, `smooth` of which are the prior's.
fn column_of<'a>(prior: &'a Prior, affine: &'a [f64], smooth: usize, p: usize) -> &'a [f64] {
    if p < smooth {
        prior.column(p)
    } else {
        &affine[(p - smooth) * prior.stride..][..prior.stride]
    }
}

#[cfg(test)]
mod tests;
