//! Frames from a batch, and frames of another size.
use super::trial;
use crate::common::press_of;
use ndarray::Array2;
use tactile_imaging::pipeline::{PipelineError, contacts};

#[test]
fn a_batch_reads_as_frames_one_by_one() {
    let trial = trial(&[0.2, 0.7, 1.2], 8);
    let pipeline = trial.pipeline().unwrap();
    let views: Vec<_> = trial.simulation.frames.iter().map(|f| f.view()).collect();
    let batch = contacts(&pipeline, trial.simulation.reference.view(), &views).unwrap();
    let press = trial.press(&pipeline).unwrap();
    for (i, reading) in batch.iter().enumerate() {
        let reading = reading.as_ref().unwrap().as_ref();
        assert_eq!(reading, press.contact(i).unwrap());
    }
}

#[test]
fn frames_of_another_size_are_an_error() {
    let trial = trial(&[0.7], 1);
    let pipeline = trial.pipeline().unwrap();
    let press = press_of(
        &pipeline,
        trial.simulation.reference.view(),
        [Array2::zeros((10, 10))],
    );
    let error = press.contact(0).unwrap_err();
    assert!(
        matches!(error, PipelineError::Contact { frame: 0, .. }),
        "{error}"
    );
}
