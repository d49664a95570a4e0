//! Calibrations: what they recover, how sure they say they are, what they refuse.

use proptest::prelude::*;
use rand::{SeedableRng, rngs::ChaCha8Rng};
use rand_distr::{Distribution, Normal};
use tactile_force::{
    CalibrationOptions, CalibrationPair, Estimate, ForceError, LinearCalibration, MonotoneCalibration,
    PolynomialCalibration, Robustness, StopReason, StressCalibration,
};

type Pairs = Vec<CalibrationPair<f64>>;
type Fit = fn(&Pairs) -> Box<dyn StressCalibration<f64>>;

/// Loading to two newtons in `steps` steps and back, along a curve, with noise in the force.
fn cycle(steps: usize, noise: f64, seed: u64, curve: impl Fn(f64) -> f64) -> Pairs {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let normal = Normal::new(0.0, noise).unwrap();
    let value = |k: usize| 4e6 * k as f64 / steps as f64;
    let mut pairs: Pairs = (0..=steps)
        .map(|k| CalibrationPair::loading(value(k), curve(value(k)) + normal.sample(&mut rng)))
        .collect();
    let down = (0..steps).rev().map(value);
    pairs.extend(down.map(|v| CalibrationPair::unloading(v, curve(v) + normal.sample(&mut rng))));
    pairs
}

fn line(v: f64) -> f64 {
    0.01 + 5e-7 * v
}

fn bent(v: f64) -> f64 {
    4e-7 * v + 2.5e-14 * v * v
}

fn options(through_origin: bool, robustness: Robustness) -> CalibrationOptions {
    CalibrationOptions { through_origin, robustness }
}

fn all(pairs: &Pairs, o: &CalibrationOptions) -> Vec<Box<dyn StressCalibration<f64>>> {
    vec![
        Box::new(LinearCalibration::fit(pairs, o).unwrap()),
        Box::new(PolynomialCalibration::fit(pairs, 3, o).unwrap()),
        Box::new(MonotoneCalibration::fit(pairs, o).unwrap()),
    ]
}

#[test]
fn exact_data_are_recovered_to_rounding() {
    let pairs = cycle(10, 0.0, 1, line);
    for (k, c) in all(&pairs, &CalibrationOptions::default()).iter().enumerate() {
        for v in [0.0, 1.3e5, 2.7e6, 4e6] {
            assert!((c.force_n(v) - line(v)).abs() < 1e-14, "calibration {k} at {v}");
            assert!((c.sensitivity_n(v) - 5e-7).abs() < 1e-19, "calibration {k} at {v}");
        }
        let r = c.report();
        assert!(r.residual_sd_n < 1e-14 && r.linearity_error < 1e-13 && r.monotone, "{r:?}");
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
    for p in pairs.iter_mut().filter(|p| p.branch == tactile_force::Branch::Unloading) {
        let x = p.integrated_pixel_value / 4e6;
        p.force_n -= 0.08 * x * (1.0 - x);
    }
    let h =
        LinearCalibration::fit(&pairs, &CalibrationOptions::default()).unwrap().report().hysteresis.unwrap();
    // Greatest difference 0.02 N at half range, up to three times the noise of a difference; mean 0.08/6.
    assert!((h.greatest_n - 0.02).abs() < 5e-4, "{h:?}");
    assert!((h.mean_n.value - 0.08 / 6.0).abs() < 5e-4, "{h:?}");
    assert!((h.share_of_full_scale - 0.01).abs() < 3e-4, "{h:?}");
}

/// Share of seeds for which the truth lies within one standard error, at a pixel value.
fn coverage(fit: impl Fn(&Pairs) -> Box<dyn StressCalibration<f64>>, curve: fn(f64) -> f64, at: f64) -> f64 {
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
        let linear = coverage(|p| Box::new(LinearCalibration::fit(p, &plain).unwrap()), line, at);
        assert!((0.64..0.72).contains(&linear), "line at {at}: {linear}");
        let cubic = coverage(|p| Box::new(PolynomialCalibration::fit(p, 3, &plain).unwrap()), bent, at);
        assert!((0.63..0.72).contains(&cubic), "cubic at {at}: {cubic}");
        let robust = coverage(|p| Box::new(LinearCalibration::fit(p, &huber).unwrap()), line, at);
        assert!((0.62..0.73).contains(&robust), "robust at {at}: {robust}");
    }
}

#[test]
fn confidence_intervals_cover_nineteen_in_twenty() {
    let inside = (0..1000)
        .filter(|seed| {
            let c =
                LinearCalibration::fit(&cycle(4, 5e-3, *seed, line), &CalibrationOptions::default()).unwrap();
            let [low, high] = c.report().intervals_95[1];
            low < 5e-7 && 5e-7 < high
        })
        .count();
    // 95 % ± 0.7 %: three standard deviations. Seven degrees of freedom: with the normal's 1.96 it would be 91 %.
    assert!((929..=971).contains(&inside), "{inside}");
}

#[test]
fn outliers_lose_their_pull_on_request() {
    let mut pairs = cycle(20, 2e-3, 5, line);
    pairs[7].force_n += 1.0;
    pairs[30].force_n -= 0.8;
    let error = |r: Robustness| -> Vec<f64> {
        all(&pairs, &options(false, r)).iter().map(|c| (c.force_n(1.4e6) - line(1.4e6)).abs()).collect()
    };
    let (plain, huber, tukey) = (error(Robustness::None), error(Robustness::Huber), error(Robustness::Tukey));
    // Tukey: as if the two were not there, within three standard errors of the clean fit (2 mN/√10 for a cubic or a step).
    assert!(plain[0] > 5e-3 && tukey.iter().all(|e| *e < 4e-3), "{plain:?} {tukey:?}");
    assert!(huber[0] < 0.5 * plain[0], "{huber:?}");
    let report = LinearCalibration::fit(&pairs, &options(false, Robustness::Tukey)).unwrap().report().clone();
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
        assert!((seen - stated).abs() < 0.13 * size, "{seen} {stated} {size}");
    }
}

#[test]
fn forces_of_one_calibration_share_its_error() {
    let c = LinearCalibration::fit(&cycle(20, 5e-3, 2, line), &CalibrationOptions::default()).unwrap();
    let values = [2e5, 2e6, 3.9e6].map(|value| Estimate { value, standard_error: 4e3 });
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
    let c = LinearCalibration::fit(&cycle(20, 5e-3, 2, line), &CalibrationOptions::default()).unwrap();
    let inside = c.read(Estimate { value: 2e6, standard_error: 1e4 });
    assert!((inside.noise_n / 5e-3 - 1.0).abs() < 0.01 && inside.calibration_n > 0.0);
    assert_eq!(inside.force_n.standard_error, inside.noise_n.hypot(inside.calibration_n));
    assert!(!inside.out_of_range);
    for value in [-1.0, 4.1e6, f64::NAN] {
        assert!(c.read(Estimate { value, standard_error: 0.0 }).out_of_range, "{value}");
    }
}

#[test]
fn stress_over_the_contact_is_the_force() {
    for c in all(&cycle(20, 5e-3, 2, bent), &CalibrationOptions::default()) {
        let differences = [3.0, 100.0, 20.0, 0.0, 77.0];
        let (v, area) = (differences.iter().sum::<f64>() * 1e4, 4e-10);
        let table = c.stress_table_pa(v, area);
        let force: f64 = differences.iter().map(|d| table[*d as usize] * area * 1e4).sum();
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
    assert_eq!(LinearCalibration::fit(&nan, &o), Err(ForceError::NonFinitePair { index: 3 }));
    nan[2].integrated_pixel_value = f64::INFINITY;
    assert_eq!(MonotoneCalibration::fit(&nan, &o), Err(ForceError::NonFinitePair { index: 2 }));
    assert_eq!(
        LinearCalibration::fit(&good[..2], &o),
        Err(ForceError::TooFewPairs { required: 3, found: 2 })
    );
    assert_eq!(
        PolynomialCalibration::fit(&good[..4], 3, &o),
        Err(ForceError::TooFewPairs { required: 5, found: 4 })
    );
    let still = vec![good[2]; 6];
    assert!(matches!(LinearCalibration::fit(&still, &o), Err(ForceError::DegeneratePairs { .. })));
    assert!(matches!(MonotoneCalibration::fit(&still, &o), Err(ForceError::DegeneratePairs { .. })));
    assert!(matches!(PolynomialCalibration::fit(&still, 1, &o), Err(ForceError::DegeneratePairs { .. })));
    // Two pixel values cannot carry a parabola.
    let two: Pairs = [0, 10, 0, 10, 0].map(|k| good[k]).to_vec();
    let two: Pairs = two
        .iter()
        .enumerate()
        .map(|(k, p)| CalibrationPair::loading((k % 2) as f64 * 1e6, p.force_n))
        .collect();
    assert!(matches!(PolynomialCalibration::fit(&two, 2, &o), Err(ForceError::DegeneratePairs { .. })));
    assert!(matches!(PolynomialCalibration::fit(&good, 0, &o), Err(ForceError::InvalidOption { .. })));
    let falling = cycle(5, 0.0, 1, |v| 2.0 - line(v));
    assert!(matches!(MonotoneCalibration::fit(&falling, &o), Err(ForceError::NotMonotone { .. })));
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
