//! A user-defined contact stage in the pipeline.
#![allow(clippy::print_stdout)]
use ndarray::ArrayView2;
use std::error::Error;
use tactile_imaging::prelude::*;
use tactile_simulate::{CalibrationRun, PressOptions, Trial};

/// All pixels that exceed the reference by a threshold. Their light is the force.
struct Bright {
    threshold: u8,
    newton_per_grey: f64,
    pixel_m: f64,
}

impl ContactStage for Bright {
    fn measure(
        &self,
        frame: ArrayView2<'_, u8>,
        reference: &ReferenceFrame,
    ) -> Result<FrameContact, ForceError> {
        let light = ndarray::Zip::from(frame)
            .and(reference.image())
            .map_collect(|f, r| f.saturating_sub(*r));
        let mask = light.mapv(|grey| grey > self.threshold);
        let (area_px, sum) = (light.iter().zip(&mask).filter(|(_, inside)| **inside))
            .fold((0.0, 0.0), |(n, sum), (grey, _)| {
                (n + 1.0, sum + f64::from(*grey))
            });
        let radius_m = self.pixel_m * (area_px / std::f64::consts::PI).sqrt();
        let force_n = Estimate::new(sum * self.newton_per_grey, 2e-3);
        let radius = Estimate::new(radius_m, 0.5 * self.pixel_m);
        let mut reading = ContactReading::new(Some(force_n), radius);
        reading.peak_grey = light.iter().copied().max().map_or(1.0, f64::from);
        Ok(FrameContact::new(reading, mask.view()))
    }

    fn pixel_size_m(&self) -> [f64; 2] {
        [self.pixel_m; 2]
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let trial = Trial::new(PressOptions::default(), &CalibrationRun::default())?;
    let brightest = trial
        .pairs
        .iter()
        .max_by(|a, b| a.force_n.total_cmp(&b.force_n));
    let pair = brightest.ok_or("no pairs")?;
    let stage = Bright {
        threshold: 3,
        newton_per_grey: pair.force_n / pair.integrated_pixel_value,
        pixel_m: trial.simulation.pixel_size_m[0],
    };
    let press = trial.press(&trial.pipeline()?.with_contact(stage))?;
    for frame in 0..press.frames() {
        println!("{}", press.contact(frame)?.ok_or("no contact")?);
    }
    println!("E = {:.1} kPa", 1e-3 * press.modulus()?.youngs_modulus_pa);
    Ok(())
}
