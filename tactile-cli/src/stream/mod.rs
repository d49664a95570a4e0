//! `tactile stream`: force and modulus live, from a simulated series at camera rate or from recorded frames.
mod live;
mod recorded;
mod simulated;

use crate::context::Context;
use crate::failure::{Exit, Failure};
use crate::numbers::{not_negative, positive};
use crate::outputs::{Csv, Outputs};
use clap::Args;
use live::Live;
use serde_json::{Value, json};
use std::path::PathBuf;

/// Measure frame after frame: force, contact and modulus live
///
/// Without SCENE.toml a loading–unloading series is simulated and played at camera rate: frames are made beforehand, so that only
/// the measuring is timed; a frame is late if its answer comes after the next frame is due. The exit code is then 1 if more
/// frames came late than allowed or the modulus ends outside the tolerance. With SCENE.toml (see `tactile measure`), which
/// describes sensor and object, recorded frames are measured one after the other, as fast as they can be; one is late if
/// that takes longer than a frame at --rate lasts. --out gets stream.csv, a row a frame.
#[derive(Args)]
#[command(after_help = "\
Examples:
  tactile stream --rate 20 --period 1 --allowed-late 100
  tactile stream --rate 20 --period 1 --allowed-late 100 --strain --json
  tactile stream examples/data/press/scene.toml --allowed-late 100 --out target/stream
  tactile stream examples/data/press/scene.toml examples/data/press/frame_1.png examples/data/press/frame_2.png --allowed-late 100")]
pub struct Arguments {
    /// Scene file of the sensor and the object, whose recorded frames are measured.
    #[arg(value_name = "SCENE.toml")]
    scene: Option<PathBuf>,
    /// Recorded frames: images, or folders whose images are taken in the order of their names; those of the scene if
    /// there is none here.
    #[arg(value_name = "FRAMES", requires = "scene")]
    frames: Vec<PathBuf>,
    /// Frames per second.
    #[arg(long, value_name = "HZ", default_value_t = 80.0, value_parser = positive)]
    rate: f64,
    /// Largest force in newtons (1.5 in a simulation).
    #[arg(long, value_name = "N", value_parser = positive)]
    force: Option<f64>,
    /// Measure strain too, in frames of at least a third of the largest force, counted from the first of them.
    #[arg(long)]
    strain: bool,
    /// Share of frames in per cent that may come late.
    #[arg(long, value_name = "PERCENT", default_value_t = 0.0, value_parser = not_negative)]
    allowed_late: f64,
    /// Folder for stream.csv.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    simulation: Simulation,
}

/// What is simulated where no scene is given.
#[derive(Args)]
struct Simulation {
    /// Simulation: seconds of one load and unload.
    #[arg(long, value_name = "S", default_value_t = 2.0, value_parser = positive, conflicts_with = "scene")]
    period: f64,
    /// Simulation: cycles.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..), conflicts_with = "scene")]
    cycles: u32,
    /// Simulation: frames of 1392 × 1042 pixels instead of 348 × 260.
    #[arg(long, conflicts_with = "scene")]
    full_size: bool,
    /// Simulation: error of the modulus in per cent beyond which the run fails.
    #[arg(long, value_name = "PERCENT", default_value_t = 3.0, value_parser = positive, conflicts_with = "scene")]
    tolerance: f64,
}

const FILE: &str = "stream.csv";

pub fn run(arguments: &Arguments, context: &mut Context) -> Result<Exit, Failure> {
    let inputs: Vec<_> = arguments.scene.iter().map(PathBuf::as_path).collect();
    let outputs = Outputs::plan(arguments.out.as_deref(), &[FILE], &inputs)?;
    match &arguments.scene {
        Some(scene) => recorded::run(scene, arguments, outputs, context),
        None => simulated::run(arguments, outputs, context),
    }
}

/// Prints what the series as a whole says, and writes its table.
fn finish(
    live: &mut Live,
    arguments: &Arguments,
    mut outputs: Outputs,
    context: &mut Context,
) -> Result<Exit, Failure> {
    let late_percent = live.late_percent();
    let console = &mut context.console;
    console.line(format!(
        "{} frames at {} Hz, {} late ({late_percent:.1} %)",
        live.rows.len(),
        arguments.rate,
        live.late
    ));
    let modulus = live.session.modulus();
    match &modulus {
        Ok(modulus) => console.line(format!(
            "modulus {}{}",
            live::in_kpa(modulus),
            live.beside_truth(modulus.youngs_modulus_pa)
        )),
        Err(reason) => console.line(format!("modulus none: {reason}")),
    }
    console.line(live.session.report());
    let caution = live.session.drift().caution.as_ref();
    let caution = caution.map(ToString::to_string);
    if let Some(caution) = &caution {
        console.line(format!("caution: {caution}"));
    }
    let updates: Vec<Value> = live.rows.iter().map(live::Row::json).collect();
    let mut value = json!({
        "frames": live.rows.len(), "rate_hz": arguments.rate, "late": live.late, "updates": updates,
        "youngs_modulus_pa": match &modulus {
            Ok(m) => json!({ "value": { "value": m.youngs_modulus_pa, "standard_error": m.standard_error_pa } }),
            Err(reason) => json!({ "error": reason.to_string() }),
        },
        "caution": caution,
    });
    if let Some(truth_pa) = live.truth_pa {
        value["true_youngs_modulus_pa"] = json!(truth_pa);
    }
    console.value(&value);
    outputs.write(FILE, &table(&live.rows))?;
    if let Some(summary) = outputs.summary() {
        console.line(summary);
    }
    let mut exit = Exit::Complete;
    if late_percent > arguments.allowed_late {
        exit = Exit::Partial;
        console.note(format!(
            "{late_percent:.1} % of the frames came late, more than {} %",
            arguments.allowed_late
        ));
    }
    if let Err(reason) = &modulus {
        exit = Exit::Partial;
        console.note(format!("there is no modulus: {reason}"));
    }
    Ok(exit)
}

/// A row a frame; empty where nothing is known.
fn table(rows: &[live::Row]) -> Vec<u8> {
    let mut csv = Csv::new(&[
        "time_s",
        "force_N",
        "force_error_N",
        "contact_radius_m",
        "contact_radius_error_m",
        "youngs_modulus_Pa",
        "youngs_modulus_error_Pa",
        "strain_xx",
        "strain_zz",
    ]);
    for row in rows {
        let [force, radius, modulus] = [row.force_n, row.radius_m, row.modulus_pa];
        csv.cells([
            Some(row.time_s),
            force.map(|f| f[0]),
            force.map(|f| f[1]),
            radius.map(|a| a[0]),
            radius.map(|a| a[1]),
            modulus.map(|e| e[0]),
            modulus.map(|e| e[1]),
            row.strain_xx_zz.map(|e| e[0]),
            row.strain_xx_zz.map(|e| e[1]),
        ]);
    }
    csv.into_bytes()
}
