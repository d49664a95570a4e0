//! The report of a calibrated sensor: curve, residuals, contact radii, and what was identified.
use crate::plot::{Colour, Legend, Page, Panel};
use tactile_imaging::force::{Branch, Estimate, LocalCalibration};
use tactile_imaging::pipeline::with_error;
use tactile_imaging::sensor::{CalibratedSensor, LayerFinding, PressFinding};

pub fn page(found: &CalibratedSensor) -> Page {
    let page = Page::new(format!("Sensor calibration of {}", found.sensor.date))
        .columns(2)
        .panel(curve(found))
        .panel(residuals(found))
        .panel(radii(found));
    if found.layers.is_empty() {
        return page;
    }
    page.panel(layers(found))
}

/// Pressure over grey level with its 95 % band.
fn curve(found: &CalibratedSensor) -> Panel {
    let [low, high] = &found.sensor.curve.report.identified_grey;
    let greys: Vec<f64> = (0..=128).map(|k| high * f64::from(k) / 128.0).collect();
    let line = |sds: f64| {
        let point = |grey: &f64| {
            let pressure = found.sensor.curve.pressure_pa(*grey);
            [
                *grey,
                1e-3 * (pressure.value + sds * pressure.standard_error),
            ]
        };
        greys.iter().map(point).collect::<Vec<_>>()
    };
    Panel::new(format!(
        "Light to pressure, known to 5 % from {low:.0} to {high:.0} grey levels"
    ))
    .legend(Legend::UpperLeft)
    .x_label("grey level above the reference")
    .y_label("pressure (kPa)")
    .line(line(0.0), Colour::BLACK, "fitted curve")
    .dashed(line(1.96), Colour::BLUE, "95 % interval")
    .dashed(line(-1.96), Colour::BLUE, "")
}

const BRANCHES: [(Branch, Colour, &str); 2] = [
    (Branch::Loading, Colour::BLUE, "loading"),
    (Branch::Unloading, Colour::ORANGE, "unloading"),
];

/// Adds a point a press to a panel, in its branch's colour.
fn with_presses(
    mut panel: Panel,
    found: &CalibratedSensor,
    point: impl Fn(&PressFinding) -> Option<[f64; 2]>,
) -> Panel {
    for (branch, colour, name) in BRANCHES {
        let of_branch = found.presses.iter().filter(|p| p.branch == branch);
        let points: Vec<_> = of_branch.filter_map(&point).collect();
        if !points.is_empty() {
            panel = panel.points(points, colour, name);
        }
    }
    panel
}

/// Force read with the curve against the gauge's.
fn residuals(found: &CalibratedSensor) -> Panel {
    let error = |press: &PressFinding| {
        let read = press.read_force_n.filter(|_| press.force_n > 0.0)?;
        Some([press.force_n, 100.0 * (read / press.force_n - 1.0)])
    };
    let largest = found.presses.iter().map(|p| p.force_n).fold(0.0, f64::max);
    let panel = Panel::new("Force by the curve against the gauge")
        .legend(Legend::UpperRight)
        .x_label("gauge (N)")
        .y_label("by the curve − gauge (%)")
        .line([[0.0, 0.0], [largest, 0.0]], Colour::BLACK, "");
    with_presses(panel, found, error)
}

/// Contact radius over the gauge's force, and the force that the fitted layers have at that radius.
fn radii(found: &CalibratedSensor) -> Panel {
    let radius = |press: &PressFinding| Some([press.force_n, 1e3 * press.contact_radius_m?.value]);
    let mut law: Vec<[f64; 2]> = found
        .presses
        .iter()
        .filter_map(|p| Some([p.layers_force_n?, 1e3 * p.contact_radius_m?.value]))
        .collect();
    law.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let mut panel = Panel::new("Contact radii")
        .legend(Legend::UpperLeft)
        .x_label("force (N)")
        .y_label("contact radius (mm)");
    panel = with_presses(panel, found, radius);
    if law.is_empty() {
        return panel;
    }
    panel.points(law, Colour::BLACK, "fitted layers")
}

/// What was learned of every layer, in words.
fn layers(found: &CalibratedSensor) -> Panel {
    let line = |finding| layer_words(finding).join("\t");
    Panel::new("Layers").text(found.layers.iter().map(line))
}

/// A layer's parameter, and what was learned of it.
pub fn layer_words(finding: &LayerFinding) -> [String; 2] {
    let (name, scale, unit) = match finding.parameter {
        "youngs_modulus_pa" => ("Young's modulus", 1e-3, " kPa"),
        "thickness_m" => ("thickness", 1e3, " mm"),
        _ => ("Poisson's ratio", 1.0, ""),
    };
    let text = |e: Estimate| with_error(e.value, e.standard_error, scale);
    let (stated, fitted) = (text(finding.stated), text(finding.fitted));
    let says = if finding.identified {
        format!("{fitted}{unit} (stated {stated})")
    } else if finding.stated.standard_error > 0.0 {
        format!("not identified, stays as stated: {fitted}{unit}")
    } else {
        format!("stated as exact: {stated}{unit}")
    };
    [format!("layer {} {name}", finding.layer + 1), says]
}
