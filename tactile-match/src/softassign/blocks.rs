//! Target points in blocks of neighbours: what is far from a block's box is far from all its points.

/// Points a block: one or two vectors of single precision.
pub(crate) const LANES: usize = 16;

/// Blocks a group: in large sets whole groups are passed over at once.
const GROUP: usize = 32;
/// Fewer groups are not worth their own test.
const FEW_GROUPS: usize = 4;

/// Where the padding lies: no Gaussian reaches it, and its square is finite.
const FAR: f32 = 1e15;

/// Points in the order of their blocks, one array an axis, with the blocks' boxes.
#[derive(Clone, Debug, Default)]
pub(crate) struct Blocks<const D: usize> {
    /// Which point stands at every place.
    pub(crate) order: Vec<usize>,
    axes: Vec<f32>,
    low: Vec<f32>,
    high: Vec<f32>,
    groups: Groups,
}

/// Boxes of [`GROUP`] consecutive blocks, one array an axis.
#[derive(Clone, Debug, Default)]
struct Groups {
    low: Vec<f32>,
    high: Vec<f32>,
}

impl<const D: usize> Blocks<D> {
    /// Sorts `points` into blocks: halves across the longest side, until one block is left; `O(J log² J)`.
    pub(crate) fn build(&mut self, points: &[[f64; D]]) {
        self.order.clear();
        self.order.extend(0..points.len());
        split(points, &mut self.order);
        let width = points.len().next_multiple_of(LANES);
        let (order, axes) = (&self.order, &mut self.axes);
        axes.clear();
        self.low.clear();
        self.high.clear();
        for k in 0..D {
            axes.extend(order.iter().map(|&j| points[j][k] as f32));
            let real = axes[k * width..].chunks(LANES);
            self.low.extend(
                real.clone()
                    .map(|block| block.iter().copied().fold(f32::MAX, f32::min)),
            );
            self.high
                .extend(real.map(|block| block.iter().copied().fold(f32::MIN, f32::max)));
            axes.resize((k + 1) * width, FAR);
        }
        let count = self.low.len() / D;
        self.groups.low.clear();
        self.groups.high.clear();
        for k in 0..D {
            let sides = k * count..(k + 1) * count;
            let low = self.low[sides.clone()].chunks(GROUP);
            let high = self.high[sides].chunks(GROUP);
            let least = |group: &[f32]| group.iter().copied().fold(f32::MAX, f32::min);
            let largest = |group: &[f32]| group.iter().copied().fold(f32::MIN, f32::max);
            self.groups.low.extend(low.map(least));
            self.groups.high.extend(high.map(largest));
        }
    }

    /// Number of places, padding included.
    pub(crate) fn width(&self) -> usize {
        self.order.len().next_multiple_of(LANES)
    }

    /// The coordinates of block `block`.
    #[inline(always)]
    pub(crate) fn at(&self, block: u32) -> [&[f32; LANES]; D] {
        let axes = self.axes.as_chunks::<LANES>().0;
        let count = axes.len() / D;
        let mut at = [&[0.0; LANES]; D];
        for k in 0..D {
            at[k] = &axes[k * count + block as usize];
        }
        at
    }

    /// Appends the blocks whose boxes lie within the squared distance `cut` of `y`, in ascending order; `squared` is scratch.
    ///
    /// `O(J/16)` for small sets; in large ones `O(J/512)` and the blocks of the groups in reach.
    #[inline(always)]
    pub(crate) fn within(
        &self,
        y: &[f32; D],
        cut: f32,
        squared: &mut Vec<f32>,
        found: &mut Vec<u32>,
    ) {
        let count = self.low.len() / D;
        let groups = self.groups.low.len() / D;
        if groups <= FEW_GROUPS {
            squared_distances(y, (&self.low, &self.high), count, squared);
            for (block, &square) in squared.iter().enumerate() {
                if square <= cut {
                    found.push(block as u32);
                }
            }
            return;
        }
        let boxes = (&*self.groups.low, &*self.groups.high);
        squared_distances(y, boxes, groups, squared);
        for group in 0..groups {
            if squared[group] > cut {
                continue;
            }
            for block in group * GROUP..((group + 1) * GROUP).min(count) {
                let outside = |k: usize| {
                    let side = k * count + block;
                    (self.low[side] - y[k]).max(y[k] - self.high[side]).max(0.0)
                };
                let square: f32 = (0..D).map(|k| outside(k) * outside(k)).sum();
                if square <= cut {
                    found.push(block as u32);
                }
            }
        }
    }
}

/// Squared distances of `y` from boxes given by their sides, one array an axis.
#[inline(always)]
fn squared_distances<const D: usize>(
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

/// Orders `rows` so that blocks of [`LANES`] consecutive ones lie close together.
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
mod tests {
    use super::*;

    #[test]
    fn blocks_hold_every_point_once_and_keep_their_distance() {
        let points: Vec<[f64; 2]> = (0..101)
            .map(|i| [f64::from(i * 37 % 101), f64::from(i * 53 % 89)])
            .collect();
        let mut blocks = Blocks::default();
        blocks.build(&points);
        let mut sorted = blocks.order.clone();
        sorted.sort_unstable();
        assert_eq!(sorted, (0..101).collect::<Vec<_>>());
        let mut squared = Vec::new();
        squared_distances(&[20.0, 30.0], (&blocks.low, &blocks.high), 7, &mut squared);
        for (place, &j) in blocks.order.iter().enumerate() {
            let distance = (points[j][0] - 20.0).powi(2) + (points[j][1] - 30.0).powi(2);
            // Whole numbers below 2¹⁴ are exact in single precision.
            assert!(f64::from(squared[place / LANES]) <= distance, "{place}");
        }
    }

    /// In a set of many groups the blocks found are those found one by one.
    #[test]
    fn groups_leave_out_no_block_in_reach() {
        let points: Vec<[f64; 2]> = (0..4003)
            .map(|i| [f64::from(i * 37 % 4001), f64::from(i * 53 % 3989)])
            .collect();
        let mut blocks = Blocks::default();
        blocks.build(&points);
        let count = blocks.low.len() / 2;
        let (mut scratch, mut found) = (Vec::new(), Vec::new());
        for cut in [0.0, 300.0, 90_000.0] {
            for y in [[700.0, 900.0], [-100.0, 4000.0]] {
                found.clear();
                blocks.within(&y, cut, &mut scratch, &mut found);
                squared_distances(&y, (&blocks.low, &blocks.high), count, &mut scratch);
                let near = (0..).zip(&scratch).filter(|&(_, &s)| s <= cut);
                assert_eq!(found, near.map(|(block, _)| block).collect::<Vec<u32>>());
            }
        }
    }
}
