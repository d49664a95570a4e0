//! The result of one pass over a frame.

use ndarray::{ArrayView2, Axis, Slice};

use crate::estimate::Real;

/// A rectangle of pixels, half open: rows `row_start..row_end`, columns `column_start..column_end`.
///
/// ```
/// use ndarray::Array2;
/// use tactile_force::BoundingBox;
///
/// let left = BoundingBox { row_start: 2, row_end: 5, column_start: 0, column_end: 4 };
/// let right = BoundingBox { row_start: 4, row_end: 6, column_start: 6, column_end: 9 };
/// let both = left.union(right).grown(1, (6, 20));
/// assert_eq!((both.rows(), both.columns()), (5, 10));
/// let image = Array2::from_shape_fn((6, 20), |(row, column)| 100 * row + column);
/// assert_eq!(right.of(image.view())[[0, 0]], 406);
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
    pub fn of<'a, P>(&self, mut image: ArrayView2<'a, P>) -> ArrayView2<'a, P> {
        image.slice_axis_inplace(Axis(0), Slice::from(self.row_start..self.row_end));
        image.slice_axis_inplace(Axis(1), Slice::from(self.column_start..self.column_end));
        image
    }

    /// The smallest box that holds both.
    pub fn union(self, other: Self) -> Self {
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

/// Sums over the signed difference d = frame − reference of a whole frame, exact in integers.
///
/// x is the column and y the row of a pixel, counted from the centre of the first pixel. Differences keep their sign:
/// clamping the negative ones to zero would turn noise into force.
///
/// ```
/// use ndarray::Array2;
/// use tactile_force::ReferenceFrame;
///
/// // A bar of 9 × 3 pixels: (n² − 1)/12 along each axis.
/// let mut frame = Array2::zeros((40, 40));
/// let reference = ReferenceFrame::new(frame.view())?;
/// frame.slice_mut(ndarray::s![10..13, 20..29]).fill(100_u8);
/// let statistics = reference.compare(frame.view(), 10)?;
/// assert_eq!(statistics.centroid_px(), Some([24.0, 11.0]));
/// let [xx, xy, yy] = statistics.central_moments_px2::<f64>().expect("a signal");
/// assert!((xx - 80.0 / 12.0).abs() < 1e-12 && xy == 0.0 && (yy - 8.0 / 12.0).abs() < 1e-12);
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
    /// Σ x d.
    pub sum_x: i64,
    /// Σ y d.
    pub sum_y: i64,
    /// Σ x² d.
    pub sum_xx: i64,
    /// Σ x y d.
    pub sum_xy: i64,
    /// Σ y² d.
    pub sum_yy: i64,
    /// Least difference.
    pub least: i16,
    /// Greatest difference.
    pub greatest: i16,
    /// Number of pixels of the frame at 255.
    pub saturated: usize,
    /// Box around every pixel with |d| above the threshold; `None` if there is none.
    pub bounding_box: Option<BoundingBox>,
}

impl FrameStatistics {
    /// Σ x d / Σ d and Σ y d / Σ d in pixels (equations (7) and (8) over the whole frame); `None` if Σ d is zero.
    pub fn centroid_px<T: Real>(&self) -> Option<[T; 2]> {
        let over = |moment: i64| T::nearest(moment as f64 / self.sum as f64);
        (self.sum != 0).then(|| [over(self.sum_x), over(self.sum_y)])
    }

    /// Central second moments [xx, xy, yy] per unit of Σ d, in square pixels; `None` if Σ d is zero.
    ///
    /// Computed as (Σd Σx²d − (Σxd)²)/(Σd)² with an exact numerator, so that nothing cancels; signed differences can
    /// make them negative.
    pub fn central_moments_px2<T: Real>(&self) -> Option<[T; 3]> {
        let s = i128::from(self.sum);
        let central = |second: i64, a: i64, b: i64| {
            let numerator = s * i128::from(second) - i128::from(a) * i128::from(b);
            T::nearest(numerator as f64 / (s * s) as f64)
        };
        (self.sum != 0).then(|| {
            [
                central(self.sum_xx, self.sum_x, self.sum_x),
                central(self.sum_xy, self.sum_x, self.sum_y),
                central(self.sum_yy, self.sum_y, self.sum_y),
            ]
        })
    }
}
