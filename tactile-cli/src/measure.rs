//! `tactile measure`: all results of a simulated press or of a user's frames.
use crate::arguments::{Repetition, force_n};
use crate::console::{Bar, Context};
use crate::failure::{Exit, Failure};
use crate::frames::{Colours, NamedFrame, Reading, frames_help};
use crate::gel;
use crate::plot::{PlotError, known_heights_mm, press_pages, summary_lines};
use crate::simulation::{Physics, Simulation};
use crate::text::{digits, in_unit};
use clap::Args;
use serde::Serialize;
use serde_json::{Value, json};
use std::path::PathBuf;
use std::time::{Duration, Instant};
use tactile_files::io::{Grey, image_colour, image_size};
use tactile_files::scene::{Scene, SceneData, SceneFrame};
use tactile_files::sensor::GelPresses;
use tactile_imaging::Pipeline;
use tactile_imaging::pipeline::{
    ContactReading, Measurement, PerPercent, PipelineError, Press, Stage,
};
use tactile_simulate::{PressLoad, PressOptions, PressSimulation, PressTruth, Trial};

/// Measure the Young's modulus of an object from frames at two or more loads
///
/// Without SCENE.toml it simulates the experiment of the paper: a ball of 3 mm radius pressed with
/// 0.7 N and 1.2 N on the layered waveguide. It measures the simulated frames and prints every
/// result with its true value. With SCENE.toml it measures the frames of a scene. With the sensor
/// file of a gel it prints depth, contact and force in every frame, and writes the files of
/// `tactile depth --sensor`. --repeat N prints the median and the 99th centile of the times of every
/// stage and of the whole. --out gets the plots: frames.svg, surfaces.svg, matches.svg,
/// displacement.svg, strain.svg, summary.svg.
#[derive(Args)]
#[command(after_help = "\
Examples:
  tactile measure
  tactile measure examples/data/press/scene.toml --out target/measure
  tactile measure --polymer cl2003x --seed 7 --json
  tactile measure --physics hertz --radius-mm 20
  ffmpeg -i press.mp4 -vf fps=2 -f yuv4mpegpipe -pix_fmt gray - | tactile measure scene.toml -

SCENE.toml (paths are relative to it; colour becomes grey by the luma of Rec. 601):

  reference = \"reference.png\"            # the sensor without contact
  pixel_size_m = [21.55e-6, 21.55e-6]    # x, y, on the sensing surface
  [calibration]
  pairs = \"calibration.csv\"              # columns integrated_pixel_value,force_N
  # or: depth_table = \"depth.csv\"        # columns darkness_grey_levels,depth_mm
  [[frames]]
  image = \"frame_1.png\"
  force_N = 0.70                         # optional gauge reading
  [[frames]]
  image = \"frame_2.png\"
  [object]
  shape = \"sphere\"                       # or \"block\", \"cylinder\" (flat faces, no size), \
                        \"flat_punch\", \"unknown\"
  radius_m = 3e-3
  poisson_ratio = 0.5
  [waveguide]                            # from the object's side to the glass
  layers = [{ refractive_index = 1.38, thickness_m = 2e-3, youngs_modulus_pa = 1.36e5, \
                        poisson_ratio = 0.5 }]")]
pub(crate) struct MeasureArguments {
    /// Scene file with your own frames (see below). Without it a press is simulated.
    #[arg(value_name = "SCENE.toml")]
    scene: Option<PathBuf>,
    #[arg(value_name = "FRAMES", requires = "scene",
          help = frames_help("Frames to measure instead of those of the scene"))]
    frames: Vec<PathBuf>,
    #[command(flatten)]
    repetition: Repetition,
    /// Number of control points on each surface.
    #[arg(long, value_name = "COUNT", default_value_t = 200,
          value_parser = clap::value_parser!(u32).range(8..=5000))]
    points: u32,
    #[command(flatten)]
    simulation: Simulation,
    /// Simulation: the loads in newtons.
    #[arg(long, value_name = "N,N,...", value_delimiter = ',', default_values_t = [0.7, 1.2],
          value_parser = force_n, conflicts_with = "scene")]
    forces: Vec<f64>,
}

/// Frames with all inputs of their measurement.
enum Frames {
    /// Simulated, with the truth.
    Simulated(Box<Trial>),
    /// From a scene file.
    Scene(Box<(Scene, SceneData, Exit)>),
}

impl Frames {
    fn open(arguments: &MeasureArguments, context: &mut Context) -> Result<Self, Failure> {
        let Some(path) = &arguments.scene else {
            let loads = arguments.forces.iter().map(|&f| PressLoad::normal(f));
            let options = arguments.simulation.options(Physics::FiniteElements);
            let trial = arguments.simulation.trial(PressOptions {
                loads: loads.collect(),
                ..options
            });
            return Ok(Self::Simulated(Box::new(trial?)));
        };
        let mut scene = Scene::read(path).map_err(Failure::input)?;
        if !arguments.frames.is_empty() {
            let mut data = scene.load_without_frames().map_err(Failure::input)?;
            context.warn_of_light(&scene);
            let reading = Reading {
                grey: Grey::default(),
                bits: scene.bits,
                reference: &scene.reference,
                size: data.reference.dim(),
            };
            let (frames, unreadable) = reading.all(&arguments.frames, context)?;
            let named = |frame: &NamedFrame| SceneFrame::new(&frame.name);
            let named = frames.iter().map(named).collect();
            data.frames = frames.into_iter().map(|frame| frame.pixels).collect();
            scene.frames = named;
            let exit = Exit::complete_if(unreadable == 0);
            return Ok(Self::Scene(Box::new((scene, data, exit))));
        }
        let frames = scene.frames.len();
        // Loading reports the error of an unreadable reference.
        if let Some((rows, columns)) = image_size(&scene.reference) {
            // Frames of up to 64 MB are kept, and larger ones are read again. Their results take 4
            // kB each.
            let pixels = (rows * columns) as f64;
            let bytes = pixels + (frames as f64 * pixels).min(64e6) + 4e3 * frames as f64;
            let job = format!("a scene of {frames} frames");
            context.allow(bytes, &job, "give fewer or smaller frames")?;
        }
        let data = scene.load_without_frames().map_err(Failure::input)?;
        context.warn_of_light(&scene);
        let mut colours = Colours::Unknown;
        for SceneFrame { image, .. } in &scene.frames {
            // Loading the frames reports the error of an unreadable one.
            let colour = image_colour(image).unwrap_or_default();
            colours.compare(&scene.reference, image, colour, context);
        }
        Ok(Self::Scene(Box::new((scene, data, Exit::Complete))))
    }

    /// Leaves out the frames that have a reason for it.
    fn leave_out(&mut self, reasons: &[Option<String>], context: &mut Context) {
        let Self::Scene(own) = self else { return };
        let (scene, data, _) = own.as_mut();
        for (frame, reason) in scene.frames.iter().zip(reasons) {
            if let Some(reason) = reason {
                let text = format!("{} is left out: {reason}", frame.image.display());
                context.warn("frame_left_out", json!({}), text);
            }
        }
        let mut kept = reasons.iter().map(Option::is_none);
        scene.frames.retain(|_| kept.next() == Some(true));
        let mut kept = reasons.iter().map(Option::is_none);
        data.frames.retain(|_| kept.next() == Some(true));
    }

    fn pipeline(&self, points: usize) -> Result<Pipeline, Failure> {
        let pipeline = match self {
            Self::Simulated(trial) => trial.pipeline().map_err(Failure::input)?,
            Self::Scene(own) => own.0.pipeline(&own.1).map_err(Failure::input)?,
        };
        Ok(pipeline.with_control_points(points))
    }

    fn press(&self, pipeline: &Pipeline) -> Result<Press<'_>, Failure> {
        match self {
            Self::Simulated(trial) => trial.press(pipeline).map_err(Failure::input),
            Self::Scene(own) => {
                let _clock = Bar::clock(format!("reading {} frames", own.0.frames.len()));
                own.0.press(pipeline, &own.1).map_err(Failure::input)
            }
        }
    }

    /// The error of the pipeline, with file and field if there is a scene file.
    fn explain(&self, error: PipelineError) -> String {
        match self {
            Self::Simulated(_) => error.numbered_from(1).to_string(),
            Self::Scene(own) => own.0.measure_error(error).to_string(),
        }
    }

    /// Whether no stream of frames was truncated.
    fn all_read(&self) -> bool {
        match self {
            Self::Simulated(_) => true,
            Self::Scene(own) => own.2 == Exit::Complete,
        }
    }

    fn truth(&self) -> Option<&PressSimulation> {
        match self {
            Self::Simulated(trial) => Some(&trial.simulation),
            Self::Scene(_) => None,
        }
    }
}

/// Strain of the apparent surfaces of a simulated press between the first and the last frame.
fn true_strain(truth: &[PressTruth]) -> Option<[[f64; 3]; 3]> {
    let (first, last) = (truth.first()?, truth[1..].last()?);
    let e = first.scaling_to(last).green_lagrange_strain();
    Some(std::array::from_fn(|r| std::array::from_fn(|c| e[(r, c)])))
}

/// The truth of a simulated press as JSON. The surface is the apparent one.
fn truth_value(simulation: &PressSimulation) -> Value {
    let frame = |t: &PressTruth| {
        json!({
            "force_n": t.contact.force_n, "contact_radius_m": t.contact.contact_radius_m,
            "contact_ratio": t.contact.contact_ratio(), "centroid_px": t.centroid_px,
            "indentation_m": t.contact.indentation_m,
            "surface_height_m": t.contact.apparent_height_m(0.0),
        })
    };
    json!({
        "youngs_modulus_pa": simulation.youngs_modulus_pa,
        "frames": simulation.truth.iter().map(frame).collect::<Vec<_>>(),
        "strain": true_strain(&simulation.truth),
    })
}

/// Median and 99th centile of a stage in milliseconds.
#[derive(Serialize)]
struct Timing {
    stage: String,
    median_ms: f64,
    centile_99_ms: f64,
}

/// The output of `--json`.
#[derive(Serialize)]
struct Answer<'a> {
    #[serde(flatten)]
    measurement: &'a Measurement,
    #[serde(skip_serializing_if = "Option::is_none")]
    truth: Option<Value>,
    /// Relative change of the modulus for one per cent of what frames cannot show.
    #[serde(skip_serializing_if = "Option::is_none")]
    modulus_per_percent: Option<PerPercent>,
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    timing: &'a [Timing],
}

/// Result of the first stage for a frame. `None` without contact.
type Contact = Result<Option<ContactReading>, PipelineError>;

pub(crate) fn run(arguments: &MeasureArguments, context: &mut Context) -> Result<Exit, Failure> {
    if let Some(sensor) = arguments
        .scene
        .as_deref()
        .filter(|path| GelPresses::names_kind(path))
    {
        return gel::measure(sensor, &arguments.frames, context);
    }
    let stages = [
        "frames",
        "surfaces",
        "matches",
        "displacement",
        "strain",
        "summary",
    ];
    let names = stages.map(|name| format!("{name}.svg"));
    context.outputs.plan(&names, arguments.scene.as_slice())?;
    let mut frames = Frames::open(arguments, context)?;
    let pipeline = frames.pipeline(arguments.points as usize)?;
    let press = frames.press(&pipeline)?;
    // The contact of a frame is independent of the others: contacts are available even if Ctrl-C
    // stops the rest.
    let Some(contacts) = contacts(&press, context) else {
        return Ok(Exit::Interrupted);
    };
    // What one frame spoils does not spoil the others.
    let reasons: Vec<_> = contacts.iter().map(spoilt).collect();
    let is_spoilt = reasons.iter().flatten().count();
    let mut press = match is_spoilt > 0 && is_spoilt < reasons.len() {
        true => {
            drop(press);
            frames.leave_out(&reasons, context);
            frames.press(&pipeline)?
        }
        false => press,
    };
    if !long_stages(&press, context) {
        print_contacts(&contacts, context);
        return Ok(Exit::Interrupted);
    }
    let measurement = press.measure();
    let cautions = measurement.flags.clone();
    let failure = measurement.youngs_modulus_pa.as_ref().err().cloned();
    // Here frames are counted from 1.
    let mut measurement = measurement.numbered_from(1);
    let timing = timing(&press, arguments.repetition.repeat, context);
    let truth = frames.truth();
    print(&measurement, truth, &timing, context);
    let per_percent = press.per_percent().ok();
    if let Some(PerPercent {
        force,
        pixel_size,
        distortion,
        ..
    }) = per_percent
    {
        let [force, pixel_size, distortion] =
            [force, pixel_size, distortion].map(|change| digits(100.0 * change, 2));
        context.row(
            "sensitivity",
            format_args!(
                "the modulus changes by {force} % for forces 1 % larger, by {pixel_size} % for \
                 pixels 1 % larger, by {distortion} % for 1 % of distortion at the corners"
            ),
        );
    }
    if let Some(error) = failure {
        context.note(frames.explain(error));
    }
    context.keep_cautions(&cautions);
    // The cautions are separate from the measurement, as in every result.
    let flags = std::mem::take(&mut measurement.flags);
    context.value(&Answer {
        measurement: &measurement,
        truth: truth.map(truth_value),
        modulus_per_percent: per_percent,
        timing: &timing,
    });
    measurement.flags = flags;
    let mut results = measurement.frames.iter();
    let complete = frames.all_read()
        && measurement.youngs_modulus_pa.is_ok()
        && measurement.strain.is_ok()
        && results.all(|f| f.as_ref().is_ok_and(|f| f.force_n.is_ok()));
    if let Some(report) = &mut context.outputs.report {
        report.measurement(&measurement);
        report.inputs(arguments.frames.iter().cloned());
        if let Frames::Scene(own) = &frames {
            report.assumptions(&own.0);
        }
    }
    if !context.outputs.draws() {
        return Ok(Exit::complete_if(complete));
    }
    if let (Some(report), Some(last)) = (&mut context.outputs.report, press.frames().checked_sub(1))
        && let Ok(found) = press.surface(last)
    {
        let apparent = if found.apparent { "apparent " } else { "" };
        let title = format!("{apparent}surface of frame {}", last + 1);
        report.surface(
            &title,
            known_heights_mm(found).view(),
            found.pixel_size_m.map(|m| 1e3 * m),
        );
    }
    // A simulated press is drawn with its truth.
    let mut lines = summary_lines(&measurement);
    if let (Some(truth), Ok(modulus)) = (truth, &measurement.youngs_modulus_pa) {
        let error = percent(modulus.value, truth.youngs_modulus_pa);
        let kpa = truth.youngs_modulus_pa * 1e-3;
        lines.push(format!("true modulus\t{kpa:.2} kPa (error {error:+.2} %)"));
    }
    match press_pages(&mut press, lines) {
        Ok(pages) => {
            for (name, page) in pages {
                context.outputs.page(format!("{name}.svg"), || page)?;
            }
            Ok(Exit::complete_if(complete))
        }
        Err(PlotError::Measure(error)) => {
            context.note(format_args!("no plots: {}", error.numbered_from(1)));
            Ok(Exit::Partial)
        }
        Err(error) => Err(Failure::output(error)),
    }
}

/// Why a frame is left out if others remain.
fn spoilt(contact: &Contact) -> Option<String> {
    match contact {
        Ok(Some(_)) => None,
        Ok(None) => Some("it shows no contact".to_owned()),
        Err(PipelineError::Contact { source, .. }) => Some(source.to_string()),
        Err(_) => None,
    }
}

/// The contact of every frame. After Ctrl-C the contacts so far are printed, and the program ends.
fn contacts(press: &Press<'_>, context: &mut Context) -> Option<Vec<Contact>> {
    let mut bar = Bar::of(press.frames(), "measuring contacts");
    context.interrupt.polled(true);
    let mut contacts = Vec::with_capacity(press.frames());
    for frame in 0..press.frames() {
        if context.interrupt.requested() {
            drop(bar);
            print_contacts(&contacts, context);
            return None;
        }
        let contact = press.contact(frame).map(|contact| contact.copied());
        contacts.push(contact.map_err(|error| error.numbered_from(1)));
        bar.done(frame + 1);
    }
    Some(contacts)
}

/// Runs the long stages one by one, so that Ctrl-C can stop between two of them. Returns false in
/// that case. The press keeps the results and the errors of its stages.
fn long_stages(press: &Press<'_>, context: &Context) -> bool {
    let mut bar = Bar::of(
        press.measured_surfaces().count() + 1,
        "measuring surfaces and strain",
    );
    for (done, frame) in press.measured_surfaces().enumerate() {
        if context.interrupt.requested() {
            return false;
        }
        let _ = press.surface(frame);
        bar.done(done + 1);
    }
    if let last @ 1.. = press.frames().saturating_sub(1)
        && !context.interrupt.requested()
    {
        let _ = press.strain(last);
    }
    !context.interrupt.requested()
}

/// Prints only the contacts, for a measurement stopped by Ctrl-C.
fn print_contacts(contacts: &[Contact], context: &mut Context) {
    let mut values = Vec::new();
    for (k, contact) in contacts.iter().enumerate() {
        let name = format!("frame {}", k + 1);
        match contact {
            Ok(Some(contact)) => {
                let force = contact.force_n.map(|f| in_unit(f.total(), 1.0) + " N");
                let force = force.unwrap_or("unknown".to_owned());
                let radius = in_unit(contact.contact_radius_m.total(), 1e3);
                context.row(
                    &name,
                    format_args!("force {force}   contact radius {radius} mm"),
                );
                values.push(json!(contact));
            }
            Ok(None) => {
                context.row(&name, "no contact");
                values.push(Value::Null);
            }
            Err(error) => {
                context.row(&name, format_args!("none: {error}"));
                values.push(json!({ "error": error.to_string() }));
            }
        }
    }
    context.line("stopped by Ctrl-C before surfaces, strain and modulus");
    context.value(&json!({ "interrupted": true, "contacts": values }));
}

/// Measures `n` times from the frames, with a known reference. Empty if `n` is one.
fn timing(first: &Press<'_>, n: u32, context: &Context) -> Vec<Timing> {
    if n < 2 {
        return Vec::new();
    }
    let mut times: Vec<Vec<Duration>> = vec![Vec::new(); Stage::ALL.len() + 1];
    let mut bar = Bar::of(n as usize, "measuring");
    context.interrupt.polled(true);
    for k in 0..n {
        if context.interrupt.requested() {
            break;
        }
        let start = Instant::now();
        let press = first.renewed();
        // A stage without a result takes time as well.
        let _ = press.measure();
        let whole = start.elapsed();
        for (list, stage) in times.iter_mut().zip(Stage::ALL) {
            list.push(press.report().work(stage).time);
        }
        times[Stage::ALL.len()].push(whole);
        bar.done(k as usize + 1);
    }
    let stages = Stage::ALL.map(|stage| stage.to_string());
    let names = stages.into_iter().chain(["whole".to_owned()]);
    let timed = names.zip(times).map(|(stage, mut list)| {
        list.sort_unstable();
        // Rounded up, so that the 99th centile of few runs is the slowest.
        let at = |share: f64| {
            let last = list.len().saturating_sub(1) as f64;
            let time = list.get((last * share).ceil() as usize);
            time.map_or(0.0, |time| time.as_secs_f64() * 1e3)
        };
        Timing {
            stage,
            median_ms: at(0.5),
            centile_99_ms: at(0.99),
        }
    });
    timed.collect()
}

fn percent(found: f64, truth: f64) -> f64 {
    100.0 * (found / truth - 1.0)
}

fn print(
    measurement: &Measurement,
    truth: Option<&PressSimulation>,
    timing: &[Timing],
    context: &mut Context,
) {
    context.line(measurement);
    context.aside(format_args!("time\n{}", measurement.report));
    for row in timing {
        context.aside(format_args!(
            "  {:<18} median {:9.3} ms   99th centile {:9.3} ms",
            row.stage, row.median_ms, row.centile_99_ms
        ));
    }
    let Some(truth) = truth else {
        return;
    };
    let [measured, exact, error] = ["measured", "true", "error"];
    context.line(format_args!(
        "beside the truth        {measured:>12} {exact:>12} {error:>10}"
    ));
    let mut line = |name: String, unit: &str, found: f64, truth: f64| {
        let error = percent(found, truth);
        context.line(format_args!(
            "  {name:<16} {unit:<4} {found:>12.4} {truth:>12.4} {error:>+8.2} %"
        ));
    };
    for (i, (m, t)) in measurement.frames.iter().zip(&truth.truth).enumerate() {
        let Ok(m) = m else {
            continue;
        };
        let i = i + 1;
        if let Ok(force) = &m.force_n {
            line(format!("force {i}"), "N", force.value, t.contact.force_n);
        }
        let [found, exact] =
            [m.contact_radius_m.value, t.contact.contact_radius_m].map(|r| 1e3 * r);
        line(format!("contact radius {i}"), "mm", found, exact);
        if let Ok(height) = &m.surface_height_m {
            let exact = 1e3 * t.contact.apparent_height_m(0.0);
            line(
                format!("apparent height {i}"),
                "mm",
                1e3 * height.value,
                exact,
            );
        }
        for (k, axis) in ["x", "y"].into_iter().enumerate() {
            let (found, exact) = (m.centroid_px[k].value, t.centroid_px[k]);
            line(format!("centroid {axis} {i}"), "px", found, exact);
        }
    }
    if let (Ok(m), Some(t)) = (&measurement.strain, true_strain(&truth.truth)) {
        for (k, name) in ["e_xx", "e_yy", "e_zz"].into_iter().enumerate() {
            line(format!("strain {name}"), "", m.mean[k][k], t[k][k]);
        }
    }
    if let Ok(modulus) = &measurement.youngs_modulus_pa {
        let [found, exact] = [modulus.value, truth.youngs_modulus_pa].map(|pa| 1e-3 * pa);
        line("modulus".into(), "kPa", found, exact);
    }
}
