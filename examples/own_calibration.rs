//! A user-defined calibration: light that saturates, F = c V/(V₀ − V), and the force of a frame.
#![allow(clippy::print_stdout)]
use ndarray::Array2;
use tactile_force::{ForceError, StressCalibration, measure_force};

struct Saturating {
    scale_n: f64,
    most: f64,
}

impl StressCalibration for Saturating {
    fn force_n(&self, integrated_pixel_value: f64) -> f64 {
        self.scale_n * integrated_pixel_value / (self.most - integrated_pixel_value)
    }
    fn range(&self) -> [f64; 2] {
        [0.0, 0.9 * self.most]
    }
}

fn main() -> Result<(), ForceError> {
    let calibration = Saturating {
        scale_n: 2.0,
        most: 1e5,
    };
    let reference = Array2::from_elem((64, 64), 12_u8);
    let mut frame = reference.clone();
    frame.slice_mut(ndarray::s![20..40, 20..40]).fill(112);
    let (frame, reference) = (frame.view(), reference.view());
    let found = measure_force(
        frame,
        reference,
        [20e-6; 2],
        &calibration,
        &Default::default(),
    )?;
    println!("force {} N", found.force_n);
    Ok(())
}
