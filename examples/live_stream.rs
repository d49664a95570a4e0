//! Plays a loading–unloading series at camera rate and prints force and modulus live.
//!
//! ```text
//! cargo run --release --example live_stream                     # simulated: Fig. 9's 0 to 2 N and back at 80 frames a second
//! cargo run --release --example live_stream -- --full-size      # frames of 1392 × 1042
//! cargo run --release --example live_stream -- --strain         # the strain of every frame as well
//! ```
//! Frames are made beforehand, so that only the measuring is timed; a frame is late if its answer comes after the next
//! frame is due. The exit status is 1 if more frames came late than allowed (none) or the modulus ends outside the tolerance.
#![allow(clippy::print_stdout, clippy::print_stderr)]
use clap::Parser;
use ndarray::Array2;
use std::process::ExitCode;
use std::time::{Duration, Instant};
use tactile_imaging::elasticity::modulus::ModulusEstimate;
use tactile_imaging::pipeline::{FrameSource, PipelineError, Session, Trial, Update, with_error};
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
    /// Measure strain too, in frames of at least a third of the largest force, counted from the first of them.
    #[arg(long)]
    strain: bool,
    /// Share of frames in per cent that may come late: a machine that is not ours alone has its own ideas.
    #[arg(long, default_value_t = 0.0)]
    allowed_late: f64,
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
    let mut session = Session::from_frames(&trial.pipeline()?, &views)?;
    let truth = trial.truth().youngs_modulus_pa;
    let late = play(&mut session, &frames, &arguments, truth)?;
    let share = 100.0 * late as f64 / frames.len() as f64;
    println!(
        "{} frames at {} Hz, {late} late ({share:.1} %)",
        frames.len(),
        arguments.rate
    );
    let modulus = session.modulus()?;
    let error = 100.0 * (modulus.youngs_modulus_pa / truth - 1.0);
    println!(
        "modulus {}, true {:.2} kPa ({error:+.2} %)",
        in_kpa(&modulus),
        truth * 1e-3
    );
    print!("{}", session.report());
    if let Some(caution) = session.drift_flag() {
        println!("caution: {caution}");
    }
    Ok(verdict(share, error, &arguments))
}

/// Success if few enough frames came late and the modulus is right; says on stderr what is not.
fn verdict(late_percent: f64, error_percent: f64, arguments: &Arguments) -> ExitCode {
    let Arguments {
        tolerance,
        allowed_late,
        ..
    } = arguments;
    let wrong = error_percent.is_nan() || error_percent.abs() > *tolerance;
    let late = late_percent > *allowed_late;
    if late {
        eprintln!(
            "failed: {late_percent:.1} % of the frames came late, more than {allowed_late} %"
        );
    }
    if wrong {
        eprintln!("failed: the modulus is off by {error_percent:+.2} %, more than {tolerance} %");
    }
    if late || wrong {
        ExitCode::FAILURE
    } else {
        ExitCode::SUCCESS
    }
}

fn press_options(arguments: &Arguments) -> PressOptions {
    let small = Camera {
        shape: [260, 348],
        pixel_size_m: [86.2e-6; 2],
        ..Camera::default()
    };
    let camera = if arguments.full_size {
        Camera::default()
    } else {
        small
    };
    let loads = vec![Load::normal(arguments.force)];
    PressOptions {
        camera,
        loads,
        gain: Gain::PeakGrey(200.0),
        ..PressOptions::default()
    }
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
    arguments: &Arguments,
    truth_pa: f64,
) -> Result<usize, Failure> {
    let Some((_, first)) = frames.first() else {
        return Ok(0);
    };
    let period = Duration::from_secs_f64(1.0 / arguments.rate);
    session.push(first.view())?; // buffers get their size before the clock starts
    let start = Instant::now();
    let mut late = 0;
    let heading = if arguments.strain {
        "   strain xx, zz"
    } else {
        ""
    };
    println!("time (s)   force (N)   radius (mm)   late (%)   modulus (kPa){heading}");
    for (i, (time_s, frame)) in frames.iter().enumerate() {
        let due = Duration::from_secs_f64(*time_s);
        std::thread::sleep(due.saturating_sub(start.elapsed()));
        let update = session.push(frame.view())?;
        let modulus = session.modulus().ok();
        let force = update
            .contact
            .and_then(|c| c.force_n)
            .map_or(0.0, |f| f.value);
        let strained = arguments.strain && force > arguments.force / 3.0;
        let strain = if strained { strain_of(session)? } else { None };
        late += usize::from(start.elapsed() > due + period);
        if i % 16 == 0 {
            let share = 100.0 * late as f64 / (i + 1) as f64;
            print_line(*time_s, &update, share, modulus.as_ref(), truth_pa);
            println!(
                "{}",
                strain.map_or(String::new(), |[x, z]| format!("   {x:+.3}, {z:+.3}"))
            );
        }
    }
    Ok(late)
}

/// Mean strain along x and z; none of the frame that strain is counted from, and where the match has too few points to tell.
fn strain_of(session: &mut Session) -> Result<Option<[f64; 2]>, Failure> {
    match session.strain() {
        Ok(found) => Ok(found.map(|s| [(0, 0), (2, 2)].map(|at| s.strain.summary.mean[at]))),
        Err(PipelineError::TooFewMatches { .. } | PipelineError::Surface { .. }) => Ok(None),
        Err(error) => Err(error.into()),
    }
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
        format!(
            "{} ({:+.2} %)",
            in_kpa(m),
            100.0 * (m.youngs_modulus_pa / truth_pa - 1.0)
        )
    });
    print!("{time_s:8.3} {force:11.4} {radius_mm:13.4} {late_percent:10.1}   {text:<27}");
}

fn in_kpa(modulus: &ModulusEstimate<f64>) -> String {
    format!(
        "{} kPa",
        with_error(modulus.youngs_modulus_pa, modulus.standard_error_pa, 1e-3)
    )
}
