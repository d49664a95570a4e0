//! A simulated loading–unloading series, played at camera rate.
use super::live::Live;
use super::{Arguments, finish};
use crate::context::Context;
use crate::failure::{Exit, Failure};
use crate::outputs::Outputs;
use crate::progress::Progress;
use crate::simulated::trial;
use ndarray::Array2;
use std::time::{Duration, Instant};
use tactile_imaging::pipeline::{FrameSource, PipelineError, Session};
use tactile_simulate::Trial;
use tactile_simulate::{Camera, Gain, LoadCycle, PressLoad, PressOptions};

/// Times in seconds and frames.
type Recording = Vec<(f64, Array2<u8>)>;

/// Largest force in newtons where none is given.
const FORCE_N: f64 = 1.5;

pub fn run(
    arguments: &Arguments,
    outputs: Outputs,
    context: &mut Context,
) -> Result<Exit, Failure> {
    let options = press_options(arguments);
    let pixels = options.camera.shape.iter().product::<usize>() as f64;
    let simulation = &arguments.simulation;
    let frames = arguments.rate * simulation.period * f64::from(simulation.cycles);
    let job = format!("a stream of {frames:.0} frames");
    context.memory.allow(
        frames * pixels,
        &job,
        "ask for fewer cycles or a lower rate",
    )?;
    let trial = trial(options)
        .map_err(|error| Failure::input(format!("the press cannot be simulated: {error}")))?;
    let frames = record(&trial, arguments, context)?;
    let references: Vec<_> = (1..5).map(|k| trial.scene.reference(k)).collect();
    let views: Vec<_> = references.iter().map(|r| r.view()).collect();
    let pipeline = trial.pipeline().map_err(Failure::no_answer)?;
    let session = Session::new(&pipeline, &views).map_err(Failure::no_answer)?;
    let truth_pa = trial.simulation.youngs_modulus_pa;
    let strained_above_n = arguments.strain.then(|| largest_force_n(arguments) / 3.0);
    let mut live = Live::new(session, Some(truth_pa), strained_above_n);
    play(&mut live, &frames, arguments.rate, context).map_err(Failure::no_answer)?;
    let exit = finish(&mut live, arguments, outputs, context)?;
    Ok(verdict(&mut live, truth_pa, arguments, context).unwrap_or(exit))
}

fn largest_force_n(arguments: &Arguments) -> f64 {
    arguments.force.unwrap_or(FORCE_N)
}

/// The exit code where the modulus is wrong, which standard error is told.
fn verdict(
    live: &mut Live,
    truth_pa: f64,
    arguments: &Arguments,
    context: &Context,
) -> Option<Exit> {
    let modulus = live.session.modulus().ok()?;
    let error = 100.0 * (modulus.youngs_modulus_pa / truth_pa - 1.0);
    let tolerance = arguments.simulation.tolerance;
    if error.abs() <= tolerance {
        return None;
    }
    context.console.note(format!(
        "the modulus is off by {error:+.2} %, more than {tolerance} %"
    ));
    Some(Exit::Partial)
}

fn press_options(arguments: &Arguments) -> PressOptions {
    let factor = if arguments.simulation.full_size { 1 } else { 4 };
    PressOptions {
        camera: Camera::default().coarser(factor),
        loads: vec![PressLoad::normal(largest_force_n(arguments))],
        gain: Gain::PeakGrey(200.0),
        ..PressOptions::default()
    }
}

/// Makes all frames of the loading and unloading; Ctrl-C leaves those that are made.
fn record(trial: &Trial, arguments: &Arguments, context: &Context) -> Result<Recording, Failure> {
    let cycle = LoadCycle {
        largest_force_n: largest_force_n(arguments),
        period_s: arguments.simulation.period,
        cycles: arguments.simulation.cycles as usize,
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

/// Gives every frame to the session when it is due.
fn play(
    live: &mut Live,
    frames: &[(f64, Array2<u8>)],
    rate_hz: f64,
    context: &mut Context,
) -> Result<(), PipelineError> {
    let Some((_, first)) = frames.first() else {
        return Ok(());
    };
    let period = Duration::from_secs_f64(1.0 / rate_hz);
    // Buffers get their size before the clock starts.
    live.session.push(first.view())?;
    let start = Instant::now();
    live.print_heading(&mut context.console);
    for (time_s, frame) in frames {
        if context.interrupt.requested() {
            break;
        }
        let due = Duration::from_secs_f64(*time_s);
        std::thread::sleep(due.saturating_sub(start.elapsed()));
        live.push(*time_s, frame.view())?;
        live.late += usize::from(start.elapsed() > due + period);
        live.print_last(false, &mut context.console);
    }
    Ok(())
}
