//! `tactile measure`: everything, of a simulated press or of a user's own frames.
mod report;
mod source;
mod timing;
mod truth;

use crate::context::Context;
use crate::failure::{Exit, Failure};
use crate::numbers::positive;
use crate::outputs::Outputs;
use crate::progress::{Progress, waiting_or_interrupted};
use clap::{Args, ValueEnum};
use serde::Serialize;

use crate::plot::{PlotError, save_pages, summary_lines};
use source::Source;
use std::path::PathBuf;
use tactile_imaging::pipeline::{ContactReading, Measurement, PipelineError, Press};
use timing::Timing;
use truth::Truth;

/// Measure the Young's modulus of an object from frames at two or more loads
///
/// Without SCENE.toml it simulates the paper's experiment (a ball of 3 mm radius pressed with 0.7 N and 1.2 N on the layered
/// waveguide), measures the simulated frames blindly, and prints every result beside the truth. With SCENE.toml it
/// measures your own frames. --out gets the plots: frames.svg, surfaces.svg, matches.svg, displacement.svg, strain.svg,
/// summary.svg.
#[derive(Args)]
#[command(after_help = AFTER_HELP)]
pub struct Arguments {
    /// Scene file with your own frames; see below. Without it a press is simulated.
    #[arg(value_name = "SCENE.toml")]
    scene: Option<PathBuf>,
    /// Measure N times and report the median and the 99th centile of every stage and of the whole.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    repeat: u32,
    /// Folder for the plots.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Number of control points on each surface.
    #[arg(long, value_name = "COUNT", default_value_t = 200, value_parser = clap::value_parser!(u32).range(8..=5000))]
    points: u32,
    #[command(flatten)]
    simulation: Simulation,
}

/// What is simulated where no scene is given.
#[derive(Args)]
struct Simulation {
    /// Simulation: the ball's material.
    #[arg(long, value_enum, default_value_t = Polymer::Cl2000x, conflicts_with = "scene")]
    polymer: Polymer,
    /// Simulation: the ball's Young's modulus in kPa, instead of a polymer's.
    #[arg(long, value_name = "KPA", value_parser = positive, conflicts_with_all = ["scene", "polymer"])]
    modulus_kpa: Option<f64>,
    /// Simulation: the ball's radius in mm.
    #[arg(long, value_name = "MM", default_value_t = 3.0, value_parser = positive, conflicts_with = "scene")]
    radius_mm: f64,
    /// Simulation: the loads in newtons.
    #[arg(long, value_name = "N,N,...", value_delimiter = ',', default_values_t = [0.7, 1.2], value_parser = positive, conflicts_with = "scene")]
    forces: Vec<f64>,
    /// Simulation: where the contacts come from. Finite elements are there for the two polymers, 3 mm, up to 1.3 N.
    #[arg(long, value_enum, default_value_t = Physics::FiniteElements, conflicts_with = "scene")]
    physics: Physics,
    /// Simulation: seed of the camera's noise.
    #[arg(long, default_value_t = 1, conflicts_with = "scene")]
    seed: u64,
    /// Simulation: no noise, blur, vignetting or background.
    #[arg(long, conflicts_with = "scene")]
    ideal_camera: bool,
}

/// What `--json` prints.
#[derive(Serialize)]
struct Answer<'a> {
    #[serde(flatten)]
    measurement: &'a Measurement,
    #[serde(skip_serializing_if = "Option::is_none")]
    truth: Option<&'a Truth>,
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    timing: &'a [Timing],
}

/// What the simulated contacts obey.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Physics {
    /// Finite elements at finite strain, on the layers; read by the default estimator.
    FiniteElements,
    /// Hertz with the layers in series; read by the same law.
    Hertz,
}

/// The paper's two polymers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Polymer {
    /// Versaflex CL2000X, 103 kPa.
    Cl2000x,
    /// Versaflex CL2003X, 62 kPa.
    Cl2003x,
}

const AFTER_HELP: &str = "\
Examples:
  tactile measure
  tactile measure examples/data/press/scene.toml --out target/measure
  tactile measure --polymer cl2003x --seed 7 --json
  tactile measure --physics hertz --radius-mm 20

SCENE.toml (paths are relative to it; PNG, PGM or JPEG; colour becomes grey by the luma of Rec. 601):

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
  shape = \"sphere\"                       # or \"block\", \"cylinder\" (flat faces, no size), \"flat_punch\", \"unknown\"
  radius_m = 3e-3
  poisson_ratio = 0.5
  [waveguide]                            # from the object's side to the glass
  layers = [{ refractive_index = 1.38, thickness_m = 2e-3, youngs_modulus_pa = 1.36e5, poisson_ratio = 0.5 }]";

const PAGES: [&str; 6] = [
    "frames.svg",
    "surfaces.svg",
    "matches.svg",
    "displacement.svg",
    "strain.svg",
    "summary.svg",
];

/// The contact of every frame, which needs nothing of the others; after Ctrl-C those that are there are printed and there is nothing more
/// to do.
fn contacts(press: &mut Press<'_>, context: &mut Context) -> Option<Vec<Contact>> {
    let mut bar = Progress::of(press.frames(), "measuring contacts");
    context.interrupt.hear(true);
    let mut contacts = Vec::with_capacity(press.frames());
    for frame in 0..press.frames() {
        if context.interrupt.requested() {
            drop(bar);
            report::print_contacts(&contacts, &mut context.console);
            return None;
        }
        contacts.push(press.contact(frame).map(|contact| contact.copied()));
        bar.done(frame + 1);
    }
    Some(contacts)
}

/// What the first stage says of a frame; None without contact.
type Contact = Result<Option<ContactReading>, PipelineError>;

pub fn run(arguments: &Arguments, context: &mut Context) -> Result<Exit, Failure> {
    let inputs: Vec<_> = arguments.scene.iter().map(PathBuf::as_path).collect();
    let outputs = Outputs::plan(arguments.out.as_deref(), &PAGES, &inputs)?;
    // It lives as long as the program, so that Ctrl-C can leave work on it undone.
    let source: &'static Source = Box::leak(Box::new(Source::open(arguments, context)?));
    outputs.check(&source.files())?;
    let pipeline = source.pipeline(arguments.points as usize)?;
    let mut press = source.press(&pipeline)?;
    let Some(contacts) = contacts(&mut press, context) else {
        return Ok(Exit::Interrupted);
    };
    let job = format!("measuring {} frames", press.frames());
    let measured = waiting_or_interrupted(job, &context.interrupt, move || {
        let measurement = press.measure();
        (press, measurement)
    });
    let Some((mut press, measurement)) = measured else {
        report::print_contacts(&contacts, &mut context.console);
        return Ok(Exit::Interrupted);
    };
    let timing = timing::repeated(&press, arguments.repeat, context);
    let truth = source.truth();
    report::print(&measurement, truth.as_ref(), &timing, &mut context.console);
    let mut exit = Exit::Complete;
    if !report::is_complete(&measurement) {
        exit = Exit::Partial;
        if let Err(error) = &measurement.youngs_modulus_pa {
            context.console.note(source.explain(error.clone()));
        }
    }
    context.console.value(&Answer {
        measurement: &measurement,
        truth: truth.as_ref(),
        timing: &timing,
    });
    if let Some(folder) = &arguments.out {
        let mut lines = summary_lines(&measurement);
        if let (Some(truth), Ok(modulus)) = (&truth, &measurement.youngs_modulus_pa) {
            lines.push(format!(
                "true modulus\t{:.2} kPa (error {:+.2} %)",
                truth.youngs_modulus_pa * 1e-3,
                report::percent(modulus.value, truth.youngs_modulus_pa)
            ));
        }
        match save_pages(&mut press, lines, folder) {
            Ok(paths) => {
                let names: Vec<_> = paths.iter().map(|p| p.display().to_string()).collect();
                context.console.line(format!("wrote {}", names.join(", ")));
            }
            Err(error @ PlotError::Write { .. }) => {
                return Err(Failure::output(error));
            }
            Err(error) => {
                exit = Exit::Partial;
                context.console.note(format!("no plots: {error}"));
            }
        }
    }
    Ok(exit)
}
