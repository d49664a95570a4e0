//! Plays a loading–unloading series at camera rate and prints force and modulus live.
//!
//! ```text
//! cargo run --release --example live_stream                     # simulated: Fig. 9's 0 to 2 N and back at 80 frames a second
//! cargo run --release --example live_stream -- --full-size      # frames of 1392 × 1042
//! ```
//! Frames are made beforehand, so that only the measuring is timed; a frame is late if its answer comes after the next
//! frame is due.
#![allow(clippy::print_stdout, clippy::print_stderr)]
use clap::Parser;
use ndarray::Array2;
use std::sync::Arc;
use std::time::{Duration, Instant};
use tactile_imaging::pipeline::{FrameSource, Session, Trial};
use tactile_imaging::simulate::{CalibrationOptions, Camera, Gain, Load, LoadCycle, PressOptions};

/// Plays a simulated loading–unloading series at camera rate.
#[derive(Parser)]
struct Arguments {
    /// Frames per second.
    #[arg(long, default_value_t = 80.0)]
    rate: f64,
    /// Largest force in newtons.
    #[arg(long, default_value_t = 1.5)]
    force: f64,
    /// Seconds of one load and unload.
    #[arg(long, default_value_t = 2.0)]
    period: f64,
    /// Cycles.
    #[arg(long, default_value_t = 1)]
    cycles: usize,
    /// Frames of 1392 × 1042 pixels instead of 348 × 260.
    #[arg(long)]
    full_size: bool,
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments = Arguments::parse();
    let small = Camera { shape: [260, 348], pixel_size_m: [86.2e-6; 2], ..Camera::default() };
    let camera = if arguments.full_size { Camera::default() } else { small };
    let loads = vec![Load::normal(arguments.force)];
    let options = PressOptions { camera, loads, gain: Gain::PeakGrey(200.0), ..PressOptions::default() };
    let trial = Trial::new(options, &CalibrationOptions::default())?;
    let cycle = LoadCycle {
        largest_force_n: arguments.force,
        period_s: arguments.period,
        cycles: arguments.cycles,
        frame_rate_hz: arguments.rate,
        ..LoadCycle::default()
    };
    let mut source = trial.scene.stream(cycle)?;
    eprintln!("making {} frames", source.len());
    let mut frames = Vec::new();
    let mut frame = Array2::zeros((0, 0));
    while let Some(time_s) = source.next_frame(&mut frame)? {
        frames.push((time_s, frame.clone()));
    }
    let references: Vec<_> = (1..5).map(|k| trial.scene.reference(k)).collect();
    let views: Vec<_> = references.iter().map(|r| r.view()).collect();
    let mut session = Session::from_frames(Arc::new(trial.pipeline()?), &views)?;
    let late = play(&mut session, &frames, arguments.rate)?;
    let share = 100.0 * late as f64 / frames.len() as f64;
    println!("{} frames at {} Hz, {late} late ({share:.1} %)", frames.len(), arguments.rate);
    let (modulus, truth) = (session.modulus()?, trial.truth().youngs_modulus_pa);
    let (value, error) = (modulus.youngs_modulus_pa * 1e-3, modulus.standard_error_pa * 1e-3);
    println!(
        "modulus {value:.2} ± {error:.2} kPa, true {:.2} kPa ({:+.2} %)",
        truth * 1e-3,
        100.0 * (modulus.youngs_modulus_pa / truth - 1.0)
    );
    Ok(())
}

/// Gives every frame to the session when it is due; the number of frames that came late.
fn play(
    session: &mut Session,
    frames: &[(f64, Array2<u8>)],
    rate: f64,
) -> Result<usize, Box<dyn std::error::Error>> {
    let period = Duration::from_secs_f64(1.0 / rate);
    session.push(frames[0].1.view())?; // buffers get their size before the clock starts
    let start = Instant::now();
    let mut late = 0;
    println!("time (s)   force (N)   radius (mm)   modulus (kPa)");
    for (i, (time_s, frame)) in frames.iter().enumerate() {
        let due = Duration::from_secs_f64(*time_s);
        std::thread::sleep(due.saturating_sub(start.elapsed()));
        let update = session.push(frame.view())?;
        let modulus = session.modulus().ok();
        late += usize::from(start.elapsed() > due + period);
        if i % 16 == 0 {
            let (force, radius) = update
                .contact
                .map_or((0.0, 0.0), |c| (c.force_n.map_or(0.0, |f| f.value), c.contact_radius_m.value));
            let text = modulus.map_or("-".into(), |m| {
                format!("{:.2} ± {:.2}", m.youngs_modulus_pa * 1e-3, m.standard_error_pa * 1e-3)
            });
            println!("{time_s:8.3} {force:11.4} {:13.4}   {text}", radius * 1e3);
        }
    }
    Ok(late)
}
