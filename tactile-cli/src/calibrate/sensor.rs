//! A sensor calibrated from frames of presses.
use super::sensor_report::{layer_words, page};
use crate::console::Console;
use crate::context::Context;
use crate::failure::{Exit, Failure};
use crate::numbers::{digits, four_digits};
use crate::outputs::Outputs;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use tactile_imaging::force::{Branch, Estimate, LocalCalibration};
use tactile_imaging::pipeline::with_error;
use tactile_imaging::sensor::{
    CalibratedSensor, Indenter, LayerFinding, PressFinding, SensorCalibration, SensorError,
};

pub fn run(path: &Path, out: Option<&Path>, context: &mut Context) -> Result<Exit, Failure> {
    let target = out.map(Target::new).transpose()?;
    let names = target.iter().flat_map(Target::names).collect::<Vec<_>>();
    let folder = target.as_ref().map(|t| t.folder.as_path());
    let mut outputs = Outputs::plan(folder, &names, &[path])?;
    let failed = |error: SensorError| match error {
        // Says the file itself.
        SensorError::File(error) => Failure::input(error),
        error => Failure::input(format!("{}: {error}", path.display())),
    };
    let calibration = SensorCalibration::read(path).map_err(failed)?;
    let found = calibration.run().map_err(failed)?;
    if let Some(target) = &target {
        let text = toml::to_string(&found.sensor).map_err(Failure::output)?;
        let svg = page(&found).to_svg().map_err(Failure::output)?;
        outputs.write(&target.file, text.as_bytes())?;
        outputs.write(&target.report, svg.as_bytes())?;
    }
    print(&found, &mut context.console);
    context.console.value(&value(&found)?);
    if let Some(summary) = outputs.summary() {
        context.console.line(summary);
    }
    Ok(Exit::Complete)
}

/// Where the sensor and its report go.
struct Target {
    folder: PathBuf,
    file: PathBuf,
    report: PathBuf,
}

impl Target {
    fn new(out: &Path) -> Result<Self, Failure> {
        let toml = out.extension().is_some_and(|e| e == "toml");
        let (Some(file), true) = (out.file_name(), toml && !out.is_dir()) else {
            return Err(Failure::input(format!(
                "--out {} is not the name of a sensor file: it ends with .toml",
                out.display()
            )));
        };
        let folder = out.parent().filter(|f| !f.as_os_str().is_empty());
        Ok(Self {
            folder: folder.unwrap_or(Path::new(".")).into(),
            report: Path::new(file).with_extension("svg"),
            file: file.into(),
        })
    }

    fn names(&self) -> [&Path; 2] {
        [&self.file, &self.report]
    }
}

fn print(found: &CalibratedSensor, console: &mut Console) {
    let sensor = &found.sensor;
    let presses = found.presses.len();
    let empty = found.presses.iter().filter(|p| p.read_force_n.is_none());
    let left_out = match empty.count() {
        0 => String::new(),
        empty => format!(", {empty} of them without a visible contact and left out"),
    };
    console.line(format!(
        "sensor of {}, from {presses} presses{left_out}:",
        sensor.date
    ));
    let [width, height] = sensor.geometry.frame_px;
    let [x, y] = sensor.geometry.lens.pixel_size_m();
    console.line(format!(
        "  pixels       {width} × {height} of {} × {} µm, known to {} %",
        four_digits(1e6 * x),
        four_digits(1e6 * y),
        digits(100.0 * sensor.geometry.length_scale_error(), 2)
    ));
    console.line(match found.lens {
        Some(lens) => {
            let [k1, k2] = lens
                .distortion
                .map(|k| with_error(k.value, k.standard_error, 1.0));
            format!("  distortion   k1 {k1}, k2 {k2}")
        }
        None => "  distortion   not identified: there is no target".into(),
    });
    let report = &sensor.curve.report;
    let [low, high] = report.identified_grey;
    let largest = sensor.curve.pressure_pa(high);
    console.line(format!(
        "  light        identified from {low:.0} to {high:.0} grey levels, {} kPa there",
        with_error(largest.value, largest.standard_error, 1e-3)
    ));
    console.line(format!(
        "  residuals    {} times what the gauge explains, {} effective parameters",
        digits(report.residual_sd, 2),
        digits(report.effective_parameters, 2)
    ));
    console.line(match report.hysteresis {
        Some(h) => {
            let difference = with_error(h.relative.value, h.relative.standard_error, 100.0);
            format!("  hysteresis   {difference} % between loading and unloading")
        }
        None => "  hysteresis   not identified: a branch has fewer than three presses".into(),
    });
    for finding in &found.layers {
        let [name, says] = layer_words(finding);
        console.line(format!("  {name:<24} {says}"));
    }
}

fn value(found: &CalibratedSensor) -> Result<Value, Failure> {
    let pair = |e: Estimate| [e.value, e.standard_error];
    let press = |p: &PressFinding| {
        let (shape, radius_m) = match p.indenter {
            Indenter::Ball { radius_m, .. } => ("ball", radius_m),
            Indenter::Punch { radius_m } => ("punch", radius_m),
        };
        let branch = match p.branch {
            Branch::Loading => "loading",
            Branch::Unloading => "unloading",
        };
        json!({
            "indenter": shape, "radius_m": radius_m, "branch": branch, "force_n": p.force_n,
            "read_force_n": p.read_force_n, "contact_radius_m": p.contact_radius_m.map(pair),
            "layers_force_n": p.layers_force_n,
        })
    };
    let layer = |l: &LayerFinding| {
        json!({
            "layer": l.layer + 1, "parameter": l.parameter, "stated": pair(l.stated),
            "fitted": pair(l.fitted), "identified": l.identified,
        })
    };
    let sensor = serde_json::to_value(&found.sensor).map_err(Failure::output)?;
    Ok(json!({
        "sensor": sensor,
        "lens": found.lens,
        "identified_grey": found.sensor.curve.report.identified_grey,
        "presses": found.presses.iter().map(press).collect::<Vec<_>>(),
        "layers": found.layers.iter().map(layer).collect::<Vec<_>>(),
    }))
}
