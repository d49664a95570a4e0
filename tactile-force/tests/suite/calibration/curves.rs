//! What a calibration makes of its pairs.

use super::*;

#[test]
fn exact_data_are_recovered_to_rounding() {
    let pairs = cycle(10, 0.0, 1, line);
    for (k, c) in all(&pairs, &CalibrationOptions::default())
        .iter()
        .enumerate()
    {
        for v in [0.0, 1.3e5, 2.7e6, 4e6] {
            assert!(
                (c.force_n(v) - line(v)).abs() < 1e-14,
                "calibration {k} at {v}"
            );
            assert!(
                (c.sensitivity_n(v) - 5e-7).abs() < 1e-19,
                "calibration {k} at {v}"
            );
        }
        let r = c.report();
        assert!(
            r.residual_sd_n < 1e-14 && r.linearity_error < 1e-13 && r.monotone,
            "{r:?}"
        );
        assert!((r.r_squared - 1.0).abs() < 1e-14);
        assert!(r.hysteresis.unwrap().greatest_n.abs() < 1e-14);
        assert_eq!(c.range(), [0.0, 4e6]);
    }
}

#[test]
fn monotone_calibrations_invert() {
    for c in all(&cycle(20, 0.0, 1, bent), &CalibrationOptions::default()) {
        for v in [1e3, 0.9e6, 2.1e6, 3.99e6] {
            let back = c.integrated_pixel_value(c.force_n(v)).unwrap();
            assert!((back / v - 1.0).abs() < 1e-12, "{back} {v}");
        }
    }
    let falling = cycle(20, 0.0, 1, |v| 1e-6 * v - 2e-13 * v * v);
    let curve = PolynomialCalibration::fit(&falling, 2, &CalibrationOptions::default()).unwrap();
    assert!(!curve.report().monotone);
    assert_eq!(curve.integrated_pixel_value(1.0), None);
}

#[test]
fn a_bent_curve_is_seen_as_such() {
    let pairs = cycle(20, 0.0, 1, bent);
    let curve = PolynomialCalibration::fit(&pairs, 2, &CalibrationOptions::default()).unwrap();
    // A parabola c v² over a range L leaves its best line by c L²/6 in the middle or at the ends of a dense, even grid: here
    // 2.5e-14 × 16e12 / 6 = 0.0667 of 2 N; with 41 points the best line sits a little differently.
    let expected = 0.4 / 6.0 / 2.0;
    assert!(
        (curve.report().linearity_error / expected - 1.0).abs() < 0.1,
        "{}",
        curve.report().linearity_error
    );
    assert!((curve.report().sensitivity_n / 5e-7 - 1.0).abs() < 1e-12);
}

#[test]
fn hysteresis_is_measured_with_its_sign() {
    let mut pairs = cycle(40, 1e-4, 3, line);
    for p in pairs
        .iter_mut()
        .filter(|p| p.branch == tactile_force::Branch::Unloading)
    {
        let x = p.integrated_pixel_value / 4e6;
        p.force_n -= 0.08 * x * (1.0 - x);
    }
    let h = LinearCalibration::fit(&pairs, &CalibrationOptions::default())
        .unwrap()
        .report()
        .hysteresis
        .unwrap();
    // Greatest difference 0.02 N at half range, up to three times the noise of a difference; mean 0.08/6.
    assert!((h.greatest_n - 0.02).abs() < 5e-4, "{h:?}");
    assert!((h.mean_n.value - 0.08 / 6.0).abs() < 5e-4, "{h:?}");
    assert!((h.share_of_full_scale - 0.01).abs() < 3e-4, "{h:?}");
    // The curves lie between the branches: what they state of one force holds half of the difference, and of two it is common.
    assert!((h.width_n / (0.04 / 6.0) - 1.0).abs() < 0.05, "{h:?}");
    for curve in all(&pairs, &options(false, Robustness::None)) {
        let (low, high) = (0.8e6, 2.4e6);
        assert!(curve.standard_error_n(low) >= h.width_n);
        assert!(curve.error_covariance_n2(low, high) >= 0.9 * h.width_n.powi(2));
    }
}

#[test]
fn outliers_lose_their_pull_on_request() {
    let mut pairs = cycle(20, 2e-3, 5, line);
    pairs[7].force_n += 1.0;
    pairs[30].force_n -= 0.8;
    let error = |r: Robustness| -> Vec<f64> {
        all(&pairs, &options(false, r))
            .iter()
            .map(|c| (c.force_n(1.4e6) - line(1.4e6)).abs())
            .collect()
    };
    let (plain, huber, tukey) = (
        error(Robustness::None),
        error(Robustness::Huber),
        error(Robustness::Tukey),
    );
    // Tukey: as if the two were not there, within three standard errors of the clean fit (2 mN/√10 for a cubic or a step).
    assert!(
        plain[0] > 5e-3 && tukey.iter().all(|e| *e < 4e-3),
        "{plain:?} {tukey:?}"
    );
    assert!(huber[0] < 0.5 * plain[0], "{huber:?}");
    let report = LinearCalibration::fit(&pairs, &options(false, Robustness::Tukey))
        .unwrap()
        .report()
        .clone();
    assert_eq!((report.weights[7], report.weights[30]), (0.0, 0.0));
    assert_eq!(report.stop, StopReason::Converged);
    assert!((report.residual_sd_n / 2e-3 - 1.0).abs() < 0.5);
}

#[test]
fn the_origin_can_be_forced() {
    let pairs = cycle(20, 5e-3, 9, line);
    for c in all(&pairs, &options(true, Robustness::None)) {
        assert!(c.force_n(0.0).abs() < 1e-9, "{}", c.force_n(0.0));
    }
}

#[test]
fn stress_over_the_contact_is_the_force() {
    for c in all(&cycle(20, 5e-3, 2, bent), &CalibrationOptions::default()) {
        let differences = [3.0, 100.0, 20.0, 0.0, 77.0];
        let (v, area) = (differences.iter().sum::<f64>() * 1e4, 4e-10);
        let step = c.stress_per_grey_level_pa(v, area);
        let force: f64 = differences.iter().map(|d| step * d * area * 1e4).sum();
        assert!((force / c.force_n(v) - 1.0).abs() < 1e-14);
        let limit = c.stress_per_grey_level_pa(0.0, area);
        assert!((limit * area / c.sensitivity_n(0.0) - 1.0).abs() < 1e-14);
    }
}

#[test]
fn single_precision_agrees() {
    let pairs = cycle(20, 5e-3, 2, bent);
    let narrow: Vec<CalibrationPair<f32>> = pairs
        .iter()
        .map(|p| CalibrationPair {
            integrated_pixel_value: p.integrated_pixel_value as f32,
            force_n: p.force_n as f32,
            branch: p.branch,
        })
        .collect();
    let o = CalibrationOptions::default();
    let wide = PolynomialCalibration::fit(&pairs, 3, &o).unwrap();
    let single = PolynomialCalibration::fit(&narrow, 3, &o).unwrap();
    // Forces of 2 N in f32: 1e-7 relative.
    assert!((f64::from(single.force_n(1.1e6)) - wide.force_n(1.1e6)).abs() < 1e-6);
    let single = MonotoneCalibration::fit(&narrow, &o).unwrap();
    assert!((f64::from(single.force_n(1.1e6)) - bent(1.1e6)).abs() < 2e-2);
}

#[test]
fn bad_pairs_are_refused() {
    let o = CalibrationOptions::default();
    let good = cycle(5, 0.0, 1, line);
    let mut nan = good.clone();
    nan[3].force_n = f64::NAN;
    assert_eq!(
        LinearCalibration::fit(&nan, &o),
        Err(ForceError::NonFinitePair { index: 3 })
    );
    nan[2].integrated_pixel_value = f64::INFINITY;
    assert_eq!(
        MonotoneCalibration::fit(&nan, &o),
        Err(ForceError::NonFinitePair { index: 2 })
    );
    assert_eq!(
        LinearCalibration::fit(&good[..2], &o),
        Err(ForceError::TooFewPairs {
            required: 3,
            found: 2
        })
    );
    assert_eq!(
        PolynomialCalibration::fit(&good[..4], 3, &o),
        Err(ForceError::TooFewPairs {
            required: 5,
            found: 4
        })
    );
    let still = vec![good[2]; 6];
    assert!(matches!(
        LinearCalibration::fit(&still, &o),
        Err(ForceError::DegeneratePairs { .. })
    ));
    assert!(matches!(
        MonotoneCalibration::fit(&still, &o),
        Err(ForceError::DegeneratePairs { .. })
    ));
    assert!(matches!(
        PolynomialCalibration::fit(&still, 1, &o),
        Err(ForceError::DegeneratePairs { .. })
    ));
    // Two pixel values cannot carry a parabola.
    let two: Pairs = [0, 10, 0, 10, 0].map(|k| good[k]).to_vec();
    let two: Pairs = two
        .iter()
        .enumerate()
        .map(|(k, p)| CalibrationPair::loading((k % 2) as f64 * 1e6, p.force_n))
        .collect();
    assert!(matches!(
        PolynomialCalibration::fit(&two, 2, &o),
        Err(ForceError::DegeneratePairs { .. })
    ));
    assert!(matches!(
        PolynomialCalibration::fit(&good, 0, &o),
        Err(ForceError::InvalidOption { .. })
    ));
    let falling = cycle(5, 0.0, 1, |v| 2.0 - line(v));
    assert!(matches!(
        MonotoneCalibration::fit(&falling, &o),
        Err(ForceError::NotMonotone { .. })
    ));
}

proptest! {
    #[test]
    fn monotone_curves_never_fall(forces in proptest::collection::vec(-1.0_f64..1.0, 5..40), trend in 0.02_f64..0.3) {
        let pairs: Pairs =
            forces.iter().enumerate().map(|(k, f)| CalibrationPair::loading(k as f64, f + trend * k as f64)).collect();
        for robustness in [Robustness::None, Robustness::Huber] {
            let Ok(c) = MonotoneCalibration::fit(&pairs, &options(false, robustness)) else { continue };
            let mut last = f64::NEG_INFINITY;
            for k in 0..1000 {
                let v = 0.04 * f64::from(k) - 1.0;
                let f = c.force_n(v);
                prop_assert!(f >= last - 1e-12 && c.sensitivity_n(v) >= -1e-12, "{v}: {f} after {last}");
                last = f;
            }
        }
    }

    #[test]
    fn units_do_not_matter(scale in 1e-12_f64..1e12, seed in 0_u64..50) {
        // Forces and pixel values in other units: the same curve in those units.
        let pairs = cycle(10, 5e-3, seed, bent);
        let scaled: Pairs = pairs.iter().map(|p| CalibrationPair {
            integrated_pixel_value: p.integrated_pixel_value * scale, force_n: p.force_n / scale, branch: p.branch
        }).collect();
        let o = CalibrationOptions::default();
        for (a, b) in all(&pairs, &o).iter().zip(all(&scaled, &o)) {
            let (fa, fb) = (a.force_n(1.3e6), b.force_n(1.3e6 * scale) * scale);
            prop_assert!((fa / fb - 1.0).abs() < 1e-11, "{fa} {fb}");
        }
    }
}
