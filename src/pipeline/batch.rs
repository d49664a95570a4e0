//! Many frames in one call: serial, or parallel with the feature `rayon`. The results are bitwise
//! equal.
use super::contact::{ContactReading, FrameContact};
use super::error::PipelineError;
use super::pipeline::Pipeline;
use super::stages::{Scratch, Stages};
use ndarray::ArrayView2;
use std::sync::Arc;

type Reading = Result<Option<ContactReading>, PipelineError>;

/// Contact and force of each frame, in order. Workspaces are reused from frame to frame (one per
/// thread of the current pool with the feature `rayon`).
///
/// ```
/// use tactile_imaging::pipeline::contacts;
/// use tactile_simulate::Trial;
/// let trial = Trial::coarser(8)?;
/// let frames: Vec<_> = trial.simulation.frames.iter().map(|frame| frame.view()).collect();
/// let found = contacts(&trial.pipeline()?, trial.simulation.reference.view(), &frames)?;
/// for (found, newton) in found.into_iter().zip([0.7, 1.2]) {
///     let force = found?.and_then(|c| c.force_n).expect("a calibrated contact");
///     assert!((force.value / newton - 1.0).abs() < 0.02);
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`PipelineError::Sensor`] for a reference without pixels. The error of a frame takes its place
/// in the result.
pub fn contacts(
    pipeline: &Pipeline,
    reference: ArrayView2<'_, u8>,
    frames: &[ArrayView2<'_, u8>],
) -> Result<Vec<Reading>, PipelineError> {
    let reference = Arc::new(pipeline.reference_frame(&[reference])?);
    let stages = Stages::new(pipeline.clone(), reference);
    let one = |(scratch, contact): &mut (Scratch, FrameContact),
               (frame, image): (usize, &ArrayView2<'_, u8>)| {
        stages.contact(scratch, frame, *image, None, contact)?;
        Ok(contact.reading)
    };
    #[cfg(feature = "rayon")]
    {
        use rayon::prelude::*;
        let start = || (Scratch::default(), FrameContact::default());
        Ok(frames.par_iter().enumerate().map_init(start, one).collect())
    }
    #[cfg(not(feature = "rayon"))]
    {
        let mut state = (Scratch::default(), FrameContact::default());
        Ok(frames
            .iter()
            .enumerate()
            .map(|item| one(&mut state, item))
            .collect())
    }
}
