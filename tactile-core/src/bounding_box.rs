//! A rectangle of pixels.

#[cfg(feature = "ndarray")]
use ndarray::{ArrayView1, ArrayView2, ArrayViewMut2, Axis, Slice};

/// A rectangle of pixels, half open: rows `row_start..row_end` and columns
/// `column_start..column_end`.
///
/// ```
/// use tactile_core::BoundingBox;
///
/// let contact = BoundingBox { row_start: 2, row_end: 5, column_start: 0, column_end: 4 };
/// // A margin of one pixel, clipped to a frame of 5 × 20 pixels.
/// let wider = contact.grown(1, (5, 20));
/// assert_eq!((wider.rows(), wider.columns()), (4, 5));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct BoundingBox {
    /// First row.
    pub row_start: usize,
    /// One past the last row.
    pub row_end: usize,
    /// First column.
    pub column_start: usize,
    /// One past the last column.
    pub column_end: usize,
}

/// Whether a pixel is inside. A fold without an early exit is computed with SIMD instructions.
#[cfg(feature = "ndarray")]
fn any_inside(line: ArrayView1<'_, bool>) -> bool {
    match line.to_slice() {
        Some(line) => line.iter().fold(false, |any, &inside| any | inside),
        None => line.iter().any(|&inside| inside),
    }
}

impl BoundingBox {
    /// The box of a whole image of the given shape, (rows, columns).
    ///
    /// ```
    /// use tactile_core::BoundingBox;
    /// assert_eq!(BoundingBox::whole((5, 20)).columns(), 20);
    /// ```
    #[must_use]
    pub const fn whole((rows, columns): (usize, usize)) -> Self {
        Self {
            row_start: 0,
            row_end: rows,
            column_start: 0,
            column_end: columns,
        }
    }

    /// The smallest box that contains the true pixels of a mask. `None` if there are none.
    ///
    /// ```
    /// use tactile_core::BoundingBox;
    /// let mask = ndarray::array![[false, false, true], [false, true, false]];
    /// let bounds = BoundingBox::of_mask(mask.view()).expect("two pixels");
    /// assert_eq!((bounds.rows(), bounds.column_start, bounds.columns()), (2, 1, 2));
    /// ```
    #[must_use]
    #[cfg(feature = "ndarray")]
    pub fn of_mask(mask: ArrayView2<'_, bool>) -> Option<Self> {
        let mut bounds: Option<Self> = None;
        for (row, line) in mask.outer_iter().enumerate() {
            // Columns beyond the bounds so far are all that a row can add.
            let (left, right) = bounds.map_or((line.len(), 0), |b| (b.column_start, b.column_end));
            if !any_inside(line) {
                continue;
            }
            let before = line.slice_axis(Axis(0), Slice::from(..left));
            let after = line.slice_axis(Axis(0), Slice::from(right..));
            let mut columns = left..right;
            if any_inside(before) {
                columns.start = before.iter().position(|&inside| inside).unwrap_or(left);
            }
            if any_inside(after) {
                let last = after.iter().rposition(|&inside| inside);
                columns.end = last.map_or(right, |last| right + last + 1);
            }
            bounds = Some(Self {
                row_start: bounds.map_or(row, |bounds| bounds.row_start),
                row_end: row + 1,
                column_start: columns.start,
                column_end: columns.end,
            });
        }
        bounds
    }

    /// Number of rows.
    #[must_use]
    pub const fn rows(&self) -> usize {
        self.row_end - self.row_start
    }

    /// Number of columns.
    #[must_use]
    pub const fn columns(&self) -> usize {
        self.column_end - self.column_start
    }

    /// Number of pixels.
    #[must_use]
    pub const fn area(&self) -> usize {
        self.rows() * self.columns()
    }

    /// Row and column of each pixel of the box, in reading order.
    ///
    /// ```
    /// use tactile_core::BoundingBox;
    /// let bounds = BoundingBox { row_start: 2, row_end: 4, column_start: 7, column_end: 9 };
    /// assert!(bounds.pixels().eq([(2, 7), (2, 8), (3, 7), (3, 8)]));
    /// ```
    pub fn pixels(self) -> impl Iterator<Item = (usize, usize)> {
        let columns = self.column_start..self.column_end;
        (self.row_start..self.row_end)
            .flat_map(move |row| columns.clone().map(move |column| (row, column)))
    }

    /// Centre (x, y) in pixels.
    ///
    /// ```
    /// use tactile_core::BoundingBox;
    /// assert_eq!(BoundingBox::whole((5, 20)).centre(), (9.5, 2.0));
    /// ```
    #[must_use]
    pub fn centre(&self) -> (f64, f64) {
        // Pixel centres have integer coordinates, and `to` is one past the last pixel.
        let half = |from: usize, to: usize| 0.5 * ((from + to) as f64 - 1.0);
        (
            half(self.column_start, self.column_end),
            half(self.row_start, self.row_end),
        )
    }

    /// The part of an image inside the box.
    ///
    /// ```
    /// use ndarray::Array2;
    /// use tactile_core::BoundingBox;
    ///
    /// let right = BoundingBox { row_start: 4, row_end: 6, column_start: 6, column_end: 9 };
    /// let image = Array2::from_shape_fn((6, 20), |(row, column)| 100 * row + column);
    /// assert_eq!(right.of(image.view())[[0, 0]], 406);
    /// ```
    #[must_use]
    #[cfg(feature = "ndarray")]
    pub fn of<'a, P>(&self, mut image: ArrayView2<'a, P>) -> ArrayView2<'a, P> {
        image.slice_axis_inplace(Axis(0), Slice::from(self.row_start..self.row_end));
        image.slice_axis_inplace(Axis(1), Slice::from(self.column_start..self.column_end));
        image
    }

    /// The part of a mutable image inside the box.
    #[must_use]
    #[cfg(feature = "ndarray")]
    pub fn of_mut<'a, P>(&self, mut image: ArrayViewMut2<'a, P>) -> ArrayViewMut2<'a, P> {
        image.slice_axis_inplace(Axis(0), Slice::from(self.row_start..self.row_end));
        image.slice_axis_inplace(Axis(1), Slice::from(self.column_start..self.column_end));
        image
    }

    /// The smallest box that contains both boxes.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self {
            row_start: self.row_start.min(other.row_start),
            row_end: self.row_end.max(other.row_end),
            column_start: self.column_start.min(other.column_start),
            column_end: self.column_end.max(other.column_end),
        }
    }

    /// The box with a margin on every side, clipped to an image of the given size.
    #[must_use]
    pub fn grown(self, margin: usize, (rows, columns): (usize, usize)) -> Self {
        Self {
            row_start: self.row_start.saturating_sub(margin),
            row_end: (self.row_end + margin).min(rows),
            column_start: self.column_start.saturating_sub(margin),
            column_end: (self.column_end + margin).min(columns),
        }
    }
}

#[cfg(all(test, feature = "ndarray"))]
mod tests {
    use super::*;
    use ndarray::Array2;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_mask_has_the_box_of_its_pixels(
            pixels in proptest::collection::vec((0..9_usize, 0..12_usize), 0..6), transposed: bool,
        ) {
            let mut mask = Array2::from_elem((9, 12), false);
            pixels.iter().for_each(|&at| mask[at] = true);
            let place = |&(row, column): &(usize, usize)| match transposed {
                true => [column, row],
                false => [row, column],
            };
            let places: Vec<_> = pixels.iter().map(place).collect();
            let end = |k: usize| places.iter().map(|p| p[k] + 1).max();
            let start = |k: usize| places.iter().map(|p| p[k]).min();
            let expected = start(0).map(|row_start| BoundingBox {
                row_start,
                row_end: end(0).unwrap(),
                column_start: start(1).unwrap(),
                column_end: end(1).unwrap(),
            });
            let mask = if transposed { mask.t() } else { mask.view() };
            prop_assert_eq!(BoundingBox::of_mask(mask), expected);
        }
    }
}
