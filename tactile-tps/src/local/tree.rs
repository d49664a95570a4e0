//! A k-d tree: blocks of neighbours, and nearest-neighbour search.

use nalgebra::Point;

/// Rows of points in the order of the tree, with the cuts of its inner nodes.
#[derive(Clone, Debug, Default)]
pub(super) struct Tree<const D: usize> {
    order: Vec<usize>,
    /// Maximum number of points in a leaf.
    leaf: usize,
    /// Axis and coordinate of each cut, as a heap. A range is cut at its middle.
    cuts: Vec<(usize, f64)>,
}

impl<const D: usize> Tree<D> {
    /// Builds the tree of some rows of `points`, with at most `leaf` points per leaf.
    pub(super) fn new(points: &[Point<f64, D>], mut order: Vec<usize>, leaf: usize) -> Self {
        let mut cuts = Vec::new();
        split(points, &mut order, leaf, 0, &mut cuts);
        Self { order, leaf, cuts }
    }

    /// The rows, with neighbours next to each other.
    pub(super) fn rows(&self) -> &[usize] {
        &self.order
    }

    pub(super) fn len(&self) -> usize {
        self.order.len()
    }

    /// The leaves, with neighbours next to each other.
    pub(super) fn leaves(&self) -> Vec<&[usize]> {
        let mut leaves = Vec::new();
        let mut open = vec![&self.order[..]];
        while let Some(rows) = open.pop() {
            if rows.len() <= self.leaf {
                leaves.push(rows);
            } else {
                let (low, high) = rows.split_at(rows.len() / 2);
                // The lower half is popped from the stack first, so that leaves follow the order of
                // the tree.
                open.extend([high, low]);
            }
        }
        leaves
    }

    /// Squared distances and rows of the `count` points nearest to a position, nearest first.
    pub(super) fn nearest(
        &self,
        points: &[Point<f64, D>],
        place: &Point<f64, D>,
        count: usize,
    ) -> Vec<(f64, usize)> {
        let mut found = Vec::with_capacity(3 * count + self.leaf);
        let mut limit = f64::INFINITY;
        self.collect(
            points,
            place,
            count,
            (0, 0..self.order.len()),
            &mut found,
            &mut limit,
        );
        found.sort_unstable_by(by_distance);
        found.truncate(count);
        found
    }

    fn collect(
        &self,
        points: &[Point<f64, D>],
        place: &Point<f64, D>,
        count: usize,
        (node, range): (usize, std::ops::Range<usize>),
        found: &mut Vec<(f64, usize)>,
        limit: &mut f64,
    ) {
        if range.len() <= self.leaf {
            let rows = self.order[range].iter();
            let distances = rows.map(|&i| ((points[i] - place).norm_squared(), i));
            found.extend(distances.filter(|near| near.0 <= *limit));
            // Pruned occasionally: O(1) per examined point on average.
            if found.len() > 2 * count {
                found.select_nth_unstable_by(count, by_distance);
                found.truncate(count);
                *limit = found.iter().map(|near| near.0).fold(0.0, f64::max);
            }
            return;
        }
        let (axis, cut) = self.cuts[node];
        let middle = range.start + range.len() / 2;
        let low = (2 * node + 1, range.start..middle);
        let high = (2 * node + 2, middle..range.end);
        let beyond = place[axis] - cut;
        // The half that contains the position comes first, because it narrows the limit for the
        // other.
        let (first, second) = if beyond < 0.0 {
            (low, high)
        } else {
            (high, low)
        };
        self.collect(points, place, count, first, found, limit);
        if beyond * beyond <= *limit {
            self.collect(points, place, count, second, found, limit);
        }
    }
}

/// Orders rows by halving, and records the cuts.
fn split<const D: usize>(
    points: &[Point<f64, D>],
    rows: &mut [usize],
    leaf: usize,
    node: usize,
    cuts: &mut Vec<(usize, f64)>,
) {
    if rows.len() <= leaf {
        return;
    }
    let extent = |axis: usize| {
        let range = |(low, high): (f64, f64), &i: &usize| {
            let x: f64 = points[i][axis];
            (low.min(x), high.max(x))
        };
        let (low, high) = rows.iter().fold((f64::MAX, f64::MIN), range);
        high - low
    };
    // Cutting across the longest axis keeps blocks compact and ends searches early.
    let axis = (1..D).fold(0, |best, a| if extent(a) > extent(best) { a } else { best });
    let middle = rows.len() / 2;
    let by_place =
        |&a: &usize, &b: &usize| points[a][axis].total_cmp(&points[b][axis]).then(a.cmp(&b));
    let (_, &mut cut, _) = rows.select_nth_unstable_by(middle, by_place);
    if cuts.len() <= node {
        cuts.resize(node + 1, (0, 0.0));
    }
    cuts[node] = (axis, points[cut][axis]);
    let (low, high) = rows.split_at_mut(middle);
    split(points, low, leaf, 2 * node + 1, cuts);
    split(points, high, leaf, 2 * node + 2, cuts);
}

fn by_distance(a: &(f64, usize), b: &(f64, usize)) -> std::cmp::Ordering {
    a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))
}
