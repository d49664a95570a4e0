//! What a session says of one frame.
use crate::force::ShearMeasurement;
use crate::pipeline::contact::ContactReading;

/// What one frame of a stream says.
///
/// ```
/// use std::sync::Arc;
/// use tactile_imaging::pipeline::{Object, Pipeline, Session, Update};
/// # use tactile_imaging::force::CalibrationPair;
/// # let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
/// # let hertz = |peak: f64| ndarray::Array2::from_shape_fn((64, 64), |(r, c)| {
/// #     let d = ((r as f64 - 32.0).hypot(c as f64 - 32.0) / 20.0).min(1.0);
/// #     10 + (peak * (1.0 - d * d).sqrt()).round() as u8
/// # });
/// let pipeline = Pipeline::from_pairs(&pairs, [50e-6; 2], Object::sphere(3e-3))?;
/// let mut session = Session::new(&pipeline, &[hertz(0.0).view()])?;
/// let first: Update = session.push(hertz(120.0).view())?;
/// let again = session.push(hertz(120.0).view())?;
/// assert_eq!((again.frame, again.repeated), (1, true), "the same image: not measured again");
/// assert_eq!(again.contact, first.contact);
/// assert!(first.to_string().starts_with("frame 1: force 1.00"));
/// # Ok::<(), tactile_imaging::pipeline::PipelineError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Update {
    /// Number of the frame, counted from 0.
    pub frame: u64,
    /// The contact; `None` where nothing touches.
    pub contact: Option<ContactReading>,
    /// The frame equals the one before it, bit for bit, and was not measured again.
    pub repeated: bool,
    /// Shear since contact began, where the session knows the stiffnesses.
    pub shear: Option<ShearMeasurement>,
}
