//! `tactile stream`: a loading–unloading series at camera rate, force and modulus live.
use crate::context::Context;
use crate::failure::{Exit, Failure};
use crate::numbers::{not_negative, positive};
use crate::progress::Progress;
use clap::Args;
use ndarray::Array2;
use serde_json::{Value, json};
use std::time::{Duration, Instant};
use tactile_imaging::elasticity::modulus::ModulusEstimate;
use tactile_imaging::pipeline::{FrameSource, PipelineError, Session, Trial, Update, with_error};
use tactile_imaging::simulate::{CalibrationOptions, Camera, Gain, Load, LoadCycle, PressOptions};

/// Play a simulated loading–unloading series at camera rate and measure it live
///
/// Frames are made beforehand, so that only the measuring is timed; a frame is late if its answer comes after the next
/// frame is due. The exit code is 1 if more frames came late than allowed or the modulus ends outside the tolerance.
#[derive(Args)]
#[command(after_help = "\
Examples:
  tactile stream --rate 20 --period 1 --allowed-late 100
  tactile stream --rate 20 --period 1 --allowed-late 100 --strain --json")]
pub struct Arguments {
    /// Frames per second.
    #[arg(long, value_name = "HZ", default_value_t = 80.0, value_parser = positive)]
    rate: f64,
    /// Largest force in newtons.
    #[arg(long, value_name = "N", default_value_t = 1.5, value_parser = positive)]
    force: f64,
    /// Seconds of one load and unload.
    #[arg(long, value_name = "S", default_value_t = 2.0, value_parser = positive)]
    period: f64,
    /// Cycles.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    cycles: u32,
    /// Frames of 1392 × 1042 pixels instead of 348 × 260.
    #[arg(long)]
    full_size: bool,
    /// Measure strain too, in frames of at least a third of the largest force, counted from the first of them.
    #[arg(long)]
    strain: bool,
    /// Share of frames in per cent that may come late.
    #[arg(long, value_name = "PERCENT", default_value_t = 0.0, value_parser = not_negative)]
    allowed_late: f64,
    /// Error of the modulus in per cent beyond which the run fails.
    #[arg(long, value_name = "PERCENT", default_value_t = 3.0, value_parser = positive)]
    tolerance: f64,
}

/// Times in seconds and frames.
type Recording = Vec<(f64, Array2<u8>)>;

/// Every so many frames one is printed.
const PRINTED: usize = 16;

pub fn run(arguments: &Arguments, context: &mut Context) -> Result<Exit, Failure> {
    let options = press_options(arguments);
    let pixels = options.camera.shape.iter().product::<usize>() as f64;
    let frames = arguments.rate * arguments.period * f64::from(arguments.cycles);
    let job = format!("a stream of {frames:.0} frames");
    context.memory.allow(
        frames * pixels,
        &job,
        "ask for fewer cycles or a lower rate",
    )?;
    let trial = Trial::new(options, &CalibrationOptions::default())
        .map_err(|error| Failure::input(format!("the press cannot be simulated: {error}")))?;
    let frames = record(&trial, arguments, context)?;
    let references: Vec<_> = (1..5).map(|k| trial.scene.reference(k)).collect();
    let views: Vec<_> = references.iter().map(|r| r.view()).collect();
    let pipeline = trial.pipeline().map_err(Failure::no_answer)?;
    let mut session = Session::from_frames(&pipeline, &views).map_err(Failure::no_answer)?;
    let truth_pa = trial.truth().youngs_modulus_pa;
    let played = play(&mut session, &frames, arguments, truth_pa, context);
    let played = played.map_err(Failure::no_answer)?;
    let share = 100.0 * played.late as f64 / played.frames.max(1) as f64;
    let console = &mut context.console;
    console.line(format!(
        "{} frames at {} Hz, {} late ({share:.1} %)",
        played.frames, arguments.rate, played.late
    ));
    let modulus = session.modulus();
    let error = match &modulus {
        Ok(modulus) => 100.0 * (modulus.youngs_modulus_pa / truth_pa - 1.0),
        Err(_) => f64::NAN,
    };
    match &modulus {
        Ok(modulus) => console.line(format!(
            "modulus {}, true {:.2} kPa ({error:+.2} %)",
            in_kpa(modulus),
            truth_pa * 1e-3
        )),
        Err(reason) => console.line(format!("modulus none: {reason}")),
    }
    console.line(session.report());
    if let Some(caution) = session.drift_flag() {
        console.line(format!("caution: {caution}"));
    }
    console.value(&json!({
        "frames": played.frames, "rate_hz": arguments.rate, "late": played.late, "updates": played.updates,
        "youngs_modulus_pa": match &modulus {
            Ok(m) => json!({ "value": { "value": m.youngs_modulus_pa, "standard_error": m.standard_error_pa } }),
            Err(reason) => json!({ "error": reason.to_string() }),
        },
        "true_youngs_modulus_pa": truth_pa,
    }));
    Ok(verdict(share, error, arguments, context))
}

/// Complete if few enough frames came late and the modulus is right; says on standard error what is not.
fn verdict(
    late_percent: f64,
    error_percent: f64,
    arguments: &Arguments,
    context: &Context,
) -> Exit {
    let Arguments {
        tolerance,
        allowed_late,
        ..
    } = arguments;
    let mut exit = Exit::Complete;
    if late_percent > *allowed_late {
        exit = Exit::Partial;
        context.console.note(format!(
            "{late_percent:.1} % of the frames came late, more than {allowed_late} %"
        ));
    }
    if error_percent.is_nan() || error_percent.abs() > *tolerance {
        exit = Exit::Partial;
        context.console.note(format!(
            "the modulus is off by {error_percent:+.2} %, more than {tolerance} %"
        ));
    }
    exit
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
    PressOptions {
        camera,
        loads: vec![Load::normal(arguments.force)],
        gain: Gain::PeakGrey(200.0),
        ..PressOptions::default()
    }
}

/// Makes all frames of the loading and unloading; Ctrl-C leaves those that are made.
fn record(trial: &Trial, arguments: &Arguments, context: &Context) -> Result<Recording, Failure> {
    let cycle = LoadCycle {
        largest_force_n: arguments.force,
        period_s: arguments.period,
        cycles: arguments.cycles as usize,
        frame_rate_hz: arguments.rate,
        ..LoadCycle::default()
    };
    let source = trial.scene.stream(cycle);
    let mut source =
        source.map_err(|e| Failure::input(format!("the series cannot be simulated: {e}")))?;
    let mut bar = Progress::of(source.len(), format!("making {} frames", source.len()));
    let mut frames = Recording::new();
    let mut frame = Array2::zeros((0, 0));
    context.interrupt.hear(true);
    while !context.interrupt.requested()
        && let Some(time_s) = source.next_frame(&mut frame).map_err(Failure::no_answer)?
    {
        frames.push((time_s, frame.clone()));
        bar.done(frames.len());
    }
    Ok(frames)
}

/// What became of the frames.
struct Played {
    frames: usize,
    late: usize,
    /// One of some frames, as JSON.
    updates: Vec<Value>,
}

/// Gives every frame to the session when it is due.
fn play(
    session: &mut Session,
    frames: &[(f64, Array2<u8>)],
    arguments: &Arguments,
    truth_pa: f64,
    context: &mut Context,
) -> Result<Played, PipelineError> {
    let mut played = Played {
        frames: 0,
        late: 0,
        updates: Vec::new(),
    };
    let Some((_, first)) = frames.first() else {
        return Ok(played);
    };
    let period = Duration::from_secs_f64(1.0 / arguments.rate);
    // Buffers get their size before the clock starts.
    session.push(first.view())?;
    let start = Instant::now();
    let heading = if arguments.strain {
        "   strain xx, zz"
    } else {
        ""
    };
    context.console.line(format!(
        "time (s)   force (N)   radius (mm)   late (%)   modulus (kPa){heading}"
    ));
    for (time_s, frame) in frames {
        if context.interrupt.requested() {
            break;
        }
        let due = Duration::from_secs_f64(*time_s);
        std::thread::sleep(due.saturating_sub(start.elapsed()));
        let update = session.push(frame.view())?;
        let modulus = session.modulus().ok();
        let contact = update.contact.as_ref();
        let force_n = contact.and_then(|c| c.force_n).map_or(0.0, |f| f.value);
        let strained = arguments.strain && force_n > arguments.force / 3.0;
        let strain = if strained { strain_of(session)? } else { None };
        played.late += usize::from(start.elapsed() > due + period);
        played.frames += 1;
        if (played.frames - 1).is_multiple_of(PRINTED) {
            let share = 100.0 * played.late as f64 / played.frames as f64;
            let strain_text = strain.map_or(String::new(), |[x, z]| format!("   {x:+.3}, {z:+.3}"));
            let text = line(*time_s, force_n, &update, share, modulus.as_ref(), truth_pa);
            context.console.line(text + &strain_text);
            let value = modulus.as_ref().map(|m| m.youngs_modulus_pa);
            played.updates.push(json!({
                "time_s": time_s, "force_n": force_n, "youngs_modulus_pa": value, "strain_xx_zz": strain,
            }));
        }
    }
    Ok(played)
}

/// Mean strain along x and z; none of the frame that strain is counted from, and where the match has too few points to tell.
fn strain_of(session: &mut Session) -> Result<Option<[f64; 2]>, PipelineError> {
    match session.strain() {
        Ok(found) => Ok(found.map(|s| [(0, 0), (2, 2)].map(|at| s.strain.summary.mean[at]))),
        Err(PipelineError::TooFewMatches { .. } | PipelineError::Surface { .. }) => Ok(None),
        Err(error) => Err(error),
    }
}

fn line(
    time_s: f64,
    force_n: f64,
    update: &Update,
    late_percent: f64,
    modulus: Option<&ModulusEstimate<f64>>,
    truth_pa: f64,
) -> String {
    let contact = update.contact.as_ref();
    let radius_mm = contact.map_or(0.0, |c| c.contact_radius_m.value * 1e3);
    let text = modulus.map_or("-".into(), |m| {
        let error = 100.0 * (m.youngs_modulus_pa / truth_pa - 1.0);
        format!("{} ({error:+.2} %)", in_kpa(m))
    });
    format!("{time_s:8.3} {force_n:11.4} {radius_mm:13.4} {late_percent:10.1}   {text:<27}")
}

fn in_kpa(modulus: &ModulusEstimate<f64>) -> String {
    let value = with_error(modulus.youngs_modulus_pa, modulus.standard_error_pa, 1e-3);
    format!("{value} kPa")
}
