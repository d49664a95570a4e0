//! Frames that are hardly frames: a typed error, or an answer that is finite or flagged; never a
//! panic.
use ndarray::Array2;
use tactile_imaging::Pipeline;
use tactile_imaging::force::CalibrationPair;
use tactile_imaging::pipeline::{
    ContactReading, EstimatorChoice, Measurement, Object, PipelineError, Press, Session,
    SessionStrain, StagesConfig,
};

/// Hertz's hemisphere of this radius in pixels and peak in grey levels, in the middle of a frame
/// over a background of 15.
fn dome((rows, columns): (usize, usize), radius: f64, peak: f64) -> Array2<u8> {
    let middle = [(rows as f64 - 1.0) / 2.0, (columns as f64 - 1.0) / 2.0];
    Array2::from_shape_fn((rows, columns), |(r, c)| {
        let d = ((r as f64 - middle[0]).hypot(c as f64 - middle[1]) / radius).min(1.0);
        // `as` saturates at 255.
        (15.0 + peak * (1.0 - d * d).sqrt()).round() as u8
    })
}

/// Only these pixels, counted from the middle, are bright.
fn pixels(shape: (usize, usize), bright: &[(isize, isize)]) -> Array2<u8> {
    let mut frame = Array2::from_elem(shape, 15);
    for (r, c) in bright {
        let at = |n: usize, by: isize| (n / 2).saturating_add_signed(by);
        frame[[at(shape.0, *r), at(shape.1, *c)]] = 215;
    }
    frame
}

const SHAPE: (usize, usize) = (48, 64);

/// Reference and two frames.
type Case = (String, [Array2<u8>; 3]);

fn frames_of_every_kind() -> Vec<Case> {
    let even = |grey: u8| Array2::from_elem(SHAPE, grey);
    let sound = dome(SHAPE, 12.0, 150.0);
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
        (
            "a contact of white alone",
            sound.mapv(|v| if v > 15 { 255 } else { 15 }),
        ),
        ("one bright pixel", pixels(SHAPE, &[(0, 0)])),
        (
            "one bright pixel in the corner",
            pixels(SHAPE, &[(-24, -32)]),
        ),
        ("a contact of five pixels", pixels(SHAPE, &five)),
        (
            "five pixels in a row",
            pixels(SHAPE, &[(0, -2), (0, -1), (0, 0), (0, 1), (0, 2)]),
        ),
        ("a contact as large as the frame", dome(SHAPE, 45.0, 150.0)),
        ("a contact larger than the frame", dome(SHAPE, 400.0, 150.0)),
        ("stripes", stripes),
        ("a board of black and white", board),
        ("a sound contact", sound.clone()),
    ];
    let references = [
        ("constant", even(15)),
        ("black", even(0)),
        ("white", even(255)),
    ];
    let mut cases = Vec::new();
    for (on, reference) in &references {
        for (what, frame) in &frames {
            let name = |order: &str| format!("{what}, {order}, on a {on} reference");
            let [r, f, s] = [reference, frame, &sound].map(Array2::clone);
            cases.push((name("twice"), [r.clone(), f.clone(), f.clone()]));
            cases.push((name("first"), [r.clone(), f.clone(), s.clone()]));
            cases.push((name("last"), [r, s, f]));
        }
    }
    cases
}

fn frames_of_every_size() -> Vec<Case> {
    let mut cases = Vec::new();
    for shape in [
        (1, 1),
        (2, 2),
        (3, 3),
        (1, 1000),
        (1000, 1),
        (2, 500),
        (5, 5),
        (8, 8),
    ] {
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
    let objects = [
        (Object::sphere(3e-3), EstimatorChoice::Best),
        (Object::sphere(3e-3), EstimatorChoice::PaperRatio),
        (
            Object::FlatPunch {
                radius_m: 2e-3,
                poisson_ratio: 0.5,
            },
            EstimatorChoice::FlatPunch,
        ),
        (
            Object::Unknown {
                poisson_ratio: 0.45,
            },
            EstimatorChoice::Best,
        ),
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

fn all_finite<'a>(numbers: impl IntoIterator<Item = &'a f64>) -> bool {
    numbers.into_iter().all(|v| v.is_finite())
}

fn is_sound(contact: &ContactReading) -> bool {
    let [x, y] = contact.centroid_px;
    let estimates = [contact.contact_radius_m, x, y]
        .into_iter()
        .chain(contact.force_n);
    let mut numbers = vec![contact.area_m2, contact.peak_grey, contact.saturated_share];
    numbers.extend(estimates.flat_map(|e| [e.value, e.standard_error]));
    all_finite(&numbers) || contact.flags(0).next().is_some()
}

/// Every stage on its own, whatever became of the one before.
fn press_stage_by_stage(
    case: &str,
    pipeline: &Pipeline,
    [reference, first, second]: &[Array2<u8>; 3],
) {
    let Ok(mut press) = pipeline.press(reference.view()) else {
        return;
    };
    press.add_frame(first.view());
    press.add_frame(second.view());
    (0..2).for_each(|frame| stages_are_sound(case, &mut press, frame));
    for estimate in press
        .modulus()
        .into_iter()
        .chain(press.estimates().into_iter().flatten())
    {
        let finite = all_finite(&[estimate.youngs_modulus_pa, estimate.standard_error_pa]);
        assert!(
            finite || !estimate.warnings.is_empty(),
            "{case}: {estimate:?}"
        );
    }
    measured_is_sound(case, &press.measure());
}

fn stages_are_sound(case: &str, press: &mut Press<'_>, frame: usize) {
    if let Ok(Some(contact)) = press.contact(frame) {
        assert!(is_sound(contact), "{case}: {contact:?}");
    }
    if let Ok(surface) = press.surface(frame) {
        let heights = surface.surface.heights.iter().zip(&surface.surface.mask);
        assert!(
            heights
                .into_iter()
                .all(|(h, inside)| !inside || h.is_finite()),
            "{case}"
        );
    }
    if let Ok(points) = press.control_points(frame) {
        assert!(points.iter().all(|p| all_finite(p.iter())), "{case}");
    }
    if let Ok(matching) = press.matching(frame) {
        assert!(all_finite(&matching.confidence), "{case}");
        assert!(
            matching.warped.iter().all(|p| all_finite(p.iter())),
            "{case}"
        );
    }
    if let Ok(strain) = press.strain(frame) {
        let summary = &strain.summary;
        assert!(
            all_finite(summary.mean.iter().chain(&summary.standard_error)),
            "{case}: {summary:?}"
        );
    }
}

fn measured_is_sound(case: &str, measured: &Measurement) {
    let mut numbers = Vec::new();
    match &measured.youngs_modulus_pa {
        Ok(modulus) => {
            numbers.extend([modulus.value, modulus.standard_error, modulus.interval_95.0]);
        }
        Err(error) => assert!(!error.to_string().is_empty(), "{case}"),
    }
    for frame in measured.frames.iter().flatten() {
        numbers.extend(frame.force_n.iter().map(|force| force.value));
        numbers.extend([frame.contact_radius_m.value, frame.contact_area_m2]);
        let centroid = frame.centroid_px.map(|c| [c.value, c.standard_error]);
        numbers.extend(centroid.as_flattened());
        numbers.extend(frame.surface_height_m.iter().map(|height| height.value));
    }
    if let Ok(strain) = &measured.strain {
        numbers.extend(
            strain
                .mean
                .iter()
                .chain(&strain.standard_error)
                .chain(&strain.spread)
                .flatten(),
        );
    }
    if let Ok(matching) = &measured.matching {
        numbers.extend([
            matching.mean_confidence,
            matching.residual_m,
            matching.mean_displacement_m,
        ]);
    }
    assert!(
        all_finite(&numbers) || !measured.flags.is_empty(),
        "{case}: {measured:?}"
    );
}

/// A stream of the same frames, twice, in which no error may stick: a sound frame pushed after an
/// error is measured as ever.
fn stream(case: &str, pipeline: &Pipeline, [reference, first, second]: &[Array2<u8>; 3]) {
    let Ok(mut session) = Session::new(pipeline, &[reference.view()]) else {
        return;
    };
    let finite = |s: &SessionStrain| {
        all_finite(
            s.strain
                .summary
                .mean
                .iter()
                .chain(&s.strain.summary.standard_error),
        )
    };
    for frame in [first, second, first, second] {
        let Ok(update) = session.push(frame.view()) else {
            continue;
        };
        assert!(
            update.contact.is_none_or(|contact| is_sound(&contact)),
            "{case}: {update:?}"
        );
        match session.strain() {
            Ok(strain) => assert!(strain.is_none_or(finite), "{case}"),
            Err(error) => assert!(
                update.contact.is_some() || matches!(error, PipelineError::NoContact { .. }),
                "{case}: {error}"
            ),
        }
        if let Ok(modulus) = session.modulus() {
            let sound = all_finite(&[modulus.youngs_modulus_pa, modulus.standard_error_pa]);
            assert!(sound || !modulus.warnings.is_empty(), "{case}: {modulus:?}");
        }
    }
    let drift = session.drift();
    assert!(
        drift.last_grey.is_finite() && drift.greatest_grey.is_finite(),
        "{case}: {drift:?}"
    );
}

#[test]
fn degenerate_frames_end_civilly() {
    let pipelines = pipelines();
    for (case, images) in frames_of_every_kind().iter().chain(&frames_of_every_size()) {
        for (k, pipeline) in pipelines.iter().enumerate() {
            let case = format!("{case}, pipeline {k}");
            press_stage_by_stage(&case, pipeline, images);
            stream(&case, pipeline, images);
        }
    }
}
