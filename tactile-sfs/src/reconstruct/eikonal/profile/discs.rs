//! Which pixels have a disc around them wholly inside a mask, and which one that meets it.

use ndarray::ArrayView2;

use super::RING_PX;
use crate::BoundingBox;

/// Pixels that a disc reaches beyond its middle.
const REACH: usize = RING_PX as usize;

/// The pixels of a mask's box with a border around it, row by row; beyond the frame nothing is inside.
#[derive(Debug, Default)]
pub(super) struct Discs {
    padded: Vec<bool>,
    width: usize,
    result: Vec<bool>,
}

impl Discs {
    /// Takes the mask's pixels in a box, outside of which the mask has none.
    pub(super) fn load(&mut self, mask: ArrayView2<'_, bool>, area: BoundingBox) {
        self.width = area.columns + 2 * REACH;
        self.padded.clear();
        self.padded
            .resize(self.width * (area.rows + 2 * REACH), false);
        let rows = self.padded.chunks_exact_mut(self.width).skip(REACH);
        for (row, padded) in (area.top..area.top + area.rows).zip(rows) {
            let places = &mut padded[REACH..REACH + area.columns];
            for (column, inside) in (area.left..).zip(places) {
                *inside = mask[[row, column]];
            }
        }
    }

    /// The pixels of a row of the box whose disc lies wholly in the mask.
    pub(super) fn inside(&mut self, row: usize) -> &[bool] {
        self.combine(row, true, |all, pixel| all & pixel)
    }

    /// The pixels of a row of the box whose disc meets the mask.
    pub(super) fn reached(&mut self, row: usize) -> &[bool] {
        self.combine(row, false, |any, pixel| any | pixel)
    }

    /// Combines the pixels of every disc of a row, one place in the disc after the other.
    fn combine(&mut self, row: usize, start: bool, with: impl Fn(bool, bool) -> bool) -> &[bool] {
        let columns = self.width - 2 * REACH;
        self.result.clear();
        self.result.resize(columns, start);
        for (down, line) in (self.padded[row * self.width..].chunks_exact(self.width))
            .take(2 * REACH + 1)
            .enumerate()
        {
            let half = half_width(down.abs_diff(REACH));
            for right in REACH - half..=REACH + half {
                for (result, pixel) in self.result.iter_mut().zip(&line[right..]) {
                    *result = with(*result, *pixel);
                }
            }
        }
        &self.result
    }
}

/// How far the disc reaches to both sides, so many rows from its middle.
fn half_width(down: usize) -> usize {
    let beside = |right: &usize| ((down * down + right * right) as f64) <= RING_PX * RING_PX;
    (1..=REACH).take_while(beside).count()
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array2;

    #[test]
    fn discs_are_those_found_pixel_by_pixel() {
        // A ragged blob that meets two sides of the frame.
        let mask = Array2::from_shape_fn((17, 23), |(r, c)| {
            (r as f64 - 6.0).hypot(c as f64 - 13.0) < 9.4 && (7 * r + 5 * c) % 31 > 0
        });
        let area = BoundingBox {
            top: 0,
            left: 2,
            rows: 17,
            columns: 21,
        };
        let mut discs = Discs::default();
        discs.load(mask.view(), area);
        let disc = |[row, column]: [usize; 2]| {
            let near = |r: isize, c: isize| {
                let place = [row.wrapping_add_signed(r), column.wrapping_add_signed(c)];
                ((r * r + c * c) as f64 <= RING_PX * RING_PX)
                    .then(|| mask.get(place).copied().unwrap_or(false))
            };
            (-4..=4_isize)
                .flat_map(|r| (-4..=4_isize).filter_map(move |c| near(r, c)))
                .collect::<Vec<_>>()
        };
        for row in 0..area.rows {
            for column in 0..area.columns {
                let pixels = disc([row, column + area.left]);
                let all = pixels.iter().all(|inside| *inside);
                let any = pixels.iter().any(|inside| *inside);
                assert_eq!(discs.inside(row)[column], all, "{row} {column}");
                assert_eq!(discs.reached(row)[column], any, "{row} {column}");
            }
        }
    }
}
