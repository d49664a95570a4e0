//! Force and modulus of a stream of frames from a camera.
#![allow(clippy::print_stdout)]
use ndarray::Array2;
use std::error::Error;
use tactile_imaging::pipeline::{FrameSource, Session};
use tactile_simulate::Trial;
use tactile_simulate::{CalibrationRun, Camera, LoadCycle, PressOptions};

fn main() -> Result<(), Box<dyn Error>> {
    let camera = Camera::default().coarser(4);
    let options = PressOptions {
        camera,
        ..PressOptions::default()
    };
    let trial = Trial::new(options, &CalibrationRun::default())?;
    // Any source of frames is possible. This one simulates loading and unloading.
    let mut source = trial.scene.stream(LoadCycle {
        largest_force_n: 1.2,
        period_s: 0.5,
        ..LoadCycle::default()
    })?;
    let reference = trial.scene.reference(1);
    let mut session = Session::new(&trial.pipeline()?, &[reference.view()])?;
    let mut frame = Array2::zeros((0, 0));
    while let Some(time_s) = source.next_frame(&mut frame)? {
        let update = session.push(frame.view())?;
        let Some(force) = update.contact.and_then(|contact| contact.force_n) else {
            continue;
        };
        // A modulus needs at least two loads.
        let modulus = session.modulus().map_or("-".to_owned(), |m| {
            let [value, error] = [m.youngs_modulus_pa, m.standard_error_pa].map(|pa| pa * 1e-3);
            format!("{value:.2} ± {error:.2}")
        });
        println!("{time_s:6.3} s   {:.4} N   {modulus} kPa", force.value);
    }
    Ok(())
}
