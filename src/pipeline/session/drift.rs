//! Drift of the light, seen in frames without contact.
use crate::pipeline::flag::Flag;

/// Drift of the light in grey levels beyond which the reference should be taken anew.
pub(crate) const DRIFT_LIMIT_GREY: f64 = 0.5;

/// What frames without contact say of the light since the reference was taken, in grey levels: the mean of frame minus
/// reference.
///
/// ```
/// use std::sync::Arc;
/// use tactile_imaging::pipeline::{DriftWatch, Flag, Object, Pipeline, Session};
/// # use tactile_imaging::force::CalibrationPair;
/// # let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
/// # let hertz = |peak: f64| ndarray::Array2::from_shape_fn((64, 64), |(r, c)| {
/// #     let d = ((r as f64 - 32.0).hypot(c as f64 - 32.0) / 20.0).min(1.0);
/// #     10 + (peak * (1.0 - d * d).sqrt()).round() as u8
/// # });
/// let pipeline = Pipeline::from_pairs(&pairs, [50e-6; 2], Object::sphere(3e-3))?;
/// let mut session = Session::new(&pipeline, &[hertz(0.0).view()])?;
/// // The light fades by two grey levels and recovers by one.
/// for loss in [0, 2, 1] {
///     session.push(hertz(0.0).mapv(|v| v - loss).view())?;
/// }
/// assert_eq!(session.drift(), &DriftWatch { frames: 3, last_grey: -1.0, greatest_grey: -2.0, caution: Some(Flag::LightDrifted { grey: -1.0 }) });
/// # Ok::<(), tactile_imaging::pipeline::PipelineError>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct DriftWatch {
    /// Frames without contact so far.
    pub frames: u64,
    /// In the last of them.
    pub last_grey: f64,
    /// The greatest so far, with its sign.
    pub greatest_grey: f64,
    /// The light had drifted by more than half a grey level when the sensor was last free: the reference should be taken anew, or the contact
    /// stage told to correct drift.
    pub caution: Option<Flag>,
}

impl DriftWatch {
    pub(super) fn watch(&mut self, grey: f64) {
        self.frames += 1;
        self.last_grey = grey;
        self.caution = (grey.abs() > DRIFT_LIMIT_GREY).then_some(Flag::LightDrifted { grey });
        if grey.abs() > self.greatest_grey.abs() {
            self.greatest_grey = grey;
        }
    }
}
