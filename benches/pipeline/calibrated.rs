//! Cost per frame of a calibrated sensor (local curve, flat field, lens and drift correction)
//! compared with a line from sums to force.
use criterion::BenchmarkGroup;
use criterion::measurement::WallTime;
use ndarray::Array2;
use std::hint::black_box;
use std::time::{Duration, Instant};
use tactile_imaging::Pipeline;
use tactile_imaging::force::{
    Branch, CalibrationFrame, ContactOptions, DriftCorrection, ForceOptions, GreyHistogram,
    LensGeometry, PressureCurve,
};
use tactile_imaging::pipeline::{LightContact, Object, Session};
use tactile_simulate::Trial;
use tactile_simulate::{
    CalibrationRun, Camera, Gain, PressLoad, PressOptions, PressScene, PressSimulation,
};

/// Number of frames of each pipeline for the ratio of times. The pipelines alternate, so that a
/// slow machine affects both.
const TURNS: usize = 400;
const BARREL: f64 = 0.03;

/// The default press with a camera that has barrel distortion, vignetting and pixels higher than
/// wide.
fn options(loads: Vec<PressLoad>) -> PressOptions {
    let camera = Camera::default();
    let [width_m, height_m] = camera.pixel_size_m;
    PressOptions {
        camera: Camera {
            barrel: BARREL,
            vignetting: 0.05,
            pixel_size_m: [width_m, 1.02 * height_m],
            ..camera
        },
        loads,
        ..PressOptions::default()
    }
}

/// The grey histogram of a contact: the pixels within 1.1 contact radii of its centre.
fn histogram(made: &PressSimulation, load: usize) -> CalibrationFrame {
    let (truth, camera) = (&made.truth[load], options(Vec::new()).camera);
    let [width_m, height_m] = camera.pixel_size_m;
    let reach_m = 1.1 * truth.contact.contact_radius_m;
    let [x, y] = truth.centroid_px;
    let inside = |(row, column): (usize, usize)| {
        ((column as f64 - x) * width_m).hypot((row as f64 - y) * height_m) < reach_m
    };
    let frame = &made.frames[load];
    let pixels = frame.indexed_iter().filter(|(at, _)| inside(*at));
    let above = pixels.map(|(at, grey)| f32::from(*grey) - f32::from(made.reference[at]));
    let histogram =
        GreyHistogram::from_differences(above, camera.pixel_size_m.iter().product::<f64>());
    CalibrationFrame::new(histogram, truth.contact.force_n, Branch::Loading).expect("a contact")
}

/// The stages of a sensor calibrated for all effects of the camera, without and with the correction
/// of changed lamps, which is the setting of a sensor file.
fn sensor(trial: &Trial) -> [Pipeline; 2] {
    let forces = [0.1, 0.3, 0.5, 0.7, 0.9, 1.1, 1.3];
    let made = PressScene::new(PressOptions {
        gain: Gain::GreyPerPascal(trial.scene.truth(0).grey_per_pascal),
        ..options(forces.map(PressLoad::normal).to_vec())
    });
    let made = made.expect("a scene").simulate();
    let frames: Vec<_> = (0..forces.len()).map(|k| histogram(&made, k)).collect();
    let curve = PressureCurve::fit(&frames, &Default::default()).expect("a curve");
    let camera = options(Vec::new()).camera;
    let [rows, columns] = camera.shape.map(|n| 0.5 * (n as f64 - 1.0));
    let lens = LensGeometry::new(camera.pixel_size_m)
        .and_then(|lens| lens.with_distortion([columns, rows], columns.hypot(rows), [BARREL, 0.0]))
        .expect("a lens");
    let drift = ContactOptions::default().with_drift(DriftCorrection::Automatic);
    let corrected = ForceOptions::default().with_contact(drift);
    [ForceOptions::default(), corrected].map(|options| {
        let contact = LightContact::new(curve.clone(), camera.pixel_size_m, &options);
        let contact = contact.expect("a stage").with_lens(lens);
        let object = Object::sphere(trial.scene.options().object.radius_m);
        let pipeline = Pipeline::new(contact, object).expect("an object");
        let pipeline = pipeline.with_settings(|settings| settings.flat_field = true);
        pipeline.expect("a valid setting")
    })
}

/// Median times of a frame in alternating sessions.
fn medians(sessions: &mut [Session; 3], frames: &[Array2<u8>]) -> [Duration; 3] {
    let mut times = [const { Vec::new() }; 3];
    for turn in 0..TURNS {
        let frame = &frames[turn % frames.len()];
        for (session, times) in sessions.iter_mut().zip(&mut times) {
            let start = Instant::now();
            black_box(session.push(black_box(frame).view()).expect("a contact"));
            times.push(start.elapsed());
        }
    }
    times.map(|mut times| {
        times.sort();
        times[times.len() / 2]
    })
}

/// The force of a frame with a calibrated sensor and with the short form of calibration, from the
/// same frames in one run.
pub(crate) fn calibrated(group: &mut BenchmarkGroup<'_, WallTime>) {
    let loads = vec![PressLoad::normal(0.7), PressLoad::normal(1.2)];
    let trial = Trial::new(options(loads), &CalibrationRun::default()).expect("a trial");
    let line = trial.pipeline().expect("a calibrated sensor");
    let [steady, corrected] = sensor(&trial);
    let reference = trial.simulation.reference.view();
    let session = |pipeline: &Pipeline| Session::new(pipeline, &[reference]).expect("a session");
    let frames = &trial.simulation.frames;
    let mut sessions = [&line, &steady, &corrected].map(session);
    let names = ["line", "calibrated", "calibrated_drift"];
    let times = medians(&mut sessions, frames).map(|time| 1e3 * time.as_secs_f64());
    let truth_n = trial.simulation.truth[1].contact.force_n;
    for ((name, time), session) in names.iter().zip(times).zip(&mut sessions) {
        // The last iteration measured the frame of the larger load.
        let reading = session.push(frames[1].view()).expect("a frame").contact;
        let error = reading.expect("a contact").force_n.expect("a force").value / truth_n - 1.0;
        // The contact is in the middle of the frame, where lens and light of the calibration apply
        // to the press.
        assert!(error.abs() < 0.01, "{name}: force off by {error}");
        let ratio = time / times[0];
        println!(
            "force_of_a_frame/{name}: {time:.3} ms, {ratio:.2} of a line's; force off by {:+.2} %",
            100.0 * error
        );
    }
    let mut turn = 0;
    for (name, session) in names.iter().zip(&mut sessions) {
        group.bench_function(format!("force_of_a_frame/{name}"), |b| {
            b.iter(|| {
                turn += 1;
                session
                    .push(black_box(&frames[turn % 2]).view())
                    .expect("a contact")
            });
        });
    }
}
