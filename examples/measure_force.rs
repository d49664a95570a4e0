//! Normal force, contact radius, centroid and stress from frames, after fitting the calibration that they are read with.
//!
//!     cargo run --release --example measure_force --features simulate,scene,plot -- --help
//!
//! With images: a reference frame, pressed frames and a CSV of calibration pairs (integrated pixel value, force in newtons; the second half
//! of a there-and-back run may follow the first). Without: a simulated sensor that is calibrated and pressed twice.
//! The calibration and its residuals are drawn as an SVG.
#![allow(clippy::print_stdout, clippy::print_stderr)]

use std::error::Error;
use std::path::PathBuf;

use clap::Parser;
use ndarray::Array2;
use tactile_imaging::force::{
    Branch, CalibrationOptions, CalibrationPair, CalibrationReport, ForceMeasurement, ForceMeter,
    ForceOptions, ForceWorkspace, LinearCalibration, ReferenceFrame, StressCalibration,
};
use tactile_imaging::plot::{Colour, Legend, Page, Panel};
use tactile_imaging::simulate::{self, Load, PressOptions, PressScene};

/// Measure force, contact radius and centroid from frames of an optical tactile sensor.
#[derive(Parser)]
struct Arguments {
    /// Frame of the unpressed sensor (PNG, PGM or JPEG). Without it a sensor is simulated.
    #[arg(long, requires = "frame", requires = "pairs")]
    reference: Option<PathBuf>,
    /// A pressed frame; repeat for more.
    #[arg(long)]
    frame: Vec<PathBuf>,
    /// Calibration pairs: CSV with two columns, integrated pixel value and force in newtons.
    #[arg(long)]
    pairs: Option<PathBuf>,
    /// Size of a pixel on the sensor's surface in micrometres.
    #[arg(long, default_value_t = 21.55)]
    pixel_um: f64,
    /// Print one JSON object per frame instead of text.
    #[arg(long)]
    json: bool,
    /// Where to write the calibration plot.
    #[arg(long, default_value = "force_calibration.svg")]
    plot: PathBuf,
}

/// What is measured: reference, frames with their names, pairs, size of a pixel in metres.
struct Input {
    reference: Array2<u8>,
    frames: Vec<(String, Array2<u8>)>,
    pairs: Vec<CalibrationPair<f64>>,
    pixel_m: f64,
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments = Arguments::parse();
    let input = match &arguments.reference {
        Some(reference) => from_files(&arguments, reference)?,
        None => simulated()?,
    };
    let calibration = LinearCalibration::fit(&input.pairs, &CalibrationOptions::default())?;
    if !arguments.json {
        describe_calibration(calibration.report());
    }
    let reference = ReferenceFrame::new(input.reference.view())?;
    let meter = ForceMeter::new([input.pixel_m; 2], &ForceOptions::default())?;
    let mut workspace = ForceWorkspace::default();
    for (name, frame) in &input.frames {
        let m = meter.measure_with(&mut workspace, frame.view(), &reference, &calibration)?;
        if arguments.json {
            println!("{}", json(name, &m))
        } else {
            describe(name, &m)
        }
    }
    plot(&input.pairs, &calibration)?.save(&arguments.plot)?;
    eprintln!("calibration plot: {}", arguments.plot.display());
    Ok(())
}

fn from_files(arguments: &Arguments, reference: &PathBuf) -> Result<Input, Box<dyn Error>> {
    let load = |path: &PathBuf| tactile_imaging::io::read_grey_image(path);
    let named =
        |path: &PathBuf| Ok::<_, Box<dyn Error>>((path.display().to_string(), load(path)?.to_u8()));
    let path = arguments
        .pairs
        .as_ref()
        .ok_or("calibration pairs are needed")?;
    let points = tactile_imaging::io::read_points::<2>(path)?;
    let pairs = points
        .iter()
        .map(|p| CalibrationPair::loading(p[0], p[1]))
        .collect();
    Ok(Input {
        reference: load(reference)?.to_u8(),
        frames: arguments
            .frame
            .iter()
            .map(named)
            .collect::<Result<_, _>>()?,
        pairs,
        pixel_m: 1e-6 * arguments.pixel_um,
    })
}

/// The paper's sensor: calibrated to two newtons and back, then pressed with 0.7 and 1.2 N.
fn simulated() -> Result<Input, Box<dyn Error>> {
    eprintln!("no --reference: simulating a calibration run and two presses (0.7 N and 1.2 N)");
    let scene = PressScene::new(PressOptions {
        loads: vec![Load::normal(0.7), Load::normal(1.2)],
        ..Default::default()
    })?;
    let series = scene.calibrate(&simulate::CalibrationOptions {
        steps: 10,
        ..Default::default()
    })?;
    let pair = |p: &simulate::CalibrationPoint| CalibrationPair {
        integrated_pixel_value: p.integrated_pixel_value,
        force_n: p.force_n,
        branch: if p.branch == simulate::Branch::Loading {
            Branch::Loading
        } else {
            Branch::Unloading
        },
    };
    let made = scene.simulate();
    let names = made
        .truth
        .iter()
        .map(|t| format!("simulated press of {} N", t.contact.force_n));
    Ok(Input {
        frames: names.zip(made.frames).collect(),
        reference: made.reference,
        pairs: series.points.iter().map(pair).collect(),
        pixel_m: made.pixel_size_m[0],
    })
}

fn describe_calibration(report: &CalibrationReport<f64>) {
    println!("calibration, {} pairs:", report.pairs);
    println!(
        "  R2 {:.6}, residual {:.2} mN, linearity error {:.2} % of full scale",
        report.r_squared,
        1e3 * report.residual_sd_n,
        100.0 * report.linearity_error
    );
    println!(
        "  sensitivity {:.3e} N per grey level, smallest force resolved {:.1} mN",
        report.sensitivity_n,
        1e3 * report.smallest_force_n
    );
    if let Some(h) = report.hysteresis {
        println!(
            "  hysteresis {:.2} mN on average (± {:.2}), {:.2} % at most",
            1e3 * h.mean_n.value,
            1e3 * h.mean_n.standard_error,
            100.0 * h.share_of_full_scale
        );
    }
}

fn describe(name: &str, m: &ForceMeasurement<f64>) {
    println!("{name}:");
    let (Some(contact), Some(centroid)) = (m.contact, m.centroid_m) else {
        println!("  no contact");
        return;
    };
    println!(
        "  force        {:.4} ± {:.4} N",
        m.force_n.value, m.force_n.standard_error
    );
    if let Some(r) = m.contact_radius_m {
        println!(
            "  radius       {:.4} mm (± {:.2} um)",
            1e3 * r.value,
            1e6 * r.standard_error
        );
    }
    println!(
        "  centroid     {:.4} mm, {:.4} mm (± {:.2} um)",
        1e3 * centroid[0].value,
        1e3 * centroid[1].value,
        1e6 * centroid[0].standard_error
    );
    if let (Some(mean), Some(peak)) = (m.mean_stress_pa, m.peak_stress_pa) {
        println!(
            "  stress       {:.2} kPa mean, {:.2} kPa peak",
            1e-3 * mean.value,
            1e-3 * peak.value
        );
    }
    if contact.touches_edge {
        println!("  warning: the contact reaches the edge of the frame");
    }
    if m.reading.is_some_and(|r| r.out_of_range) {
        println!("  warning: outside the calibrated range");
    }
}

fn json(name: &str, m: &ForceMeasurement<f64>) -> serde_json::Value {
    let estimate =
        |e: tactile_imaging::force::Estimate<f64>| serde_json::json!([e.value, e.standard_error]);
    serde_json::json!({
        "frame": name,
        "contact": m.contact.is_some(),
        "force_n": estimate(m.force_n),
        "contact_radius_m": m.contact_radius_m.map(estimate),
        "centroid_m": m.centroid_m.map(|c| c.map(estimate)),
        "mean_stress_pa": m.mean_stress_pa.map(estimate),
        "peak_stress_pa": m.peak_stress_pa.map(estimate),
        "out_of_range": m.reading.map(|r| r.out_of_range),
    })
}

/// Pairs and line above, residuals below.
fn plot(
    pairs: &[CalibrationPair<f64>],
    line: &LinearCalibration<f64>,
) -> Result<Page, Box<dyn Error>> {
    let of = |branch: Branch| -> Vec<usize> {
        (0..pairs.len())
            .filter(|k| pairs[*k].branch == branch)
            .collect()
    };
    let residuals = &line.report().residuals_n;
    let [low, high] = line.range();
    let mut top = Panel::new("Calibration")
        .legend(Legend::UpperLeft)
        .x_label("integrated pixel value (million grey levels)")
        .y_label("force (N)");
    top = top.line(
        [
            [1e-6 * low, line.force_n(low)],
            [1e-6 * high, line.force_n(high)],
        ],
        Colour::BLACK,
        "fitted line",
    );
    let mut bottom = Panel::new("Residuals")
        .x_label("integrated pixel value (million grey levels)")
        .y_label("measured − fitted (mN)");
    bottom = bottom.line([[1e-6 * low, 0.0], [1e-6 * high, 0.0]], Colour::BLACK, "");
    for (branch, colour, name) in [
        (Branch::Loading, Colour::BLUE, "loading"),
        (Branch::Unloading, Colour::ORANGE, "unloading"),
    ] {
        let x = |k: usize| 1e-6 * pairs[k].integrated_pixel_value;
        let found = of(branch);
        if !found.is_empty() {
            top = top.points(
                found.iter().map(|k| [x(*k), pairs[*k].force_n]),
                colour,
                name,
            );
            bottom = bottom.points(
                found.iter().map(|k| [x(*k), 1e3 * residuals[*k]]),
                colour,
                "",
            );
        }
    }
    Ok(Page::new("Force calibration")
        .columns(1)
        .panel(top)
        .panel(bottom))
}
