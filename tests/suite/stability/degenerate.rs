//! Degenerate frames.
use crate::sound;
use ndarray::Array2;
use tactile_imaging::Pipeline;
use tactile_imaging::force::CalibrationPair;
use tactile_imaging::pipeline::{EstimatorChoice, Object, StagesConfig};

/// Hertz's hemisphere with this radius in pixels and peak in grey levels, in the middle of a frame
/// with a background of 15.
fn dome((rows, columns): (usize, usize), radius: f64, peak: f64) -> Array2<u8> {
    let middle = [(rows as f64 - 1.0) / 2.0, (columns as f64 - 1.0) / 2.0];
    Array2::from_shape_fn((rows, columns), |(r, c)| {
        let d = ((r as f64 - middle[0]).hypot(c as f64 - middle[1]) / radius).min(1.0);
        // `as` saturates at 255.
        (15.0 + peak * (1.0 - d * d).sqrt()).round() as u8
    })
}

const SHAPE: (usize, usize) = (48, 64);

/// Only these pixels, counted from the middle, are bright.
fn pixels(bright: &[(isize, isize)]) -> Array2<u8> {
    let mut frame = Array2::from_elem(SHAPE, 15);
    for (r, c) in bright {
        let at = |n: usize, by: isize| (n / 2).saturating_add_signed(by);
        frame[[at(SHAPE.0, *r), at(SHAPE.1, *c)]] = 215;
    }
    frame
}

/// Reference and two frames.
type Case = (String, [Array2<u8>; 3]);

fn frames_of_every_kind() -> Vec<Case> {
    let even = |grey: u8| Array2::from_elem(SHAPE, grey);
    let sound = dome(SHAPE, 12.0, 150.0);
    let white = sound.mapv(|v| if v > 15 { 255 } else { 15 });
    let five = [(0, 0), (0, 1), (0, -1), (1, 0), (-1, 0)];
    let stripes = Array2::from_shape_fn(SHAPE, |(_, c)| if c % 2 == 0 { 15 } else { 200 });
    let board = Array2::from_shape_fn(SHAPE, |(r, c)| if (r + c) % 2 == 0 { 0 } else { 255 });
    let frames = [
        ("all black", even(0)),
        ("all white", even(255)),
        ("constant", even(15)),
        ("a level above the reference", even(16)),
        ("brighter all over", even(115)),
        ("saturated contact", dome(SHAPE, 12.0, 900.0)),
        ("a contact of white alone", white),
        ("one bright pixel", pixels(&[(0, 0)])),
        ("one bright pixel in the corner", pixels(&[(-24, -32)])),
        ("a contact of five pixels", pixels(&five)),
        (
            "five pixels in a row",
            pixels(&[-2, -1, 0, 1, 2].map(|c| (0, c))),
        ),
        ("a contact as large as the frame", dome(SHAPE, 45.0, 150.0)),
        ("a contact larger than the frame", dome(SHAPE, 400.0, 150.0)),
        ("stripes", stripes),
        ("a board of black and white", board),
        ("a sound contact", sound.clone()),
    ];
    let mut cases = Vec::new();
    for grey in [15, 0, 255] {
        for (what, frame) in &frames {
            let name = |order: &str| format!("{what}, {order}, on a reference of {grey}");
            let [r, f, s] = [&even(grey), frame, &sound].map(Array2::clone);
            cases.push((name("twice"), [r.clone(), f.clone(), f.clone()]));
            cases.push((name("first"), [r.clone(), f.clone(), s.clone()]));
            cases.push((name("last"), [r, s, f]));
        }
    }
    cases
}

fn frames_of_every_size() -> Vec<Case> {
    let mut cases = Vec::new();
    let sides = [1, 2, 3, 5, 8].map(|n| (n, n));
    for shape in sides.into_iter().chain([(1, 1000), (1000, 1), (2, 500)]) {
        let flat = |grey: u8| Array2::from_elem(shape, grey);
        let small = dome(shape, 2.0, 150.0);
        let wide = dome(shape, 30.0, 200.0);
        for (what, frames) in [
            ("black and white", [flat(0), flat(255), flat(255)]),
            ("white and black", [flat(255), flat(0), flat(0)]),
            ("constant", [flat(15), flat(15), flat(15)]),
            ("a small contact", [flat(15), small.clone(), wide.clone()]),
            ("a wide contact", [flat(15), wide, small]),
        ] {
            cases.push((format!("{what}, {} × {}", shape.0, shape.1), frames));
        }
    }
    cases
}

fn pipelines() -> Vec<Pipeline> {
    let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
    let punch = Object::FlatPunch {
        radius_m: 2e-3,
        poisson_ratio: 0.5,
    };
    let unknown = Object::Unknown {
        poisson_ratio: 0.45,
    };
    let objects = [
        (Object::sphere(3e-3), EstimatorChoice::Best),
        (Object::sphere(3e-3), EstimatorChoice::PaperRatio),
        (punch, EstimatorChoice::FlatPunch),
        (unknown, EstimatorChoice::Best),
    ];
    let made = objects.map(|(object, estimator)| {
        let pipeline = Pipeline::from_pairs(&pairs, [50e-6; 2], object).unwrap();
        let config = StagesConfig {
            estimator,
            ..StagesConfig::default()
        };
        pipeline
            .with_stages(&config)
            .unwrap()
            .with_control_points(24)
    });
    let flat = made[0]
        .clone()
        .with_settings(|settings| settings.flat_field = true)
        .unwrap();
    made.into_iter().chain([flat]).collect()
}

#[test]
fn degenerate_frames_end_civilly() {
    let pipelines = pipelines();
    for (case, images) in frames_of_every_kind().iter().chain(&frames_of_every_size()) {
        let [reference, first, second] = images;
        for (k, pipeline) in pipelines.iter().enumerate() {
            let case = format!("{case}, pipeline {k}");
            if let Ok(mut press) = pipeline.press(reference.view()) {
                press.add_frame(first.view());
                press.add_frame(second.view());
                sound::press(&case, &press);
            }
            sound::stream(&case, pipeline, reference, [first, second]);
        }
    }
}
