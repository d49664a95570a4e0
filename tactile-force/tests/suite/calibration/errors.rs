//! The errors that calibrations state.

use super::*;

/// Share of seeds for which the truth lies within one standard error, at a pixel value.
fn coverage(
    fit: impl Fn(&Pairs) -> Box<dyn StressCalibration<f64>>,
    curve: fn(f64) -> f64,
    at: f64,
) -> f64 {
    let seeds = 1000;
    let inside = (0..seeds)
        .filter(|seed| {
            let c = fit(&cycle(20, 5e-3, *seed, curve));
            (c.force_n(at) - curve(at)).abs() < c.standard_error_n(at)
        })
        .count();
    inside as f64 / seeds as f64
}

#[test]
fn stated_errors_are_right() {
    let plain = CalibrationOptions::default();
    let huber = options(false, Robustness::Huber);
    // 68.3 % ± 1.5 % (binomial, 1000 seeds); Student's t with 38 degrees takes 0.5 % off.
    for at in [0.0, 1.7e6, 3.9e6] {
        let linear = coverage(
            |p| Box::new(LinearCalibration::fit(p, &plain).unwrap()),
            line,
            at,
        );
        assert!((0.64..0.72).contains(&linear), "line at {at}: {linear}");
        let cubic = coverage(
            |p| Box::new(PolynomialCalibration::fit(p, 3, &plain).unwrap()),
            bent,
            at,
        );
        assert!((0.63..0.72).contains(&cubic), "cubic at {at}: {cubic}");
        let robust = coverage(
            |p| Box::new(LinearCalibration::fit(p, &huber).unwrap()),
            line,
            at,
        );
        assert!((0.62..0.73).contains(&robust), "robust at {at}: {robust}");
    }
}

#[test]
fn confidence_intervals_cover_nineteen_in_twenty() {
    let inside = (0..1000)
        .filter(|seed| {
            let c = LinearCalibration::fit(
                &cycle(4, 5e-3, *seed, line),
                &CalibrationOptions::default(),
            )
            .unwrap();
            let [low, high] = c.report().intervals_95[1];
            low < 5e-7 && 5e-7 < high
        })
        .count();
    // 95 % ± 0.7 %: three standard deviations. Seven degrees of freedom: with the normal's 1.96 it would be 91 %.
    assert!((929..=971).contains(&inside), "{inside}");
}

#[test]
fn errors_of_two_forces_go_together_as_stated() {
    let at = [3e5, 3.2e6];
    let fits: [Fit; 2] = [
        |p| Box::new(LinearCalibration::fit(p, &CalibrationOptions::default()).unwrap()),
        |p| Box::new(PolynomialCalibration::fit(p, 3, &CalibrationOptions::default()).unwrap()),
    ];
    for fit in fits {
        let (mut seen, mut stated, mut size) = (0.0, 0.0, 0.0);
        for seed in 0..1000 {
            let c = fit(&cycle(20, 5e-3, seed, line));
            let error = at.map(|v| c.force_n(v) - line(v));
            seen += error[0] * error[1];
            stated += c.error_covariance_n2(at[0], at[1]);
            size += c.standard_error_n(at[0]) * c.standard_error_n(at[1]);
        }
        // The mean of a thousand products of two errors is uncertain by √2/√1000 of their size at most; three of that.
        assert!(
            (seen - stated).abs() < 0.13 * size,
            "{seen} {stated} {size}"
        );
    }
}

#[test]
fn forces_of_one_calibration_share_its_error() {
    let c =
        LinearCalibration::fit(&cycle(20, 5e-3, 2, line), &CalibrationOptions::default()).unwrap();
    let values = [2e5, 2e6, 3.9e6].map(|value| Estimate {
        value,
        standard_error: 4e3,
    });
    let covariance = c.force_covariance_n2(&values);
    for (i, v) in values.iter().enumerate() {
        let reading = c.read(*v);
        // One rounding per operation.
        assert!((covariance[[i, i]].sqrt() / reading.force_n.standard_error - 1.0).abs() < 1e-12);
        for (j, w) in values.iter().enumerate().filter(|(j, _)| *j != i) {
            assert_eq!(covariance[[i, j]], covariance[[j, i]]);
            assert!(covariance[[i, j]].abs() <= reading.calibration_n * c.read(*w).calibration_n);
        }
    }
}

#[test]
fn reading_adds_both_errors_and_flags_extrapolation() {
    let c =
        LinearCalibration::fit(&cycle(20, 5e-3, 2, line), &CalibrationOptions::default()).unwrap();
    let inside = c.read(Estimate {
        value: 2e6,
        standard_error: 1e4,
    });
    assert!((inside.noise_n / 5e-3 - 1.0).abs() < 0.01 && inside.calibration_n > 0.0);
    assert_eq!(
        inside.force_n.standard_error,
        inside.noise_n.hypot(inside.calibration_n)
    );
    assert!(!inside.out_of_range);
    for value in [-1.0, 4.1e6, f64::NAN] {
        assert!(
            c.read(Estimate {
                value,
                standard_error: 0.0
            })
            .out_of_range,
            "{value}"
        );
    }
}
