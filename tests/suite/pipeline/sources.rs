//! Frames from a batch, from a folder of images, and of another size.
use super::trial;
use ndarray::Array2;
use tactile_imaging::io::write_grey_image;
use tactile_imaging::pipeline::{FrameSource, ImageFolder, PipelineError, contacts};

#[test]
fn a_batch_reads_as_frames_one_by_one() {
    let trial = trial(&[0.2, 0.7, 1.2], 8);
    let pipeline = trial.pipeline().unwrap();
    let views: Vec<_> = trial.simulation.frames.iter().map(|f| f.view()).collect();
    let batch = contacts(&pipeline, trial.simulation.reference.view(), &views).unwrap();
    let press = trial.press(&pipeline).unwrap();
    for (i, reading) in batch.iter().enumerate() {
        assert_eq!(
            reading.as_ref().unwrap().as_ref(),
            press.contact(i).unwrap()
        );
    }
}

#[test]
fn a_folder_of_images_streams_as_the_frames_it_was_written_from() {
    let trial = trial(&[0.4, 0.9], 12);
    let folder = tempfile::tempdir().unwrap();
    for (i, frame) in trial.simulation.frames.iter().enumerate() {
        write_grey_image(folder.path().join(format!("{i}.png")), frame.view()).unwrap();
    }
    std::fs::write(folder.path().join("notes.txt"), "no image").unwrap();
    let mut source = ImageFolder::open(folder.path(), 80.0).unwrap();
    let mut frame = Array2::zeros((0, 0));
    for (i, written) in trial.simulation.frames.iter().enumerate() {
        assert_eq!(
            source.next_frame(&mut frame).unwrap(),
            Some(i as f64 / 80.0)
        );
        assert_eq!(frame, written);
    }
    assert_eq!(source.next_frame(&mut frame).unwrap(), None);
    assert!(ImageFolder::open(folder.path().join("none"), 80.0).is_err());
}

#[test]
fn frames_of_another_size_are_an_error() {
    let trial = trial(&[0.7], 1);
    let pipeline = trial.pipeline().unwrap();
    let small = Array2::zeros((10, 10));
    let mut press = pipeline.press(trial.simulation.reference.view()).unwrap();
    press.add_frame(small.view());
    assert!(matches!(
        press.contact(0),
        Err(PipelineError::Contact { frame: 0, .. })
    ));
}
