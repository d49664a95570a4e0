//! The result of one pass over a frame.

use tactile_core::BoundingBox;

/// What one pass tells of the signed difference d = frame − reference of a whole frame, exact in integers.
///
/// Differences keep their sign: clamping the negative ones to zero would turn noise into force.
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
