//! Many frames at once.

use ndarray::ArrayView2;

use crate::{
    ForceError, ForceMeasurement, ForceMeter, ForceWorkspace, Real, ReferenceFrame, StressCalibration,
};

impl<T: Real> ForceMeter<T> {
    /// Measures frames one after the other with one workspace.
    pub fn measure_all(
        &self,
        frames: &[ArrayView2<'_, u8>],
        reference: &ReferenceFrame,
        calibration: &(impl StressCalibration<T> + ?Sized),
    ) -> Vec<Result<ForceMeasurement<T>, ForceError>> {
        let mut workspace = ForceWorkspace::default();
        frames.iter().map(|f| self.measure_with(&mut workspace, f.view(), reference, calibration)).collect()
    }

    /// Measures frames on all threads of the current pool; the results are those of [`ForceMeter::measure_all`], bit for bit.
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
