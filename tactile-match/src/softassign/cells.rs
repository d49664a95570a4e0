//! Points in hashed square cells, so that a search by distance examines only nearby points.

use super::squared_distance;

/// Beyond this number of cells from the origin all cells are one: such coordinates are as good as
/// infinite.
const MAX_CELLS: f64 = 1e9;
/// Stands for "no point".
const NONE: u32 = u32::MAX;

/// Square cells that fill space.
#[derive(Clone, Copy, Debug, Default)]
struct Grid {
    /// Reciprocal side of a cell.
    per_side: f64,
}

impl Grid {
    /// Cells of this side, which is positive and finite.
    fn new(side: f64) -> Self {
        Self {
            per_side: side.recip(),
        }
    }

    /// Index of a coordinate's cell along its axis.
    #[inline]
    fn cell(self, coordinate: f64) -> i64 {
        let place = (coordinate * self.per_side).clamp(-MAX_CELLS, MAX_CELLS);
        // Rounds down by hand: `floor` is a function call if the code is not compiled for newer
        // instructions.
        let towards_zero = place as i64;
        towards_zero - i64::from(towards_zero as f64 > place)
    }

    /// Calls `visit` with each cell that intersects a box of half width `radius` about `place`.
    #[inline]
    fn for_each_cell<const D: usize>(
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

    /// Index of the chain of a cell. `chains` is a power of two.
    #[inline]
    fn chain<const D: usize>(cell: &[i64; D], chains: usize) -> usize {
        let mixed = cell.iter().fold(0_u64, |hash, &c| {
            (hash ^ c as u64)
                .wrapping_mul(0x9e37_79b9_7f4a_7c15)
                .rotate_left(29)
        });
        (mixed ^ (mixed >> 32)) as usize & (chains - 1)
    }
}

/// Chains of points by the hash of their cell. Cells with the same hash share a chain, and
/// distances separate their points.
#[derive(Clone, Debug, Default)]
pub(super) struct Cells<const D: usize> {
    points: Vec<[f64; D]>,
    grid: Grid,
    heads: Vec<u32>,
    next: Vec<u32>,
}

impl<const D: usize> Cells<D> {
    /// Stores points in cells of this side, which is positive and finite. `O(I)`.
    pub(super) fn build(&mut self, points: &[[f64; D]], side: f64) {
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

    /// Calls `visit` with row and squared distance of each point within `radius` of `place`, in
    /// unspecified order. A point is visited twice if two of the cells share a chain.
    pub(super) fn within(&self, place: &[f64; D], radius: f64, mut visit: impl FnMut(usize, f64)) {
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
    pub(super) fn nearest(&self, place: &[f64; D], radius: f64) -> Option<usize> {
        let mut best = (f64::INFINITY, None);
        self.within(place, radius, |row, square| {
            if square < best.0 {
                best = (square, Some(row));
            }
        });
        best.1
    }
}

/// The points of both sets, to be found by their place.
#[derive(Clone, Debug, Default)]
pub(super) struct LookUp<const D: usize> {
    pub model: Cells<D>,
    pub targets: Cells<D>,
}

#[cfg(test)]
mod tests;
