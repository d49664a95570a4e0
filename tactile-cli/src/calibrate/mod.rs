//! `tactile calibrate`: a sensor from presses under known forces, or the line from integrated pixel value to force.
mod pairs;
mod sensor;
mod sensor_report;

pub use pairs::{FILE, fit, page, print, read_pairs, value};

use crate::context::Context;
use crate::failure::{Exit, Failure};
use clap::Args;
use std::path::PathBuf;

/// Calibrate a sensor from frames of presses, or fit the line from pixel value to force
///
/// CALIBRATION.toml names frames of rigid balls or flat punches of known radius under forces of a gauge, a frame without contact, a
/// frame of a dot target where there is one, and the guide's layers as they are stated. The local light-to-pressure curve, the lens,
/// the layers and the errors of all of them are found. --out sensor.toml gets the sensor file that scenes name, and sensor.svg
/// beside it, the report: what was learned, and what the presses did not identify. Where the frames cannot be used nothing is
/// written.
///
/// PAIRS.csv has the columns integrated_pixel_value (grey levels above the reference, summed over the contact) and force
/// (N, mN, … by its heading), at least three rows. --out is a folder and gets calibration.svg.
#[derive(Args)]
#[command(after_help = "\
Examples:
  tactile calibrate examples/data/sensor/calibration.toml
  tactile calibrate examples/data/sensor/calibration.toml --out target/sensor/sensor.toml
  tactile calibrate examples/data/press/calibration.csv
  tactile calibrate examples/data/press/calibration.csv --there-and-back --out target/calibrate")]
pub struct Arguments {
    /// Calibration file of a sensor (.toml), or table of integrated pixel values and forces.
    #[arg(value_name = "CALIBRATION.toml | PAIRS.csv")]
    input: PathBuf,
    /// Of a table: the rows after the one of largest force were taken while unloading, hysteresis is reported.
    #[arg(long)]
    there_and_back: bool,
    /// The sensor file to write, or the folder for calibration.svg.
    #[arg(long, value_name = "sensor.toml | DIR")]
    out: Option<PathBuf>,
}

pub fn run(arguments: &Arguments, context: &mut Context) -> Result<Exit, Failure> {
    let (input, out) = (arguments.input.as_path(), arguments.out.as_deref());
    if !input
        .extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("toml"))
    {
        return pairs::run(input, arguments.there_and_back, out, context);
    }
    if arguments.there_and_back {
        return Err(Failure::input(
            "--there-and-back is for tables of pairs: a calibration file names the branch of each press",
        ));
    }
    sensor::run(input, out, context)
}
