//! `tactile force`: normal force, contact and stress from frames.
use crate::arguments::SensorFrames;
use crate::calibrate::PairLine;
use crate::console::{Bar, Context, Exit, Failure, in_unit, pair};
use crate::outputs::Csv;
use clap::Args;
use serde_json::{Value, json};
use std::path::PathBuf;
use tactile_imaging::force::{
    ForceMeasurement, ForceMeter, ForceOptions, ForceWorkspace, ReferenceFrame, background_shift,
};
use tactile_imaging::io::Grey;
use tactile_imaging::pipeline::PipelineError;

/// Measure force, contact radius, centroid and stress in frames of a sensor that grows brighter
/// where it is pressed
///
/// Fits the calibration to the pairs first and reports it, see `tactile calibrate`. --out gets
/// force.csv (a row a frame) and calibration.svg.
#[derive(Args)]
#[command(after_help = "\
Examples:
  tactile force --reference examples/data/press/reference.png --pairs examples/data/press/calibration.csv --pixel-um 40 examples/data/press/frame_1.png examples/data/press/frame_2.png
  tactile force --reference examples/data/press/reference.png --pairs examples/data/press/calibration.csv --pixel-um 40 examples/data/press/frame_1.png --out target/force")]
pub struct ForceArguments {
    #[command(flatten)]
    frames: SensorFrames,
    /// Calibration pairs: CSV with the columns integrated_pixel_value and force.
    #[arg(long, value_name = "PAIRS.csv")]
    pairs: PathBuf,
}

pub fn run(arguments: &ForceArguments, context: &mut Context) -> Result<Exit, Failure> {
    let ForceArguments { frames, pairs } = arguments;
    let table = "force.csv";
    context
        .outputs
        .plan(&[table, PairLine::PAGE], &frames.files(pairs))?;
    let line = PairLine::read(pairs, false)?;
    let image = frames.read_reference(Grey::default())?;
    let reference = ReferenceFrame::new(image.view())
        .map_err(|error| Failure::in_file(&frames.reference, error))?;
    let options = ForceOptions::default();
    let meter = ForceMeter::new(frames.pixel_m(), &options).map_err(Failure::input)?;
    // One frame is held at a time, but a file that cannot be read is found before the first is
    // measured.
    for path in &frames.frames {
        frames.read(path, Grey::default(), &image)?;
    }
    line.print(context);
    let mut exit = Exit::Complete;
    let mut workspace = ForceWorkspace::default();
    let mut values = Vec::new();
    let mut csv = Csv::new(&[
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
    ]);
    let mut bar = Bar::of(frames.frames.len(), "measuring");
    context.interrupt.polled(true);
    for (k, path) in frames.frames.iter().enumerate() {
        if context.interrupt.requested() {
            break;
        }
        let frame = frames.read(path, Grey::default(), &image)?;
        let name = path.display().to_string();
        let found = meter.measure_with(&mut workspace, frame.view(), &reference, &line.line);
        bar.done(k + 1);
        context.line(format_args!("{name}:"));
        match found {
            Ok(measurement) => {
                let step = background_shift(frame.view(), image.view());
                let warnings = warnings(&measurement, step);
                print(&measurement, &warnings, context);
                values.push(json!({ "frame": name, "value": value(&measurement, &warnings) }));
                csv.row(row(k, &measurement));
            }
            Err(error) => {
                exit = Exit::Partial;
                context.line(format_args!("no answer: {error}"));
                values.push(json!({ "frame": name, "error": error.to_string() }));
            }
        }
    }
    drop(bar);
    context.value(&json!({ "calibration": { "value": line.value() }, "frames": values }));
    context.outputs.add(table, csv.into_bytes());
    context.outputs.page(PairLine::PAGE, || line.page())?;
    Ok(exit)
}

/// The doubts about a measurement. `step_grey` is the largest difference from the reference, if
/// that is no noise.
fn warnings(m: &ForceMeasurement, step_grey: Option<f64>) -> Vec<String> {
    let mut warnings = Vec::new();
    if m.contact.is_some_and(|contact| contact.touches_edge) {
        warnings.push("the contact reaches the edge of the frame: a part of it is not seen".into());
    }
    if m.reading.is_some_and(|reading| reading.out_of_range) {
        warnings.push("the force is outside the calibrated range".into());
    }
    if let Some(grey) = step_grey.filter(|_| m.contact.is_none()) {
        let error = PipelineError::OppositeSignal { frame: 0, grey };
        warnings.push(error.to_string().replacen("frame 1 shows ", "", 1));
    }
    warnings
}

fn print(m: &ForceMeasurement, warnings: &[String], context: &mut Context) {
    if let Some([x, y]) = m.centroid_m.map(|c| c.map(|e| in_unit(e, 1e3))) {
        context.row("force", in_unit(m.force_n, 1.0) + " N");
        if let Some(radius) = m.contact_radius_m {
            context.row("radius", in_unit(radius, 1e3) + " mm");
        }
        context.row("centroid", format_args!("({x}, {y}) mm"));
        if let (Some(mean), Some(peak)) = (m.mean_stress_pa, m.peak_stress_pa) {
            let [mean, peak] = [mean, peak].map(|e| in_unit(e, 1e-3));
            context.row("stress", format_args!("{mean} kPa mean, {peak} kPa peak"));
        }
    } else {
        context.line("no contact");
    }
    for warning in warnings {
        context.row("warning", warning);
    }
}

fn value(m: &ForceMeasurement, warnings: &[String]) -> Value {
    json!({
        "contact": m.contact.is_some(),
        "force_n": pair(m.force_n),
        "contact_radius_m": m.contact_radius_m.map(pair),
        "centroid_m": m.centroid_m.map(|c| c.map(pair)),
        "mean_stress_pa": m.mean_stress_pa.map(pair),
        "peak_stress_pa": m.peak_stress_pa.map(pair),
        "warnings": warnings,
    })
}

/// A frame's row, with NaN where there is no contact.
fn row(k: usize, m: &ForceMeasurement) -> Vec<f64> {
    let [x, y] = m.centroid_m.map_or([None; 2], |c| c.map(Some));
    let estimates = [Some(m.force_n), m.contact_radius_m, x, y, m.mean_stress_pa];
    let cells = estimates.map(|e| e.map_or([f64::NAN; 2], pair)).concat();
    std::iter::once(k as f64 + 1.0).chain(cells).collect()
}
