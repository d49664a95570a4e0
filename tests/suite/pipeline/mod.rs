//! The pipeline pulls: what is not asked for is not computed, what is skipped changes no answer,
//! stages can be swapped.
mod blocks;
mod hostile;
mod on_demand;
mod own_contact_stage;
mod repeated;
mod results;
mod sources;
mod strain_of_sizes;
mod strain_stream;
mod streams;
mod time;

use nalgebra::Point3;
use ndarray::ArrayView2;
use tactile_imaging::Pipeline;
use tactile_imaging::elasticity::strain::Hencky;
use tactile_imaging::force::CalibrationPair;
use tactile_imaging::pipeline::{Object, PipelineError, Press, SkipReason, Stage};
use tactile_imaging::sfs::{ControlPointSampler, Domain, EquallySpaced, SfsError};
use tactile_simulate::Trial;
use tactile_simulate::{CalibrationRun, Camera, PressLoad, PressOptions, PressScene};

/// A press seen by a camera of 348 × 260 pixels: a sixteenth of the default's, to be quick.
fn trial(forces: &[f64], seed: u64) -> Trial {
    let camera = Camera::default().coarser(4);
    let loads = forces.iter().map(|&f| PressLoad::normal(f)).collect();
    Trial::new(
        PressOptions {
            camera,
            loads,
            seed,
            ..PressOptions::default()
        },
        &CalibrationRun::default(),
    )
    .unwrap()
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
    assert_eq!(
        runs(&press),
        [1, 0, 0, 0, 0, 0],
        "force alone never touches a surface"
    );
    press.modulus().unwrap();
    assert_eq!(
        runs(&press),
        [2, 0, 0, 0, 0, 1],
        "a ball's modulus takes the contacts alone"
    );
    press.surface(1).unwrap();
    assert_eq!(runs(&press), [2, 1, 0, 0, 0, 1]);
    press.strain(1).unwrap();
    press.strain(1).unwrap();
    assert_eq!(
        runs(&press),
        [2, 2, 2, 1, 1, 1],
        "what is known is not computed again"
    );
}

#[test]
fn a_frame_without_contact_stops_there() {
    let trial = trial(&[0.7], 1);
    let pipeline = trial.pipeline().unwrap();
    let empty = trial.scene.reference(7);
    let mut press = pipeline.press(trial.simulation.reference.view()).unwrap();
    press.add_frame(empty.view());
    assert!(press.contact(0).unwrap().is_none());
    assert_eq!(
        press.surface(0).unwrap_err(),
        PipelineError::NoContact { frame: 0 }
    );
    assert_eq!(
        press.modulus().unwrap_err(),
        PipelineError::NoContact { frame: 0 }
    );
    assert_eq!(runs(&press), [1, 0, 0, 0, 0, 0]);
    assert!(
        press
            .report()
            .skips
            .iter()
            .any(|s| s.reason == SkipReason::NoContact)
    );
    assert!(matches!(
        press.contact(1).unwrap_err(),
        PipelineError::NoSuchFrame {
            frame: 1,
            frames: 1
        }
    ));
}

/// A user's sampler: half as many points.
struct Half;

impl ControlPointSampler<f64> for Half {
    fn sample(
        &self,
        heights: ArrayView2<'_, f64>,
        domain: &Domain<'_, f64>,
        count: usize,
    ) -> Result<Vec<Point3<f64>>, SfsError> {
        EquallySpaced.sample(heights, domain, count / 2)
    }
}

#[test]
fn every_stage_can_be_swapped_in_one_line() {
    let trial = trial(&[0.7, 1.2], 4);
    let pipeline = trial
        .pipeline()
        .unwrap()
        .with_sampler(Half)
        .with_strain(Hencky);
    let press = trial.press(&pipeline).unwrap();
    assert_eq!(press.control_points(0).unwrap().len(), 100);
    assert!(press.strain(1).unwrap().measure.contains("Hencky"));
}

#[test]
fn a_flat_field_makes_the_force_the_same_in_a_corner() {
    let mut options = trial(&[0.5], 11).scene.options().clone();
    options.centre_px = Some([50.0, 45.0]);
    options.camera.vignetting = 0.15;
    let corner = Trial::new(options.clone(), &CalibrationRun::default()).unwrap();
    let scene = PressScene::new(PressOptions {
        centre_px: None,
        ..options
    })
    .unwrap();
    // The sensor is calibrated in the frame's middle.
    let series = scene.calibrate(&CalibrationRun::default()).unwrap();
    let pairs: Vec<_> = series
        .pairs
        .iter()
        .map(|p| CalibrationPair::loading(p.integrated_pixel_value, p.force_n))
        .collect();
    let error = |flat: bool| {
        let pipeline =
            Pipeline::from_pairs(&pairs, corner.simulation.pixel_size_m, Object::sphere(3e-3));
        let pipeline = pipeline
            .unwrap()
            .with_settings(|settings| settings.flat_field = flat)
            .unwrap();
        let press = corner.press(&pipeline).unwrap();
        press.contact(0).unwrap().unwrap().force_n.unwrap().value / 0.5 - 1.0
    };
    // The corner loses a tenth; what is left is noise (0.3 %) and the calibration (0.3 %).
    assert!(error(false) < -0.05, "{}", error(false));
    assert!(error(true).abs() < 0.02, "{}", error(true));
}
