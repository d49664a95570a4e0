//! The crate tactile-elasticity alone: the modulus of a ball from force and contact radius at three
//! loads.
#![allow(clippy::print_stdout)]
use tactile_elasticity::ElasticityError;
use tactile_elasticity::contact::{Layer, Waveguide};
use tactile_elasticity::modulus::{
    Estimate, HertzSphere, LoadSeries, LoadState, ModulusEstimator, SharedErrors,
};

fn main() -> Result<(), ElasticityError> {
    let gel = Waveguide::new(vec![Layer {
        thickness_m: 10e-3,
        youngs_modulus_pa: 50e3,
        poisson_ratio: 0.5,
    }])?;
    let measured = [(1e-3, 0.395e-3), (2e-3, 0.497e-3), (4e-3, 0.627e-3)];
    let loads = measured.map(|(force_n, radius_m)| LoadState {
        contact_radius_m: Some(Estimate::new(radius_m, 1e-6)),
        ..LoadState::new(Estimate::new(force_n, 1e-5))
    });
    // One calibration, known to 0.2 %, is behind all three forces.
    let shared = SharedErrors {
        force_scale: 0.002,
        ..SharedErrors::default()
    };
    let series = LoadSeries::new(loads).with_shared_errors(shared)?;
    for (name, estimator) in [
        ("rigid sensor", HertzSphere::new(3e-3, 0.5)?),
        (
            "sensor of 50 kPa",
            HertzSphere::new(3e-3, 0.5)?.with_waveguide(&gel),
        ),
    ] {
        let modulus = estimator.estimate(&series)?;
        let error = modulus.standard_error_pa;
        println!("{name}: {:.1} ± {error:.1} Pa", modulus.youngs_modulus_pa);
    }
    Ok(())
}
