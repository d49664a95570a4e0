//! The point nearest to a place within a fixed gate, for many places: one look-up instead of one for every cell that the gate touches.

use super::cells::{Grid, NONE, squared_distance};

/// Chains of points by the hash of every cell, two gates wide, that a point's gate touches: at most two cells an axis, so that any place finds
/// all points within the gate in the chain of its own cell. Cells that share a hash share a chain: distances tell them apart.
#[derive(Clone, Debug, Default)]
pub(crate) struct GatedNearest<const D: usize> {
    points: Vec<[f64; D]>,
    grid: Grid,
    gate: f64,
    heads: Vec<u32>,
    /// Row, and the entry that follows it in the chain.
    entries: Vec<(u32, u32)>,
}

impl<const D: usize> GatedNearest<D> {
    /// Takes points and a gate, which is positive and finite. `O(2ᴰ I)` time and memory.
    pub(crate) fn build(&mut self, points: &[[f64; D]], gate: f64) {
        self.points.clear();
        self.points.extend_from_slice(points);
        self.gate = gate;
        self.grid = Grid::new(2.0 * gate);
        self.heads.clear();
        self.heads
            .resize((points.len() << D).next_power_of_two(), NONE);
        self.entries.clear();
        let (heads, entries) = (&mut self.heads, &mut self.entries);
        for (i, point) in points.iter().enumerate() {
            self.grid.for_each_cell(point, gate, |cell| {
                let chain = Grid::chain(cell, heads.len());
                entries.push((i as u32, heads[chain]));
                heads[chain] = (entries.len() - 1) as u32;
            });
        }
    }

    /// The point nearest to `place`, if one is within the gate.
    pub(crate) fn find(&self, place: &[f64; D]) -> Option<usize> {
        let cell = place.map(|c| self.grid.cell(c));
        let mut entry = self.heads[Grid::chain(&cell, self.heads.len())];
        let mut best = (self.gate * self.gate, None);
        while entry != NONE {
            let (row, next) = self.entries[entry as usize];
            let square = squared_distance(&self.points[row as usize], place);
            if square <= best.0 {
                best = (square, Some(row as usize));
            }
            entry = next;
        }
        best.1
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Against every point looked at, negative coordinates and crowded cells included.
        #[test]
        fn the_nearest_within_the_gate_is_found(
            points in prop::collection::vec(prop::array::uniform3(-3.0..3.0_f64), 1..60),
            place in prop::array::uniform3(-3.0..3.0_f64),
            gate in 0.01..2.0_f64,
        ) {
            let mut gated = GatedNearest::default();
            gated.build(&points, gate);
            let squares = points.iter().map(|p| squared_distance(p, &place));
            let expected = squares.filter(|&s| s <= gate * gate).min_by(f64::total_cmp);
            let found = gated.find(&place).map(|i| squared_distance(&points[i], &place));
            prop_assert_eq!(found, expected);
        }
    }

    /// A place whose gate ends on a cell's face, where rounding could leave out the cell beyond.
    #[test]
    fn places_at_the_gate_itself_are_found() {
        for gate in [0.1, 0.25, 1.0 / 3.0] {
            for k in -20..20 {
                let point = [f64::from(k) * gate, 0.0];
                let mut gated = GatedNearest::default();
                gated.build(&[point], gate);
                // Within a rounding error of the gate.
                let place = [point[0] + gate * (1.0 - 1e-12), 0.0];
                assert_eq!(gated.find(&place), Some(0), "gate {gate}, point {point:?}");
            }
        }
    }
}
