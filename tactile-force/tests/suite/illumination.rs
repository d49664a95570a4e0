//! Drift of the illumination, estimated in each frame outside the contact and divided out.

use tactile_force::{Branch, DriftCorrection, DriftOutcome, ReferenceFrame};

use crate::simulated::{Sensor, contact_radius, measure};

const CENTRE: [f64; 2] = [121.3, 97.6];

#[test]
fn five_percent_from_frame_to_frame_are_divided_out() {
    let sensor = Sensor {
        q: 1.1,
        ..Sensor::default()
    };
    let reference = sensor.reference();
    let curve = sensor.curve(&reference, 1);
    let (mut inside, mut count) = (0, 0);
    for (k, illumination) in [0.95, 0.97, 1.0, 1.02, 1.05].into_iter().enumerate() {
        let lit = Sensor {
            illumination,
            ..sensor
        };
        for (j, force) in [0.1, 0.2, 0.4].into_iter().enumerate() {
            let seed = (10 * k + j) as u64;
            let frame = lit.frame(force, 2.5e-3, CENTRE, Branch::Loading, seed);
            let found = measure(&frame, &reference, &curve, DriftCorrection::Automatic);
            assert_eq!(found.drift.outcome, DriftOutcome::Corrected);
            let level = (found.drift.coefficients[0], found.drift.standard_error);
            inside += usize::from((level.0 - illumination).abs() < 2.0 * level.1);
            count += 1;
            let error = found.force_n.value / force - 1.0;
            let radius =
                found.contact_radius_m.unwrap().value / contact_radius(force, 2.5e-3) - 1.0;
            assert!(
                error.abs() < 0.005 && radius.abs() < 0.002,
                "{illumination} {force}: {error} {radius}"
            );
            if illumination == 1.05 {
                let plain = measure(&frame, &reference, &curve, DriftCorrection::None);
                assert!((plain.force_n.value / force - 1.0).abs() > 0.04);
            }
        }
    }
    // Two standard errors. The error of the reference is common to all frames.
    assert!(inside * 10 >= count * 8, "{inside} of {count}");
}

#[test]
fn what_cannot_be_told_is_said_and_left_alone() {
    // A background of a quarter of a grey level, which disappears in integer grey levels.
    let dark = Sensor {
        background: 0.25,
        vignetting: 0.0,
        ..Sensor::default()
    };
    let at_rest = dark.frame(0.0, 1.0, [0.0; 2], Branch::Loading, 1);
    let reference = ReferenceFrame::new(at_rest.view()).unwrap();
    let bright = Sensor::default();
    let curve = bright.curve(&bright.reference(), 2);
    let frame = dark.frame(0.2, 2.5e-3, CENTRE, Branch::Loading, 5);
    let found = measure(&frame, &reference, &curve, DriftCorrection::Automatic);
    assert!(
        matches!(found.drift.outcome, DriftOutcome::TooDark { .. }),
        "{:?}",
        found.drift
    );
    let plain = measure(&frame, &reference, &curve, DriftCorrection::None);
    assert_eq!(found.force_n, plain.force_n);
    assert_eq!(plain.drift.outcome, DriftOutcome::NotRequested);
    // A contact of 85 pixels' radius covers most of the frame.
    let reference = bright.reference();
    let frame = bright.frame(0.25, 45e-3, CENTRE, Branch::Loading, 6);
    let found = measure(&frame, &reference, &curve, DriftCorrection::Automatic);
    assert!(
        matches!(
            found.drift.outcome,
            DriftOutcome::TooLittleBackground { .. }
        ),
        "{:?}",
        found.drift
    );
}

/// Stray light over an illuminated background and over a uniform one, in grey levels.
#[test]
fn stray_light_is_taken_off_or_held_by_the_error() {
    for vignetting in [Sensor::default().vignetting, 0.0] {
        let sensor = Sensor {
            vignetting,
            ..Sensor::default()
        };
        let reference = sensor.reference();
        let curve = sensor.curve(&reference, 1);
        for stray in [-8_i16, 6, 12] {
            let frame = sensor.frame(0.3, 2.5e-3, CENTRE, Branch::Loading, 7);
            let frame = frame.mapv(|grey| (i16::from(grey) + stray).clamp(0, 255) as u8);
            let found = measure(&frame, &reference, &curve, DriftCorrection::Automatic);
            let force = found.force_n.total();
            let off = (force.value - 0.3).abs();
            assert!(
                off < 2.0 * force.standard_error + 0.002,
                "{vignetting} {stray}: {force:?}"
            );
            if vignetting > 0.0 {
                assert!(off < 0.01 * 0.3, "{stray}: {force:?}");
                assert!((found.drift.stray_grey - f64::from(stray)).abs() < 0.3);
            }
        }
    }
}

/// The mean of several frames in 8 bits has less noise than a frame: an untouched sensor must not
/// show a contact. Nor must rows that differ by more than their pixels.
#[test]
fn an_untouched_sensor_shows_no_contact_beside_a_smooth_reference() {
    use rand::{SeedableRng, rngs::ChaCha8Rng};
    use rand_distr::{Distribution, StandardNormal};
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let smooth = ndarray::Array2::from_elem((240, 320), 30_u8);
    for row_noise in [0.0, 0.3] {
        for _ in 0..20 {
            let mut frame = ndarray::Array2::zeros((240, 320));
            for mut row in frame.rows_mut() {
                let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
                let level = 30.0 + row_noise * normal();
                row.mapv_inplace(|_: u8| (level + 0.5 * normal()).round() as u8);
            }
            let pairs =
                [0.0, 1.0, 2.0].map(|n| tactile_force::CalibrationPair::loading(1e5 * n, n));
            let line = tactile_force::LinearCalibration::fit(&pairs).unwrap();
            let (frame, options) = (frame.view(), Default::default());
            let found =
                tactile_force::measure_force(frame, smooth.view(), [50e-6; 2], &line, &options);
            let found = found.unwrap();
            assert!(found.contact.is_none(), "{row_noise}: {:?}", found.contact);
        }
    }
}

/// A Hertz contact of 100 grey levels and this radius in pixels on a background of 20, with the noise
/// of a camera.
fn hertz(size: usize, radius_px: f64, seed: u64) -> ndarray::Array2<u8> {
    use rand::{SeedableRng, rngs::ChaCha8Rng};
    use rand_distr::{Distribution, StandardNormal};
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let middle = 0.5 * (size as f64 - 1.0);
    ndarray::Array2::from_shape_fn((size, size), |(y, x)| {
        let share = ((y as f64 - middle).powi(2) + (x as f64 - middle).powi(2)) / radius_px.powi(2);
        let noise: f64 = StandardNormal.sample(&mut rng);
        (20.0 + 0.5 * noise + 100.0 * (1.0 - share).max(0.0).sqrt()).round() as u8
    })
}

fn sum_of(frame: &ndarray::Array2<u8>, reference: &ndarray::Array2<u8>) -> tactile_force::Contact {
    let reference = ReferenceFrame::new(reference.view()).unwrap();
    let meter = tactile_force::ForceMeter::new([50e-6; 2], &Default::default()).unwrap();
    let found = meter.detect_with(&mut Default::default(), frame.view(), &reference);
    found.unwrap().expect("a contact")
}

/// The rim of a contact on half of a small frame was taken for brighter lamps, 1.3 % of the force.
#[test]
fn a_contact_on_half_of_a_small_frame_is_no_drift() {
    for radius_px in [10.0, 16.0, 20.0, 22.0, 24.0] {
        let contact = sum_of(&hertz(72, radius_px, 1), &hertz(72, 0.0, 2));
        let volume = 100.0 * 2.0 / 3.0 * std::f64::consts::PI * radius_px.powi(2);
        let off = contact.integrated_pixel_value.value / volume - 1.0;
        // Noise of the background under the contact, 1/√(free pixels), is 0.4 % of the smallest.
        assert!(off.abs() < 6e-3, "{radius_px}: {off}");
    }
}

#[test]
fn hot_and_dead_pixels_take_the_light_of_their_neighbours() {
    let (mut frame, mut reference) = (hertz(120, 30.0, 3), hertz(120, 0.0, 4));
    let whole = sum_of(&frame, &reference);
    for (k, level) in [(50, 255), (55, 255), (56, 255), (66, 0)] {
        frame[(60, k)] = level;
        reference[(60, k)] = level;
    }
    let found = sum_of(&frame, &reference);
    assert_eq!(found.saturated_px, 0);
    let values = [found, whole].map(|contact| contact.integrated_pixel_value.value);
    // Four pixels of 90 grey levels would be missing, 0.2 %. Their neighbours deviate by noise.
    assert!((values[0] / values[1] - 1.0).abs() < 2e-4, "{values:?}");
}
