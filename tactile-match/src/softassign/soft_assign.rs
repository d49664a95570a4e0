//! Soft assignment: the match matrix M from distances, made doubly stochastic with slack (Sinkhorn).
//!
//! `m_ij = aᵢ bⱼ exp(−|yᵢ − tⱼ|²/2σ²)` with `aᵢ`, `bⱼ` such that every row and every column sums to one together with its
//! slack, whose weight is the density of outliers seen through the same Gaussian. Worked in single precision: the
//! weights need no more, and the positions they lead to are refined in double precision.
//!
//! The targets are put into blocks of neighbours ([`blocks`](super::blocks)); of a row only the blocks within reach of its
//! Gaussian are kept. At a low temperature that is a small part of `I J`.

use super::blocks::{Blocks, LANES};
use super::lanes::{add_product, add_scaled, gaussians, gaussians_of, sum};
use super::moments::AllMoments;
use super::target_errors::TargetErrors;
use crate::simd::vectorised;

/// Match matrices of so many entries (16 MB) are kept as if they were dense.
const SMALL: usize = 1 << 22;

/// The match matrix in factored form, with the moments of its rows. Columns stand in the order of the blocks.
#[derive(Clone, Debug)]
pub(crate) struct SoftAssignment<const D: usize> {
    pub(super) blocks: Blocks<D>,
    /// How precise the targets are.
    pub(crate) errors: TargetErrors,
    /// Affinities so much fainter than the largest there can be are left out.
    pub(crate) faintest: f64,
    /// Where the blocks of every row begin in `active`, and one past the last.
    pub(super) starts: Vec<usize>,
    pub(super) active: Vec<u32>,
    reach: Vec<f32>,
    pub(super) kernel: Vec<f32>,
    pub(crate) row_scale: Vec<f32>,
    pub(crate) column_scale: Vec<f32>,
    column_sum: Vec<f32>,
    /// Moments of the rows.
    pub(crate) moments: AllMoments<D>,
}

/// What the affinities are: `exp(−s |yᵢ − tⱼ|²/2σ²)`, wider and lower for targets that are less precise than others.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Gaussian {
    /// The variance σ² of the most precise targets.
    pub(crate) variance: f64,
    /// The power s that they are raised to.
    pub(crate) sharpness: f64,
}

impl<const D: usize> Default for SoftAssignment<D> {
    fn default() -> Self {
        Self {
            blocks: Blocks::default(),
            errors: TargetErrors::default(),
            faintest: 1e-6,
            starts: Vec::new(),
            active: Vec::new(),
            reach: Vec::new(),
            kernel: Vec::new(),
            row_scale: Vec::new(),
            column_scale: Vec::new(),
            column_sum: Vec::new(),
            moments: AllMoments::default(),
        }
    }
}

impl<const D: usize> SoftAssignment<D> {
    /// Takes the target points and their standard deviations, where those are known.
    pub(crate) fn set_targets(&mut self, targets: &[[f64; D]], deviations: &[f64]) {
        self.blocks.build(targets);
        self.errors.set(deviations);
    }

    /// Number of target points.
    pub(crate) fn targets(&self) -> usize {
        self.blocks.order.len()
    }

    /// The Gaussian affinities of `warped`; blocks in which all are below `least`, or below [`faintest`](Self::faintest), are left out.
    pub(crate) fn affinities(&mut self, warped: &[[f64; D]], gaussian: Gaussian, least: f64) {
        let Gaussian {
            variance,
            sharpness,
        } = gaussian;
        let Self { blocks, errors, .. } = self;
        errors.prepare(&blocks.order, variance, 0.5 * D as f64 * sharpness);
        let widest = errors.widest(variance) / sharpness;
        let (scale, cut) = (
            (-0.5 / (variance / sharpness)) as f32,
            (-2.0 * widest * least.min(self.faintest).ln()) as f32,
        );
        let (precision, height) = (
            errors.precision.as_chunks::<LANES>().0,
            errors.height.as_chunks::<LANES>().0,
        );
        self.starts.clear();
        self.starts.push(0);
        self.active.clear();
        let kernel = &mut self.kernel;
        vectorised(
            #[inline(always)]
            || {
                for y in warped {
                    let y = single(y);
                    blocks.within(&y, cut, &mut self.reach, &mut self.active);
                    self.starts.push(self.active.len());
                }
                let dense = warped.len() * blocks.width();
                let sparse = self.active.len() * LANES;
                // Of small sets all the memory there can be is taken at once: no later match of sets of this size needs more.
                kernel.resize(if dense <= SMALL { dense } else { sparse }, 0.0);
                let rows = kernel.as_chunks_mut::<LANES>().0;
                for (y, range) in warped.iter().zip(self.starts.windows(2)) {
                    let y = single(y);
                    let range = range[0]..range[1];
                    for (row, &block) in rows[range.clone()].iter_mut().zip(&self.active[range]) {
                        let targets = blocks.at(block);
                        let Some(precision) = precision.get(block as usize) else {
                            gaussians(row, targets, &y, scale);
                            continue;
                        };
                        let height = &height[block as usize];
                        gaussians_of(row, targets, &y, scale, (precision, height));
                    }
                }
            },
        );
    }

    /// Number of model points.
    fn rows(&self) -> usize {
        self.starts.len() - 1
    }

    /// The blocks of row `i`, and its affinities there.
    #[inline(always)]
    fn row(&self, i: usize) -> impl Iterator<Item = (usize, &[f32; LANES])> {
        row_of(&self.starts, &self.active, &self.kernel, i)
    }

    /// Alternates row and column normalisation `sweeps` times.
    pub(crate) fn normalise(&mut self, sweeps: usize, row_slack: f32, column_slack: f32) {
        let rows = self.rows();
        refill(&mut self.row_scale, rows, 1.0);
        refill(&mut self.column_scale, self.blocks.width(), 1.0);
        let Self {
            starts,
            active,
            kernel,
            row_scale,
            column_scale,
            column_sum,
            ..
        } = self;
        vectorised(
            #[inline(always)]
            || {
                for _ in 0..sweeps {
                    refill(column_sum, column_scale.len(), column_slack);
                    let (b, sums) = (
                        column_scale.as_chunks::<LANES>().0,
                        column_sum.as_chunks_mut::<LANES>().0,
                    );
                    for (i, a) in row_scale.iter_mut().enumerate() {
                        let mut dots = [0.0_f32; LANES];
                        for (block, k) in row_of(starts, active, kernel, i) {
                            add_product(&mut dots, k, &b[block]);
                        }
                        let scale = 1.0 / (sum(dots) + row_slack);
                        *a = scale;
                        for (block, k) in row_of(starts, active, kernel, i) {
                            add_scaled(&mut sums[block], scale, k);
                        }
                    }
                    for (b, s) in column_scale.iter_mut().zip(&*column_sum) {
                        *b = 1.0 / s;
                    }
                }
            },
        );
    }

    /// Row `i` of M where it is not zero: target rows, in the order of the blocks, and entries.
    pub(crate) fn entries(&self, i: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let (scale, columns) = (self.row_scale[i], self.column_scale.as_chunks::<LANES>().0);
        self.row(i).flat_map(move |(block, k)| {
            let real = self.blocks.order[block * LANES..].iter().take(LANES);
            real.enumerate()
                .map(move |(l, &j)| (j, f64::from(scale * k[l] * columns[block][l])))
        })
    }

    /// Sums of the affinities over the rows, for every column; the first [`targets`](Self::targets) are targets.
    pub(crate) fn column_totals(&self, totals: &mut Vec<f64>) {
        refill(totals, self.blocks.width(), 0.0);
        let totals = totals.as_chunks_mut::<LANES>().0;
        vectorised(
            #[inline(always)]
            || {
                for i in 0..self.rows() {
                    for (b, k) in self.row(i) {
                        for l in 0..LANES {
                            totals[b][l] += f64::from(k[l]);
                        }
                    }
                }
            },
        );
    }

    /// Sums of the affinities over the columns, each times its factor, for every row.
    pub(crate) fn row_totals(&self, factors: &[f64], totals: &mut Vec<f64>) {
        let factors = factors.as_chunks::<LANES>().0;
        totals.clear();
        vectorised(
            #[inline(always)]
            || {
                for i in 0..self.rows() {
                    let mut sums = [0.0; LANES];
                    for (b, k) in self.row(i) {
                        for l in 0..LANES {
                            sums[l] += f64::from(k[l]) * factors[b][l];
                        }
                    }
                    totals.push(sums.iter().sum());
                }
            },
        );
    }
}

#[inline(always)]
pub(super) fn row_of<'a>(
    starts: &[usize],
    active: &'a [u32],
    kernel: &'a [f32],
    i: usize,
) -> impl Iterator<Item = (usize, &'a [f32; LANES])> + use<'a> {
    let range = starts[i]..starts[i + 1];
    let rows = kernel.as_chunks::<LANES>().0;
    active[range.clone()]
        .iter()
        .map(|&b| b as usize)
        .zip(&rows[range])
}

/// In single precision.
#[inline(always)]
pub(super) fn single<const D: usize>(y: &[f64; D]) -> [f32; D] {
    let mut single = [0.0; D];
    for d in 0..D {
        single[d] = y[d] as f32;
    }
    single
}

fn refill<V: Clone>(values: &mut Vec<V>, len: usize, value: V) {
    values.clear();
    values.resize(len, value);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene() -> (Vec<[f64; 2]>, SoftAssignment<2>) {
        let targets: Vec<[f64; 2]> = (0..41)
            .map(|i| [f64::from(i) * 0.1, f64::from(i * i % 7) * 0.2])
            .collect();
        let mut soft = SoftAssignment::default();
        soft.set_targets(&targets, &[]);
        (
            targets
                .iter()
                .take(37)
                .map(|t| [t[0] + 0.02, t[1] - 0.01])
                .collect(),
            soft,
        )
    }

    fn plain(variance: f64) -> Gaussian {
        Gaussian {
            variance,
            sharpness: 1.0,
        }
    }

    #[test]
    fn rows_and_columns_sum_to_one_with_their_slack() {
        let (warped, mut soft) = scene();
        soft.affinities(&warped, plain(0.02), 1e-9);
        soft.normalise(300, 0.05, 0.05);
        soft.sum_moments(&warped);
        let mut columns = vec![0.0; 41];
        for i in 0..37 {
            let slack = f64::from(soft.row_scale[i]) * 0.05;
            let sum: f64 = soft.entries(i).map(|(_, p)| p).sum();
            // Single precision sums of 41 terms, at the fixed point of the sweeps.
            assert!(
                (sum + slack - 1.0).abs() < 1e-5
                    && (sum - soft.moments.plain().weight[i]).abs() < 1e-5
            );
            soft.entries(i).for_each(|(j, p)| columns[j] += p);
        }
        for (c, &j) in soft.blocks.order.iter().enumerate() {
            assert!((columns[j] + f64::from(soft.column_scale[c]) * 0.05 - 1.0).abs() < 1e-5);
        }
    }

    #[test]
    fn what_is_out_of_reach_makes_no_difference() {
        let (warped, mut soft) = scene();
        let (mut near, mut sparse) = (vec![vec![0.0_f64; 41]; 37], 0);
        for least in [1e-30, 1e-7] {
            soft.affinities(&warped, plain(0.01), least);
            soft.normalise(5, 0.01, 0.01);
            soft.sum_moments(&warped);
            sparse = sparse.max(37 * 3 - soft.active.len());
            for i in 0..37 {
                for (j, p) in soft.entries(i) {
                    // Forty affinities of 1e-7 each, over a slack of 1e-2.
                    assert!(least == 1e-30 || (p - near[i][j]).abs() < 4e-4);
                    near[i][j] = p;
                }
            }
        }
        assert!(sparse > 20, "blocks were left out: {sparse}");
    }
}
