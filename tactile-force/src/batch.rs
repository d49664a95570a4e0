//! Measurement of many frames.

use ndarray::ArrayView2;
use rayon::prelude::*;

use crate::calibration::StressCalibration;
use crate::error::ForceError;
use crate::frame::ReferenceFrame;
use crate::measure::{ForceMeasurement, ForceMeter, ForceWorkspace};

impl ForceMeter {
    /// Measures frames on all threads of the current pool. The results are those of
    /// [`measure_with`](Self::measure_with) frame by frame, bit for bit.
    ///
    /// ```
    /// use ndarray::Array2;
    /// use tactile_force::{
    ///     CalibrationPair, ForceMeter, ForceWorkspace, LinearCalibration, ReferenceFrame,
    /// };
    ///
    /// let pairs = [0.0, 1e5, 2e5].map(|v| CalibrationPair::loading(v, 1e-5 * v));
    /// let calibration = LinearCalibration::fit(&pairs, &Default::default())?;
    /// let at_rest = Array2::from_elem((64, 64), 12_u8);
    /// let mut pressed = at_rest.clone();
    /// pressed.slice_mut(ndarray::s![20..40, 20..40]).fill(90);
    /// let (reference, frames) = (
    ///     ReferenceFrame::new(at_rest.view())?,
    ///     [at_rest.view(), pressed.view()],
    /// );
    /// let meter = ForceMeter::new([20e-6; 2], &Default::default())?;
    /// let parallel = meter.measure_all_in_parallel(&frames, &reference, &calibration);
    /// let serial = meter.measure_with(
    ///     &mut ForceWorkspace::default(),
    ///     pressed.view(),
    ///     &reference,
    ///     &calibration,
    /// )?;
    /// assert_eq!(parallel[1], Ok(serial));
    /// # Ok::<(), tactile_force::ForceError>(())
    /// ```
    pub fn measure_all_in_parallel(
        &self,
        frames: &[ArrayView2<'_, u8>],
        reference: &ReferenceFrame,
        calibration: &(impl StressCalibration + ?Sized),
    ) -> Vec<Result<ForceMeasurement, ForceError>> {
        frames
            .par_iter()
            .map_init(ForceWorkspace::default, |workspace, f| {
                self.measure_with(workspace, f.view(), reference, calibration)
            })
            .collect()
    }
}
