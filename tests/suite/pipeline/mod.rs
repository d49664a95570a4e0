//! The pipeline pulls: what is not asked for is not computed, what is skipped changes no answer, stages can be swapped.
mod blocks;
mod hostile;
mod on_demand;
mod own_contact_stage;
mod repeated;
mod strain_of_sizes;
mod strain_stream;
mod streams;
mod time;

use nalgebra::Point3;
use ndarray::{Array2, ArrayView2};
use tactile_imaging::Pipeline;
use tactile_imaging::elasticity::strain::Hencky;
use tactile_imaging::force::CalibrationPair;
use tactile_imaging::io::write_grey_image;
use tactile_imaging::pipeline::{
    BallFit, FrameSource, ImageFolder, Object, PipelineError, Press, Report, Session, SkipReason,
    Skips, Stage, Trial, Update, contacts,
};
use tactile_imaging::sfs::{ControlPointSampler, EquallySpaced, SfsError, Workspace};
use tactile_imaging::simulate::{
    CalibrationOptions, Camera, Elastic, Load, PressOptions, PressScene,
};

/// A press seen by a camera of 348 × 260 pixels: a sixteenth of the default's, to be quick.
fn trial(forces: &[f64], seed: u64) -> Trial {
    let camera = Camera::default().coarser(4);
    let loads = forces.iter().map(|&f| Load::normal(f)).collect();
    Trial::new(
        PressOptions {
            camera,
            loads,
            seed,
            ..PressOptions::default()
        },
        &CalibrationOptions::default(),
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
    let mut press = trial.press(&pipeline).unwrap();
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
fn both_polymers_come_out_within_the_papers_error() {
    for material in [Elastic::CL2000X, Elastic::CL2003X] {
        for seed in 0..4 {
            let mut options = trial(&[0.7, 1.2], seed).scene.options().clone();
            options.object.material = material;
            let trial = Trial::new(options, &CalibrationOptions::default()).unwrap();
            let pipeline = trial.pipeline().unwrap();
            let modulus = trial.press(&pipeline).unwrap().modulus().unwrap();
            let error = modulus.youngs_modulus_pa / material.youngs_modulus_pa - 1.0;
            assert!(
                error.abs() < 0.0538,
                "{material:?}, seed {seed}: error {error}"
            );
        }
    }
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

/// All answers of a press that must not depend on what is skipped.
fn answers(trial: &Trial, pipeline: &Pipeline, twice: bool) -> (Vec<u64>, [usize; 6]) {
    let mut press = pipeline.press(trial.simulation.reference.view()).unwrap();
    for frame in &trial.simulation.frames {
        press.add_frame(frame.view());
        if twice {
            press.add_frame(frame.view());
        }
    }
    let last = press.frames() - 1;
    let mut bits = Vec::new();
    for frame in 0..=last {
        bits.push(
            press
                .contact(frame)
                .unwrap()
                .unwrap()
                .contact_radius_m
                .value
                .to_bits(),
        );
        bits.extend(
            press
                .control_points(frame)
                .unwrap()
                .iter()
                .flat_map(|p| [p.x, p.y, p.z].map(f64::to_bits)),
        );
    }
    bits.extend(
        press
            .strain(last)
            .unwrap()
            .summary
            .mean
            .iter()
            .map(|v| v.to_bits()),
    );
    bits.push(press.modulus().unwrap().youngs_modulus_pa.to_bits());
    let work = runs(&press);
    (bits, work)
}

#[test]
fn equal_frames_are_measured_once_with_the_same_bits() {
    let trial = trial(&[0.7, 1.2], 2);
    let with = trial.pipeline().unwrap();
    let skips = Skips {
        equal_frames: false,
        ..Skips::default()
    };
    let without = trial.pipeline().unwrap().with_skips(skips);
    let (a, few) = answers(&trial, &with, true);
    let (b, many) = answers(&trial, &without, true);
    assert_eq!(a, b);
    assert_eq!((few[0], many[0]), (2, 4));
    assert_eq!((few[1], many[1]), (2, 4));
}

#[test]
fn surfaces_of_the_box_alone_equal_those_of_the_whole_frame() {
    let trial = trial(&[0.7, 1.2], 3);
    let inside = trial.pipeline().unwrap();
    let skips = Skips {
        outside_contact: false,
        ..Skips::default()
    };
    let whole = trial.pipeline().unwrap().with_skips(skips);
    let (mut a, mut b) = (trial.press(&inside).unwrap(), trial.press(&whole).unwrap());
    let (a, b) = (a.surface(0).unwrap(), b.surface(0).unwrap());
    assert!(
        a.surface.heights.len() < b.surface.heights.len() / 2,
        "the box is smaller"
    );
    for ((row, column), h) in a.surface.heights.indexed_iter() {
        if a.surface.mask[[row, column]] {
            let other =
                b.surface.heights[[a.region.row_start + row, a.region.column_start + column]];
            // Sweeps run in another order over another box: rounding alone may differ.
            assert!((h - other).abs() < 1e-9, "{h} against {other}");
        }
    }
}

/// A user's sampler: half as many points.
struct Half;

impl ControlPointSampler<f64> for Half {
    fn sample_with(
        &self,
        workspace: &mut Workspace<f64>,
        surface: ArrayView2<'_, f64>,
        mask: Option<ArrayView2<'_, bool>>,
        pixel_size_m: [f64; 2],
        count: usize,
        points: &mut Vec<Point3<f64>>,
    ) -> Result<(), SfsError> {
        EquallySpaced.sample_with(workspace, surface, mask, pixel_size_m, count / 2, points)
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
    let mut press = trial.press(&pipeline).unwrap();
    assert_eq!(press.control_points(0).unwrap().len(), 100);
    assert!(press.strain(1).unwrap().measure.contains("Hencky"));
}

#[test]
fn swapped_loads_give_the_same_modulus() {
    let (up, down) = (trial(&[0.7, 1.2], 5), trial(&[1.2, 0.7], 5));
    let modulus = |t: &Trial| {
        let pipeline = t.pipeline().unwrap();
        t.press(&pipeline).unwrap().modulus().unwrap()
    };
    let (a, b) = (modulus(&up), modulus(&down));
    // Other noise in each frame: six standard errors.
    let apart = (a.youngs_modulus_pa - b.youngs_modulus_pa).abs();
    assert!(
        apart < 6.0 * a.standard_error_pa.hypot(b.standard_error_pa),
        "{apart}"
    );
}

#[test]
fn a_flat_field_makes_the_force_the_same_in_a_corner() {
    let mut options = trial(&[0.5], 11).scene.options().clone();
    options.centre_px = Some([50.0, 45.0]);
    options.camera.vignetting = 0.15;
    let corner = Trial::new(options.clone(), &CalibrationOptions::default()).unwrap();
    let scene = PressScene::new(PressOptions {
        centre_px: None,
        ..options
    })
    .unwrap();
    // The sensor is calibrated in the frame's middle.
    let series = scene.calibrate(&CalibrationOptions::default()).unwrap();
    let pairs: Vec<_> = series
        .pairs()
        .map(|(sum, force)| CalibrationPair::loading(sum, force))
        .collect();
    let error = |flat: bool| {
        let pipeline =
            Pipeline::from_pairs(&pairs, corner.simulation.pixel_size_m, Object::sphere(3e-3));
        let pipeline = pipeline.unwrap().with_flat_field(flat);
        let mut press = corner.press(&pipeline).unwrap();
        press.contact(0).unwrap().unwrap().force_n.unwrap().value / 0.5 - 1.0
    };
    // The corner loses a tenth; what is left is noise (0.3 %) and the calibration (0.3 %).
    assert!(error(false) < -0.05, "{}", error(false));
    assert!(error(true).abs() < 0.02, "{}", error(true));
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

#[test]
fn everything_can_cross_threads() {
    fn crosses<T: Send + Sync>() {}
    crosses::<tactile_imaging::Pipeline>();
    crosses::<Session>();
    crosses::<PipelineError>();
    crosses::<tactile_imaging::pipeline::Measurement>();
    crosses::<Press<'_>>();
    crosses::<Update>();
    crosses::<Report>();
    crosses::<ImageFolder>();
    crosses::<tactile_imaging::simulate::FrameStream>();
}

/// The sentence of a result; it must be writable as JSON.
fn told<T: std::fmt::Display + serde::Serialize>(result: &T) -> String {
    assert!(!serde_json::to_value(result).unwrap().is_null());
    result.to_string()
}

#[test]
fn every_result_can_be_read_by_people_and_programs() {
    let trial = trial(&[0.7, 1.2], 6);
    let pipeline = trial.pipeline().unwrap();
    let mut session = Session::new(&pipeline, trial.simulation.reference.view()).unwrap();
    let empty = trial.scene.reference(3);
    assert_eq!(
        told(&session.push(empty.view()).unwrap()),
        "frame 1: no contact"
    );
    assert!(
        told(&session.drift()).ends_with("1 frame without contact"),
        "{}",
        session.drift()
    );
    let update = session.push(trial.simulation.frames[0].view()).unwrap();
    let line = told(&update);
    assert!(
        line.starts_with("frame 2: force 0.") && line.contains(" ± "),
        "{line}"
    );
    assert!(told(&update.contact.unwrap()).contains(" mm   centroid ("));
    let mut press = trial.press(&pipeline).unwrap();
    let measured = press.measure();
    assert!(told(&measured).contains("cautions:"));
    assert!(told(measured.youngs_modulus_pa.as_ref().unwrap()).contains(" kPa"));
    assert!(told(measured.frames[0].as_ref().unwrap()).contains("contact radius"));
    assert!(told(measured.matching.as_ref().unwrap()).contains("control points matched"));
    assert!(told(measured.strain.as_ref().unwrap()).contains("e_zz"));
    assert!(measured.flags.iter().all(|flag| !told(flag).is_empty()));
    assert!(told(press.report()).contains("surface"));
    assert!(
        press
            .report()
            .skips
            .iter()
            .all(|skip| told(skip).ends_with("saved)"))
    );
    let ball = BallFit {
        radius_m: 3e-3,
        centre_m: [1e-3, 2e-3],
        contact_radius_m: 1.5e-3,
        mean_absolute_error_m: 28e-6,
        pixels: 900,
        iterations: 4,
    };
    assert!(
        told(&ball).starts_with("ball of radius 3.000 mm at (1.000, 2.000) mm"),
        "{ball}"
    );
    let truth = trial.truth();
    assert!(
        told(&truth).contains("103.0000 kPa")
            && told(&truth.frames[1]).starts_with("force 1.2000 N")
    );
}

#[test]
fn a_batch_reads_as_frames_one_by_one() {
    let trial = trial(&[0.2, 0.7, 1.2], 8);
    let pipeline = trial.pipeline().unwrap();
    let views: Vec<_> = trial.simulation.frames.iter().map(|f| f.view()).collect();
    let batch = contacts(&pipeline, trial.simulation.reference.view(), &views).unwrap();
    let mut press = trial.press(&pipeline).unwrap();
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
