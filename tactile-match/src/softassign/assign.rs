//! Soft assignment: affinities, Sinkhorn normalisation and the moments of the rows, over blocks of
//! neighbouring targets.

use super::blocks::{Blocks, LANES};
use tactile_core::vectorised;

/// Parameters of the affinities `exp(−s |yᵢ − tⱼ|²/2σ²)`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gaussian {
    /// The variance σ².
    pub variance: f64,
    /// The exponent s.
    pub sharpness: f64,
}

/// Moments of the rows of M.
#[derive(Clone, Debug, Default)]
pub(super) struct RowMoments<const D: usize> {
    /// Row sums without the slack.
    pub weight: Vec<f64>,
    /// Mean of `tⱼ − yᵢ` under row i.
    pub shift: Vec<[f64; D]>,
    /// Sum of `m_ij |tⱼ − yᵢ|²` over row i.
    pub spread: Vec<f64>,
}

/// The match matrix in factored form, with the moments of its rows. The columns are in the order of
/// the blocks.
#[derive(Clone, Debug, Default)]
pub(super) struct SoftAssignment<const D: usize> {
    pub blocks: Blocks<D>,
    /// Affinities below this fraction of the largest possible one are dropped.
    pub faintest: f64,
    /// Start of the blocks of each row in `active`, and the end of the last.
    pub starts: Vec<usize>,
    pub active: Vec<u32>,
    pub reach: Vec<f32>,
    pub kernel: Vec<f32>,
    pub row_scale: Vec<f32>,
    pub column_scale: Vec<f32>,
    pub column_sum: Vec<f32>,
    /// Moments of the rows.
    pub moments: RowMoments<D>,
}

// Soft assignment: the match matrix M from distances, made doubly stochastic with slack (Sinkhorn).
//
// `m_ij = aᵢ bⱼ exp(−|yᵢ − tⱼ|²/2σ²)`, with `aᵢ` and `bⱼ` such that each row and each column sums
// to one together with its slack. The weight of the slack is the density of outliers under the same
// Gaussian. Single precision suffices for the weights; the resulting positions are refined in
// double precision.
//
// The targets are grouped into blocks of neighbours ([`blocks`](super::blocks)); a row keeps only
// the blocks within reach of its Gaussian. At a low temperature they are a small part of `I J`.

impl<const D: usize> SoftAssignment<D> {
    /// Stores the target points.
    pub(super) fn set_targets(&mut self, targets: &[[f64; D]]) {
        self.blocks.build(targets);
    }

    /// Number of target points.
    pub(super) fn targets(&self) -> usize {
        self.blocks.order.len()
    }

    /// Computes the Gaussian affinities of `warped`. Blocks in which all are below `least` or below
    /// [`faintest`](Self::faintest) are dropped.
    pub(super) fn affinities(&mut self, warped: &[[f64; D]], gaussian: Gaussian, least: f64) {
        let Gaussian {
            variance,
            sharpness,
        } = gaussian;
        let blocks = &self.blocks;
        let (scale, cut) = (
            (-0.5 / (variance / sharpness)) as f32,
            (-2.0 * variance / sharpness * least.min(self.faintest).ln()) as f32,
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
                // For small sets the largest possible memory is allocated at once, so that no later
                // match of sets of this size allocates. Matrices up to this number of entries (16
                // MB) are stored as if they were dense.
                kernel.resize(if dense <= (1 << 22) { dense } else { sparse }, 0.0);
                let rows = kernel.as_chunks_mut::<LANES>().0;
                for (y, range) in warped.iter().zip(self.starts.windows(2)) {
                    let y = single(y);
                    let range = range[0]..range[1];
                    for (row, &block) in rows[range.clone()].iter_mut().zip(&self.active[range]) {
                        gaussians(row, blocks.at(block), &y, scale);
                    }
                }
            },
        );
    }

    /// Number of model points.
    fn rows(&self) -> usize {
        self.starts.len() - 1
    }

    /// The blocks of row `i` with their affinities.
    #[inline(always)]
    fn row(&self, i: usize) -> impl Iterator<Item = (usize, &[f32; LANES])> {
        row_of(&self.starts, &self.active, &self.kernel, i)
    }

    /// Alternates row and column normalisation `sweeps` times.
    pub(super) fn normalise(&mut self, sweeps: usize, row_slack: f32, column_slack: f32) {
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

    /// The non-zero entries of row `i` of M: target rows, in the order of the blocks, and values.
    pub(super) fn entries(&self, i: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let (scale, columns) = (self.row_scale[i], self.column_scale.as_chunks::<LANES>().0);
        self.row(i).flat_map(move |(block, k)| {
            let real = self.blocks.order[block * LANES..].iter().take(LANES);
            real.enumerate()
                .map(move |(l, &j)| (j, f64::from(scale * k[l] * columns[block][l])))
        })
    }

    /// Sums of the affinities over the rows, for each column. The first [`targets`](Self::targets)
    /// columns are targets.
    pub(super) fn column_totals(&self, totals: &mut Vec<f64>) {
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

    /// Sums over the columns of each affinity times its column's factor, for each row.
    pub(super) fn row_totals(&self, factors: &[f64], totals: &mut Vec<f64>) {
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
fn row_of<'a>(
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

/// Converts to single precision.
#[inline(always)]
fn single<const D: usize>(y: &[f64; D]) -> [f32; D] {
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

// Moments of the rows of a match matrix in factored form.

impl<const D: usize> SoftAssignment<D> {
    /// Computes the moments of M about `warped`: the matched weight of each point and the mean
    /// position of its soft partners.
    pub(super) fn sum_moments(&mut self, warped: &[[f64; D]]) {
        let mut moments = std::mem::take(&mut self.moments);
        let RowMoments {
            weight,
            shift,
            spread,
        } = &mut moments;
        weight.clear();
        shift.clear();
        spread.clear();
        let columns = self.column_scale.as_chunks::<LANES>().0;
        vectorised(
            #[inline(always)]
            || {
                for ((i, y), &a) in warped.iter().enumerate().zip(&self.row_scale) {
                    let y = single(y);
                    let mut sums = Moments::new();
                    for (block, k) in row_of(&self.starts, &self.active, &self.kernel, i) {
                        sums.add(k, &columns[block], self.blocks.at(block as u32), &y);
                    }
                    let total = f64::from(sum(sums.weight));
                    let mut mean = [0.0; D];
                    for d in 0..D {
                        if total > 0.0 {
                            mean[d] = f64::from(sum(sums.shift[d])) / total;
                        }
                    }
                    weight.push(total * f64::from(a));
                    shift.push(mean);
                    spread.push(f64::from(sum(sums.spread)) * f64::from(a));
                }
            },
        );
        self.moments = moments;
    }

    /// Scales rows whose sum the last column normalisation left above one. If points coincide, a
    /// few sweeps do not converge.
    pub(super) fn cap_rows(&mut self) {
        let weights = self.moments.weight.iter_mut();
        for (scale, weight) in self.row_scale.iter_mut().zip(weights) {
            let excess = weight.max(1.0);
            *scale /= excess as f32;
            *weight /= excess;
        }
    }
}

// The inner loops of the soft assignment over one block of targets: Gaussians and moments, lane by
// lane in single precision.
//
// They are plain loops over arrays of equal length. Closures and iterators would be functions of
// their own, which the compiler does not give the wider registers of their
// [caller](crate::vectorised).

/// One value per target of a block.
type Lanes = [f32; LANES];

/// `exp(scale · |t − y|²)` for a block of targets `t`.
#[inline(always)]
fn gaussians<const D: usize>(row: &mut Lanes, targets: [&Lanes; D], y: &[f32; D], scale: f32) {
    *row = squared_distances(targets, y);
    for value in row {
        *value = exp(*value * scale);
    }
}

#[inline(always)]
fn squared_distances<const D: usize>(targets: [&Lanes; D], y: &[f32; D]) -> Lanes {
    let mut squares = [0.0; LANES];
    for d in 0..D {
        for l in 0..LANES {
            let apart = targets[d][l] - y[d];
            squares[l] += apart * apart;
        }
    }
    squares
}

/// `sums += a · b`.
#[inline(always)]
fn add_product(sums: &mut Lanes, a: &Lanes, b: &Lanes) {
    for l in 0..LANES {
        sums[l] += a[l] * b[l];
    }
}

/// `sums += factor · values`.
#[inline(always)]
fn add_scaled(sums: &mut Lanes, factor: f32, values: &Lanes) {
    let mut sum = *sums; // a copy cannot overlap with the values
    for l in 0..LANES {
        sum[l] += factor * values[l];
    }
    *sums = sum;
}

/// Sum of all lanes by halves. It is not inlined: otherwise the compiler arranges the running sums
/// for these few additions rather than for the loop before.
#[inline(never)]
fn sum(mut values: Lanes) -> f32 {
    let mut half = LANES / 2;
    while half > 0 {
        for l in 0..half {
            values[l] += values[l + half];
        }
        half /= 2;
    }
    values[0]
}

/// Running sums of a row, by lane.
struct Moments<const D: usize> {
    weight: Lanes,
    shift: [Lanes; D],
    spread: Lanes,
}

impl<const D: usize> Moments<D> {
    #[inline(always)]
    fn new() -> Self {
        Self {
            weight: [0.0; LANES],
            shift: [[0.0; LANES]; D],
            spread: [0.0; LANES],
        }
    }

    #[inline(always)]
    fn add(&mut self, k: &Lanes, b: &Lanes, targets: [&Lanes; D], y: &[f32; D]) {
        let mut m = [0.0_f32; LANES];
        for l in 0..LANES {
            m[l] = k[l] * b[l];
            self.weight[l] += m[l];
        }
        for d in 0..D {
            for l in 0..LANES {
                let e = targets[d][l] - y[d];
                self.shift[d][l] += m[l] * e;
                self.spread[l] += m[l] * e * e;
            }
        }
    }
}

/// eˣ for x ≤ 0, to two units in the last place of single precision. Zero below −87.
#[inline(always)]
fn exp(x: f32) -> f32 {
    const MAGIC: f32 = 12_582_912.0; // 1.5 · 2²³: adding it rounds to the nearest integer
    let x = x.max(-88.0);
    let n = (x * std::f32::consts::LOG2_E + MAGIC) - MAGIC;
    let f = (x - n * 0.693_359_4) - n * -2.121_944_4e-4;
    let p = 1.0
        + f * (1.0
            + f * (0.5
                + f * (0.166_666_57 + f * (0.041_665_795 + f * (8.334_52e-3 + f * 1.388_89e-3)))));
    let power =
        f32::from_bits((((n + MAGIC).to_bits() << 23) as i32).wrapping_add(0x3f80_0000) as u32);
    if x > -87.0 { p * power } else { 0.0 }
}

#[cfg(test)]
mod tests;
