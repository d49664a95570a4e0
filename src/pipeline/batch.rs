//! Many frames at once: serial, or over threads with the feature `rayon`. The bits are the same.
use super::composition::Pipeline;
use super::contact::{ContactReading, FrameContact};
use super::error::PipelineError;
use super::stages::{Bench, Stages};
use ndarray::ArrayView2;
use std::sync::Arc;

type Reading = Result<Option<ContactReading>, PipelineError>;

/// Contact and force of every frame, in order. Workspaces are reused from frame to frame (one a
/// thread with the feature `rayon`, whose pool decides how many).
///
/// ```
/// use ndarray::Array2;
/// use tactile_imaging::{
///     force::CalibrationPair,
///     pipeline::{Object, Pipeline, contacts},
/// };
/// // 10⁵ grey levels in all are 1 N; a pixel is 50 µm wide.
/// let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
/// let pipeline = Pipeline::from_pairs(&pairs, [50e-6; 2], Object::sphere(3e-3))?;
/// // Hertz's pressure p₀√(1 − r²/a²), a = 20 pixels: (2π/3) a² p₀ grey levels, 0.503 N for p₀ =
/// // 60.
/// let press = |peak: f64| {
///     Array2::from_shape_fn((64, 64), |(r, c)| {
///         let d = ((r as f64 - 32.0).hypot(c as f64 - 32.0) / 20.0).min(1.0);
///         10 + (peak * (1.0 - d * d).sqrt()).round() as u8
///     })
/// };
/// let [reference, light, heavy] = [0.0, 60.0, 120.0].map(press);
/// let found = contacts(&pipeline, reference.view(), &[light.view(), heavy.view()])?;
/// for (found, newton) in found.into_iter().zip([0.503, 1.005]) {
///     let force = found?.and_then(|c| c.force_n).expect("a calibrated contact");
///     assert!((force.value / newton - 1.0).abs() < 0.01);
/// }
/// # Ok::<(), tactile_imaging::pipeline::PipelineError>(())
/// ```
///
/// # Errors
/// [`PipelineError::Sensor`] for a reference without pixels. A frame's own trouble stands in its
/// place.
pub fn contacts(
    pipeline: &Pipeline,
    reference: ArrayView2<'_, u8>,
    frames: &[ArrayView2<'_, u8>],
) -> Result<Vec<Reading>, PipelineError> {
    let reference = Arc::new(pipeline.reference_frame(&[reference])?);
    let stages = Stages::new(pipeline.clone(), reference);
    let one = |(bench, contact): &mut (Bench, FrameContact),
               (frame, image): (usize, &ArrayView2<'_, u8>)| {
        stages.contact(bench, frame, *image, None, contact)?;
        Ok(contact.reading)
    };
    #[cfg(feature = "rayon")]
    {
        use rayon::prelude::*;
        let start = || (Bench::default(), FrameContact::default());
        Ok(frames.par_iter().enumerate().map_init(start, one).collect())
    }
    #[cfg(not(feature = "rayon"))]
    {
        let mut state = (Bench::default(), FrameContact::default());
        Ok(frames
            .iter()
            .enumerate()
            .map(|item| one(&mut state, item))
            .collect())
    }
}
