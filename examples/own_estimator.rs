//! A user-defined estimator as a stage of the pipeline: the weighted mean of Hertz's modulus over
//! all loads. The errors of forces and radii, of the calibration, of the pixel size and of the
//! guide are propagated.
#![allow(clippy::print_stdout)]
use std::error::Error;
use tactile_imaging::elasticity::ElasticityError;
use tactile_imaging::elasticity::modulus::{
    EstimatorKind, LoadSeries, ModulusEstimate, ModulusEstimator, Source, Uncertain,
};
use tactile_simulate::{CalibrationRun, PressOptions, Trial};

/// E* = ¾ F R/a³ of a ball, and E from 1/E* = (1 − ν²)/E + C with the compliance C of the guide.
struct MeanOfHertz;

impl ModulusEstimator for MeanOfHertz {
    fn estimate(&self, series: &LoadSeries) -> Result<ModulusEstimate, ElasticityError> {
        let no_ball = || ElasticityError::custom("the object is no ball");
        let bodies = series.bodies().ok_or_else(no_ball)?;
        let radius_m = bodies.object().sphere_radius_m().ok_or_else(no_ball)?;
        let (mut sum, mut weights, mut radii) = (Uncertain::exact(0.0), 0.0, Vec::new());
        for load in series.loads() {
            let (f, Some(a)) = (load.force_n, load.contact_radius_m) else {
                continue;
            };
            // ln (¾ F/a³), weighted by its noise.
            let log = (f * a.powf(-3.0) * 0.75).map(f64::ln, f64::recip);
            let weight = log.part(Source::Noise).powi(-2);
            sum = sum + log * weight;
            weights += weight;
            radii.push(a);
        }
        let radius_m = bodies.size() * radius_m;
        let reduced = (sum * f64::recip(weights)).map(f64::exp, f64::exp) * radius_m;
        // Each source of error is propagated separately from here to the modulus.
        let mean_m = Uncertain::mean(&radii).value;
        let compliance = bodies.guide_compliance(mean_m) * bodies.in_series().compliance_per_pa();
        let lateral = bodies
            .poisson_ratio()
            .map(|nu| 1.0 - nu * nu, |nu| -2.0 * nu);
        let modulus_pa = lateral / (reduced.powf(-1.0) - compliance);
        Ok(ModulusEstimate::new(self.kind(), modulus_pa))
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
