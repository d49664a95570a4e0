//! An estimator of one's own as a stage of the pipeline: the weighted mean of Hertz's modulus over
//! all loads, with the errors of forces and radii, of the calibration, of the pixel and of the guide
//! carried along.
#![allow(clippy::print_stdout)]
use std::error::Error;
use tactile_imaging::elasticity::ElasticityError;
use tactile_imaging::elasticity::modulus::{
    Estimate, EstimatorKind, LoadSeries, ModulusEstimate, ModulusEstimator,
};
use tactile_simulate::{CalibrationRun, PressOptions, Trial};

/// E* = ¾ F R/a³ of a ball, and of it E by 1/E* = (1 − ν²)/E + C with the guide's compliance C.
struct MeanOfHertz;

impl ModulusEstimator for MeanOfHertz {
    fn estimate(&self, series: &LoadSeries) -> Result<ModulusEstimate, ElasticityError> {
        let no_ball = || ElasticityError::custom("the object is no ball");
        let bodies = series.bodies().ok_or_else(no_ball)?;
        let radius_m = bodies.object().sphere_radius_m().ok_or_else(no_ball)?;
        let (mut sum, mut weights) = (0.0, 0.0);
        for load in series.loads() {
            let (f, Some(a)) = (load.force_n, load.contact_radius_m) else {
                continue;
            };
            let error = f.relative_error().hypot(3.0 * a.relative_error());
            sum += (0.75 * f.value * radius_m / a.value.powi(3)).ln() / (error * error);
            weights += 1.0 / (error * error);
        }
        let reduced = (sum / weights).exp();
        // The ball's part of the compliance, by which errors of E* grow.
        let part = 1.0 - reduced * bodies.in_series().compliance_per_pa();
        let nu = bodies.object().poisson_ratio();
        let modulus = (1.0 - nu * nu) * reduced / part;
        // Errors that all loads share are not averaged away.
        let shared = series.shared_errors();
        let relative = (weights.recip().sqrt().hypot(shared.force_scale))
            .hypot(3.0 * shared.length_scale)
            .hypot(shared.size)
            .hypot((1.0 - part) * shared.other_body);
        let modulus = Estimate::new(modulus, relative / part * modulus);
        Ok(ModulusEstimate::new(self.kind(), modulus))
    }

    fn kind(&self) -> EstimatorKind {
        EstimatorKind::Other("mean of Hertz")
    }

    fn needs_strain(&self) -> bool {
        false
    }

    fn counts_guide(&self) -> bool {
        true
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let trial = Trial::new(PressOptions::default(), &CalibrationRun::default())?;
    let pipeline = trial.pipeline()?;
    for pipeline in [pipeline.clone().with_estimator(MeanOfHertz), pipeline] {
        let modulus = trial.press(&pipeline)?.modulus()?;
        println!(
            "{}: {:.1} ± {:.1} kPa",
            modulus.estimator,
            1e-3 * modulus.youngs_modulus_pa,
            1e-3 * modulus.standard_error_pa
        );
    }
    Ok(())
}
