//! The pipeline computes on demand: only requested results are computed, and skipped stages change
//! no result.
mod blocks;
mod hostile;
mod on_demand;
mod own_contact_stage;
mod own_estimators;
mod repeated;
mod results;
mod sources;
mod strain_of_sizes;
mod strain_stream;
mod streams;
mod time;

use tactile_imaging::pipeline::{PipelineError, Press, SkipReason, Stage};
use tactile_simulate::{Camera, Trial};

/// A press seen by a camera of 348 × 260 pixels: a sixteenth of the default, to save time.
fn trial(forces: &[f64], seed: u64) -> Trial {
    crate::common::trial(Camera::default().coarser(4), forces, seed)
}

fn runs(press: &Press<'_>) -> [usize; 6] {
    Stage::ALL.map(|stage| press.report().work(stage).runs)
}

#[test]
fn nothing_runs_before_it_is_asked_for() {
    let trial = trial(&[0.7, 1.2], 1);
    let pipeline = trial.pipeline().unwrap();
    let press = trial.press(&pipeline).unwrap();
    assert_eq!(runs(&press), [0; 6]);
    press.contact(0).unwrap();
    // The force alone needs no surface.
    assert_eq!(runs(&press), [1, 0, 0, 0, 0, 0]);
    press.modulus().unwrap();
    // The modulus of a ball needs only the contacts.
    assert_eq!(runs(&press), [2, 0, 0, 0, 0, 1]);
    press.surface(1).unwrap();
    assert_eq!(runs(&press), [2, 1, 0, 0, 0, 1]);
    press.strain(1).unwrap();
    press.strain(1).unwrap();
    // Known results are not computed again.
    assert_eq!(runs(&press), [2, 2, 2, 1, 1, 1]);
}

#[test]
fn a_frame_without_contact_stops_there() {
    let trial = trial(&[0.7], 1);
    let pipeline = trial.pipeline().unwrap();
    let empty = trial.scene.reference(7);
    let mut press = pipeline.press(trial.simulation.reference.view()).unwrap();
    press.add_frame(empty.view());
    assert!(press.contact(0).unwrap().is_none());
    let none = PipelineError::NoContact { frame: 0 };
    assert_eq!(press.surface(0).unwrap_err(), none);
    assert_eq!(press.modulus().unwrap_err(), none);
    assert_eq!(runs(&press), [1, 0, 0, 0, 0, 0]);
    let skips = press.report().skips;
    assert!(skips.iter().any(|s| s.reason == SkipReason::NoContact));
    let no_such = PipelineError::NoSuchFrame {
        frame: 1,
        frames: 1,
    };
    assert_eq!(press.contact(1).unwrap_err(), no_such);
}
