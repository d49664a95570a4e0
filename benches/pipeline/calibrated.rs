//! What a calibrated sensor costs a frame: local curve, flat field, lens and drift correction beside a line from sums to force.
use criterion::BenchmarkGroup;
use criterion::measurement::WallTime;
use ndarray::Array2;
use std::hint::black_box;
use std::time::{Duration, Instant};
use tactile_imaging::Pipeline;
use tactile_imaging::force::{
    Branch, CalibrationFrame, GreyHistogram, LensGeometry, PressureCurve,
};
use tactile_imaging::pipeline::{LightContact, Object, Session, Trial};
use tactile_imaging::sensor::Sensor;
use tactile_imaging::simulate::{
    CalibrationOptions, Camera, Load, PressOptions, PressScene, PressSimulation,
};

/// Frames of each pipeline that the ratio of times is taken from, in turns: what slows the machine slows both.
const TURNS: usize = 400;
const BARREL: f64 = 0.03;

/// The default press seen by a camera with barrel distortion, vignetting and pixels higher than wide.
fn options(loads: Vec<Load>) -> PressOptions {
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
    let histogram = GreyHistogram::from_differences(above, camera.pixel_area_m2());
    CalibrationFrame::new(histogram, truth.contact.force_n, Branch::Loading).expect("a contact")
}

/// The stages of a sensor that was calibrated for all that the camera does.
fn sensor(object: Object) -> Pipeline {
    let forces = [0.1, 0.3, 0.5, 0.7, 0.9, 1.1, 1.3];
    let made = PressScene::new(options(forces.map(Load::normal).to_vec()))
        .expect("a scene")
        .simulate();
    let frames: Vec<_> = (0..forces.len()).map(|k| histogram(&made, k)).collect();
    let curve = PressureCurve::fit(&frames, &Default::default()).expect("a curve");
    let camera = options(Vec::new()).camera;
    let [rows, columns] = camera.shape.map(|n| 0.5 * (n as f64 - 1.0));
    let lens = LensGeometry::new(camera.pixel_size_m)
        .and_then(|lens| lens.with_distortion([columns, rows], columns.hypot(rows), [BARREL, 0.0]))
        .expect("a lens");
    let contact = LightContact::new(curve, camera.pixel_size_m, &Sensor::force_options())
        .expect("a stage")
        .with_lens(lens);
    Pipeline::new(contact, object)
        .expect("an object")
        .with_flat_field(true)
}

/// Median time of a frame in a session, in turns with another's.
fn medians(sessions: &mut [Session; 2], frames: &[Array2<u8>]) -> [Duration; 2] {
    let mut times = [Vec::new(), Vec::new()];
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

/// A frame's force with a calibrated sensor and with the short form of calibration, from the same frames in one run.
pub(crate) fn calibrated(group: &mut BenchmarkGroup<'_, WallTime>) {
    let loads = vec![Load::normal(0.7), Load::normal(1.2)];
    let trial = Trial::new(options(loads), &CalibrationOptions::default()).expect("a trial");
    let line = trial.pipeline().expect("a calibrated sensor");
    let curve = sensor(Object::sphere(trial.scene.options().object.radius_m));
    let reference = trial.simulation.reference.view();
    let session = |pipeline: &Pipeline| Session::new(pipeline, reference).expect("a session");
    let frames = &trial.simulation.frames;
    let mut sessions = [session(&line), session(&curve)];
    let [short, full] = medians(&mut sessions, frames);
    println!(
        "force of a frame: {:.3} ms by a line, {:.3} ms by a calibrated sensor: {:.3} of it",
        1e3 * short.as_secs_f64(),
        1e3 * full.as_secs_f64(),
        full.as_secs_f64() / short.as_secs_f64()
    );
    let mut turn = 0;
    for (name, session) in ["line", "calibrated_sensor"].iter().zip(&mut sessions) {
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
