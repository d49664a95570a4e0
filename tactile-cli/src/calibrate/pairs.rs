//! The line from integrated pixel value to force, and how good it is.
use crate::console::Console;
use crate::context::Context;
use crate::failure::{Exit, Failure};
use crate::numbers::{digits, four_digits};
use crate::outputs::Outputs;
use crate::plot::{Colour, Legend, Page, Panel};
use serde_json::{Value, json};
use std::path::Path;
use tactile_imaging::force::{
    Branch, CalibrationOptions, CalibrationPair, CalibrationReport, LinearCalibration,
    StressCalibration,
};
use tactile_imaging::io::read_columns;
use tactile_imaging::pipeline::with_error;

pub const FILE: &str = "calibration.svg";

pub fn run(
    path: &Path,
    there_and_back: bool,
    out: Option<&Path>,
    context: &mut Context,
) -> Result<Exit, Failure> {
    let mut outputs = Outputs::plan(out, &[FILE], &[path])?;
    let pairs = read_pairs(path, there_and_back)?;
    let line = fit(path, &pairs)?;
    outputs.page(FILE, || page(&pairs, &line))?;
    print(&line, &mut context.console);
    context.console.value(&value(&line));
    if let Some(summary) = outputs.summary() {
        context.console.line(summary);
    }
    Ok(Exit::Complete)
}

pub fn read_pairs(path: &Path, there_and_back: bool) -> Result<Vec<CalibrationPair>, Failure> {
    let value = (
        &["integrated_pixel_value", "pixel_value"][..],
        "grey_levels",
    );
    let force = (&["force", "load"][..], "N");
    let [values, forces] = read_columns(path, [value, force])?;
    let largest = (0..forces.len()).max_by(|&a, &b| forces[a].total_cmp(&forces[b]));
    let branch = |k: usize| {
        if there_and_back && largest.is_some_and(|largest| k > largest) {
            Branch::Unloading
        } else {
            Branch::Loading
        }
    };
    let pair = |(k, (value, force)): (usize, (&f64, &f64))| CalibrationPair {
        integrated_pixel_value: *value,
        force_n: *force,
        branch: branch(k),
    };
    Ok(values.iter().zip(&forces).enumerate().map(pair).collect())
}

pub fn fit(path: &Path, pairs: &[CalibrationPair]) -> Result<LinearCalibration, Failure> {
    LinearCalibration::fit(pairs, &CalibrationOptions::default())
        .map_err(|error| Failure::input(format!("{}: {error}", path.display())))
}

pub fn print(line: &LinearCalibration, console: &mut Console) {
    let report: &CalibrationReport = line.report();
    console.line(format!("calibration, {} pairs:", report.pairs));
    for (name, unit, estimate) in [
        ("offset", "N", report.parameters.first()),
        (
            "slope",
            "N per million grey levels",
            report.parameters.get(1),
        ),
    ] {
        let scale = if name == "slope" { 1e6 } else { 1.0 };
        if let Some(e) = estimate {
            let value = with_error(e.value, e.standard_error, scale);
            console.line(format!("  {name:<12} {value} {unit}"));
        }
    }
    console.line(format!("  R²           {:.6}", report.r_squared));
    console.line(format!(
        "  residual     {} mN (standard deviation)",
        digits(1e3 * report.residual_sd_n, 3)
    ));
    console.line(format!(
        "  linearity    {} % of full scale at most from the line",
        digits(100.0 * report.linearity_error, 3)
    ));
    console.line(format!(
        "  resolution   {} mN, the smallest force that differs from none",
        digits(1e3 * report.smallest_force_n, 3)
    ));
    if let Some(h) = report.hysteresis {
        console.line(format!(
            "  hysteresis   {} mN on average, {} % of full scale at most",
            with_error(h.mean_n.value, h.mean_n.standard_error, 1e3),
            digits(100.0 * h.share_of_full_scale, 3)
        ));
    }
    let [low, high] = line.range();
    console.line(format!(
        "  range        {} to {} million grey levels, up to {} N",
        four_digits(1e-6 * low),
        four_digits(1e-6 * high),
        four_digits(report.full_scale_n)
    ));
}

pub fn value(line: &LinearCalibration) -> Value {
    let report = line.report();
    let parameters: Vec<[f64; 2]> = (report.parameters.iter())
        .map(|e| [e.value, e.standard_error])
        .collect();
    let intervals: Vec<_> = (report.parameters.iter())
        .map(|e| e.interval_95())
        .map(|interval| json!([interval.lower, interval.upper]))
        .collect();
    json!({
        "pairs": report.pairs, "parameters": parameters, "intervals_95": intervals,
        "r_squared": report.r_squared, "residual_sd_n": report.residual_sd_n,
        "linearity_error": report.linearity_error, "sensitivity_n_per_grey_level": report.sensitivity_n,
        "smallest_force_n": report.smallest_force_n, "full_scale_n": report.full_scale_n,
        "range_grey_levels": line.range(), "residuals_n": report.residuals_n,
        "hysteresis": report.hysteresis.map(|h| json!({
            "mean_n": [h.mean_n.value, h.mean_n.standard_error], "greatest_n": h.greatest_n,
            "share_of_full_scale": h.share_of_full_scale,
        })),
    })
}

/// Pairs and line above, residuals below.
pub fn page(pairs: &[CalibrationPair], line: &LinearCalibration) -> Page {
    let residuals = &line.report().residuals_n;
    let [low, high] = line.range();
    let x = "integrated pixel value (million grey levels)";
    let mut top = Panel::new("Calibration")
        .legend(Legend::UpperLeft)
        .x_label(x)
        .y_label("force (N)")
        .line(
            [low, high].map(|v| [1e-6 * v, line.force_n(v)]),
            Colour::BLACK,
            "fitted line",
        );
    let mut bottom = Panel::new("Residuals")
        .x_label(x)
        .y_label("measured − fitted (mN)")
        .line([low, high].map(|v| [1e-6 * v, 0.0]), Colour::BLACK, "");
    for (branch, colour, name) in [
        (Branch::Loading, Colour::BLUE, "loading"),
        (Branch::Unloading, Colour::ORANGE, "unloading"),
    ] {
        let chosen = || {
            let numbered = pairs.iter().zip(residuals);
            numbered.filter(|(pair, _)| pair.branch == branch)
        };
        if chosen().next().is_some() {
            let forces = chosen().map(|(p, _)| [1e-6 * p.integrated_pixel_value, p.force_n]);
            top = top.points(forces, colour, name);
            let rest = chosen().map(|(p, r)| [1e-6 * p.integrated_pixel_value, 1e3 * r]);
            bottom = bottom.points(rest, colour, "");
        }
    }
    Page::new("Force calibration")
        .columns(1)
        .panel(top)
        .panel(bottom)
}
