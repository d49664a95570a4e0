//! A user-defined contact law in an estimator of the pipeline. The pipeline measures force and
//! contact and provides the guide; the law converts them to a modulus with an error.
#![allow(clippy::print_stdout)]
use std::error::Error;
use tactile_imaging::elasticity::laws::{ContactLaw, ContactLength, Limits, LogForce, Reach};
use tactile_imaging::elasticity::modulus::ContactEstimator;
use tactile_simulate::{CalibrationRun, PressOptions, Trial};

/// A small contact of a ball, from its radius: F = 4/3 E* a³/R.
struct Ball {
    radius_m: f64,
}

impl ContactLaw for Ball {
    fn log_force(&self, length: ContactLength, _share: f64) -> Reach {
        match length {
            ContactLength::Radius(a) if a > 1.5 * self.radius_m => Reach::Beyond,
            ContactLength::Radius(a) => {
                let force_over_modulus = 4.0 / 3.0 * a.powi(3) / self.radius_m;
                Reach::At(LogForce::new(force_over_modulus.ln()))
            }
            _ => Reach::NotMine,
        }
    }

    fn limits(&self) -> Limits {
        Limits::of_ball(self.radius_m, 0.3)
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let trial = Trial::new(PressOptions::default(), &CalibrationRun::default())?;
    let ball = trial.scene.options().object;
    let law = Ball {
        radius_m: ball.radius_m,
    };
    let own = ContactEstimator::from_law(law, ball.material.poisson_ratio)?.named("my ball");
    let pipeline = trial.pipeline()?;
    for pipeline in [pipeline.clone().with_estimator(own), pipeline] {
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
