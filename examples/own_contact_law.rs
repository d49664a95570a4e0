//! A contact law of one's own inside an estimator inside the pipeline: the pipeline measures force
//! and contact, the law turns them into a modulus with an error.
#![allow(clippy::print_stdout)]
use std::error::Error;
use tactile_imaging::elasticity::modulus::{ContactEstimator, ContactLaw, EstimatorKind, LogForce};
use tactile_simulate::{CalibrationRun, PressOptions, Trial};

/// Hertz with F = 4/3 E* a³/R and a factor 1 + 0.3 (a/R)² for contacts that are not small beside
/// the ball, as if the ball grew stiffer while it is squeezed.
struct Stiffening {
    radius_m: f64,
}

impl ContactLaw for Stiffening {
    fn log_force_at_radius(&self, a: f64, _compliance_fraction: f64) -> Option<LogForce> {
        let square = 0.3 * (a / self.radius_m).powi(2);
        let force_over_modulus = 4.0 / 3.0 * a.powi(3) / self.radius_m * (1.0 + square);
        let stiffening_slope = 2.0 * square / (1.0 + square);
        Some(LogForce {
            value: force_over_modulus.ln(),
            // By ln a and by ln R: from these the errors of both lengths reach the modulus.
            slope: 3.0 + stiffening_slope,
            size_slope: -1.0 - stiffening_slope,
        })
    }

    fn kind(&self) -> EstimatorKind {
        EstimatorKind::Other("stiffening ball")
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let trial = Trial::new(PressOptions::default(), &CalibrationRun::default())?;
    let radius_m = trial.scene.options().object.radius_m;
    let pipeline = trial.pipeline()?;
    let own = ContactEstimator::from_law(Stiffening { radius_m }, 0.5)?;
    for pipeline in [trial.pipeline()?.with_estimator(own), pipeline] {
        let modulus = trial.press(&pipeline)?.modulus()?;
        println!(
            "{}: {:.1} ± {:.1} kPa",
            modulus.estimator,
            1e-3 * modulus.youngs_modulus_pa,
            1e-3 * modulus.standard_error_pa
        );
        modulus.warnings.iter().for_each(|w| println!("  {w}"));
    }
    Ok(())
}
