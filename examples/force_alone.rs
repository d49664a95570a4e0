//! The crate tactile-force alone: a calibration, and the force and contact in one frame.
#![allow(clippy::print_stdout)]
use ndarray::Array2;
use tactile_force::{CalibrationPair, ForceError, ForceOptions, LinearCalibration, measure_force};

fn main() -> Result<(), ForceError> {
    // Known forces and what the frames added up to, loading and unloading.
    let value = |k: u32| 1e5 * f64::from(k);
    let force = |k: u32| 0.5 * f64::from(k);
    let loading = (0..=10).map(|k| CalibrationPair::loading(value(k), force(k)));
    let unloading = (0..10).rev();
    let unloading = unloading.map(|k| CalibrationPair::unloading(value(k) + 200.0, force(k)));
    let pairs: Vec<_> = loading.chain(unloading).collect();
    let calibration = LinearCalibration::fit(&pairs, &Default::default())?;
    let report = calibration.report();
    println!(
        "R² {:.6}, smallest force {:.1} mN",
        report.r_squared,
        1e3 * report.smallest_force_n
    );

    let reference = Array2::from_elem((200, 200), 12_u8);
    let frame = Array2::from_shape_fn((200, 200), |(y, x)| {
        let share = ((x as f64 - 90.3).powi(2) + (y as f64 - 104.8).powi(2)) / 1600.0;
        12 + (150.0 * (1.0 - share).max(0.0).sqrt()).round() as u8
    });

    let found = measure_force(
        frame.view(),
        reference.view(),
        [20e-6; 2],
        &calibration,
        &ForceOptions::default(),
    )?;
    println!("force {} N", found.force_n);
    if let Some(radius) = found.contact_radius_m {
        println!("contact radius {:.3} mm", 1e3 * radius.value);
    }
    Ok(())
}
