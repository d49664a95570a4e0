//! The fit and its ridge.

use super::{block, forward, lump};
use crate::SensorErrors;
use crate::covariance::{Observed, Resolution};
use crate::fit::{ANSWER_ENDING, Prior, Problem};
use crate::parameters::{Coordinate, LARGEST_POISSON_RATIO, Parameters};
use tactile_fem::Interface;

/// Values without noise from a finer mesh than that of the fit, with the errors of a first fit.
fn problem_of(truth: &Parameters, resolution: Resolution) -> Problem {
    let finer = forward(5);
    let values = finer.predict(truth).unwrap();
    let observed = Observed {
        radii_m: finer.radii_m,
        white: values.iter().map(|p| 1e-3 * p).collect(),
        values,
        frames: 2,
        cells: None,
    };
    let covariance = observed.covariance(&SensorErrors::default(), Interface::Bonded, resolution);
    let prior = |coordinate, mean, error| Prior::new(coordinate, (mean, error));
    Problem {
        forward: forward(3),
        measured: observed.values,
        factor: covariance.cholesky().unwrap(),
        priors: vec![
            prior(Coordinate::BlockModulus, 5e3f64.ln(), 1.0),
            prior(Coordinate::Zero, 0.0, 20e-6),
            prior(Coordinate::Height, 30e-3f64.ln(), 0.02),
            prior(Coordinate::PoissonRatio, 0.49, 0.005),
            prior(Coordinate::Diameter, 10e-3f64.ln(), 0.6),
            prior(Coordinate::Depth, 5e-3f64.ln(), 0.8),
            prior(Coordinate::LumpModulus, 20e3f64.ln(), 1.2),
        ],
    }
}

#[test]
fn a_fit_from_afar_ends_at_the_truth_within_its_errors() {
    let truth = block();
    let problem = problem_of(&truth, Resolution::FirstFits);
    // The second start is at the limit of ν itself. The prior of ν and the data pull it back, but
    // first steps would cross the limit.
    for (block_modulus_pa, poisson_ratio, ball) in [
        (6e3, truth.poisson_ratio, lump(9e-3, 6e-3, 15e3)),
        (4e3, LARGEST_POISSON_RATIO, lump(14e-3, 3e-3, 60e3)),
    ] {
        let start = Parameters {
            block_modulus_pa,
            poisson_ratio,
            lump: Some(ball),
            ..block()
        };
        let fit = problem.fit(&start, ANSWER_ENDING, || true).unwrap();
        assert!(fit.converged);
        for (k, coordinate) in problem.coordinates().into_iter().enumerate() {
            let error = fit.covariance[(k, k)].sqrt();
            let z = (fit.parameters.get(coordinate) - truth.get(coordinate)) / error;
            // Without noise, only the coarse mesh and the priors, whose means are not the truth,
            // shift the result.
            assert!(z.abs() < 0.7, "{coordinate:?}: {z}");
        }
        // The covariance includes the error of the coarse mesh.
        let normal = fit.normal;
        let count = normal.predicted.len() as f64;
        assert!(normal.misfit < count, "{}", normal.misfit);
    }
}

/// For a small deep inclusion that is slightly stiffer than the tissue, the ridge bends.
#[test]
fn points_of_a_ridge_are_on_it() {
    let truth = Parameters {
        lump: Some(lump(7e-3, 8e-3, 8.5e3)),
        ..block()
    };
    let problem = problem_of(&truth, Resolution::Answer);
    let fit = problem.fit(&truth, ANSWER_ENDING, || true).unwrap();
    let ridge = problem.ridge(&fit, || true).unwrap();
    assert!(ridge.nodes.len() > 4, "{}", ridge.nodes.len());
    for node in &ridge.nodes {
        let coordinates = problem.coordinates().into_iter().zip(node.at.iter());
        let at = coordinates.fold(truth.clone(), |at, (coordinate, &value)| {
            at.moved(coordinate, value - at.get(coordinate))
        });
        let normal = problem.normal(&at, None).unwrap();
        let left = problem.step(&at, &normal, 0.0, Some(ridge.index)).unwrap();
        // The remaining distance comes from the last step, which was shorter than three standard
        // errors, and from a new mesh. After a single step it is up to 4.
        assert!(left.size < 0.5, "{}", left.size);
    }
}
