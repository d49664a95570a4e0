//! One load, many equal loads, decreasing loads, and as many loads as a session keeps.
use super::press::{SI, coarse_camera, pipeline, relative, trial};
use super::table::{EXACT, Table};
use tactile_imaging::Pipeline;
use tactile_imaging::elasticity::ElasticityError;
use tactile_imaging::elasticity::modulus::ModulusEstimate;
use tactile_imaging::pipeline::{EstimatorChoice, PipelineError, Session, StagesConfig};
use tactile_simulate::Trial;

/// Increases of 35 mN from 0.2 N: the last load is within the calibration.
fn steps(loads: usize) -> Vec<f64> {
    (0..loads).map(|k| 0.2 + 0.035 * k as f64).collect()
}

/// The deviation from the true value is at most six standard errors. These lie between a thousandth
/// (the error of the force scale) and two hundredths (the error of the worst load alone).
pub(crate) fn many(table: &mut Table) {
    let falling = steps(8).into_iter().rev().collect();
    for (what, forces) in [
        ("one load", vec![0.7]),
        ("eight equal loads", vec![0.7; 8]),
        ("eight falling loads", falling),
        ("as many as a session keeps", steps(Session::MOST_LOADS)),
        ("more than it keeps", steps(Session::MOST_LOADS + 3)),
    ] {
        let trial = trial(coarse_camera(), 200.0, &forces);
        let pipeline = pipeline(&trial, SI);
        let truth = trial.simulation.youngs_modulus_pa;
        let press = trial.press(&pipeline).unwrap().modulus().unwrap();
        let session = streamed(&trial, &pipeline);
        let gap = (session.youngs_modulus_pa / press.youngs_modulus_pa - 1.0).abs();
        // A session keeps its loads in increasing order. The loads that it merges are 3 % apart and
        // follow one law, of which they are means.
        let allowed = if forces.len() > Session::MOST_LOADS {
            0.1 * press.standard_error_pa / truth
        } else {
            EXACT
        };
        table.enter(&format!("{what}: session against press"), gap, allowed);
        for (how, modulus) in [("press", press), ("session", session)] {
            let error = (modulus.youngs_modulus_pa - truth).abs();
            let own = modulus.standard_error_pa;
            let case = format!("{what}, {how}");
            table.enter(&format!("{case}: modulus over its error"), error / own, 6.0);
            table.enter(&format!("{case}: that error"), own / truth, 0.02);
            assert!(own > 1e-3 * truth, "{what}, {how}: {own}");
        }
    }
}

fn streamed(trial: &Trial, pipeline: &Pipeline) -> ModulusEstimate {
    let reference = trial.simulation.reference.view();
    let mut session = Session::new(pipeline, &[reference]).unwrap();
    for frame in &trial.simulation.frames {
        session.push(frame.view()).unwrap();
    }
    session.modulus().unwrap()
}

#[test]
fn the_order_of_loads_is_no_matter() {
    let mut trial = trial(coarse_camera(), 200.0, &steps(8));
    let pipeline = pipeline(&trial, SI);
    let both = |trial: &Trial| {
        let press = trial.press(&pipeline).unwrap().modulus().unwrap();
        [press, streamed(trial, &pipeline)]
    };
    let rising = both(&trial);
    trial.simulation.frames.reverse();
    for (a, b) in rising.iter().zip(&both(&trial)) {
        let of = |m: &ModulusEstimate| [m.youngs_modulus_pa, m.standard_error_pa];
        let gap = relative(&of(a), &of(b), 1.0);
        assert!(gap < EXACT, "{gap}");
    }
}

/// Estimators that use strain report how many loads they need.
#[test]
fn one_load_has_no_strain() {
    for (choice, needed) in [
        (EstimatorChoice::PaperRatio, 2),
        (EstimatorChoice::Regression, 3),
    ] {
        match strained(&[0.7], choice) {
            Err(PipelineError::Modulus(ElasticityError::TooFewLoads { expected, .. })) => {
                assert_eq!(expected, needed, "{choice}");
            }
            other => panic!("{choice}: {other:?}"),
        }
    }
}

/// Stress over strain if both are noise: the loads determine no modulus, or zero within six
/// standard errors.
#[test]
fn equal_loads_have_no_ratio() {
    for choice in [EstimatorChoice::PaperRatio, EstimatorChoice::Regression] {
        match strained(&[0.7; 8], choice) {
            Err(PipelineError::Modulus(error)) => assert!(!error.to_string().is_empty()),
            Err(error) => panic!("{choice}: {error}"),
            Ok(modulus) => {
                let (value, error) = (modulus.youngs_modulus_pa, modulus.standard_error_pa);
                assert!(
                    value.abs() < 6.0 * error && error.is_finite(),
                    "{choice}: {value} ± {error}"
                );
                assert!(!modulus.warnings.is_empty(), "{choice}");
            }
        }
    }
}

fn strained(forces: &[f64], choice: EstimatorChoice) -> Result<ModulusEstimate, PipelineError> {
    let trial = trial(coarse_camera(), 200.0, forces);
    let config = StagesConfig {
        estimator: choice,
        ..StagesConfig::default()
    };
    let pipeline = pipeline(&trial, SI)
        .with_stages(&config)?
        .with_control_points(60);
    trial.press(&pipeline)?.modulus()
}
