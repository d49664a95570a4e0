//! Calibrations: results, stated errors, and refusals.

use proptest::prelude::*;
use rand::{SeedableRng, rngs::ChaCha8Rng};
use rand_distr::{Distribution, Normal};
use tactile_force::{
    CalibrationPair, Estimate, ForceError, ForceReading, LinearCalibration, Source,
    StressCalibration,
};

type Pairs = Vec<CalibrationPair>;

/// Loading to two newtons in `steps` steps and unloading, along a curve, with noise in the force.
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

fn fitted(pairs: &[CalibrationPair]) -> LinearCalibration {
    LinearCalibration::fit(pairs).unwrap()
}

#[test]
fn exact_data_are_recovered_to_rounding() {
    let pairs = cycle(10, 0.0, 1, line);
    let c = fitted(&pairs);
    for v in [0.0, 1.3e5, 2.7e6, 4e6] {
        assert!((c.force_n(v) - line(v)).abs() < 1e-14, "{v}");
        assert!((c.sensitivity_n(v) - 5e-7).abs() < 1e-19, "{v}");
    }
    let r = c.report();
    assert!(
        r.residual_sd_n < 1e-14 && r.linearity_error < 1e-13 && r.monotone,
        "{r:?}"
    );
    assert!((r.r_squared - 1.0).abs() < 1e-14);
    assert!(r.hysteresis.unwrap().greatest_n.abs() < 1e-14);
    assert_eq!(c.range(), [0.0, 4e6]);
    // The curve passes through the origin for any pairs.
    let forced = LinearCalibration::through_origin(&cycle(20, 5e-3, 9, line)).unwrap();
    assert_eq!(forced.force_n(0.0), 0.0);
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
    let h = fitted(&pairs).report().hysteresis.unwrap();
    // The largest difference is 0.02 N at half range, or up to three times the noise of a
    // difference. The mean is 0.08/6.
    assert!((h.greatest_n - 0.02).abs() < 5e-4, "{h:?}");
    assert!((h.mean_n.value - 0.08 / 6.0).abs() < 5e-4, "{h:?}");
    assert!((h.share_of_full_scale - 0.01).abs() < 3e-4, "{h:?}");
    // The curves lie between the branches: the stated error of one force contains half of the
    // difference, which is common to two forces.
    assert!((h.width_n / (0.04 / 6.0) - 1.0).abs() < 0.05, "{h:?}");
    let (curve, low, high) = (fitted(&pairs), 0.8e6, 2.4e6);
    assert!(curve.standard_error_n(low) >= h.width_n);
    assert!(curve.error_covariance_n2(low, high) >= 0.9 * h.width_n.powi(2));
}

#[test]
fn stress_over_the_contact_is_the_force() {
    let c = fitted(&cycle(20, 5e-3, 2, bent));
    let differences = [3.0, 100.0, 20.0, 0.0, 77.0];
    let (v, area) = (differences.iter().sum::<f64>() * 1e4, 4e-10);
    let step = c.stress_per_grey_level_pa(v, area);
    let force: f64 = differences.iter().map(|d| step * d * area * 1e4).sum();
    assert!((force / c.force_n(v) - 1.0).abs() < 1e-14);
    let limit = c.stress_per_grey_level_pa(0.0, area);
    assert!((limit * area / c.sensitivity_n(0.0) - 1.0).abs() < 1e-14);
}

#[test]
fn bad_pairs_are_refused() {
    let fit = LinearCalibration::fit;
    let good = cycle(5, 0.0, 1, line);
    let mut nan = good.clone();
    nan[3].force_n = f64::NAN;
    assert_eq!(fit(&nan), Err(ForceError::NonFinitePair { index: 3 }));
    let few = ForceError::TooFewPairs {
        required: 3,
        found: 2,
    };
    assert_eq!(fit(&good[..2]), Err(few));
    let still = vec![good[2]; 6];
    assert!(matches!(
        fit(&still),
        Err(ForceError::DegeneratePairs { .. })
    ));
}

proptest! {
    #[test]
    fn units_do_not_matter(scale in 1e-12_f64..1e12, seed in 0_u64..50) {
        // Forces and pixel values in other units give the same curve in those units.
        let pairs = cycle(10, 5e-3, seed, bent);
        let scaled: Pairs = pairs.iter().map(|p| CalibrationPair {
            integrated_pixel_value: p.integrated_pixel_value * scale,
            force_n: p.force_n / scale,
            branch: p.branch
        }).collect();
        let (a, b) = (fitted(&pairs), fitted(&scaled));
        let (fa, fb) = (a.force_n(1.3e6), b.force_n(1.3e6 * scale) * scale);
        prop_assert!((fa / fb - 1.0).abs() < 1e-11, "{fa} {fb}");
    }
}

#[test]
fn stated_errors_are_right() {
    // Without an offset: a line with one beyond five errors states it as an error.
    let line = |v: f64| 5e-7 * v;
    let at = [0.0, 1.7e6, 3.9e6];
    let mut inside = [0; 3];
    let (mut seen, mut stated, mut size) = (0.0, 0.0, 0.0);
    for seed in 0..1000 {
        let c = fitted(&cycle(20, 5e-3, seed, line));
        let error = at.map(|v| c.force_n(v) - line(v));
        for k in 0..3 {
            inside[k] += usize::from(error[k].abs() < c.standard_error_n(at[k]));
        }
        seen += error[0] * error[2];
        stated += c.error_covariance_n2(at[0], at[2]);
        size += c.standard_error_n(at[0]) * c.standard_error_n(at[2]);
    }
    // 68.3 % ± 1.5 % (binomial, 1000 seeds). Student's t with 38 degrees of freedom reduces it by
    // 0.5 %.
    assert!(inside.iter().all(|n| (640..720).contains(n)), "{inside:?}");
    // The mean of a thousand products of two errors is uncertain by at most √2/√1000 of their size.
    // Three times that.
    assert!(
        (seen - stated).abs() < 0.13 * size,
        "{seen} {stated} {size}"
    );
}

#[test]
fn confidence_intervals_cover_nineteen_in_twenty() {
    let inside = (0..1000)
        .filter(|seed| {
            let c = fitted(&cycle(4, 5e-3, *seed, line));
            c.report().parameters[1].interval_95().contains(5e-7)
        })
        .count();
    // 95 % ± 0.7 %: three standard deviations. There are seven degrees of freedom; with the normal
    // quantile 1.96 it would be 91 %.
    assert!((929..=971).contains(&inside), "{inside}");
}

#[test]
fn forces_of_one_calibration_share_its_error() {
    let c = fitted(&cycle(20, 5e-3, 2, line));
    let values = [2e5, 2e6, 3.9e6].map(|value| Estimate::new(value, 4e3));
    let covariance = c.force_covariance_n2(&values);
    let calibration = |reading: &ForceReading| reading.force_n.part(Source::Calibration);
    for (i, v) in values.iter().enumerate() {
        let reading = c.read(*v).unwrap();
        // One rounding per operation.
        assert!((covariance[[i, i]].sqrt() / reading.force_n.standard_error() - 1.0).abs() < 1e-12);
        for (j, w) in values.iter().enumerate().filter(|(j, _)| *j != i) {
            assert_eq!(covariance[[i, j]], covariance[[j, i]]);
            assert!(
                covariance[[i, j]].abs()
                    <= calibration(&reading) * calibration(&c.read(*w).unwrap())
            );
        }
    }
}

#[test]
fn reading_adds_both_errors_and_flags_extrapolation() {
    let c = fitted(&cycle(20, 5e-3, 2, line));
    let inside = c.read(Estimate::new(2e6, 1e4)).unwrap();
    let part = |source| inside.force_n.part(source);
    assert!((part(Source::Noise) / 5e-3 - 1.0).abs() < 0.01 && part(Source::Calibration) > 0.0);
    assert_eq!(
        inside.force_n.standard_error(),
        part(Source::Noise).hypot(part(Source::Calibration))
    );
    assert!(!inside.out_of_range);
    for value in [-1.0, 4.1e6, f64::NAN] {
        assert!(
            c.read(Estimate::new(value, 0.0)).unwrap().out_of_range,
            "{value}"
        );
    }
}

/// A calibration by hand with few pairs: Student's t determines the interval of every force.
#[test]
fn intervals_of_forces_hold_with_few_pairs() {
    let gauge = Normal::new(0.0, 0.02).unwrap();
    // Noise of a frame: 0.02 % of the force.
    let noise_of_frame = Normal::new(0.0, 120.0).unwrap();
    for count in [3, 4, 6] {
        let mut rng = ChaCha8Rng::seed_from_u64(count);
        let draws = 400;
        let held = (0..draws).filter(|_| {
            let pair = |k| {
                let force = k as f64 / count as f64;
                CalibrationPair::loading(1e6 * force, force + gauge.sample(&mut rng))
            };
            let line = fitted(&(1..=count).map(pair).collect::<Vec<_>>());
            let seen = 6e5 + noise_of_frame.sample(&mut rng);
            let reading = line.read(Estimate::new(seen, 120.0)).unwrap();
            reading.force_n.total().interval_95().contains(0.6)
        });
        let share = held.count() as f64 / f64::from(draws);
        // Three standard deviations of 400 draws, √(0.95 · 0.05/400) = 1.1 %.
        assert!((0.917..0.983).contains(&share), "{count} pairs: {share}");
    }
}
