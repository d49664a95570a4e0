//! Many frames at once: serial, or over threads with the feature `rayon`; the bits are the same.
use super::contact::{ContactReading, FrameContact};
use super::error::PipelineError;
use super::stages::{Stages, reference_frame};
use crate::force::ForceWorkspace;
use ndarray::ArrayView2;

type Reading = Result<Option<ContactReading>, PipelineError>;

/// Contact and force of every frame, in order. Workspaces are reused from frame to frame (one a thread with the feature
/// `rayon`, whose pool decides how many).
///
/// # Errors
/// [`PipelineError::Sensor`] for a reference without pixels; a frame's own trouble stands in its place.
pub fn contacts(
    stages: &dyn Stages,
    reference: ArrayView2<'_, u8>,
    frames: &[ArrayView2<'_, u8>],
) -> Result<Vec<Reading>, PipelineError> {
    let reference = reference_frame(stages, &[reference])?;
    let one = |(workspace, contact): &mut (ForceWorkspace, FrameContact),
               (frame, image): (usize, &ArrayView2<'_, u8>)| {
        stages
            .contact()
            .measure(workspace, *image, &reference, None, contact)
            .map_err(|source| PipelineError::Contact { frame, source })?;
        Ok(contact.reading)
    };
    #[cfg(feature = "rayon")]
    {
        use rayon::prelude::*;
        let start = || (ForceWorkspace::default(), FrameContact::default());
        Ok(frames.par_iter().enumerate().map_init(start, one).collect())
    }
    #[cfg(not(feature = "rayon"))]
    {
        let mut state = (ForceWorkspace::default(), FrameContact::default());
        Ok(frames.iter().enumerate().map(|item| one(&mut state, item)).collect())
    }
}
