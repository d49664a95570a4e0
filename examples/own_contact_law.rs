//! A user-defined contact law: the pipeline measures force and contact, the law turns them into a modulus.
#![allow(clippy::print_stdout)]
use std::error::Error;
use tactile_simulate::Trial;
use tactile_simulate::{CalibrationRun, PressOptions};

/// Hertz with a rigid sensor, F = 4/3 E* a³/R, and a factor for contacts that are not small against the ball:
/// 1 + 0.3 (a/R)², as if the ball grew stiffer while it is squeezed.
fn modulus_pa(force_n: f64, contact_radius_m: f64, ball_radius_m: f64) -> f64 {
    let share = contact_radius_m / ball_radius_m;
    let reduced = 0.75 * force_n * ball_radius_m / contact_radius_m.powi(3);
    // Poisson's ratio of the ball is 1/2.
    0.75 * reduced / (1.0 + 0.3 * share * share)
}

fn main() -> Result<(), Box<dyn Error>> {
    let trial = Trial::new(PressOptions::default(), &CalibrationRun::default())?;
    let pipeline = trial.pipeline()?;
    let mut press = trial.press(&pipeline)?;
    let radius_m = trial.scene.options().object.radius_m;
    for (k, load) in press.load_series()?.loads().iter().enumerate() {
        let Some(contact) = load.contact_radius_m else {
            continue;
        };
        let own = modulus_pa(load.force_n.value, contact.value, radius_m);
        println!("load {}: {:.1} kPa", k + 1, 1e-3 * own);
    }
    // The laws of the crate tactile-elasticity come with an error and with warnings.
    let modulus = press.modulus()?;
    println!(
        "default: {:.1} ± {:.1} kPa",
        1e-3 * modulus.youngs_modulus_pa,
        1e-3 * modulus.standard_error_pa
    );
    modulus.warnings.iter().for_each(|w| println!("  {w}"));
    Ok(())
}
