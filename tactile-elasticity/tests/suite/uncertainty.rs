//! An error that all loads share carried to the modulus, against redrawing the whole experiment.
//! The covariance of displacements is checked the same way with the spline that it comes from, in
//! the facade's tests.

use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};
use rand_distr::StandardNormal;
use tactile_elasticity::contact::{Body, HertzContact, reduced_modulus_pa};
use tactile_elasticity::modulus::{
    Estimate, HertzSphere, LoadSeries, LoadState, ModulusEstimator, SharedErrors,
};

/// The standard deviation of 4000 redrawn moduli is itself known to 1.1 %: 5 % is four and a half
/// of its standard deviations.
#[test]
fn a_calibrations_error_does_not_average_out() {
    let reduced = reduced_modulus_pa(Body::rigid(), Body::elastic(50e3, 0.5).unwrap()).unwrap();
    let loads: Vec<_> = (1..9)
        .map(|k| {
            let f = 1e-3 * f64::from(k);
            let a = HertzContact::from_force(f, 4e-3, reduced)
                .unwrap()
                .contact_radius_m;
            LoadState {
                contact_radius_m: Some(Estimate::new(a, 0.002 * a)),
                ..LoadState::new(Estimate::new(f, 0.004 * f))
            }
        })
        .collect();
    let estimator = HertzSphere::new(4e-3, 0.5).unwrap();
    let shared = SharedErrors {
        force_scale: 0.01,
        ..SharedErrors::default()
    };
    let series = LoadSeries::new(loads).with_shared_errors(shared).unwrap();
    let propagated = estimator.estimate(&series).unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let mut normal = || rng.sample::<f64, _>(StandardNormal);
    let mut redraw = || {
        let scale = 1.0 + shared.force_scale * normal();
        let loads = series.loads().iter().map(|load| {
            let mut draw = |e: Estimate, scale: f64| {
                Estimate::new(
                    (e.value + e.standard_error * normal()) * scale,
                    e.standard_error,
                )
            };
            LoadState {
                contact_radius_m: load.contact_radius_m.map(|a| draw(a, 1.0)),
                ..LoadState::new(draw(load.force_n, scale))
            }
        });
        let loads = LoadSeries::new(loads.collect::<Vec<_>>());
        estimator.estimate(&loads).unwrap().youngs_modulus_pa
    };
    let moduli: Vec<f64> = (0..4000).map(|_| redraw()).collect();
    let mean = moduli.iter().sum::<f64>() / 4000.0;
    let squares: f64 = moduli.iter().map(|x| (x - mean).powi(2)).sum();
    let ratio = propagated.standard_error_pa / (squares / 3999.0).sqrt();
    assert!((ratio - 1.0).abs() < 0.05, "{ratio}");
    assert!(propagated.standard_error_pa / propagated.youngs_modulus_pa > 0.01);
}
