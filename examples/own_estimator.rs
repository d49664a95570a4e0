//! An estimator of one's own as a stage of the pipeline: the mean of Hertz's modulus over all
//! loads, with the errors of forces and radii, of the calibration and of the pixel carried along.
#![allow(clippy::print_stdout)]
use std::error::Error;
use tactile_imaging::elasticity::ElasticityError;
use tactile_imaging::elasticity::modulus::{
    Estimate, EstimatorKind, LoadSeries, ModulusEstimate, ModulusEstimator,
};
use tactile_simulate::{CalibrationRun, PressOptions, Trial};

/// E = ¾(1 − ν²) F R/a³ of an incompressible ball on a rigid flat.
struct MeanOfHertz {
    radius_m: f64,
}

impl ModulusEstimator for MeanOfHertz {
    fn estimate(&self, series: &LoadSeries) -> Result<ModulusEstimate, ElasticityError> {
        let (mut sum, mut variance, mut count) = (0.0, 0.0, 0.0);
        for load in series.loads() {
            let (f, Some(a)) = (load.force_n, load.contact_radius_m) else {
                continue;
            };
            let modulus = 0.75 * 0.75 * f.value * self.radius_m / a.value.powi(3);
            sum += modulus;
            variance += (modulus * f.relative_error().hypot(3.0 * a.relative_error())).powi(2);
            count += 1.0;
        }
        if count == 0.0 {
            return Err(ElasticityError::custom("no load has a contact radius"));
        }
        // Errors that all loads share are not averaged away.
        let (mean, shared) = (sum / count, series.shared_errors());
        let common = shared
            .force_scale
            .hypot(3.0 * shared.length_scale)
            .hypot(shared.size);
        let error = (variance / (count * count) + (mean * common).powi(2)).sqrt();
        Ok(ModulusEstimate::new(
            self.kind(),
            Estimate::new(mean, error),
        ))
    }

    fn kind(&self) -> EstimatorKind {
        EstimatorKind::Other("mean of Hertz")
    }

    fn needs_strain(&self) -> bool {
        false
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let trial = Trial::new(PressOptions::default(), &CalibrationRun::default())?;
    let radius_m = trial.scene.options().object.radius_m;
    let pipeline = trial.pipeline()?.with_estimator(MeanOfHertz { radius_m });
    let modulus = trial.press(&pipeline)?.modulus()?;
    let kpa = |pa: f64| 1e-3 * pa;
    println!(
        "{}: {:.1} ± {:.1} kPa",
        modulus.estimator,
        kpa(modulus.youngs_modulus_pa),
        kpa(modulus.standard_error_pa)
    );
    Ok(())
}
