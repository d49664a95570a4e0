//! Soft assignment: affinities, Sinkhorn normalisation and the moments of the rows, over blocks of
//! neighbouring targets.

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

// Target points in blocks of neighbours. A point that is far from the box of a block is far from
// all its points.

/// Points per block: one or two vectors of single precision.
const LANES: usize = 16;

/// Number of boxes per box of the next level. In large sets whole groups are skipped at once.
const GROUP: usize = 32;
/// Up to this number of boxes, a linear scan is faster than a further level.
const MOST_BOXES: usize = 256;

/// Points in the order of their blocks, one array per axis, with the boxes of the blocks.
#[derive(Clone, Debug, Default)]
pub(super) struct Blocks<const D: usize> {
    /// Index of the point at each position.
    pub order: Vec<usize>,
    axes: Vec<f32>,
    /// The boxes of the blocks, then at each further level the boxes of [`GROUP`] boxes below.
    levels: Vec<Boxes>,
    /// The highest level in use.
    top: usize,
}

/// Boxes given by their sides, one array per axis.
#[derive(Clone, Debug, Default)]
struct Boxes {
    low: Vec<f32>,
    high: Vec<f32>,
}

impl<const D: usize> Blocks<D> {
    /// Sorts `points` into blocks by repeated halving across the longest side. `O(J log² J)`.
    pub(super) fn build(&mut self, points: &[[f64; D]]) {
        self.order.clear();
        self.order.extend(0..points.len());
        split(points, &mut self.order);
        let width = points.len().next_multiple_of(LANES);
        let (order, axes) = (&self.order, &mut self.axes);
        axes.clear();
        self.levels.iter_mut().for_each(Boxes::clear);
        if self.levels.is_empty() {
            self.levels.push(Boxes::default());
        }
        for k in 0..D {
            axes.extend(order.iter().map(|&j| points[j][k] as f32));
            let real = &axes[k * width..];
            self.levels[0].extend(real, real, LANES);
            // Position of the padding: no Gaussian reaches it, and its square is finite.
            axes.resize((k + 1) * width, 1e15);
        }
        self.top = 0;
        while self.levels[self.top].low.len() > MOST_BOXES * D {
            if self.levels.len() == self.top + 1 {
                self.levels.push(Boxes::default());
            }
            let (below, above) = self.levels.split_at_mut(self.top + 1);
            let below = &below[self.top];
            let count = below.low.len() / D;
            for sides in (0..D).map(|k| k * count..(k + 1) * count) {
                above[0].extend(&below.low[sides.clone()], &below.high[sides], GROUP);
            }
            self.top += 1;
        }
    }

    /// Number of positions, padding included.
    fn width(&self) -> usize {
        self.order.len().next_multiple_of(LANES)
    }

    /// The coordinates of block `block`.
    #[inline(always)]
    fn at(&self, block: u32) -> [&[f32; LANES]; D] {
        let axes = self.axes.as_chunks::<LANES>().0;
        let count = axes.len() / D;
        let mut at = [&[0.0; LANES]; D];
        for k in 0..D {
            at[k] = &axes[k * count + block as usize];
        }
        at
    }

    /// Appends the blocks whose boxes lie within the squared distance `cut` of `y`, in ascending
    /// order. `squared` is working memory.
    ///
    /// `O(J/16)` for small sets; for large ones `O(log J)` plus the number of blocks in reach.
    #[inline(always)]
    fn within(&self, y: &[f32; D], cut: f32, squared: &mut Vec<f32>, found: &mut Vec<u32>) {
        let top = self.top;
        let Boxes { low, high } = &self.levels[top];
        box_distances(y, (low, high), low.len() / D, squared);
        for (place, &square) in squared.iter().enumerate() {
            if square <= cut {
                self.descend(top, place, y, cut, found);
            }
        }
    }

    /// Appends the blocks within reach of a box of a level.
    fn descend(&self, level: usize, place: usize, y: &[f32; D], cut: f32, found: &mut Vec<u32>) {
        let Some(below) = level.checked_sub(1) else {
            found.push(place as u32);
            return;
        };
        let Boxes { low, high } = &self.levels[below];
        let count = low.len() / D;
        for inner in place * GROUP..((place + 1) * GROUP).min(count) {
            let outside = |k: usize| {
                let side = k * count + inner;
                (low[side] - y[k]).max(y[k] - high[side]).max(0.0)
            };
            let square: f32 = (0..D).map(|k| outside(k) * outside(k)).sum();
            if square <= cut {
                self.descend(below, inner, y, cut, found);
            }
        }
    }
}

impl Boxes {
    fn clear(&mut self) {
        self.low.clear();
        self.high.clear();
    }

    /// Appends the boxes of `members` consecutive boxes each, given by their sides along one axis.
    fn extend(&mut self, low: &[f32], high: &[f32], members: usize) {
        let least = |sides: &[f32]| sides.iter().copied().fold(f32::MAX, f32::min);
        let largest = |sides: &[f32]| sides.iter().copied().fold(f32::MIN, f32::max);
        self.low.extend(low.chunks(members).map(least));
        self.high.extend(high.chunks(members).map(largest));
    }
}

/// Squared distances of `y` from boxes given by their sides, one array per axis.
#[inline(always)]
fn box_distances<const D: usize>(
    y: &[f32; D],
    (low, high): (&[f32], &[f32]),
    count: usize,
    squared: &mut Vec<f32>,
) {
    squared.clear();
    squared.resize(count, 0.0);
    for (k, &c) in y.iter().enumerate() {
        let sides = low[k * count..].iter().zip(&high[k * count..]);
        for (s, (low, high)) in squared.iter_mut().zip(sides) {
            let outside = (low - c).max(c - high).max(0.0);
            *s += outside * outside;
        }
    }
}

/// Orders `rows` so that blocks of [`LANES`] consecutive rows are compact.
fn split<const D: usize>(points: &[[f64; D]], rows: &mut [usize]) {
    if rows.len() <= LANES {
        return;
    }
    let side = |k: usize| {
        let (low, high) = rows
            .iter()
            .map(|&j| points[j][k])
            .fold((f64::MAX, f64::MIN), |(l, h), c| (l.min(c), h.max(c)));
        high - low
    };
    let axis = (1..D).fold(0, |best, k| if side(k) > side(best) { k } else { best });
    let half = (rows.len() / 2).next_multiple_of(LANES).min(rows.len() - 1);
    rows.select_nth_unstable_by(half, |&a, &b| {
        points[a][axis].total_cmp(&points[b][axis]).then(a.cmp(&b))
    });
    let (left, right) = rows.split_at_mut(half);
    split(points, left);
    split(points, right);
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
