//! `tactile stream`: force and modulus live, from a simulated series at camera rate or from
//! recorded frames.
mod gel;
mod watch;

use self::gel::gel;
pub(crate) use self::watch::listed;
use self::watch::{Meter, Watch, watch};
use crate::arguments::{force_n, not_negative, positive};
use crate::console::{Bar, Context};
use crate::failure::{Exit, Failure};
use crate::frames::{DEFAULT_RATE_HZ, Reading, frames_help};
use crate::plot::known_heights_mm;
use crate::relief::HeightGrid;
use crate::simulation::{Physics, Simulation};
use clap::Args;
use ndarray::Array2;
use serde::Serialize;
use serde_json::{Value, json};
use std::error::Error;
use std::mem::discriminant;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use tactile_files::io::Grey;
use tactile_files::scene::Scene;
use tactile_files::sensor::GelPresses;
use tactile_imaging::elasticity::modulus::ModulusEstimate;
use tactile_imaging::force::Estimate;
use tactile_imaging::pipeline::{Flag, FrameSource, PipelineError, Session, with_error};
use tactile_simulate::{LoadCycle, PressLoad, PressOptions, Trial};

/// Measure frame after frame: force, contact and modulus live
///
/// Without SCENE.toml a loading–unloading series is simulated and played at camera rate. Its frames
/// are computed in advance, so that only the measurement is timed. A frame is late if its result is
/// available only after the next frame is due. The exit code is 1 if more frames were late than
/// allowed or if the final modulus is outside the tolerance. With SCENE.toml (see
/// `tactile measure`), which describes sensor and object, recorded frames are measured one after
/// the other, as fast as possible. A frame is then late if its measurement takes longer than the
/// duration of a frame at --rate. --out gets stream.csv, with one row per frame. With --json each
/// frame is a line when it is measured, and the last line is the whole result (JSON Lines). Instead
/// of the scene, the sensor file of a gel may be given with its frames, for force, contact and
/// depth.
#[derive(Args)]
#[command(after_help = "\
Examples:
  tactile stream --rate 20 --period 1 --allowed-late 100
  tactile stream --rate 20 --period 1 --allowed-late 100 --strain --json
  tactile stream examples/data/press/scene.toml --allowed-late 100 --out target/stream
  tactile stream examples/data/press/scene.toml examples/data/press/frame_1.png \
                        examples/data/press/frame_2.png --allowed-late 100

A camera or a video, by a pipe (ffmpeg has names for the cameras of every system):
  ffmpeg -f v4l2 -i /dev/video0 -f yuv4mpegpipe -pix_fmt gray - | tactile stream scene.toml -
  ffmpeg -i press.mp4 -f yuv4mpegpipe -pix_fmt gray - | tactile stream scene.toml - --out results
  … | tactile stream scene.toml - --record today.y4m --serve --report today.html
  ffmpeg -f v4l2 -i /dev/video0 -f image2pipe -c:v ppm - | tactile stream coloured_sensor.toml -

`-` works in the same way in measure, force and depth.")]
pub(crate) struct StreamArguments {
    /// Scene file of the sensor and the object, for measuring recorded frames.
    #[arg(value_name = "SCENE.toml")]
    scene: Option<PathBuf>,
    #[arg(value_name = "FRAMES", requires = "scene",
          help = frames_help("Recorded frames, or folders of them in the order of their names"))]
    frames: Vec<PathBuf>,
    /// Frames per second: by default those stated by a video, or 80.
    #[arg(long, value_name = "HZ", value_parser = positive, allow_negative_numbers = true)]
    rate: Option<f64>,
    /// Largest force in newtons (1.5 in a simulation).
    #[arg(long, value_name = "N", value_parser = force_n)]
    force: Option<f64>,
    /// Also measure strain, in frames of at least a third of the largest force, relative to the
    /// first of them.
    #[arg(long)]
    strain: bool,
    /// Percentage of frames that may be late.
    #[arg(long, value_name = "PERCENT", default_value_t = 0.0, value_parser = not_negative)]
    allowed_late: f64,
    /// Record the frames to this file, and their results next to it as FILE.csv. The recorded file
    /// gives the same results again. It is a video, or a sequence of PPM images for a gel lit in
    /// colours.
    #[arg(long, value_name = "FILE.y4m")]
    record: Option<PathBuf>,
    /// Show frame, force, modulus and surface live in browsers. An address that is reachable from
    /// other computers gets a token.
    #[arg(long, value_name = "ADDRESS:PORT", num_args = 0..=1,
          default_missing_value = "127.0.0.1:8642")]
    serve: Option<SocketAddr>,
    #[command(flatten)]
    simulation: Simulation,
    #[command(flatten)]
    series: Series,
}

/// The loads of the series that is simulated without a scene.
#[derive(Args)]
struct Series {
    /// Simulation: duration of one load and unload in seconds.
    #[arg(long, value_name = "S", default_value_t = 2.0, value_parser = positive,
          conflicts_with = "scene")]
    period: f64,
    /// Simulation: number of cycles.
    #[arg(long, value_name = "N", default_value_t = 1,
          value_parser = clap::value_parser!(u32).range(1..), conflicts_with = "scene")]
    cycles: u32,
    /// Simulation: frames of 1392 × 1042 pixels instead of 348 × 260.
    #[arg(long, conflicts_with = "scene")]
    full_size: bool,
    /// Simulation: error of the modulus in per cent above which the run fails.
    #[arg(long, value_name = "PERCENT", default_value_t = 3.0, value_parser = positive,
          conflicts_with = "scene")]
    tolerance: f64,
}

pub(crate) fn run(arguments: &StreamArguments, context: &mut Context) -> Result<Exit, Failure> {
    context.lines = true;
    let outputs = &mut context.outputs;
    outputs.plan(&["stream.csv"], arguments.scene.as_slice())?;
    match &arguments.scene {
        Some(sensor) if GelPresses::names_kind(sensor) => gel(sensor, arguments, context),
        Some(scene) => recorded(scene, arguments, context),
        None => simulated(arguments, context),
    }
}

/// The results of one frame, each number with its standard error.
struct Row {
    force_n: Option<Estimate>,
    radius_m: Option<Estimate>,
    /// The modulus from all frames so far.
    modulus: Option<Modulus>,
    strain_xx_zz: Option<[f64; 2]>,
    /// Centroid of the contact, for the page.
    centre_px: Option<[f64; 2]>,
}

/// A modulus in the format of JSON.
#[derive(Clone, Copy, Serialize)]
struct Modulus {
    value: f64,
    standard_error: f64,
    interval_95: [Option<f64>; 2],
}

impl From<&ModulusEstimate> for Modulus {
    fn from(found: &ModulusEstimate) -> Self {
        let (lower, upper) = (found.interval_95.lower, found.interval_95.upper);
        Self {
            value: found.youngs_modulus_pa,
            standard_error: found.standard_error_pa,
            interval_95: [Some(lower), upper],
        }
    }
}

/// A session with its cautions.
struct Live {
    session: Session,
    /// One caution of every kind, for the frame of its first occurrence.
    cautions: Vec<Flag>,
    /// Strain is measured in frames of at least this force.
    strained_above_n: Option<f64>,
}

impl Live {
    fn new(session: Session, arguments: &StreamArguments) -> Self {
        let largest_n = arguments.force.unwrap_or(SIMULATED_FORCE_N);
        Self {
            session,
            cautions: Vec::new(),
            strained_above_n: arguments.strain.then_some(largest_n / 3.0),
        }
    }

    /// Mean strain along x and z. `None` in the reference frame of the strain, and if the match has
    /// too few points.
    fn strain(&mut self) -> Result<Option<[f64; 2]>, PipelineError> {
        match self.session.strain() {
            Ok(found) => Ok(found.map(|s| [(0, 0), (2, 2)].map(|at| s.strain.summary.mean[at]))),
            Err(PipelineError::TooFewMatches { .. } | PipelineError::Surface { .. }) => Ok(None),
            Err(error) => Err(error),
        }
    }
}

impl Meter for Live {
    type Frame = Array2<u8>;
    type Row = Row;

    fn heading(&self) -> String {
        let strain = match self.strained_above_n {
            Some(_) => "   strain xx, zz",
            None => "",
        };
        format!("time (s)   force (N)   radius (mm)   late (%)   modulus (kPa)     {strain}")
    }

    const COLUMNS: &'static str = "force_N,force_error_N,contact_radius_m,contact_radius_error_m,\
                           youngs_modulus_Pa,youngs_modulus_error_Pa,strain_xx,strain_zz";

    fn measure(&mut self, frame: &Array2<u8>) -> Result<Row, Box<dyn Error>> {
        let pushed = self.session.push(frame.view());
        let contact = pushed.map_err(|error| error.numbered_from(1))?.contact;
        let force = contact.and_then(|c| c.force_n).map(|force| force.total());
        let least = self.strained_above_n;
        let strained = least.is_some_and(|least| force.is_some_and(|f| f.value > least));
        for flag in self.session.cautions() {
            let kind = discriminant(&flag);
            let mut known = self.cautions.iter().map(discriminant);
            if known.all(|known| known != kind) {
                self.cautions.push(flag);
            }
        }
        let modulus = self.session.modulus().ok();
        Ok(Row {
            force_n: force,
            radius_m: contact.map(|c| c.contact_radius_m.total()),
            modulus: modulus.as_ref().map(Modulus::from),
            strain_xx_zz: if strained { self.strain()? } else { None },
            centre_px: contact.map(|c| c.centroid_px.map(|c| c.value)),
        })
    }

    fn cells(row: &Row) -> Vec<Option<f64>> {
        let of = |e: Estimate| [e.value, e.standard_error];
        let pairs = [
            row.force_n.map(of),
            row.radius_m.map(of),
            row.modulus.map(|m| [m.value, m.standard_error]),
            row.strain_xx_zz,
        ];
        pairs
            .map(|pair| pair.map_or([None; 2], |pair| pair.map(Some)))
            .concat()
    }

    fn line(row: &Row, time_s: f64, late_percent: f64) -> String {
        let unknown = || "-".to_owned();
        let number = |number: Option<Estimate>, scale: f64| {
            number.map_or_else(unknown, |e| format!("{:.4}", e.value * scale))
        };
        let [force, radius] = [number(row.force_n, 1.0), number(row.radius_m, 1e3)];
        let kpa = |m: Modulus| with_error(m.value, m.standard_error, 1e-3);
        let modulus = row.modulus.map_or_else(unknown, kpa);
        let strain = row.strain_xx_zz.map(|[x, z]| format!("{x:+.3}, {z:+.3}"));
        let strain = strain.unwrap_or_default();
        format!("{time_s:8.3} {force:>11} {radius:>13} {late_percent:10.1}   {modulus:<18}{strain}")
    }

    fn update(row: &Row) -> Value {
        json!({
            "force_n": row.force_n, "contact_radius_m": row.radius_m,
            "youngs_modulus_pa": row.modulus, "strain_xx_zz": row.strain_xx_zz,
        })
    }

    fn shown(&self, row: &Row, columns: f64) -> Value {
        // Those that hold now: the table of the series keeps the others.
        let (standing, now) = (self.session.standing_cautions(), self.session.cautions());
        let cautions: Vec<_> = standing.iter().chain(&now).map(in_words).collect();
        let of = |e: Estimate| [e.value, e.standard_error];
        json!({
            "cautions": cautions, "force_n": row.force_n.map(of),
            "centre": row.centre_px.map(|c| c.map(|c| c / columns)),
            "modulus_pa": row.modulus.map(|m| [m.value, m.standard_error]),
        })
    }

    fn surface(&mut self) -> Value {
        // A frame without contact has no surface.
        let Ok(found) = self.session.surface() else {
            return json!({});
        };
        let name = match found.apparent {
            true => "apparent surface (the pressure interpreted as shading)",
            false => "surface",
        };
        let size = found.pixel_size_m.map(|m| 1e3 * m);
        let relief = HeightGrid::of(known_heights_mm(found).view(), size);
        json!({ "name": name, "relief": relief })
    }
}

/// A caution with its frame counted from 1.
fn in_words(caution: &Flag) -> String {
    caution.clone().numbered_from(1).to_string()
}

/// Prints the results of the whole series, which is simulated if the true modulus is known, and
/// adds its table to the files.
fn finish(
    mut live: Watch<Live>,
    truth_pa: Option<f64>,
    arguments: &StreamArguments,
    context: &mut Context,
) -> Result<Exit, Failure> {
    live.counts.print(live.rows.len(), context);
    let Live {
        session, cautions, ..
    } = &mut live.meter;
    let modulus = session.modulus();
    let error = |pa: f64| truth_pa.map(|truth| 100.0 * (pa / truth - 1.0));
    let answer = match &modulus {
        Ok(m) => {
            let kpa = with_error(m.youngs_modulus_pa, m.standard_error_pa, 1e-3);
            let beside = error(m.youngs_modulus_pa).zip(truth_pa);
            let beside = beside.map_or(String::new(), |(error, truth)| {
                format!(", true {:.2} kPa ({error:+.2} %)", truth * 1e-3)
            });
            context.answer("modulus", format_args!("{kpa} kPa{beside}"));
            json!(Modulus::from(m))
        }
        Err(reason) => {
            let reason = reason.clone().numbered_from(1);
            context.answer("modulus", format_args!("none: {reason}"));
            json!({ "error": reason.to_string() })
        }
    };
    context.aside(session.report());
    cautions.extend(session.standing_cautions());
    let drifted = |flag: &Flag| matches!(flag, Flag::LightDrifted { .. });
    if !cautions.iter().any(drifted) {
        cautions.extend(session.drift().caution.clone());
    }
    if let Ok(found) = &modulus {
        let warnings = found.warnings.iter();
        let flags = warnings.map(|&warning| Flag::Assumption { warning });
        cautions.extend(flags);
    }
    for caution in &*cautions {
        context.aside(format_args!("{:<18}{}", "caution", in_words(caution)));
    }
    context.keep_cautions(cautions);
    let mut value = live.value();
    value["youngs_modulus_pa"] = answer;
    if let Some(truth_pa) = truth_pa {
        value["true_youngs_modulus_pa"] = json!(truth_pa);
    }
    context.value(&value);
    let mut exit = live.close(arguments.allowed_late, context);
    let tolerance = arguments.series.tolerance;
    let failed = match &modulus {
        Err(reason) => Some(format!("there is no modulus: {reason}")),
        Ok(m) => {
            let beyond = error(m.youngs_modulus_pa).filter(|e| e.abs() > tolerance);
            beyond.map(|e| format!("the modulus is off by {e:+.2} %, more than {tolerance} %"))
        }
    };
    if let Some(note) = failed {
        exit = Exit::Partial;
        context.note(note);
    }
    Ok(exit)
}

/// Measures recorded frames: those of a scene, or images and folders of images.
fn recorded(
    path: &Path,
    arguments: &StreamArguments,
    context: &mut Context,
) -> Result<Exit, Failure> {
    if arguments.strain && arguments.force.is_none() {
        return Err(Failure::input(
            "--strain of recorded frames needs --force, the largest force in newtons: strain is \
             counted from the first frame of a third of it",
        ));
    }
    let scene = Scene::read(path).map_err(Failure::input)?;
    let frames = if arguments.frames.is_empty() {
        scene
            .frames
            .iter()
            .map(|frame| frame.image.clone())
            .collect()
    } else {
        listed(&arguments.frames)?
    };
    context.outputs.protect(&frames)?;
    if let Some(report) = &mut context.outputs.report {
        report.inputs(frames.iter().cloned());
        report.assumptions(&scene);
    }
    if frames.is_empty() {
        let sentence = "it names no frames: give images, a video or - for a pipe after it";
        return Err(Failure::in_file(path, sentence));
    }
    let clock = Bar::clock("reading the scene");
    let data = scene.load_without_frames().map_err(Failure::input)?;
    drop(clock);
    context.warn_of_light(&scene);
    let pipeline = scene.pipeline(&data).map_err(Failure::input)?;
    let session = Session::new(&pipeline, &[data.reference.view()])
        .map_err(|error| Failure::input(scene.measure_error(error)))?;
    let mut live = Watch::new(Live::new(session, arguments), arguments, context)?;
    let reading = Reading {
        grey: Grey::default(),
        bits: scene.bits,
        reference: &scene.reference,
        size: data.reference.dim(),
    };
    watch(&mut live, &frames, reading, arguments.rate, context)?;
    let unusable = live.counts.unusable;
    let exit = finish(live, None, arguments, context)?;
    Ok(if unusable > 0 { Exit::Partial } else { exit })
}

/// Largest force of a simulation by default.
const SIMULATED_FORCE_N: f64 = 1.5;

/// Plays a simulated loading–unloading series at camera rate.
fn simulated(arguments: &StreamArguments, context: &mut Context) -> Result<Exit, Failure> {
    let StreamArguments {
        simulation, series, ..
    } = arguments;
    let force_n = arguments.force.unwrap_or(SIMULATED_FORCE_N);
    let factor = if series.full_size { 1 } else { 4 };
    let options = simulation.options(Physics::Hertz);
    let options = PressOptions {
        camera: options.camera.coarser(factor),
        loads: vec![PressLoad::normal(force_n)],
        ..options
    };
    let pixels = options.camera.shape.iter().product::<usize>() as f64;
    let rate_hz = arguments.rate.unwrap_or(DEFAULT_RATE_HZ);
    let frames = rate_hz * series.period * f64::from(series.cycles);
    let job = format!("a stream of {frames:.0} frames");
    context.allow(
        frames * pixels,
        &job,
        "ask for fewer cycles or a lower rate",
    )?;
    let trial = simulation.trial(options)?;
    let cycle = LoadCycle {
        largest_force_n: force_n,
        period_s: series.period,
        cycles: series.cycles as usize,
        frame_rate_hz: rate_hz,
        ..LoadCycle::default()
    };
    let frames = record(&trial, cycle, context)?;
    // The mean of four frames has half the noise of one.
    let references: Vec<_> = (1..5).map(|k| trial.scene.reference(k)).collect();
    let views: Vec<_> = references.iter().map(|r| r.view()).collect();
    let pipeline = trial.pipeline().map_err(Failure::no_answer)?;
    let session = Session::new(&pipeline, &views).map_err(Failure::no_answer)?;
    let truth_pa = trial.simulation.youngs_modulus_pa;
    let mut live = Watch::new(Live::new(session, arguments), arguments, context)?;
    play(&mut live, &frames, rate_hz, context)?;
    finish(live, Some(truth_pa), arguments, context)
}

/// Times in seconds and frames.
type Recording = Vec<(f64, Array2<u8>)>;

/// Computes all frames of the loading and unloading. After Ctrl-C the frames so far remain.
fn record(trial: &Trial, cycle: LoadCycle, context: &Context) -> Result<Recording, Failure> {
    let source = trial.scene.stream(cycle);
    let mut source = source
        .map_err(|error| Failure::input(format!("the series cannot be simulated: {error}")))?;
    let mut bar = Bar::of(source.len(), format!("making {} frames", source.len()));
    let mut frames = Recording::new();
    let mut frame = Array2::zeros((0, 0));
    context.interrupt.polled(true);
    while !context.interrupt.requested()
        && let Some(time_s) = source.next_frame(&mut frame).map_err(Failure::no_answer)?
    {
        frames.push((time_s, frame.clone()));
        bar.done(frames.len());
    }
    Ok(frames)
}

/// Passes every frame to the session when it is due.
fn play(
    live: &mut Watch<Live>,
    frames: &[(f64, Array2<u8>)],
    rate_hz: f64,
    context: &mut Context,
) -> Result<(), Failure> {
    let Some((_, first)) = frames.first() else {
        return Ok(());
    };
    let period = Duration::from_secs_f64(1.0 / rate_hz);
    // Buffers are allocated before the clock starts.
    live.meter
        .session
        .push(first.view())
        .map_err(Failure::no_answer)?;
    let start = Instant::now();
    context.line(live.meter.heading());
    for (time_s, frame) in frames {
        if context.interrupt.requested() {
            break;
        }
        let due = Duration::from_secs_f64(*time_s);
        // A camera would deliver the frame at this time.
        std::thread::sleep(due.saturating_sub(start.elapsed()));
        live.counts.seen += 1;
        live.take(*time_s, frame)?;
        live.counts.late += usize::from(start.elapsed() > due + period);
        live.print_last(false, context);
    }
    Ok(())
}
