//! The model of the warp: a Gaussian-process prior, the regression under it, the average over its
//! scales, and rigid motions in its place.

use super::{Axes, FARTHEST, PriorScales, Regression, Request, State, Transformation, in_space};
use crate::BestMotion;
use nalgebra::{Matrix3, Point, SMatrix, SVector, SymmetricEigen, Vector3};
use tactile_core::vectorised;
use tactile_tps::{Affine, Warp};

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

/// Columns are padded with zeros to a multiple of this, so that they are whole vectors.
const LANES: usize = 8;

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
    fn set(&mut self, padded: usize, row: impl Fn(usize) -> ([f64; D], f64)) {
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

// Dense kernels on padded columns: normal equations, their Cholesky factor, combinations of the
// columns, whitened columns.
//
// All sum in the order of the plain loops: several columns or rows at a time only share the loads
// and hide the latency of the additions.

type Block = [f64; LANES];
/// A column's values for the rows that are whitened together.
pub(super) type Stripe = [Block; TOGETHER];

/// Columns or rows worked at a time: their running sums stay in registers.
const TOGETHER: usize = 4;

/// Rows of all columns worked at a time: half a megabyte, so that they stay near the processor
/// while every column meets every other. All at once, sets of 100,000 points take three times as
/// long.
const TILE: usize = 1024;

/// The lower triangle of `AᵀWA` into `gram`, row by row, and `AᵀWz` into `moments`, for `count`
/// columns of A and the `D` columns of z: `O(I count²)`. `weighted` is memory for one column.
#[inline(always)]
fn normal_equations<'a, const D: usize>(
    column: impl Fn(usize) -> &'a [f64],
    count: usize,
    weights: &[f64],
    targets: &[Vec<f64>; D],
    weighted: &mut [f64],
    gram: &mut [f64],
    moments: &mut Vec<[f64; D]>,
) {
    moments.clear();
    moments.resize(count, [0.0; D]);
    gram.fill(0.0);
    for start in (0..weights.len()).step_by(TILE) {
        let rows = start..(start + TILE).min(weights.len());
        let weighted = &mut weighted[..rows.len()];
        let column = |p: usize| &column(p)[rows.clone()];
        let mut axes: [&[f64]; D] = [&[]; D];
        for d in 0..D {
            axes[d] = &targets[d][rows.clone()];
        }
        for p in 0..count {
            for ((v, l), w) in weighted
                .iter_mut()
                .zip(column(p))
                .zip(&weights[rows.clone()])
            {
                *v = l * w;
            }
            let (groups, rest) = gram[p * count..=p * count + p].as_chunks_mut::<TOGETHER>();
            let mut q = 0;
            for group in groups {
                let columns = [column(q), column(q + 1), column(q + 2), column(q + 3)];
                add(group, dots(weighted, columns));
                q += TOGETHER;
            }
            for value in rest {
                *value += dots(weighted, [column(q)])[0];
                q += 1;
            }
            add(&mut moments[p], dots(weighted, axes));
        }
    }
}

#[inline(always)]
fn add<const N: usize>(sums: &mut [f64; N], terms: [f64; N]) {
    for n in 0..N {
        sums[n] += terms[n];
    }
}

/// Dot products of `a` with each of `b`.
#[inline(always)]
fn dots<const N: usize>(a: &[f64], b: [&[f64]; N]) -> [f64; N] {
    let a = a.as_chunks::<LANES>().0;
    let mut blocks: [&[Block]; N] = [&[]; N];
    for n in 0..N {
        blocks[n] = &b[n].as_chunks().0[..a.len()];
    }
    let mut sums = [[0.0; LANES]; N];
    for i in 0..a.len() {
        for n in 0..N {
            for l in 0..LANES {
                sums[n][l] += a[i][l] * blocks[n][i][l];
            }
        }
    }
    totals(sums)
}

/// Sums of the lanes, half and half. Not inlined: the compiler would else arrange the running sums
/// for these few additions rather than for the loop before.
#[inline(never)]
fn totals<const L: usize, const N: usize>(sums: [[f64; L]; N]) -> [f64; N] {
    let mut totals = [0.0; N];
    for n in 0..N {
        let mut values = sums[n];
        let mut half = L / 2;
        while half > 0 {
            for l in 0..half {
                values[l] += values[l + half];
            }
            half /= 2;
        }
        totals[n] = values[0];
    }
    totals
}

/// `u = Σ cₚ aₚ` for the columns `a` and one coefficient a column and axis.
#[inline(always)]
fn combine<'a, const D: usize>(
    column: impl Fn(usize) -> &'a [f64],
    coefficients: &[[f64; D]],
    u: &mut [Vec<f64>; D],
    stride: usize,
) {
    u.iter_mut().for_each(|axis| axis.resize(stride, 0.0));
    let blocks = stride / LANES;
    let mut start = 0;
    while start + 2 <= blocks {
        combine_blocks::<2, D>(&column, coefficients, u, start);
        start += 2;
    }
    if start < blocks {
        combine_blocks::<1, D>(&column, coefficients, u, start);
    }
}

#[inline(always)]
fn combine_blocks<'a, const B: usize, const D: usize>(
    column: &impl Fn(usize) -> &'a [f64],
    coefficients: &[[f64; D]],
    u: &mut [Vec<f64>; D],
    start: usize,
) {
    let mut sums = [[[0.0; LANES]; B]; D];
    for (p, c) in coefficients.iter().enumerate() {
        let blocks: &[Block] = column(p).as_chunks().0;
        let blocks = &blocks[start..start + B];
        for d in 0..D {
            for b in 0..B {
                for l in 0..LANES {
                    sums[d][b][l] += c[d] * blocks[b][l];
                }
            }
        }
    }
    for (axis, sums) in u.iter_mut().zip(&sums) {
        axis[start * LANES..(start + B) * LANES].copy_from_slice(sums.as_flattened());
    }
}

/// `A L⁻ᵀ` of the rows of one stripe into `whitened`, for the lower Cholesky factor L of `count`
/// columns: `O(count²)`. Blocks beyond the last are zero.
#[inline(always)]
fn whiten(
    columns: &[Block],
    blocks: usize,
    factor: &[f64],
    count: usize,
    whitened: &mut [Stripe],
    start: usize,
) {
    let here = (blocks - start).min(TOGETHER);
    for p in 0..count {
        let row = &factor[p * count..=p * count + p];
        let at = p * blocks + start;
        let mut current = [[0.0; LANES]; TOGETHER];
        current[..here].copy_from_slice(&columns[at..at + here]);
        for (a, done) in row[..p].iter().zip(&*whitened) {
            for b in 0..TOGETHER {
                for l in 0..LANES {
                    current[b][l] -= a * done[b][l];
                }
            }
        }
        let scale = 1.0 / row[p];
        for b in 0..TOGETHER {
            for l in 0..LANES {
                whitened[p][b][l] = current[b][l] * scale;
            }
        }
    }
}

/// Cholesky factor in place of the lower triangle. The diagonal carries σ², so that pivots stay
/// positive. Rounding is caught by a floor.
#[inline(always)]
pub(super) fn cholesky(a: &mut [f64], n: usize) {
    let mut first = 0;
    while first + TOGETHER <= n {
        eliminate::<TOGETHER>(a, n, first);
        first += TOGETHER;
    }
    while first < n {
        eliminate::<1>(a, n, first);
        first += 1;
    }
}

/// Rows `first..first + R` of the factor from the rows above.
#[inline(always)]
fn eliminate<const R: usize>(a: &mut [f64], n: usize, first: usize) {
    let (above, below) = a.split_at_mut(first * n);
    for j in 0..first {
        let row = &above[j * n..=j * n + j];
        let mut rows: [&[f64]; R] = [&[]; R];
        for r in 0..R {
            rows[r] = &below[r * n..r * n + j];
        }
        let sums = short_dots(&row[..j], rows);
        for r in 0..R {
            below[r * n + j] = (below[r * n + j] - sums[r]) / row[j];
        }
    }
    for r in 0..R {
        let (above, current) = below.split_at_mut(r * n);
        for j in first..first + r {
            let row = &above[(j - first) * n..=(j - first) * n + j];
            let [sum] = short_dots(&row[..j], [&current[..j]]);
            current[j] = (current[j] - sum) / row[j];
        }
        let i = first + r;
        let [sum] = short_dots(&current[..i], [&current[..i]]);
        current[i] = (current[i] - sum).max(f64::MIN_POSITIVE).sqrt();
    }
}

/// Dot products of `a` with each of `b`, with four running sums each. The remainder one by one.
#[inline(always)]
fn short_dots<const N: usize>(a: &[f64], b: [&[f64]; N]) -> [f64; N] {
    let whole = a.len() / 4;
    let mut rest = [0.0; N];
    for n in 0..N {
        for i in 4 * whole..a.len() {
            rest[n] += a[i] * b[n][i];
        }
    }
    let a = &a.as_chunks::<4>().0[..whole];
    let mut blocks: [&[[f64; 4]]; N] = [&[]; N];
    for n in 0..N {
        blocks[n] = &b[n].as_chunks().0[..whole];
    }
    let mut sums = [[0.0; 4]; N];
    for i in 0..whole {
        for n in 0..N {
            for l in 0..4 {
                sums[n][l] += a[i][l] * blocks[n][i][l];
            }
        }
    }
    let mut totals = totals(sums);
    for n in 0..N {
        totals[n] += rest[n];
    }
    totals
}

/// Solves `L Lᵀ x = b` in place, for the lower factor of [`cholesky`].
#[inline(always)]
fn solve<const D: usize>(factor: &[f64], n: usize, b: &mut [[f64; D]]) {
    for i in 0..n {
        let row = &factor[i * n..=i * n + i];
        let mut value = b[i];
        for j in 0..i {
            for d in 0..D {
                value[d] -= row[j] * b[j][d];
            }
        }
        for d in 0..D {
            b[i][d] = value[d] / row[i];
        }
    }
    for i in (0..n).rev() {
        let row = &factor[i * n..=i * n + i];
        for d in 0..D {
            b[i][d] /= row[i];
        }
        let done = b[i];
        for j in 0..i {
            for d in 0..D {
                b[j][d] -= row[j] * done[d];
            }
        }
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

// Rigid motions and similarities in place of a warp that bends.
//
// The soft matches pull model point `xᵢ` with weight `wᵢ` to `zᵢ`; the motion of least
// `Σ wᵢ |s R xᵢ + b − zᵢ|²` is closed-form ([`BestMotion`]). To first order in the noise σ² the image of the point at the offset `r` from the weighted centroid has the covariance
// `σ² (1/W + [r]× Θ⁻¹ [r]×ᵀ)` with `W = Σ wᵢ` and the tensor of inertia
// `Θ = Σ wᵢ (|rᵢ|² 1 − rᵢ rᵢᵀ)`, and where the size is free `σ² r rᵀ/Σ wᵢ|rᵢ|²` beside it.

/// The fit, for a model that it keeps.
#[derive(Clone, Debug, Default)]
pub(super) struct RigidFit<const D: usize> {
    transformation: Transformation,
    model: Vec<Point<f64, D>>,
    wanted: Vec<Point<f64, D>>,
}

impl<const D: usize> RigidFit<D> {
    /// Takes the model. Idle where the warp may bend.
    pub(super) fn set(&mut self, transformation: Transformation, model: &[[f64; D]]) {
        self.transformation = transformation;
        self.model.clear();
        if self.is_active() {
            self.model.extend(model.iter().map(|&p| Point::from(p)));
        }
    }

    pub(super) fn is_active(&self) -> bool {
        self.transformation != Transformation::Smooth
    }

    /// Whether lengths may change.
    pub(super) fn grows(&self) -> bool {
        self.transformation != Transformation::Rigid
    }

    /// The displacements from `base` and their variances that the motion of least squares gives,
    /// into `regression`: `O(I)`.
    pub(super) fn fit(
        &mut self,
        weights: &[f64],
        base: &[[f64; D]],
        displacements: &Axes<D>,
        noise: f64,
        regression: &mut Regression<D>,
    ) {
        self.wanted.clear();
        self.wanted.extend(
            base.iter()
                .enumerate()
                .map(|(i, b)| Point::from(SVector::from_fn(|k, _| b[k] + displacements.0[k][i]))),
        );
        let weights = &weights[..base.len()];
        if self.transformation == Transformation::Affine {
            return self.fit_affine(weights, base, noise, displacements.0[0].len(), regression);
        }
        let scaled = self.transformation == Transformation::Similarity;
        // Nothing matched, or nothing finite: the model stays where it is.
        let Some(fit) = BestMotion::of(&self.model, &self.wanted, weights, scaled) else {
            regression.set(displacements.0[0].len(), |_| ([0.0; D], 0.0));
            return;
        };
        let total: f64 = weights.iter().sum();
        let mut inertia = Matrix3::zeros();
        for (p, w) in self.model.iter().zip(weights) {
            let r = in_space(&(p.coords - fit.from));
            inertia += (Matrix3::identity() * r.norm_squared() - r * r.transpose()) * *w;
        }
        let turning = rotations_covariance::<D>(&inertia);
        let model = &self.model;
        regression.set(displacements.0[0].len(), |i| {
            let Some(p) = model.get(i) else {
                return ([0.0; D], 0.0);
            };
            let r = p.coords - fit.from;
            let image = fit.linear * r + fit.to;
            let arm = in_space(&r).cross_matrix();
            let turned = (arm * turning * arm.transpose()).trace().max(0.0);
            let grown = if scaled && fit.extent > 0.0 {
                r.norm_squared() / fit.extent
            } else {
                0.0
            };
            let variance = noise * (1.0 / total + (turned + grown) / D as f64);
            let variance = variance.min(FARTHEST); // hardly anything is matched
            (std::array::from_fn(|k| image[k] - base[i][k]), variance)
        });
    }
}

impl<const D: usize> RigidFit<D> {
    /// The affine map of least squares. An image at the offset `r` from the weighted centroid has
    /// the variance `σ² (1/W + rᵀ S⁻¹ r)` along each axis, `S = Σ wᵢ rᵢ rᵢᵀ`.
    fn fit_affine(
        &self,
        weights: &[f64],
        base: &[[f64; D]],
        noise: f64,
        padded: usize,
        regression: &mut Regression<D>,
    ) {
        let total: f64 = weights.iter().sum();
        let fit = Affine::fit(&self.model, &self.wanted, Some(weights)).ok();
        let Some(fit) = fit.filter(|_| total > 0.0) else {
            regression.set(padded, |_| ([0.0; D], 0.0));
            return;
        };
        let rows = self.model.iter().zip(weights);
        let centre: SVector<f64, D> = rows.clone().map(|(p, w)| p.coords * (w / total)).sum();
        let mut scatter = SMatrix::<f64, D, D>::zeros();
        for (p, w) in rows {
            let r = p.coords - centre;
            scatter += r * r.transpose() * *w;
        }
        let inverse = scatter.try_inverse().unwrap_or_else(SMatrix::zeros);
        regression.set(padded, |i| {
            let Some(p) = self.model.get(i) else {
                return ([0.0; D], 0.0);
            };
            let image = fit.apply(p);
            let r = p.coords - centre;
            let variance = noise * (1.0 / total + r.dot(&(inverse * r)).max(0.0));
            let displacement = std::array::from_fn(|k| image[k] - base[i][k]);
            (displacement, variance.min(FARTHEST))
        });
    }
}

/// Covariance of the rotation vector at unit noise: the inverse of the inertia, in the plane about
/// its normal alone. Zero where the points lie on one line, about which no rotation is determined.
fn rotations_covariance<const D: usize>(inertia: &Matrix3<f64>) -> Matrix3<f64> {
    if D == 2 {
        let about = inertia[(2, 2)];
        let variance = if about > 0.0 { about.recip() } else { 0.0 };
        return Matrix3::from_diagonal(&Vector3::new(0.0, 0.0, variance));
    }
    let axes = SymmetricEigen::new(*inertia);
    // Moments below this share of the largest are rounding: of points that lie on one line.
    let least = 1e-9 * axes.eigenvalues.max();
    let inverse = |moment: f64| if moment > least { moment.recip() } else { 0.0 };
    let turn = &axes.eigenvectors;
    turn * Matrix3::from_diagonal(&axes.eigenvalues.map(inverse)) * turn.transpose()
}

#[cfg(test)]
mod tests;
