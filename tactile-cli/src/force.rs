//! `tactile force`: normal force, contact and stress from frames.
use crate::calibrate;
use crate::context::Context;
use crate::failure::{Exit, Failure};
use crate::images;
use crate::numbers::one_or_two;
use crate::outputs::{Csv, Outputs};
use crate::progress::Progress;
use clap::Args;
use serde_json::{Value, json};
use std::path::PathBuf;
use tactile_imaging::force::{
    Estimate, ForceMeasurement, ForceMeter, ForceOptions, ForceWorkspace, ReferenceFrame,
    background_shift,
};
use tactile_imaging::pipeline::{PipelineError, with_error};

/// Measure force, contact radius, centroid and stress in frames of a sensor that grows brighter where it is pressed
///
/// Fits the calibration to the pairs first and reports it, see `tactile calibrate`. --out gets force.csv (a row a frame) and
/// calibration.svg.
#[derive(Args)]
#[command(after_help = "\
Examples:
  tactile force --reference examples/data/press/reference.png --pairs examples/data/press/calibration.csv --pixel-um 40 examples/data/press/frame_1.png examples/data/press/frame_2.png
  tactile force --reference examples/data/press/reference.png --pairs examples/data/press/calibration.csv --pixel-um 40 examples/data/press/frame_1.png --out target/force")]
pub struct Arguments {
    /// Pressed frames (PNG, PGM or JPEG).
    #[arg(required = true)]
    frames: Vec<PathBuf>,
    /// Frame of the sensor without contact.
    #[arg(long, value_name = "IMAGE")]
    reference: PathBuf,
    /// Calibration pairs: CSV with the columns integrated_pixel_value and force.
    #[arg(long, value_name = "PAIRS.csv")]
    pairs: PathBuf,
    /// Size of a pixel on the sensor's surface in micrometres, or its width and height.
    #[arg(long, value_name = "X[,Y]", value_parser = one_or_two, allow_negative_numbers = true)]
    pixel_um: [f64; 2],
    /// Bits of the camera, for images of 16 bits whose file does not say.
    #[arg(long, value_parser = clap::value_parser!(u8).range(8..=16))]
    bits: Option<u8>,
    /// Folder for force.csv and calibration.svg.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

const TABLE: &str = "force.csv";

pub fn run(arguments: &Arguments, context: &mut Context) -> Result<Exit, Failure> {
    let mut inputs = vec![arguments.reference.as_path(), arguments.pairs.as_path()];
    inputs.extend(arguments.frames.iter().map(PathBuf::as_path));
    let names = [TABLE, calibrate::FILE];
    let mut outputs = Outputs::plan(arguments.out.as_deref(), &names, &inputs)?;
    let pairs = calibrate::read_pairs(&arguments.pairs, false)?;
    let line = calibrate::fit(&arguments.pairs, &pairs)?;
    let image = images::eight_bits(&arguments.reference, arguments.bits)?;
    let first = (arguments.reference.as_path(), image.dim());
    let in_reference = |e| Failure::input(format!("{}: {e}", arguments.reference.display()));
    let reference = ReferenceFrame::new(image.view()).map_err(in_reference)?;
    let pixel_m = arguments.pixel_um.map(|um| um * 1e-6);
    let meter = ForceMeter::new(pixel_m, &ForceOptions::default()).map_err(Failure::input)?;
    // One frame is held at a time, but a file that cannot be read is found before the first is measured.
    for path in &arguments.frames {
        let frame = images::eight_bits(path, arguments.bits)?;
        images::same_shape((path, frame.dim()), first)?;
    }
    calibrate::print(&line, &mut context.console);
    let mut exit = Exit::Complete;
    let mut workspace = ForceWorkspace::default();
    let mut values = Vec::new();
    let mut csv = Csv::new(&HEADER);
    let mut bar = Progress::of(arguments.frames.len(), "measuring");
    context.interrupt.hear(true);
    for (k, path) in arguments.frames.iter().enumerate() {
        if context.interrupt.requested() {
            break;
        }
        let frame = images::eight_bits(path, arguments.bits)?;
        let name = path.display().to_string();
        let found = meter.measure_with(&mut workspace, frame.view(), &reference, &line);
        bar.done(k + 1);
        context.console.line(format!("{name}:"));
        match found {
            Ok(measurement) => {
                let step = background_shift(frame.view(), image.view());
                let warnings = warnings(&measurement, step);
                let lines = lines(&measurement, &warnings);
                lines.iter().for_each(|line| context.console.line(line));
                values.push(json!({ "frame": name, "value": value(&measurement, &warnings) }));
                csv.row(row(k, &measurement));
            }
            Err(error) => {
                exit = Exit::Partial;
                context.console.line(format!("  no answer: {error}"));
                values.push(json!({ "frame": name, "error": error.to_string() }));
            }
        }
    }
    drop(bar);
    outputs.write(TABLE, &csv.into_bytes())?;
    outputs.page(calibrate::FILE, || calibrate::page(&pairs, &line))?;
    let calibration = calibrate::value(&line);
    let all = json!({ "calibration": { "value": calibration }, "frames": values });
    context.console.value(&all);
    if let Some(summary) = outputs.summary() {
        context.console.line(summary);
    }
    Ok(exit)
}

/// What casts doubt on a measurement; `step_grey` is how far the frame is from the reference where they differ most, if that is no noise.
fn warnings(m: &ForceMeasurement, step_grey: Option<f64>) -> Vec<String> {
    let edge = m.contact.is_some_and(|contact| contact.touches_edge);
    let outside = m.reading.is_some_and(|reading| reading.out_of_range);
    let warnings = [
        (
            edge,
            "the contact reaches the edge of the frame: a part of it is not seen",
        ),
        (outside, "the force is outside the calibrated range"),
    ];
    let raised = warnings.into_iter().filter(|(raised, _)| *raised);
    let opposite = step_grey.filter(|_| m.contact.is_none()).map(|grey| {
        let error = PipelineError::OppositeSignal { frame: 0, grey };
        error.to_string().replacen("frame 1 shows ", "", 1)
    });
    let raised = raised.map(|(_, text)| text.to_owned());
    raised.chain(opposite).collect()
}

fn lines(m: &ForceMeasurement, warnings: &[String]) -> Vec<String> {
    let warnings = warnings.iter().map(|w| format!("  warning      {w}"));
    let estimate = |e: Estimate, scale| with_error(e.value, e.standard_error, scale);
    let Some([x, y]) = m.centroid_m else {
        return std::iter::once("  no contact".to_owned())
            .chain(warnings)
            .collect();
    };
    let mut lines = vec![format!("  force        {} N", estimate(m.force_n, 1.0))];
    if let Some(radius) = m.contact_radius_m {
        lines.push(format!("  radius       {} mm", estimate(radius, 1e3)));
    }
    lines.push(format!(
        "  centroid     ({}, {}) mm",
        estimate(x, 1e3),
        estimate(y, 1e3)
    ));
    if let (Some(mean), Some(peak)) = (m.mean_stress_pa, m.peak_stress_pa) {
        let (mean, peak) = (estimate(mean, 1e-3), estimate(peak, 1e-3));
        lines.push(format!("  stress       {mean} kPa mean, {peak} kPa peak"));
    }
    lines.extend(warnings);
    lines
}

fn value(m: &ForceMeasurement, warnings: &[String]) -> Value {
    let estimate = |e: Estimate| [e.value, e.standard_error];
    json!({
        "contact": m.contact.is_some(),
        "force_n": estimate(m.force_n),
        "contact_radius_m": m.contact_radius_m.map(estimate),
        "centroid_m": m.centroid_m.map(|c| c.map(estimate)),
        "mean_stress_pa": m.mean_stress_pa.map(estimate),
        "peak_stress_pa": m.peak_stress_pa.map(estimate),
        "warnings": warnings,
    })
}

const HEADER: [&str; 11] = [
    "frame",
    "force_N",
    "se_force_N",
    "radius_m",
    "se_radius_m",
    "x_m",
    "se_x_m",
    "y_m",
    "se_y_m",
    "mean_stress_Pa",
    "se_mean_stress_Pa",
];

/// A frame's row; NaN where there is no contact.
fn row(k: usize, m: &ForceMeasurement) -> Vec<f64> {
    let or_nan = |e: Option<Estimate>| e.map_or([f64::NAN; 2], |e| [e.value, e.standard_error]);
    let centroid = |i: usize| m.centroid_m.map(|c| c[i]);
    let numbers = [
        Some(m.force_n),
        m.contact_radius_m,
        centroid(0),
        centroid(1),
        m.mean_stress_pa,
    ];
    let mut row = vec![k as f64 + 1.0];
    row.extend(numbers.into_iter().flat_map(or_nan));
    row
}
