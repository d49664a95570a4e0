//! `tactile stream`: force and modulus live, from a simulated series at camera rate or from
//! recorded frames.
use crate::arguments::{force_n, not_negative, positive};
use crate::console::{Bar, Context, Exit, Failure};
use crate::frames::{DEFAULT_RATE_HZ, Reading};
use crate::outputs::Csv;
use crate::photometric;
use crate::plot::known_heights_mm;
use crate::record::FrameRecorder;
use crate::relief::HeightGrid;
use crate::serve::LivePage;
use clap::Args;
use ndarray::{Array2, ArrayView2};
use serde::Serialize;
use serde_json::{Value, json};
use std::mem::discriminant;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use tactile_imaging::elasticity::modulus::ModulusEstimate;
use tactile_imaging::force::{ChartState, Estimate};
use tactile_imaging::io::Grey;
use tactile_imaging::pipeline::{Flag, FrameSource, PipelineError, Session, with_error};
use tactile_imaging::scene::Scene;
use tactile_imaging::sensor::PhotometricPresses;
use tactile_simulate::{CalibrationRun, Camera, Gain, LoadCycle, PressLoad, PressOptions, Trial};

/// Measure frame after frame: force, contact and modulus live
///
/// Without SCENE.toml a loading–unloading series is simulated and played at camera rate: frames are
/// made beforehand, so that only the measuring is timed. A frame is late if its answer comes after
/// the next frame is due. The exit code is then 1 if more frames came late than allowed or the
/// modulus ends outside the tolerance. With SCENE.toml (see `tactile measure`), which describes
/// sensor and object, recorded frames are measured one after the other, as fast as they can be. One
/// is late if that takes longer than a frame at --rate lasts. --out gets stream.csv, a row a frame.
/// In place of the scene goes the sensor file of a gel that is lit in colours, with images or
/// folders of them: force, contact and depth.
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

Frames on the pipe are YUV4MPEG2 of 8 to 16 bits, binary PGM and PPM one after the other, arrays of
numpy.save, or an AVI of JPEG frames. `-` works in the same way in measure, force and depth.")]
pub struct StreamArguments {
    /// Scene file of the sensor and the object, whose recorded frames are measured.
    #[arg(value_name = "SCENE.toml")]
    scene: Option<PathBuf>,
    /// Recorded frames: images, folders whose images are taken in the order of their names, videos
    /// (YUV4MPEG2, AVI of JPEG), arrays (NPY, NPZ), `-` for a pipe of frames. Those of the scene if
    /// there is none here.
    #[arg(value_name = "FRAMES", requires = "scene")]
    frames: Vec<PathBuf>,
    /// Frames per second: those that a video states, or 80.
    #[arg(long, value_name = "HZ", value_parser = positive, allow_negative_numbers = true)]
    rate: Option<f64>,
    /// Largest force in newtons (1.5 in a simulation).
    #[arg(long, value_name = "N", value_parser = force_n)]
    force: Option<f64>,
    /// Measure strain too, in frames of at least a third of the largest force, counted from the
    /// first of them.
    #[arg(long)]
    strain: bool,
    /// Share of frames in per cent that may come late.
    #[arg(long, value_name = "PERCENT", default_value_t = 0.0, value_parser = not_negative)]
    allowed_late: f64,
    /// Record the frames as they come to this video, and their answers beside it as FILE.csv. The
    /// video gives the same answers again.
    #[arg(long, value_name = "FILE.y4m")]
    record: Option<PathBuf>,
    /// Show frame, force, modulus, surface and the sensor's health in browsers as they come. An
    /// address that other computers reach gets a token.
    #[arg(long, value_name = "ADDRESS:PORT", num_args = 0..=1,
          default_missing_value = "127.0.0.1:8642")]
    serve: Option<SocketAddr>,
    #[command(flatten)]
    simulation: Simulation,
}

/// The series that is simulated where no scene is given.
#[derive(Args)]
struct Simulation {
    /// Simulation: seconds of one load and unload.
    #[arg(long, value_name = "S", default_value_t = 2.0, value_parser = positive,
          conflicts_with = "scene")]
    period: f64,
    /// Simulation: cycles.
    #[arg(long, value_name = "N", default_value_t = 1,
          value_parser = clap::value_parser!(u32).range(1..), conflicts_with = "scene")]
    cycles: u32,
    /// Simulation: frames of 1392 × 1042 pixels instead of 348 × 260.
    #[arg(long, conflicts_with = "scene")]
    full_size: bool,
    /// Simulation: error of the modulus in per cent beyond which the run fails.
    #[arg(long, value_name = "PERCENT", default_value_t = 3.0, value_parser = positive,
          conflicts_with = "scene")]
    tolerance: f64,
}

pub fn run(arguments: &StreamArguments, context: &mut Context) -> Result<Exit, Failure> {
    let inputs: Vec<_> = arguments.scene.iter().map(PathBuf::as_path).collect();
    context.outputs.plan(&["stream.csv"], &inputs)?;
    match &arguments.scene {
        Some(sensor) if PhotometricPresses::names_kind(sensor) => {
            coloured(sensor, arguments, context)
        }
        Some(scene) => recorded(scene, arguments, context),
        None => simulated(arguments, context),
    }
}

/// The results of one frame, each number with its standard error.
struct Row {
    time_s: f64,
    force_n: Option<Estimate>,
    radius_m: Option<Estimate>,
    /// The modulus from all frames so far.
    modulus: Option<Modulus>,
    strain_xx_zz: Option<[f64; 2]>,
    /// Centroid of the contact, for the page.
    centre_px: Option<[f64; 2]>,
}

impl Row {
    /// Adds the row, with empty cells for unknown values.
    fn add_to(&self, csv: &mut Csv) {
        let of = |e: Estimate| [e.value, e.standard_error];
        let pairs = [
            self.force_n.map(of),
            self.radius_m.map(of),
            self.modulus.map(|m| [m.value, m.standard_error]),
            self.strain_xx_zz,
        ];
        let cells = pairs.map(|pair| pair.map_or([None; 2], |pair| pair.map(Some)));
        csv.cells(std::iter::once(Some(self.time_s)).chain(cells.concat()));
    }
}

/// A modulus as JSON has it.
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

/// A session with the results of every frame so far.
struct Live {
    session: Session,
    rows: Vec<Row>,
    /// One of every kind, of the frame where it came first.
    cautions: Vec<Flag>,
    late: usize,
    rate_hz: f64,
    /// The number of frames that came, measured or not.
    seen: usize,
    /// Those, and the files, that could not be measured.
    unusable: usize,
    page: Option<LivePage>,
    recording: Option<FrameRecorder>,
    /// Where the frames are simulated.
    truth_pa: Option<f64>,
    /// Strain is measured in frames of at least this force.
    strained_above_n: Option<f64>,
}

impl Live {
    fn new(
        session: Session,
        arguments: &StreamArguments,
        truth_pa: Option<f64>,
        context: &Context,
    ) -> Result<Self, Failure> {
        let largest_n = arguments.force.unwrap_or(SIMULATED_FORCE_N);
        let page = arguments.serve.map(LivePage::serve).transpose()?;
        if let Some(page) = &page {
            context.note(format_args!("the measurement is shown at {}", page.url));
        }
        let recording = arguments.record.as_deref().map(FrameRecorder::create);
        Ok(Self {
            seen: 0,
            unusable: 0,
            page,
            recording: recording.transpose()?,
            session,
            rows: Vec::new(),
            cautions: Vec::new(),
            late: 0,
            rate_hz: arguments.rate.unwrap_or(DEFAULT_RATE_HZ),
            truth_pa,
            strained_above_n: arguments.strain.then_some(largest_n / 3.0),
        })
    }

    /// Records a frame, measures it and shows its answer. Returns how long measuring and showing
    /// took.
    fn take(&mut self, time_s: f64, frame: ArrayView2<'_, u8>) -> Result<Duration, Failure> {
        if let Some(recording) = &mut self.recording {
            recording.frame(frame, self.rate_hz)?;
        }
        let start = Instant::now();
        let pushed = self.push(time_s, frame);
        pushed.map_err(|error| Failure::no_answer(format!("frame {}: {error}", self.seen)))?;
        self.show(frame);
        let took = start.elapsed();
        if let (Some(recording), Some(row)) = (&mut self.recording, self.rows.last()) {
            let mut csv = match self.rows.len() {
                1 => Csv::new(&COLUMNS),
                _ => Csv::default(),
            };
            row.add_to(&mut csv);
            recording.answers(&csv.into_bytes())?;
        }
        Ok(took)
    }

    fn show(&mut self, frame: ArrayView2<'_, u8>) {
        let (Some(page), Some(row)) = (&mut self.page, self.rows.last()) else {
            return;
        };
        let cautions: Vec<String> = self.cautions.iter().map(ToString::to_string).collect();
        let centre = row.centre_px.map(|c| c.map(|c| c / frame.ncols() as f64));
        let of = |e: Estimate| [e.value, e.standard_error];
        let numbers = json!({
            "frame": self.seen, "time_s": row.time_s, "late": self.late, "cautions": cautions,
            "force_n": row.force_n.map(of), "centre": centre,
            "modulus_pa": row.modulus.map(|m| [m.value, m.standard_error]),
        });
        let session = &mut self.session;
        page.show(numbers, frame, || {
            let health = health_words(session);
            // A frame without contact has no surface.
            let Ok(found) = session.surface() else {
                return json!({ "health": health });
            };
            let name = match found.apparent {
                true => "apparent surface (the pressure, read as shading)",
                false => "surface",
            };
            let size = found.pixel_size_m.map(|m| 1e3 * m);
            let relief = HeightGrid::of(known_heights_mm(found).view(), size);
            json!({ "name": name, "relief": relief, "health": health })
        });
    }

    /// Measures a frame.
    fn push(&mut self, time_s: f64, frame: ArrayView2<'_, u8>) -> Result<(), PipelineError> {
        let contact = self.session.push(frame)?.contact;
        let force = contact.and_then(|c| c.force_n);
        let least = self.strained_above_n;
        let strained = least.is_some_and(|least| force.is_some_and(|f| f.value > least));
        for flag in self.session.cautions() {
            let kind = discriminant(&flag);
            if self
                .cautions
                .iter()
                .all(|known| discriminant(known) != kind)
            {
                self.cautions.push(flag);
            }
        }
        let modulus = self.session.modulus().ok();
        let strain_xx_zz = if strained { self.strain()? } else { None };
        self.rows.push(Row {
            time_s,
            force_n: force,
            radius_m: contact.map(|c| c.contact_radius_m),
            modulus: modulus.as_ref().map(Modulus::from),
            strain_xx_zz,
            centre_px: contact.map(|c| c.centroid_px.map(|c| c.value)),
        });
        Ok(())
    }

    /// Measures the frames of a file or a pipe as they come, in the memory of `frame`.
    fn watch(
        &mut self,
        path: &Path,
        reading: Reading<'_>,
        arguments: &StreamArguments,
        frame: &mut Array2<u8>,
        context: &mut Context,
    ) -> Result<(), Failure> {
        let mut source = reading.open(path)?;
        let own_hz = arguments.rate.or(source.frame_rate_hz());
        self.rate_hz = own_hz.unwrap_or(self.rate_hz);
        while !context.interrupt.requested() && source.next_frame(frame)?.is_some() {
            reading.fits(path, frame)?;
            let time_s = self.seen as f64 / self.rate_hz;
            self.seen += 1;
            // Reading the file is not part of the measurement.
            match self.take(time_s, frame.view()) {
                Ok(took) => self.late += usize::from(took.as_secs_f64() > 1.0 / self.rate_hz),
                // A frame without an answer does not end a stream, and thousands of them are one
                // trouble.
                Err(failure) if failure.exit == Exit::Partial => {
                    self.unusable += 1;
                    if self.unusable <= 3 {
                        context.caution(Failure::in_file(path, failure));
                    }
                }
                Err(failure) => return Err(failure),
            }
            self.print_last(self.rows.len() <= 32, context);
        }
        Ok(())
    }

    /// Mean strain along x and z. It is none in the frame that strain is counted from, and where
    /// the match has too few points.
    fn strain(&mut self) -> Result<Option<[f64; 2]>, PipelineError> {
        match self.session.strain() {
            Ok(found) => Ok(found.map(|s| [(0, 0), (2, 2)].map(|at| s.strain.summary.mean[at]))),
            Err(PipelineError::TooFewMatches { .. } | PipelineError::Surface { .. }) => Ok(None),
            Err(error) => Err(error),
        }
    }

    fn late_percent(&self) -> f64 {
        100.0 * self.late as f64 / self.rows.len().max(1) as f64
    }

    fn print_heading(&self, context: &mut Context) {
        let strain = if self.strained_above_n.is_some() {
            "   strain xx, zz"
        } else {
            ""
        };
        context.line(format_args!(
            "time (s)   force (N)   radius (mm)   late (%)   modulus (kPa)     {strain}"
        ));
    }

    /// Prints a line for every frame or, of a long series, for one out of sixteen.
    fn print_last(&self, every_one: bool, context: &mut Context) {
        let Some(row) = self.rows.last() else {
            return;
        };
        if !every_one && !(self.rows.len() - 1).is_multiple_of(16) {
            return;
        }
        let unknown = || "-".to_owned();
        let number = |number: Option<Estimate>, scale: f64| {
            number.map_or_else(unknown, |e| format!("{:.4}", e.value * scale))
        };
        let [force, radius] = [number(row.force_n, 1.0), number(row.radius_m, 1e3)];
        let kpa = |m: Modulus| with_error(m.value, m.standard_error, 1e-3);
        let modulus = row.modulus.map_or_else(unknown, kpa);
        let strain = row.strain_xx_zz.map(|[x, z]| format!("{x:+.3}, {z:+.3}"));
        let (time, late) = (row.time_s, self.late_percent());
        let strain = strain.unwrap_or_default();
        let line =
            format!("{time:8.3} {force:>11} {radius:>13} {late:10.1}   {modulus:<18}{strain}");
        context.line(line.trim_end());
    }

    /// Prints the results of the whole series, and adds its table to the files.
    fn finish(
        mut self,
        arguments: &StreamArguments,
        context: &mut Context,
    ) -> Result<Exit, Failure> {
        let (frames, late, rate) = (self.rows.len(), self.late, self.rate_hz);
        let percent = self.late_percent();
        context.line(format_args!(
            "{frames} frames at {rate} Hz, {late} late ({percent:.1} %)"
        ));
        let modulus = self.session.modulus();
        let error = |pa: f64| self.truth_pa.map(|truth| 100.0 * (pa / truth - 1.0));
        let answer = match &modulus {
            Ok(m) => {
                let kpa = with_error(m.youngs_modulus_pa, m.standard_error_pa, 1e-3);
                let beside = error(m.youngs_modulus_pa).zip(self.truth_pa);
                let beside = beside.map_or(String::new(), |(error, truth)| {
                    format!(", true {:.2} kPa ({error:+.2} %)", truth * 1e-3)
                });
                context.answer("modulus", format_args!("{kpa} kPa{beside}"));
                json!(Modulus::from(m))
            }
            Err(reason) => {
                context.answer("modulus", format_args!("none: {reason}"));
                json!({ "error": reason.to_string() })
            }
        };
        context.aside(self.session.report());
        let drifted = |flag: &Flag| matches!(flag, Flag::LightDrifted { .. });
        if !self.cautions.iter().any(drifted) {
            self.cautions.extend(self.session.drift().caution.clone());
        }
        if let Ok(found) = &modulus {
            let warnings = found.warnings.iter();
            let flags = warnings.map(|&warning| Flag::Assumption { warning });
            self.cautions.extend(flags);
        }
        for caution in &self.cautions {
            context.aside(format_args!("{:<18}{caution}", "caution"));
        }
        context.keep_cautions(&self.cautions);
        let update = |row: &Row| {
            json!({
                "time_s": row.time_s, "force_n": row.force_n, "contact_radius_m": row.radius_m,
                "youngs_modulus_pa": row.modulus, "strain_xx_zz": row.strain_xx_zz,
            })
        };
        let mut value = json!({
            "frames": frames, "rate_hz": rate, "late": late,
            "updates": self.rows.iter().map(update).collect::<Vec<Value>>(),
            "youngs_modulus_pa": answer,
        });
        if let Some(truth_pa) = self.truth_pa {
            value["true_youngs_modulus_pa"] = json!(truth_pa);
        }
        context.value(&value);
        context.outputs.add("stream.csv", table(&self.rows));
        let mut exit = Exit::Complete;
        let mut fail = |note: String| {
            exit = Exit::Partial;
            context.note(note);
        };
        let allowed = arguments.allowed_late;
        if percent > allowed {
            fail(format!(
                "{percent:.1} % of the frames came late, more than {allowed} %"
            ));
        }
        match &modulus {
            Err(reason) => fail(format!("there is no modulus: {reason}")),
            Ok(m) => {
                let tolerance = arguments.simulation.tolerance;
                let beyond = error(m.youngs_modulus_pa).filter(|e| e.abs() > tolerance);
                if let Some(error) = beyond {
                    fail(format!(
                        "the modulus is off by {error:+.2} %, more than {tolerance} %"
                    ));
                }
            }
        }
        Ok(exit)
    }
}

/// The state of the sensor, as its background shows it.
fn health_words(session: &Session) -> String {
    let Some(health) = session.health() else {
        return String::new();
    };
    let words = |state| match state {
        ChartState::Learning => "not known yet",
        ChartState::Healthy => "unchanged",
        ChartState::Changed => "changed",
        _ => "scatters too much to follow",
    };
    let stuck = match session.stuck_pixels().len() {
        0 => String::new(),
        count => format!(", {count} pixels stuck"),
    };
    format!(
        "sensor: background {:.1} grey levels, brightness {}, noise {}{stuck}",
        health.background_grey,
        words(health.brightness),
        words(health.noise),
    )
}

/// A row a frame.
fn table(rows: &[Row]) -> Vec<u8> {
    let mut csv = Csv::new(&COLUMNS);
    rows.iter().for_each(|row| row.add_to(&mut csv));
    csv.into_bytes()
}

const COLUMNS: [&str; 9] = [
    "time_s",
    "force_N",
    "force_error_N",
    "contact_radius_m",
    "contact_radius_error_m",
    "youngs_modulus_Pa",
    "youngs_modulus_error_Pa",
    "strain_xx",
    "strain_zz",
];

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
    let pipeline = scene.pipeline(&data).map_err(Failure::input)?;
    let session = Session::new(&pipeline, &[data.reference.view()])
        .map_err(|error| Failure::input(scene.measure_error(error)))?;
    let mut live = Live::new(session, arguments, None, context)?;
    live.print_heading(context);
    // The clock of a recording is the number in its frames' names, where they have one.
    let numbers = numbers(&frames);
    let last = numbers.as_deref().and_then(<[_]>::last);
    let missing = last.map_or(0, |&last| last + 1 - frames.len() as u64);
    let reading = Reading {
        grey: Grey::default(),
        bits: scene.bits,
        reference: &scene.reference,
        size: data.reference.dim(),
    };
    let mut bar = Bar::of(frames.len(), "measuring");
    let mut frame = Array2::zeros((0, 0));
    context.interrupt.polled(true);
    for (k, path) in frames.iter().enumerate() {
        if context.interrupt.requested() {
            break;
        }
        if let Some(numbers) = &numbers {
            live.seen = numbers[k] as usize;
        }
        // A torn frame does not end a recording. Of a stream it ends what comes from there.
        if let Err(failure) = live.watch(path, reading, arguments, &mut frame, context) {
            if failure.exit == Exit::Output {
                return Err(failure);
            }
            live.unusable += 1;
            live.seen = live.seen.max(k + 1);
            context.caution(failure);
        }
        bar.done(k + 1);
    }
    drop(bar);
    let unusable = live.unusable;
    if live.rows.is_empty() && unusable > 0 {
        return Err(Failure::input(format!(
            "none of the {unusable} inputs can be measured"
        )));
    }
    if missing > 0 {
        context.warn(
            "frames_missing",
            json!({ "frames": missing }),
            format_args!(
                "{missing} missing in the numbers of the frames' names: times are counted by the \
                 numbers"
            ),
        );
    }
    let exit = live.finish(arguments, context)?;
    Ok(if unusable > 0 { Exit::Partial } else { exit })
}

/// Measures images of a gel that is lit in colours.
fn coloured(
    sensor: &Path,
    arguments: &StreamArguments,
    context: &mut Context,
) -> Result<Exit, Failure> {
    let grey = [
        ("--strain", arguments.strain),
        ("--record", arguments.record.is_some()),
        ("--serve", arguments.serve.is_some()),
    ];
    if let Some((name, _)) = grey.iter().find(|(_, given)| *given) {
        return Err(Failure::input(format!(
            "{name} is not there for a gel that is lit in colours"
        )));
    }
    let frames = listed(&arguments.frames)?;
    if frames.is_empty() {
        let sentence = "a sensor file names no frames: give images or folders after it";
        return Err(Failure::in_file(sensor, sentence));
    }
    context.outputs.protect(&frames)?;
    let rate_hz = arguments.rate.unwrap_or(DEFAULT_RATE_HZ);
    photometric::stream(sensor, &frames, rate_hz, arguments.allowed_late, context)
}

/// The numbers at the end of the frames' names, less the first one. `None` where a name has none or
/// they do not rise.
fn numbers(frames: &[PathBuf]) -> Option<Vec<u64>> {
    let number = |path: &PathBuf| -> Option<u64> {
        let stem = path.file_stem()?.to_str()?;
        let digits = stem.trim_end_matches(|c: char| c.is_ascii_digit()).len();
        stem[digits..].parse().ok()
    };
    let numbers = frames.iter().map(number).collect::<Option<Vec<u64>>>()?;
    let first = *numbers.first()?;
    // More than a tenth missing is a way of naming (times, dates), not a gap.
    let last = numbers.last()?.checked_sub(first)?;
    let few_gaps = last < frames.len() as u64 + (frames.len() as u64 / 10).max(2);
    let rising = numbers.windows(2).all(|pair| pair[0] < pair[1]);
    (rising && few_gaps).then(|| numbers.iter().map(|n| n - first).collect())
}

/// The images that are named, and those of the folders that are named in the order of their names.
fn listed(paths: &[PathBuf]) -> Result<Vec<PathBuf>, Failure> {
    let mut frames = Vec::new();
    for path in paths {
        if !path.is_dir() {
            frames.push(path.clone());
            continue;
        }
        let name = path.display();
        let entries = std::fs::read_dir(path).and_then(|entries| {
            let paths = entries.map(|entry| entry.map(|e| e.path()));
            paths.collect::<std::io::Result<Vec<PathBuf>>>()
        });
        let unreadable = |error| Failure::input(format!("cannot list the folder {name}: {error}"));
        let mut images = entries.map_err(unreadable)?;
        images.retain(|file| is_image(file));
        if images.is_empty() {
            return Err(Failure::input(format!(
                "the folder {name} has no PNG, PGM, JPEG or TIFF images"
            )));
        }
        images.sort_by_cached_key(|image| natural(image));
        frames.append(&mut images);
    }
    Ok(frames)
}

fn is_image(path: &Path) -> bool {
    let extension = path.extension().and_then(|e| e.to_str());
    let extension = extension.unwrap_or_default().to_ascii_lowercase();
    ["png", "pgm", "ppm", "jpg", "jpeg", "tif", "tiff"].contains(&extension.as_str())
}

/// The parts of a file's name, numbers by their value: frame_2 comes before frame_10.
fn natural(path: &Path) -> Vec<(u64, String)> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let mut parts: Vec<(u64, String)> = vec![(0, String::new())];
    let mut in_number = false;
    for character in name.chars() {
        let digit = character.to_digit(10);
        if digit.is_some() && !in_number {
            parts.push((0, String::new()));
        }
        in_number = digit.is_some();
        let Some((number, text)) = parts.last_mut() else {
            continue;
        };
        match digit {
            Some(digit) => *number = number.saturating_mul(10).saturating_add(digit.into()),
            None => text.push(character),
        }
    }
    parts
}

/// Largest force of a simulation where none is given.
const SIMULATED_FORCE_N: f64 = 1.5;

/// Plays a simulated loading–unloading series at camera rate.
fn simulated(arguments: &StreamArguments, context: &mut Context) -> Result<Exit, Failure> {
    let simulation = &arguments.simulation;
    let force_n = arguments.force.unwrap_or(SIMULATED_FORCE_N);
    let factor = if simulation.full_size { 1 } else { 4 };
    let options = PressOptions {
        camera: Camera::default().coarser(factor),
        loads: vec![PressLoad::normal(force_n)],
        gain: Gain::PeakGrey(200.0),
        ..PressOptions::default()
    };
    let pixels = options.camera.shape.iter().product::<usize>() as f64;
    let rate_hz = arguments.rate.unwrap_or(DEFAULT_RATE_HZ);
    let frames = rate_hz * simulation.period * f64::from(simulation.cycles);
    let job = format!("a stream of {frames:.0} frames");
    context.allow(
        frames * pixels,
        &job,
        "ask for fewer cycles or a lower rate",
    )?;
    let trial = Trial::new(options, &CalibrationRun::default())
        .map_err(|error| Failure::input(format!("the press cannot be simulated: {error}")))?;
    let cycle = LoadCycle {
        largest_force_n: force_n,
        period_s: simulation.period,
        cycles: simulation.cycles as usize,
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
    let mut live = Live::new(session, arguments, Some(truth_pa), context)?;
    play(&mut live, &frames, rate_hz, context)?;
    live.finish(arguments, context)
}

/// Times in seconds and frames.
type Recording = Vec<(f64, Array2<u8>)>;

/// Makes all frames of the loading and unloading. Ctrl-C leaves those that are made.
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

/// Gives every frame to the session when it is due.
fn play(
    live: &mut Live,
    frames: &[(f64, Array2<u8>)],
    rate_hz: f64,
    context: &mut Context,
) -> Result<(), Failure> {
    let Some((_, first)) = frames.first() else {
        return Ok(());
    };
    let period = Duration::from_secs_f64(1.0 / rate_hz);
    // Buffers get their size before the clock starts.
    live.session
        .push(first.view())
        .map_err(Failure::no_answer)?;
    let start = Instant::now();
    live.print_heading(context);
    for (time_s, frame) in frames {
        if context.interrupt.requested() {
            break;
        }
        let due = Duration::from_secs_f64(*time_s);
        // A camera would deliver the frame now.
        std::thread::sleep(due.saturating_sub(start.elapsed()));
        live.seen += 1;
        live.take(*time_s, frame.view())?;
        live.late += usize::from(start.elapsed() > due + period);
        live.print_last(false, context);
    }
    Ok(())
}
