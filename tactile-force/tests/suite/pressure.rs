//! The local curve compared with an independent forward model: light proportional to a power of the
//! pressure, vignetting, noise and integer grey levels. The measured scenes have another ball than
//! the calibration.
#![allow(clippy::print_stdout)]

use proptest::prelude::*;
use tactile_force::{
    Branch, CalibrationFrame, DriftCorrection, ForceError, GreyHistogram, LinearCalibration,
    LocalCalibration, PressureCurve, PressureCurveOptions, Source, StressCalibration,
};

use crate::simulated::{AREA_M2, Sensor, contact_radius, measure};

fn sensor(q: f64) -> Sensor {
    Sensor {
        q,
        ..Sensor::default()
    }
}

#[test]
fn force_and_radius_of_another_ball_are_right_whatever_the_power() {
    for q in [0.8, 0.9, 1.0, 1.1, 1.2] {
        let sensor = sensor(q);
        let reference = sensor.reference();
        let (frames, pairs) = sensor.calibration(&reference, 1);
        let curve = PressureCurve::fit(&frames, &PressureCurveOptions::default()).unwrap();
        let sums = LinearCalibration::through_origin(&pairs).unwrap();
        // The local curve, and the frame sums for comparison: worst relative errors of force and
        // radius.
        let (mut local, mut summed) = ([0.0_f64; 2], [0.0_f64; 2]);
        for (k, force) in [0.1, 0.2, 0.3, 0.4].into_iter().enumerate() {
            let frame = sensor.frame(force, 2.5e-3, [121.3, 97.6], Branch::Loading, 77 + k as u64);
            let radius = contact_radius(force, 2.5e-3);
            for (worst, calibration) in [
                (&mut local, &curve as &dyn StressCalibration),
                (&mut summed, &sums),
            ] {
                let m = measure(&frame, &reference, calibration, DriftCorrection::Automatic);
                worst[0] = worst[0].max((m.force_n.value / force - 1.0).abs());
                worst[1] = worst[1].max((m.contact_radius_m.unwrap().value / radius - 1.0).abs());
            }
        }
        println!(
            "q {q}: force {:.4} (sums {:.4}), radius {:.4} (light {:.4})",
            local[0], summed[0], local[1], summed[1]
        );
        // A modulus is proportional to F/a³: 1 % is the allowance for the sum of both errors.
        assert!(local[0] < 0.01 && local[1] < 0.004, "q {q}: {local:?}");
        if (q - 1.0_f64).abs() > 0.15 {
            assert!(
                summed[0] > 2.0 * local[0] && summed[1] > 2.0 * local[1],
                "q {q}: {summed:?} {local:?}"
            );
        }
    }
}

#[test]
fn stated_errors_cover_the_truth() {
    let sensor = sensor(0.9);
    let reference = sensor.reference();
    let frames: Vec<_> = (0..4)
        .map(|k| {
            (
                0.1 * f64::from(k + 1),
                sensor.frame(
                    0.1 * f64::from(k + 1),
                    2.5e-3,
                    [121.3, 97.6],
                    Branch::Loading,
                    50 + k as u64,
                ),
            )
        })
        .collect();
    let (mut inside, mut count) = (0, 0);
    for seed in 0..12 {
        let curve = sensor.curve(&reference, seed);
        for (force, frame) in &frames {
            let found = measure(frame, &reference, &curve, DriftCorrection::Automatic).force_n;
            inside += usize::from((found.value - force).abs() < 2.0 * found.standard_error());
            count += 1;
        }
    }
    let share = inside as f64 / count as f64;
    // 95.4 % for exact errors. Those of smoothing are an average over curves like this one, and the
    // four forces of one calibration have its error in common: 12 draws, ± 6 %.
    assert!(share > 0.8, "{share}");
}

#[test]
fn the_report_says_what_was_learned() {
    let sensor = Sensor {
        hysteresis: 0.03,
        ..sensor(1.1)
    };
    let reference = sensor.reference();
    let curve = sensor.curve(&reference, 3);
    let report = &curve.report;
    assert_eq!(report.frames, 24);
    let [low, high] = report.identified_grey;
    let top = sensor.light(1.5 / (std::f64::consts::PI * contact_radius(1.0, 4e-3).powi(2)));
    assert!(
        low < 30.0 && (0.9 * top..1.3 * top).contains(&high),
        "{low} {high} {top}"
    );
    // Light of p (1 − 0.03) under the same force: f of unloading is larger by 3 %.
    let lag = report.hysteresis.unwrap();
    assert!(
        (lag.relative.value + 0.03).abs() < 3.0 * lag.relative.standard_error,
        "{lag:?}"
    );
    assert!((0.01..0.02).contains(&lag.width), "{lag:?}");
    // Pressures are those of the forward model, between the two branches.
    for grey in [40.0, 80.0, 120.0] {
        let truth = 60e3 * (grey / 120.0_f64).powf(1.0 / 1.1) * 1.015;
        let found = curve.pressure_pa(grey);
        assert!(
            (found.value / truth - 1.0).abs() < 0.03,
            "{grey}: {found:?} {truth}"
        );
    }
    // The error of a reading is at least half of the lag.
    let frame = sensor.frame(0.4, 2.5e-3, [121.3, 97.6], Branch::Loading, 8);
    let reading = measure(&frame, &reference, &curve, DriftCorrection::Automatic)
        .reading
        .unwrap();
    assert!(
        reading.force_n.part(Source::Calibration) >= lag.width * reading.force_n.value
            && !reading.out_of_range
    );
}

#[test]
fn grey_levels_beyond_those_seen_are_flagged() {
    let sensor = sensor(1.0);
    let reference = sensor.reference();
    let curve = sensor.curve(&reference, 4);
    // The pressure of a small ball is higher than every pressure of the calibration.
    let frame = sensor.frame(0.15, 1.2e-3, [121.3, 97.6], Branch::Loading, 9);
    assert!(
        measure(&frame, &reference, &curve, DriftCorrection::Automatic)
            .reading
            .unwrap()
            .out_of_range
    );
}

/// Forces without any error leave no residual on a curve that follows every press.
#[test]
fn a_few_presses_under_exact_forces_have_an_error_that_holds() {
    let radius = |force: f64| (force / 2.5e7).cbrt();
    let (mut held, mut errors) = (0, Vec::new());
    for power in [0.8, 0.9, 1.1, 1.2, 1.3] {
        for count in [5, 6, 7] {
            // Hertz's pressure under a ball on 20 µm pixels, grey levels as a power of it.
            let press = |k: u32| {
                let force = 0.4 * f64::from(k) / f64::from(count);
                let (a, pixel) = (radius(force), 2e-5);
                let peak = 1.5 * force / (std::f64::consts::PI * a * a);
                let side = (a / pixel) as i32 + 1;
                let greys = (-side..=side).flat_map(|y| (-side..=side).map(move |x| (x, y)));
                let greys = greys.map(|(x, y)| {
                    let r2 = f64::from(x * x + y * y) * pixel * pixel / (a * a);
                    (200.0 * (peak * (1.0 - r2).max(0.0).sqrt() / 4e4).powf(power)) as f32
                });
                let light = GreyHistogram::from_differences(greys, pixel * pixel);
                CalibrationFrame::new(light, force, Branch::Loading).unwrap()
            };
            let frames: Vec<_> = (1..=count).map(press).collect();
            let curve = PressureCurve::fit(&frames, &PressureCurveOptions::default()).unwrap();
            assert!(curve.report.effective_parameters <= f64::from(count) - 2.0);
            let grey = 0.9 * curve.report.identified_grey[1];
            let truth = 4e4 * (grey / 200.0).powf(power.recip());
            let found = curve.pressure_pa(grey);
            let interval = found.interval_95();
            let below = interval.upper.is_none_or(|upper| truth <= upper);
            held += u32::from(interval.lower <= truth && below);
            errors.push((found.value / truth - 1.0, found.standard_error / truth));
        }
    }
    assert!(held >= 14, "{held} of 15: {errors:?}");
}

#[test]
fn frames_that_determine_no_curve_are_refused() {
    let disc = |grey: f32| GreyHistogram::from_differences(std::iter::repeat_n(grey, 500), AREA_M2);
    let frame =
        |grey: f32, force| CalibrationFrame::new(disc(grey), force, Branch::Loading).unwrap();
    let fit =
        |frames: &[CalibrationFrame]| PressureCurve::fit(frames, &PressureCurveOptions::default());
    let few: Vec<_> = (1..5)
        .map(|k| frame(10.0 * k as f32, f64::from(k)))
        .collect();
    assert_eq!(
        fit(&few),
        Err(ForceError::TooFewPairs {
            required: 5,
            found: 4
        })
    );
    let dark = vec![frame(0.0, 1.0); 6];
    assert!(matches!(
        fit(&dark),
        Err(ForceError::DegeneratePairs { .. })
    ));
    let idle = vec![frame(50.0, 0.0); 6];
    assert!(matches!(
        fit(&idle),
        Err(ForceError::DegeneratePairs { .. })
    ));
    for force in [f64::NAN, -0.1, f64::INFINITY] {
        assert!(CalibrationFrame::new(disc(3.0), force, Branch::Loading).is_err());
    }
    let options = PressureCurveOptions::default();
    for bad in [f64::NAN, -1.0, f64::INFINITY] {
        assert!(
            options.with_force_error(bad, 0.1).is_err()
                && options.with_force_error(0.1, bad).is_err()
        );
    }
    assert!(options.with_force_error(0.0, 0.0).is_err());
}

proptest! {
    #[test]
    fn curves_rise_through_the_origin_whatever_the_frames(
        greys in proptest::collection::vec(1.0_f32..250.0, 5..20),
        noise in proptest::collection::vec(0.2_f64..1.8, 20),
    ) {
        let frames: Vec<_> = greys
            .iter()
            .zip(&noise)
            .map(|(grey, noise)| {
                let disc = GreyHistogram::from_differences(std::iter::repeat_n(*grey, 100), 1e-9);
                CalibrationFrame::new(disc, noise * f64::from(*grey), Branch::Loading).unwrap()
            })
            .collect();
        // If all forces decrease, the sums have no rising curve, which is refused.
        if let Ok(curve) = PressureCurve::fit(&frames, &PressureCurveOptions::default()) {
            prop_assert_eq!(curve.pressure_pa(0.0).value, 0.0);
            let pressure = |g: i32| curve.pressure_pa(f64::from(g)).value;
            let pressures: Vec<f64> = (-10..=260).map(pressure).collect();
            prop_assert!(pressures.windows(2).all(|w| w[1] >= w[0]));
            prop_assert!(curve.pressure_pa(100.0).standard_error.is_finite());
        }
    }
}
