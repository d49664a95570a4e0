//! Points in hashed square cells: what lies near a place is found without looking at the rest.

/// Beyond this many cells from the origin all cells are one: coordinates there are as good as infinite.
const FARTHEST: f64 = 1e9;
/// No point.
pub(super) const NONE: u32 = u32::MAX;

/// Square cells that fill space.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Grid {
    /// Reciprocal side of a cell.
    per_side: f64,
}

impl Grid {
    /// Cells of this side, which is positive and finite.
    pub(super) fn new(side: f64) -> Self {
        Self {
            per_side: side.recip(),
        }
    }

    /// Index of the cell of a coordinate, along its axis.
    #[inline]
    pub(super) fn cell(self, coordinate: f64) -> i64 {
        let place = (coordinate * self.per_side).clamp(-FARTHEST, FARTHEST);
        // Rounding down by hand: `floor` is a call where the processor's newer instructions are not compiled for.
        let towards_zero = place as i64;
        towards_zero - i64::from(towards_zero as f64 > place)
    }

    /// Calls `visit` with every cell that a box of half width `radius` about `place` touches.
    #[inline]
    pub(super) fn for_each_cell<const D: usize>(
        self,
        place: &[f64; D],
        radius: f64,
        mut visit: impl FnMut(&[i64; D]),
    ) {
        let low = place.map(|c| self.cell(c - radius));
        let high = place.map(|c| self.cell(c + radius));
        let mut cell = low;
        loop {
            visit(&cell);
            let Some(axis) = (0..D).find(|&k| cell[k] < high[k]) else {
                return;
            };
            cell[axis] += 1;
            cell[..axis].copy_from_slice(&low[..axis]);
        }
    }

    /// The chain of a cell, of so many, which are a power of two.
    #[inline]
    pub(super) fn chain<const D: usize>(cell: &[i64; D], chains: usize) -> usize {
        let mixed = cell.iter().fold(0_u64, |hash, &c| {
            (hash ^ c as u64)
                .wrapping_mul(0x9e37_79b9_7f4a_7c15)
                .rotate_left(29)
        });
        (mixed ^ (mixed >> 32)) as usize & (chains - 1)
    }
}

/// Chains of points by the hash of their cell. Cells that share a hash share a chain: distances tell them apart.
#[derive(Clone, Debug, Default)]
pub(crate) struct Cells<const D: usize> {
    points: Vec<[f64; D]>,
    grid: Grid,
    heads: Vec<u32>,
    next: Vec<u32>,
}

impl<const D: usize> Cells<D> {
    /// Takes points into cells of this side, which is positive and finite. `O(I)`.
    pub(crate) fn build(&mut self, points: &[[f64; D]], side: f64) {
        self.points.clear();
        self.points.extend_from_slice(points);
        self.grid = Grid::new(side);
        self.heads.clear();
        self.heads
            .resize((2 * points.len()).next_power_of_two(), NONE);
        self.next.clear();
        for (i, p) in points.iter().enumerate() {
            let cell = p.map(|c| self.grid.cell(c));
            let head = Grid::chain(&cell, self.heads.len());
            self.next.push(self.heads[head]);
            self.heads[head] = i as u32;
        }
    }

    /// Calls `visit` with row and squared distance of every point within `radius` of `place`, in no useful order; twice with
    /// the same where two of the cells share a chain.
    pub(crate) fn within(&self, place: &[f64; D], radius: f64, mut visit: impl FnMut(usize, f64)) {
        self.grid.for_each_cell(place, radius, |cell| {
            let mut row = self.heads[Grid::chain(cell, self.heads.len())];
            while row != NONE {
                let square = squared_distance(&self.points[row as usize], place);
                if square <= radius * radius {
                    visit(row as usize, square);
                }
                row = self.next[row as usize];
            }
        });
    }

    /// The point nearest to `place`, if one is within `radius`.
    pub(crate) fn nearest(&self, place: &[f64; D], radius: f64) -> Option<usize> {
        let mut best = (f64::INFINITY, None);
        self.within(place, radius, |row, square| {
            if square < best.0 {
                best = (square, Some(row));
            }
        });
        best.1
    }
}

pub(super) fn squared_distance<const D: usize>(a: &[f64; D], b: &[f64; D]) -> f64 {
    (0..D).map(|k| (a[k] - b[k]).powi(2)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Against every point looked at, negative coordinates and crowded cells included.
        #[test]
        fn what_is_near_is_found(
            points in prop::collection::vec(prop::array::uniform3(-3.0..3.0_f64), 1..60),
            place in prop::array::uniform3(-3.0..3.0_f64),
            radius in 0.01..2.0_f64,
            side in 0.05..5.0_f64,
        ) {
            let mut cells = Cells::default();
            cells.build(&points, side);
            let mut found = Vec::new();
            cells.within(&place, radius, |row, _| found.push(row));
            found.sort_unstable();
            found.dedup();
            let near = |&i: &usize| squared_distance(&points[i], &place) <= radius * radius;
            let expected: Vec<usize> = (0..points.len()).filter(near).collect();
            prop_assert_eq!(&found, &expected);
            let least = expected.iter().map(|&i| squared_distance(&points[i], &place)).fold(f64::INFINITY, f64::min);
            let nearest = cells.nearest(&place, radius);
            prop_assert_eq!(nearest.map(|i| squared_distance(&points[i], &place)), expected.first().map(|_| least));
        }
    }
}
