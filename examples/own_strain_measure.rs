//! A user-defined strain measure in the pipeline.
#![allow(clippy::print_stdout)]
use nalgebra::Matrix3;
use std::error::Error;
use tactile_imaging::prelude::*;
use tactile_simulate::{CalibrationRun, PressOptions, Trial};

/// Swainger's strain I − V⁻¹, computed as I − B^(−½): V² = B = F Fᵀ.
struct Swainger;

impl StrainMeasure for Swainger {
    fn of(&self, deformation: &Deformation) -> Result<Matrix3<f64>, ElasticityError> {
        let f = deformation.deformation_gradient();
        let mut b = (f * f.transpose()).symmetric_eigen();
        b.eigenvalues
            .apply(|stretch| *stretch = stretch.sqrt().recip());
        Ok(Matrix3::identity() - b.recompose())
    }

    fn name(&self) -> &'static str {
        "Swainger"
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let trial = Trial::new(PressOptions::default(), &CalibrationRun::default())?;
    let press = trial.press(&trial.pipeline()?.with_strain(Swainger))?;
    let strain = press.strain(1)?;
    println!(
        "{}: e_zz {:.3}",
        strain.measure,
        strain.summary.mean[(2, 2)]
    );
    Ok(())
}
