//! Plays a loading–unloading series at camera rate and prints force and modulus live.
//!
//! ```text
//! cargo run --release --example live_stream                     # simulated: Fig. 9's 0 to 2 N and back at 80 frames a second
//! cargo run --release --example live_stream -- --full-size      # frames of 1392 × 1042
//! ```
//! Frames are made beforehand, so that only the measuring is timed; a frame is late if its answer comes after the next
//! frame is due. The exit status is 1 if a frame came late or the modulus ends outside the tolerance.
#![allow(clippy::print_stdout, clippy::print_stderr)]
use clap::Parser;
use ndarray::Array2;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::{Duration, Instant};
use tactile_imaging::elasticity::modulus::ModulusEstimate;
use tactile_imaging::pipeline::{FrameSource, Session, Trial, Update, with_error};
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
    /// Error of the modulus in per cent beyond which the run fails.
    #[arg(long, default_value_t = 3.0)]
    tolerance: f64,
}

type Failure = Box<dyn std::error::Error>;
/// Times in seconds and frames.
type Recording = Vec<(f64, Array2<u8>)>;

fn main() -> Result<ExitCode, Failure> {
    let arguments = Arguments::parse();
    let trial = Trial::new(press_options(&arguments), &CalibrationOptions::default())?;
    let frames = record(&trial, &arguments)?;
    let references: Vec<_> = (1..5).map(|k| trial.scene.reference(k)).collect();
    let views: Vec<_> = references.iter().map(|r| r.view()).collect();
    let mut session = Session::from_frames(Arc::new(trial.pipeline()?), &views)?;
    let truth = trial.truth().youngs_modulus_pa;
    let late = play(&mut session, &frames, arguments.rate, truth)?;
    let share = 100.0 * late as f64 / frames.len() as f64;
    println!("{} frames at {} Hz, {late} late ({share:.1} %)", frames.len(), arguments.rate);
    let modulus = session.modulus()?;
    let error = 100.0 * (modulus.youngs_modulus_pa / truth - 1.0);
    println!("modulus {}, true {:.2} kPa ({error:+.2} %)", in_kpa(&modulus), truth * 1e-3);
    if let Some(caution) = session.drift_flag() {
        println!("caution: {caution}");
    }
    Ok(verdict(late, error, arguments.tolerance))
}

/// Success if no frame came late and the modulus is right; says on stderr what is not.
fn verdict(late: usize, error_percent: f64, tolerance_percent: f64) -> ExitCode {
    let wrong = error_percent.is_nan() || error_percent.abs() > tolerance_percent;
    if late > 0 {
        eprintln!("failed: {late} frames came late");
    }
    if wrong {
        eprintln!("failed: the modulus is off by {error_percent:+.2} %, more than {tolerance_percent} %");
    }
    if late > 0 || wrong { ExitCode::FAILURE } else { ExitCode::SUCCESS }
}

fn press_options(arguments: &Arguments) -> PressOptions {
    let small = Camera { shape: [260, 348], pixel_size_m: [86.2e-6; 2], ..Camera::default() };
    let camera = if arguments.full_size { Camera::default() } else { small };
    let loads = vec![Load::normal(arguments.force)];
    PressOptions { camera, loads, gain: Gain::PeakGrey(200.0), ..PressOptions::default() }
}

/// Makes all frames of the loading and unloading.
fn record(trial: &Trial, arguments: &Arguments) -> Result<Recording, Failure> {
    let mut source = trial.scene.stream(LoadCycle {
        largest_force_n: arguments.force,
        period_s: arguments.period,
        cycles: arguments.cycles,
        frame_rate_hz: arguments.rate,
        ..LoadCycle::default()
    })?;
    eprintln!("making {} frames", source.len());
    let mut frames = Recording::new();
    let mut frame = Array2::zeros((0, 0));
    while let Some(time_s) = source.next_frame(&mut frame)? {
        frames.push((time_s, frame.clone()));
    }
    Ok(frames)
}

/// Gives every frame to the session when it is due; the number of frames that came late.
fn play(
    session: &mut Session,
    frames: &[(f64, Array2<u8>)],
    rate: f64,
    truth_pa: f64,
) -> Result<usize, Failure> {
    let Some((_, first)) = frames.first() else { return Ok(0) };
    let period = Duration::from_secs_f64(1.0 / rate);
    session.push(first.view())?; // buffers get their size before the clock starts
    let start = Instant::now();
    let mut late = 0;
    println!("time (s)   force (N)   radius (mm)   late (%)   modulus (kPa)");
    for (i, (time_s, frame)) in frames.iter().enumerate() {
        let due = Duration::from_secs_f64(*time_s);
        std::thread::sleep(due.saturating_sub(start.elapsed()));
        let update = session.push(frame.view())?;
        let modulus = session.modulus().ok();
        late += usize::from(start.elapsed() > due + period);
        if i % 16 == 0 {
            let share = 100.0 * late as f64 / (i + 1) as f64;
            print_line(*time_s, &update, share, modulus.as_ref(), truth_pa);
        }
    }
    Ok(late)
}

fn print_line(
    time_s: f64,
    update: &Update,
    late_percent: f64,
    modulus: Option<&ModulusEstimate<f64>>,
    truth_pa: f64,
) {
    let contact = update.contact.as_ref();
    let force = contact.and_then(|c| c.force_n).map_or(0.0, |f| f.value);
    let radius_mm = contact.map_or(0.0, |c| c.contact_radius_m.value * 1e3);
    let text = modulus.map_or("-".into(), |m| {
        format!("{} ({:+.2} %)", in_kpa(m), 100.0 * (m.youngs_modulus_pa / truth_pa - 1.0))
    });
    println!("{time_s:8.3} {force:11.4} {radius_mm:13.4} {late_percent:10.1}   {text}");
}

fn in_kpa(modulus: &ModulusEstimate<f64>) -> String {
    format!("{} kPa", with_error(modulus.youngs_modulus_pa, modulus.standard_error_pa, 1e-3))
}
