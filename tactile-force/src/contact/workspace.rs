//! Buffers of the detector, and what they still know of the last frame.

use ndarray::ArrayView2;

use super::noise::NoiseWorkspace;
use super::region::Region;
use crate::calibration::GreyHistogram;
use crate::drift::FitWorkspace;
use crate::frame::{PassWorkspace, ReferenceFrame};
use crate::health::FrameCondition;
use tactile_core::BoundingBox;

/// Buffers that detection reuses from frame to frame.
///
/// ```
/// use ndarray::Array2;
/// use tactile_force::{ContactDetector, ContactOptions, Detection, DetectorWorkspace, ReferenceFrame};
///
/// let mut frame = Array2::from_elem((64, 64), 12_u8);
/// let reference = ReferenceFrame::new(frame.view())?;
/// frame.slice_mut(ndarray::s![20..40, 20..40]).fill(90);
/// frame.slice_mut(ndarray::s![28..32, 28..32]).fill(12); // a hole, which is filled
/// let mut workspace = DetectorWorkspace::default();
/// let _: Detection = ContactDetector::new(ContactOptions::default())
///     .detect_with(&mut workspace, frame.view(), &reference)?;
/// let (_, mask) = workspace.mask().expect("contact");
/// assert_eq!(mask.iter().filter(|inside| **inside == 1).count(), 400);
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct DetectorWorkspace {
    pub(super) pass: PassWorkspace,
    pub(crate) region: Region,
    pub(super) noise: NoiseWorkspace,
    /// Sums over the columns of a region.
    pub(super) columns: Vec<f64>,
    pub(super) drift: FitWorkspace,
}

impl DetectorWorkspace {
    /// The mask of the last frame's contact (1 inside, 0 outside) over a region, and the region's place in the frame; `None`
    /// if there was no contact.
    pub fn mask(&self) -> Option<(BoundingBox, ArrayView2<'_, u8>)> {
        let place = self.region.place?;
        let view =
            ArrayView2::from_shape((place.rows(), place.columns()), &self.region.pixels).ok()?;
        Some((place, view))
    }

    /// Brightness and noise of the last frame outside the contact, against the reference that it was compared with; `None` if no
    /// frame of the reference's size was. From at most 1,500 tiles of 8 × 32 pixels, evenly over the frame, or all of a smaller one: O(tiles).
    ///
    /// ```
    /// # use ndarray::Array2;
    /// # use tactile_force::{ContactDetector, ContactOptions, Detection, DetectorWorkspace, ReferenceFrame};
    /// # let reference = ReferenceFrame::new(Array2::from_elem((160, 160), 50_u8).view())?;
    /// let mut workspace = DetectorWorkspace::default();
    /// assert!(workspace.condition(&reference).is_none(), "no frame yet");
    /// # let dimmed = Array2::from_elem((160, 160), 49_u8);
    /// let _: Detection =
    ///     ContactDetector::new(ContactOptions::default()).detect_with(&mut workspace, dimmed.view(), &reference)?;
    /// let condition = workspace.condition(&reference).expect("a frame");
    /// assert!((condition.brightness.value - 0.98).abs() < 1e-9);
    /// # Ok::<(), tactile_force::ForceError>(())
    /// ```
    pub fn condition(&mut self, reference: &ReferenceFrame) -> Option<FrameCondition> {
        let size = reference.image().dim();
        let tiles = reference.tile_sums(&self.pass.tiles)?;
        let step = FrameCondition::tile_step(self.pass.tiles.sums.len(), self.pass.tiles.columns);
        let sd = reference.difference_variance().sqrt();
        FrameCondition::of(size, tiles.step_by(step), sd, &mut self.drift)
    }

    /// The grey histogram of the last frame's contact over its aperture, each pixel covering `pixel_area_m2`: a row of the fit of a
    /// [`PressureCurve`](crate::PressureCurve). `None` if there was no contact.
    ///
    /// ```
    /// use ndarray::Array2;
    /// use tactile_force::{ContactDetector, ContactOptions, Detection, DetectorWorkspace, ReferenceFrame};
    ///
    /// let mut frame = Array2::from_elem((64, 64), 12_u8);
    /// let reference = ReferenceFrame::new(frame.view())?;
    /// frame.slice_mut(ndarray::s![20..40, 20..40]).fill(90);
    /// let mut workspace = DetectorWorkspace::default();
    /// let found: Detection =
    ///     ContactDetector::new(ContactOptions::default()).detect_with(&mut workspace, frame.view(), &reference)?;
    /// let histogram = workspace.grey_histogram(4e-10).expect("a contact");
    /// let sum = found.contact.expect("a contact").integrated_pixel_value.value;
    /// assert!((histogram.integral(|grey| grey) / (4e-10 * sum) - 1.0).abs() < 1e-12);
    /// # Ok::<(), tactile_force::ForceError>(())
    /// ```
    pub fn grey_histogram(&self, pixel_area_m2: f64) -> Option<GreyHistogram> {
        self.region.place?;
        let columns = self.region.columns();
        let runs = self.region.aperture.iter();
        let differences = runs.flat_map(|run| &self.region.difference[run.span(columns)]);
        Some(GreyHistogram::from_differences(
            differences.copied(),
            pixel_area_m2,
        ))
    }
}
