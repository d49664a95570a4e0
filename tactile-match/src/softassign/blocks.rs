//! Target points in blocks of neighbours. A point that is far from the box of a block is far from
//! all its points.

/// Points per block: one or two vectors of single precision.
pub(super) const LANES: usize = 16;

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
    pub(super) fn width(&self) -> usize {
        self.order.len().next_multiple_of(LANES)
    }

    /// The coordinates of block `block`.
    #[inline(always)]
    pub(super) fn at(&self, block: u32) -> [&[f32; LANES]; D] {
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
    pub(super) fn within(
        &self,
        y: &[f32; D],
        cut: f32,
        squared: &mut Vec<f32>,
        found: &mut Vec<u32>,
    ) {
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

#[cfg(test)]
mod tests;
