//! Buffers of a measurement, and what they still know of the last frame.

use ndarray::Array2;

use super::local::Local;
use crate::contact::DetectorWorkspace;
use crate::hertz::Rings;
use tactile_core::BoundingBox;

/// Buffers that measurements reuse from frame to frame; after the first frames nothing is allocated.
///
/// ```
/// use ndarray::Array2;
/// use tactile_force::{CalibrationPair, ForceMeter, ForceWorkspace, LinearCalibration, ReferenceFrame};
///
/// let pairs = [0.0, 1e5, 2e5].map(|v| CalibrationPair::loading(v, 1e-5 * v));
/// let calibration = LinearCalibration::fit(&pairs, &Default::default())?;
/// let mut frame = Array2::from_elem((64, 64), 12_u8);
/// let reference = ReferenceFrame::new(frame.view())?;
/// frame.slice_mut(ndarray::s![20..40, 24..48]).fill(90);
/// let mut workspace = ForceWorkspace::default();
/// let meter = ForceMeter::new([20e-6; 2], &Default::default())?;
/// meter.measure_with(&mut workspace, frame.view(), &reference, &calibration)?;
/// let (place, mask) = workspace.detector.mask().expect("contact");
/// assert_eq!(mask.iter().filter(|inside| **inside == 1).count(), 20 * 24);
/// assert!(place.row_start <= 20 && place.row_end >= 40);
/// // Outside the contact the sensor is as bright as before.
/// let condition = workspace.detector.condition(&reference).expect("a frame");
/// assert!((condition.brightness.value - 1.0).abs() < 1e-9);
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct ForceWorkspace {
    /// What the detector keeps of the last frame: mask, grey histogram and background.
    pub detector: DetectorWorkspace,
    pub(super) rings: Rings,
    pub(super) local: Local,
}

impl ForceWorkspace {
    /// The pressure of the last contact in pascals over its region (zero outside the aperture), and the region's place in the
    /// frame; `None` without contact, or if the calibration had no [local curve](crate::StressCalibration::local). O(pixels of the region).
    ///
    /// ```
    /// use ndarray::Array2;
    /// use tactile_force::{
    ///     Branch, CalibrationFrame, ForceMeter, ForceWorkspace, GreyHistogram, PressureCurve, ReferenceFrame,
    /// };
    ///
    /// // 2 kPa a grey level.
    /// let disc = |grey: f32| GreyHistogram::from_differences(std::iter::repeat_n(grey, 1000), 4e-10);
    /// let frames: Vec<_> = [20.0_f32, 40.0, 60.0, 80.0, 100.0]
    ///     .map(|grey| CalibrationFrame::new(disc(grey), f64::from(grey) * 2e3 * 4e-7, Branch::Loading))
    ///     .into_iter()
    ///     .collect::<Result<_, _>>()?;
    /// let curve = PressureCurve::fit(&frames, &Default::default())?;
    /// let mut frame = Array2::from_elem((64, 64), 12_u8);
    /// let reference = ReferenceFrame::new(frame.view())?;
    /// frame.slice_mut(ndarray::s![20..40, 20..40]).fill(62);
    /// let mut workspace = ForceWorkspace::default();
    /// let meter = ForceMeter::new([20e-6; 2], &Default::default())?;
    /// let measured = meter.measure_with(&mut workspace, frame.view(), &reference, &curve)?;
    /// let (_, pressure) = workspace.pressure_pa().expect("a contact");
    /// assert!((f64::from(pressure[[pressure.nrows() / 2, pressure.ncols() / 2]]) / 1e5 - 1.0).abs() < 1e-3);
    /// let force = pressure.iter().map(|p| f64::from(*p) * 4e-10).sum::<f64>();
    /// assert!((force / measured.force_n.value - 1.0).abs() < 1e-5);
    /// # Ok::<(), tactile_force::ForceError>(())
    /// ```
    pub fn pressure_pa(&self) -> Option<(BoundingBox, Array2<f32>)> {
        self.local.per_grey_pa()?;
        let region = &self.detector.region;
        let place = region.place?;
        let columns = region.columns();
        let mut image = vec![0.0; region.difference.len()];
        for run in &region.aperture {
            let span = run.span(columns);
            image[span.clone()].copy_from_slice(&region.difference[span]);
        }
        let image = Array2::from_shape_vec((place.rows(), place.columns()), image).ok()?;
        Some((place, image))
    }
}
