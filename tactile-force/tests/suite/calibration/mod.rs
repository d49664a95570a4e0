//! Calibrations: what they recover, how sure they say they are, what they refuse.

mod curves;
mod errors;

use proptest::prelude::*;
use rand::{SeedableRng, rngs::ChaCha8Rng};
use rand_distr::{Distribution, Normal};
use tactile_force::{
    CalibrationOptions, CalibrationPair, Estimate, ForceError, LinearCalibration,
    MonotoneCalibration, PolynomialCalibration, Robustness, StopReason, StressCalibration,
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
    let options = CalibrationOptions::default().with_robustness(robustness);
    if through_origin {
        options.with_zero_at_origin()
    } else {
        options
    }
}

fn all(pairs: &Pairs, o: &CalibrationOptions) -> Vec<Box<dyn StressCalibration<f64>>> {
    vec![
        Box::new(LinearCalibration::fit(pairs, o).unwrap()),
        Box::new(PolynomialCalibration::fit(pairs, 3, o).unwrap()),
        Box::new(MonotoneCalibration::fit(pairs, o).unwrap()),
    ]
}
