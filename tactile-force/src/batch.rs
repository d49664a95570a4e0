//! Measurement of many frames.

use ndarray::ArrayView2;

use crate::calibration::StressCalibration;
use crate::error::ForceError;
use crate::estimate::Real;
use crate::frame::ReferenceFrame;
use crate::measure::{ForceMeasurement, ForceMeter, ForceWorkspace};

impl<T: Real> ForceMeter<T> {
    /// Measures frames one after the other with one workspace.
    ///
    /// ```
    /// use ndarray::Array2;
    /// use tactile_force::{CalibrationPair, ForceMeter, LinearCalibration, ReferenceFrame};
    ///
    /// let pairs = [0.0, 1e5, 2e5].map(|v| CalibrationPair::loading(v, 1e-5 * v));
    /// let calibration = LinearCalibration::fit(&pairs, &Default::default())?;
    /// let frame = |peak: u8| Array2::from_shape_fn((64, 64), |(y, x)| if y.abs_diff(32).max(x.abs_diff(32)) < 9 { 12 + peak } else { 12 });
    /// let (at_rest, light, firm) = (frame(0), frame(50), frame(100));
    /// let reference = ReferenceFrame::new(at_rest.view())?;
    /// let meter = ForceMeter::new([20e-6; 2], &Default::default())?;
    /// let forces: Vec<f64> = meter
    ///     .measure_all(&[at_rest.view(), light.view(), firm.view()], &reference, &calibration)
    ///     .into_iter()
    ///     .map(|m| m.map(|m| m.force_n.value))
    ///     .collect::<Result<_, _>>()?;
    /// assert_eq!(forces[0], 0.0);
    /// assert!((forces[2] / forces[1] - 2.0).abs() < 1e-9);
    /// # Ok::<(), tactile_force::ForceError>(())
    /// ```
    pub fn measure_all(
        &self,
        frames: &[ArrayView2<'_, u8>],
        reference: &ReferenceFrame,
        calibration: &(impl StressCalibration<T> + ?Sized),
    ) -> Vec<Result<ForceMeasurement<T>, ForceError>> {
        let mut workspace = ForceWorkspace::default();
        frames
            .iter()
            .map(|f| self.measure_with(&mut workspace, f.view(), reference, calibration))
            .collect()
    }

    /// Measures frames on all threads of the current pool; the results are those of [`ForceMeter::measure_all`], bit for bit.
    ///
    /// ```
    /// use ndarray::Array2;
    /// use tactile_force::{CalibrationPair, ForceMeter, LinearCalibration, ReferenceFrame};
    ///
    /// let pairs = [0.0, 1e5, 2e5].map(|v| CalibrationPair::loading(v, 1e-5 * v));
    /// let calibration = LinearCalibration::fit(&pairs, &Default::default())?;
    /// let at_rest = Array2::from_elem((64, 64), 12_u8);
    /// let mut pressed = at_rest.clone();
    /// pressed.slice_mut(ndarray::s![20..40, 20..40]).fill(90);
    /// let (reference, frames) = (ReferenceFrame::new(at_rest.view())?, [at_rest.view(), pressed.view()]);
    /// let meter = ForceMeter::<f64>::new([20e-6; 2], &Default::default())?;
    /// let parallel = meter.measure_all_in_parallel(&frames, &reference, &calibration);
    /// assert_eq!(parallel, meter.measure_all(&frames, &reference, &calibration));
    /// # Ok::<(), tactile_force::ForceError>(())
    /// ```
    #[cfg(feature = "rayon")]
    pub fn measure_all_in_parallel(
        &self,
        frames: &[ArrayView2<'_, u8>],
        reference: &ReferenceFrame,
        calibration: &(impl StressCalibration<T> + ?Sized),
    ) -> Vec<Result<ForceMeasurement<T>, ForceError>> {
        use rayon::prelude::*;
        frames
            .par_iter()
            .map_init(ForceWorkspace::default, |workspace, f| {
                self.measure_with(workspace, f.view(), reference, calibration)
            })
            .collect()
    }
}
