//! The result of one pass over a frame.

use ndarray::{ArrayView2, Axis, Slice};

/// A rectangle of pixels, half open: rows `row_start..row_end`, columns `column_start..column_end`.
///
/// ```
/// use tactile_force::BoundingBox;
///
/// let seen = BoundingBox { row_start: 2, row_end: 5, column_start: 0, column_end: 4 };
/// // A margin of one pixel, as far as a frame of 5 × 20 goes.
/// let wider = seen.grown(1, (5, 20));
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

impl BoundingBox {
    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.row_end - self.row_start
    }

    /// Number of columns.
    pub fn columns(&self) -> usize {
        self.column_end - self.column_start
    }

    /// Centre (x, y).
    pub(crate) fn middle(&self) -> (f64, f64) {
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
    /// use tactile_force::BoundingBox;
    ///
    /// let right = BoundingBox { row_start: 4, row_end: 6, column_start: 6, column_end: 9 };
    /// let image = Array2::from_shape_fn((6, 20), |(row, column)| 100 * row + column);
    /// assert_eq!(right.of(image.view())[[0, 0]], 406);
    /// ```
    pub fn of<'a, P>(&self, mut image: ArrayView2<'a, P>) -> ArrayView2<'a, P> {
        image.slice_axis_inplace(Axis(0), Slice::from(self.row_start..self.row_end));
        image.slice_axis_inplace(Axis(1), Slice::from(self.column_start..self.column_end));
        image
    }

    /// The smallest box that holds both.
    pub(crate) fn union(self, other: Self) -> Self {
        Self {
            row_start: self.row_start.min(other.row_start),
            row_end: self.row_end.max(other.row_end),
            column_start: self.column_start.min(other.column_start),
            column_end: self.column_end.max(other.column_end),
        }
    }

    /// The box with a margin on every side, clipped to an image of the given size.
    pub fn grown(self, margin: usize, (rows, columns): (usize, usize)) -> Self {
        Self {
            row_start: self.row_start.saturating_sub(margin),
            row_end: (self.row_end + margin).min(rows),
            column_start: self.column_start.saturating_sub(margin),
            column_end: (self.column_end + margin).min(columns),
        }
    }
}

/// What one pass tells of the signed difference d = frame − reference of a whole frame, exact in integers.
///
/// Differences keep their sign: clamping the negative ones to zero would turn noise into force. Moments are those of a
/// [`Contact`](crate::Contact); of any image [`ImageMoments`](crate::ImageMoments) has them.
///
/// ```
/// use ndarray::Array2;
/// use tactile_force::ReferenceFrame;
///
/// let mut frame = Array2::from_elem((40, 40), 7_u8);
/// let reference = ReferenceFrame::new(frame.view())?;
/// frame.slice_mut(ndarray::s![10..13, 20..29]).fill(107);
/// frame[[0, 0]] = 5;
/// let statistics = reference.compare(frame.view(), 10)?;
/// assert_eq!((statistics.sum, statistics.least, statistics.greatest), (2698, -2, 100));
/// let found = statistics.bounding_box.expect("pixels above the threshold");
/// assert_eq!((found.rows(), found.columns()), (3, 9));
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct FrameStatistics {
    /// Number of rows.
    pub rows: usize,
    /// Number of columns.
    pub columns: usize,
    /// Σ d.
    pub sum: i64,
    /// Least difference.
    pub least: i16,
    /// Greatest difference.
    pub greatest: i16,
    /// Number of pixels of the frame at 255.
    pub saturated: usize,
    /// Box around every pixel with |d| above the threshold; `None` if there is none.
    pub bounding_box: Option<BoundingBox>,
}
