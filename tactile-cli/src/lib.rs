//! The program `tactile`: every stage of a measurement with an optical tactile sensor, and the
//! whole measurement, from the command line.
//!
//! ```text
//! cargo run --release -p tactile-cli -- measure
//! ```
#![forbid(unsafe_code)]

mod arguments;
mod calibrate;
mod console;
mod depth;
mod failure;
mod force;
mod frames;
mod gel;
mod hidden;
mod inclusion;
mod light;
mod markers;
mod match_points;
mod measure;
mod mesh;
mod outputs;
mod paper;
mod plot;
mod record;
mod relief;
mod report;
mod serve;
mod simulation;
mod slopes;
mod strain;
mod stream;
mod surfaces;
mod table;
mod text;
mod warp;

use clap::error::ErrorKind;
use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use console::Context;
use failure::{Exit, Failure};
use outputs::Outputs;
use report::Report;
use std::ffi::OsString;
use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;
use text::printable;

/// Force, shape, strain and Young's modulus from the frames of an optical tactile sensor.
///
/// Every subcommand prints its results as text, or as one JSON object with --json. It writes files
/// (tables as CSV, plots as SVG) only to the folder given by --out. The examples in the help can be
/// run in a copy of the repository.
#[derive(Parser)]
#[command(name = "tactile", version, after_help = AFTER_HELP, arg_required_else_help = true)]
struct Program {
    #[command(subcommand)]
    command: Command,
    /// Print one JSON object on standard output instead of text. Each stage is a value or its
    /// error.
    #[arg(long, global = true)]
    json: bool,
    /// Write tables and plots to this folder. `calibrate` writes a sensor to this file.
    #[arg(long, global = true, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Write the result to this file as a page: pictures, cautions, assumptions, inputs with their
    /// hashes, and the call. It needs no network.
    #[arg(long, global = true, value_name = "FILE.html")]
    report: Option<PathBuf>,
    /// Refuse a job that needs more memory than this, in GB.
    #[arg(long, global = true, value_name = "GB", default_value = "6",
          value_parser = arguments::positive, allow_negative_numbers = true)]
    memory_gb: f64,
}

const AFTER_HELP: &str = "\
Examples, one for each subcommand:
  tactile measure examples/data/press/scene.toml
  tactile force --reference examples/data/press/reference.png --pairs \
                          examples/data/press/calibration.csv --pixel-um 40 \
                          examples/data/press/frame_1.png
  tactile calibrate examples/data/sensor/calibration.toml
  tactile match examples/data/cases.txt
  tactile warp examples/data/sources.csv examples/data/targets.csv examples/data/queries.csv
  tactile strain examples/data/before.csv examples/data/after.csv
  tactile integrate examples/data/slope_x.csv examples/data/slope_y.csv
  tactile depth --reference examples/data/dark_reference.pgm --table examples/data/depth_table.csv \
                          --pixel-um 100 examples/data/dark_frame.pgm
  tactile inclusion --design examples/data/inclusion/scene.toml
  tactile stream --rate 20 --period 1 --allowed-late 100
  tactile light --rays 2000
  tactile markers --reference examples/data/markers_reference.png examples/data/markers_frame.png
  tactile table examples/data/press/scene.toml --moduli 2 --largest-ratio 0.5
  tactile paper --out target/paper

Exit codes:
  0    all requested results are available
  1    results were printed, but a stage failed; its reason is printed
  2    an argument or a file cannot be used; nothing was computed
  3    a result could not be written
  130  stopped by Ctrl-C; the results so far were printed";

#[derive(Subcommand)]
enum Command {
    Measure(measure::MeasureArguments),
    Force(force::ForceArguments),
    Calibrate(calibrate::CalibrateArguments),
    Match(match_points::MatchArguments),
    Warp(warp::WarpArguments),
    Strain(strain::StrainArguments),
    Integrate(surfaces::IntegrateArguments),
    Depth(depth::DepthArguments),
    Inclusion(inclusion::InclusionArguments),
    Stream(stream::StreamArguments),
    Light(light::LightArguments),
    Markers(markers::MarkersArguments),
    Table(table::ContactTableArguments),
    Paper(paper::PaperArguments),
}

impl Command {
    fn run(&self, context: &mut Context) -> Result<Exit, Failure> {
        match self {
            Self::Measure(arguments) => measure::run(arguments, context),
            Self::Force(arguments) => force::run(arguments, context),
            Self::Calibrate(arguments) => calibrate::run(arguments, context),
            Self::Match(arguments) => match_points::run(arguments, context),
            Self::Warp(arguments) => warp::run(arguments, context),
            Self::Strain(arguments) => strain::run(arguments, context),
            Self::Integrate(arguments) => surfaces::integrate(arguments, context),
            Self::Depth(arguments) => depth::run(arguments, context),
            Self::Inclusion(arguments) => inclusion::run(arguments, context),
            Self::Stream(arguments) => stream::run(arguments, context),
            Self::Light(arguments) => light::run(arguments, context),
            Self::Markers(arguments) => markers::run(arguments, context),
            Self::Table(arguments) => table::run(arguments, context),
            Self::Paper(arguments) => paper::run(arguments, context),
        }
    }
}

/// Runs the program on the arguments of this process.
///
/// Reads and writes files and the standard streams and, if possible, installs a handler for
/// interrupts: intended for a `main`.
///
/// ```no_run
/// fn main() -> std::process::ExitCode {
///     tactile_cli::run()
/// }
/// ```
pub fn run() -> ExitCode {
    ExitCode::from(run_with(std::env::args_os()))
}

/// Runs the program on arguments, the first of which is its name, and returns its exit code as
/// listed by `tactile --help`.
///
/// Like [`run`], it installs a handler for interrupts: intended for a program in another language
/// that acts as this one.
///
/// ```
/// let code = tactile_cli::run_with(["tactile", "--version"]);
/// assert_eq!(code, 0);
/// ```
pub fn run_with(arguments: impl IntoIterator<Item: Into<OsString> + Clone>) -> u8 {
    let arguments: Vec<OsString> = arguments.into_iter().map(Into::into).collect();
    let mut command = Program::command();
    let matches = command.try_get_matches_from_mut(&arguments);
    let parsed = matches.and_then(|found| {
        let name = found.subcommand_name().unwrap_or_default().to_owned();
        Ok((name, Program::from_arg_matches(&found)?))
    });
    let (name, program) = match parsed {
        Ok(parsed) => parsed,
        Err(error) => return explain(&error).code(),
    };
    let mut outputs = Outputs::new(program.out, program.memory_gb);
    outputs.report = program.report.map(|path| {
        // The purpose of the subcommand: the first sentence of its help.
        let about = command
            .find_subcommand(&name)
            .and_then(clap::Command::get_about);
        let question = about.map_or(String::new(), ToString::to_string);
        Report::new(path, &arguments, question)
    });
    let mut context = Context::new(name, program.json, outputs);
    let ended = program.command.run(&mut context);
    context.close(ended).code()
}

/// Prints the help if it was requested, otherwise the error in the arguments as one sentence.
fn explain(error: &clap::Error) -> Exit {
    let text = error.render().to_string();
    match error.kind() {
        ErrorKind::DisplayHelp | ErrorKind::DisplayVersion => {
            match std::io::stdout().write_all(text.as_bytes()) {
                Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => Exit::Output,
                _ => Exit::Complete,
            }
        }
        ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand => {
            let _ = std::io::stderr().write_all(text.as_bytes());
            Exit::Input
        }
        _ => {
            // The first paragraph describes the error, followed by usage and tips.
            let first = text.split("\n\n").next().unwrap_or_default();
            let words: Vec<&str> = first.split_whitespace().collect();
            let sentence = printable(&words.join(" "));
            let sentence = sentence.strip_prefix("error: ").unwrap_or(&sentence);
            let _ = writeln!(
                std::io::stderr(),
                "tactile: {sentence}; --help lists the arguments"
            );
            Exit::Input
        }
    }
}
