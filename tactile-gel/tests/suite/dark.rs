//! A gel that darkens, calibrated and read against rendered faces of known depth.

use ndarray::{Array2, Array3};
use tactile_gel::{BallPress, DarkModel, FrameDoubt, GelError, GelSensor};

const PIXEL_M: f64 = 5e-5;
const BALL_M: f64 = 4e-3;
const SHAPE: (usize, usize) = (160, 200);

use crate::sensors::random;

/// Depth in metres of a gel under a ball: the ball inside the circle of radius `contact_m`, and a
/// dent that decays over the thickness of the gel outside, with the slope of the ball at the circle.
fn depth_m([x0, y0]: [f64; 2], contact_m: f64) -> Array2<f64> {
    let rim = (BALL_M * BALL_M - contact_m * contact_m).sqrt();
    let slope = contact_m / rim;
    let reach = 0.6e-3;
    Array2::from_shape_fn(SHAPE, |(row, column)| {
        let r = PIXEL_M * (column as f64 - x0).hypot(row as f64 - y0);
        if r < contact_m {
            slope * reach + (BALL_M * BALL_M - r * r).sqrt() - rim
        } else {
            slope * reach * (-(r - contact_m) / reach).exp()
        }
    })
}

/// Grey levels of a frame of noise 0.8 on a reference with uneven light: 90 grey levels per
/// millimetre, bent by a share `bend` per millimetre.
fn frame(depth_m: &Array2<f64>, bend: f64, seed: usize) -> Array2<u8> {
    Array2::from_shape_fn(SHAPE, |at @ (row, column)| {
        let index = seed * SHAPE.0 * SHAPE.1 + row * SHAPE.1 + column;
        // The sum of twelve uniform numbers has the variance 1.
        let noise: f64 = (0..12).map(|k| random(index, k) - 0.5).sum();
        let mm = 1e3 * depth_m[at];
        let light = 170.0 + 20.0 * (column as f64 / 60.0).sin();
        (light - 90.0 * mm * (1.0 - bend * mm) + 0.8 * noise).round() as u8
    })
}

fn reference(seed: usize) -> Array2<u8> {
    frame(&Array2::zeros(SHAPE), 0.0, seed)
}

/// Eight presses at different positions and depths.
fn presses(bend: f64) -> Vec<Array2<u8>> {
    let press = |k: usize| {
        let at = [70.0 + 60.0 * random(k, 20), 60.0 + 40.0 * random(k, 21)];
        frame(&depth_m(at, 1e-3 + 1e-3 * random(k, 22)), bend, 10 + k)
    };
    (0..8).map(press).collect()
}

fn calibrated(bend: f64) -> GelSensor {
    let frames = presses(bend);
    let presses: Vec<_> = frames
        .iter()
        .map(|frame| BallPress::new(frame, BALL_M))
        .collect();
    let (sensor, report) = GelSensor::calibrate(&reference(0), PIXEL_M, &presses).unwrap();
    assert_eq!(report.doubts, []);
    assert!(report.median_angle_deg < 3.0, "{}", report.median_angle_deg);
    sensor
}

#[test]
fn presses_of_balls_calibrate_the_depth() {
    // Linear and bent tables.
    for bend in [0.0, 0.12] {
        let sensor = calibrated(bend);
        let mut outside = 0;
        for k in 0..20 {
            let at = [70.0 + 60.0 * random(k, 30), 60.0 + 40.0 * random(k, 31)];
            let truth = depth_m(at, 1e-3 + 0.7e-3 * random(k, 32));
            let found = sensor.read(&frame(&truth, bend, 50 + k)).unwrap();
            assert!(found.doubts.is_empty(), "{:?}", found.doubts);
            let [contact] = &found.contacts[..] else {
                panic!("{} contacts", found.contacts.len());
            };
            let deepest = truth.iter().copied().fold(0.0, f64::max);
            let depth = contact.depth_below_far_m;
            outside += usize::from(!depth.interval_95().contains(deepest));
            // Two grey levels.
            assert!(
                (depth.value - deepest).abs() < 25e-6,
                "{depth} for {deepest}"
            );
            for (centroid, truth) in contact.centroid_px.iter().zip(at) {
                assert!((centroid.value - truth).abs() < 4.0 * centroid.standard_error);
                assert!(centroid.standard_error < 0.6, "{centroid}");
            }
        }
        // Of 20 intervals of 95 %, four outside have a probability of 2 %.
        assert!(outside < 4, "{outside} of 20 outside, bend {bend}");
    }
}

#[test]
fn frames_that_the_table_does_not_hold_are_named() {
    let sensor = calibrated(0.0);
    let doubts = |frame: &Array2<u8>| sensor.read(frame).unwrap().doubts;
    assert_eq!(doubts(&reference(7)), []);
    assert_eq!(doubts(&Array2::zeros(SHAPE)), [FrameDoubt::Black]);
    assert_eq!(doubts(&Array2::from_elem(SHAPE, 255)), [FrameDoubt::White]);
    let noise = Array2::from_shape_fn(SHAPE, |(r, c)| (255.0 * random(r * 999 + c, 1)) as u8);
    assert_eq!(doubts(&noise), [FrameDoubt::Noise]);
    // A contact that is deeper than every press of the calibration.
    let deep = frame(&depth_m([100.0, 80.0], 2.6e-3), 0.0, 99);
    assert_eq!(doubts(&deep), [FrameDoubt::BeyondTable { contact: 0 }]);
    // Frame and reference exchanged.
    let pressed = frame(&depth_m([100.0, 80.0], 1.5e-3), 0.0, 98);
    let swapped = GelSensor::new(sensor.model().clone(), &pressed).unwrap();
    let found = swapped.read(&reference(7)).unwrap();
    assert_eq!(found.doubts, [FrameDoubt::Brighter]);
    // A frame in colours.
    let colours = Array3::zeros((SHAPE.0, SHAPE.1, 3));
    let error = sensor.read(&colours).unwrap_err();
    assert_eq!(error, GelError::WrongImage { colours: false });
}

/// A change of all levels is subtracted, and each contact of a frame is found.
#[test]
fn light_that_changes_everywhere_is_no_contact() {
    let model = DarkModel::new(1e-4, vec![[0.0, 0.0], [100.0, 1e-3]]);
    let sensor = GelSensor::new(model, &Array2::from_elem((64, 80), 120)).unwrap();
    for step in [-20_i16, -4, 0, 4, 20] {
        let level = |darker: i16| (120 + step - darker) as u8;
        let mut frame = Array2::from_elem((64, 80), level(0));
        assert!(sensor.read(&frame).unwrap().contacts.is_empty(), "{step}");
        for ((row, column), pixel) in frame.indexed_iter_mut() {
            if (20..40).contains(&row) && (30..60).contains(&column) {
                *pixel = level(50);
            }
        }
        let found = sensor.read(&frame).unwrap();
        let depth = found.contacts[0].depth_below_far_m;
        assert!((depth.value - 0.5e-3).abs() < 1e-12, "{step}: {depth}");
    }
}
