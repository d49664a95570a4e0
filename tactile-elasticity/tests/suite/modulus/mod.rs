//! Every estimator recovers the modulus from loads of its own law, with its error, and refuses
//! loads that it cannot use.

mod finite_elements;
mod intervals;
mod laws;
mod stress_over_strain;

use proptest::prelude::*;
use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};
use rand_distr::StandardNormal;
use tactile_elasticity::ElasticityError;
use tactile_elasticity::contact::{Body, Bond, HertzContact, Layer, LayerEquation, Waveguide};
use tactile_elasticity::modulus::*;

const SAMPLE: f64 = 60e3;
const NU: f64 = 0.48;

fn exact(x: f64) -> Estimate {
    Estimate::exact(x)
}

/// Layers of thicknesses and moduli.
fn guide(layers: &[[f64; 2]], poisson_ratio: f64) -> Waveguide {
    let layers = layers
        .iter()
        .map(|&[thickness_m, youngs_modulus_pa]| Layer {
            thickness_m,
            youngs_modulus_pa,
            poisson_ratio,
        });
    Waveguide::new(layers.collect()).unwrap()
}

fn waveguide() -> Waveguide {
    guide(&[[2e-3, 1.36e5], [3e-3, 8.0e4], [5e-3, 3.4e4]], 0.5)
}

fn reduced() -> f64 {
    Body::rigid()
        .reduced_modulus_pa(Body::elastic(SAMPLE, NU).unwrap())
        .unwrap()
}

/// Hertz loads of a 4 mm sphere of the sample on `other`.
fn hertz_loads(other: Body, forces: &[f64]) -> Vec<LoadState> {
    let e = other
        .reduced_modulus_pa(Body::elastic(SAMPLE, NU).unwrap())
        .unwrap();
    (forces.iter())
        .map(|&f| {
            let c = HertzContact::from_force(f, 4e-3, e).unwrap();
            LoadState::new(exact(f))
                .with_radius(exact(c.contact_radius_m))
                .with_indentation(exact(c.indentation_m))
        })
        .collect()
}

/// A load without its measured depth.
fn by_radius(mut load: LoadState) -> LoadState {
    load.indentation_m = None;
    load
}

/// A load without its contact radius.
fn by_depth(mut load: LoadState) -> LoadState {
    load.contact_radius_m = None;
    load
}

/// Loads whose forces have a common relative error of this size.
fn gauged(mut loads: Vec<LoadState>, relative: f64) -> LoadSeries {
    for load in &mut loads {
        load.force_n = load.force_n.by_relative(Source::Gain, relative);
    }
    LoadSeries::new(loads)
}

fn finds(estimator: &dyn ModulusEstimator, loads: &[LoadState]) {
    let found = estimator.estimate(&LoadSeries::new(loads)).unwrap();
    let gap = (found.youngs_modulus_pa / SAMPLE - 1.0).abs();
    assert!(gap < 1e-9, "{}: off by {gap:e}", found.estimator);
}
