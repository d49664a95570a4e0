//! `tactile calibrate`: a sensor from presses under known forces, or the line from integrated pixel
//! value to force.
use crate::arguments::TableArguments;
use crate::console::Context;
use crate::failure::{Exit, Failure};
use crate::gel;
use crate::plot::{Colour, Page, Panel};
use crate::text::{digits, four_digits, in_unit};
use clap::Args;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use tactile_files::scene::doubt_of_pairs;
use tactile_files::sensor::{
    CalibratedSensor, GelPresses, Indenter, LayerFinding, PressFinding, SensorCalibration,
    SensorError,
};
use tactile_imaging::core::Source;
use tactile_imaging::force::{
    Branch, CalibrationPair, LinearCalibration, LocalCalibration, StressCalibration,
};
use tactile_imaging::pipeline::{Assumptions, Flag};

/// Calibrate a sensor from frames of presses, or fit the line from pixel value to force
///
/// CALIBRATION.toml lists frames of rigid balls or flat punches of known radius under forces
/// measured by a gauge. It also names a frame without contact, the stated layers of the guide and,
/// optionally, a frame of a dot target. The local light-to-pressure curve, the lens and the layers
/// are determined with their errors. --out sensor.toml writes the sensor file for scenes, and next
/// to it sensor.svg, a report of which properties the presses determine and which they do not. If
/// the frames cannot be used, no file is written.
///
/// With kind = "photometric" the file lists presses of a ball on a gel lit in colours, with kind =
/// "darkening" on a gel that darkens where it is pressed. It has a frame without contact, the pixel
/// size, and for every press the radius of the ball and optionally its drawn contact circle. Wrong
/// circles are reported. A gel that darkens may have a table of darkness and depth instead of
/// presses. --out sensor.toml writes the sensor file for `tactile depth --sensor`, and the frame
/// without contact next to it.
///
/// PAIRS.csv has the columns integrated_pixel_value (grey levels above the reference, summed over
/// the contact) and force (N, mN, … according to its heading), in at least three rows. --out is a
/// folder for calibration.svg.
#[derive(Args)]
#[command(after_help = "\
Examples:
  tactile calibrate examples/data/sensor/calibration.toml
  tactile calibrate examples/data/sensor/calibration.toml --out target/sensor/sensor.toml
  tactile calibrate examples/data/colour/calibration.toml --out target/colour/sensor.toml
  tactile calibrate examples/data/press/calibration.csv
  tactile calibrate examples/data/press/calibration.csv --there-and-back --out target/calibrate")]
pub(crate) struct CalibrateArguments {
    /// Calibration file of a sensor (.toml), or table of integrated pixel values and forces.
    #[arg(value_name = "CALIBRATION.toml | PAIRS.csv")]
    input: PathBuf,
    /// For a table: the rows after the largest force were taken during unloading. The hysteresis is
    /// reported.
    #[arg(long)]
    there_and_back: bool,
    #[command(flatten)]
    reading: TableArguments,
}

pub(crate) fn run(arguments: &CalibrateArguments, context: &mut Context) -> Result<Exit, Failure> {
    let input = arguments.input.as_path();
    let extension = input.extension();
    if extension.is_some_and(|e| e.eq_ignore_ascii_case("toml")) {
        if arguments.there_and_back {
            return Err(Failure::input(
                "--there-and-back is for tables of pairs: a calibration file names the branch of \
                 each press",
            ));
        }
        return calibrate_sensor(input, context);
    }
    context.outputs.plan(&[PairLine::PAGE], &[input])?;
    let line = PairLine::read(input, arguments.there_and_back, &arguments.reading, context)?;
    line.print(context);
    line.warn(context);
    context.value(&line.value());
    context.outputs.page(PairLine::PAGE, || line.page())?;
    Ok(Exit::Complete)
}

const BRANCHES: [(Branch, Colour, &str); 2] = [
    (Branch::Loading, Colour::Blue, "loading"),
    (Branch::Unloading, Colour::Orange, "unloading"),
];

/// Pairs of integrated pixel value and force, and the line through them.
pub(crate) struct PairLine {
    pub pairs: Vec<CalibrationPair>,
    pub line: LinearCalibration,
}

impl PairLine {
    /// File name of its page.
    pub(crate) const PAGE: &str = "calibration.svg";

    pub(crate) fn read(
        path: &Path,
        there_and_back: bool,
        reading: &TableArguments,
        context: &mut Context,
    ) -> Result<Self, Failure> {
        let value = (
            &["integrated_pixel_value", "pixel_value"][..],
            "grey_levels",
        );
        let columns = [value, (&["force", "load"][..], "N")];
        let [values, forces] = reading.columns(path, columns, context)?;
        let largest = (0..forces.len()).max_by(|&a, &b| forces[a].total_cmp(&forces[b]));
        let pair = |(k, (value, force)): (usize, (&f64, &f64))| CalibrationPair {
            integrated_pixel_value: *value,
            force_n: *force,
            // Forces increase up to the largest and decrease after it.
            branch: if there_and_back && largest.is_some_and(|largest| k > largest) {
                Branch::Unloading
            } else {
                Branch::Loading
            },
        };
        let pairs: Vec<_> = values.iter().zip(&forces).enumerate().map(pair).collect();
        if let Some(reason) = doubt_of_pairs(&pairs) {
            return Err(Failure::in_file(path, reason));
        }
        let line = LinearCalibration::fit(&pairs).map_err(|error| Failure::in_file(path, error))?;
        Ok(Self { pairs, line })
    }

    /// The doubts about the pairs, in the words of the frames that are measured by them.
    pub(crate) fn warn(&self, context: &mut Context) {
        let doubts = self.line.report().doubts.iter();
        let flags: Vec<Flag> = doubts.filter_map(Flag::of_pairs).collect();
        context.warn_of_frame(&flags);
    }

    pub(crate) fn print(&self, context: &mut Context) {
        let report = self.line.report();
        context.line(format_args!("calibration, {} pairs:", report.pairs));
        let parameters = report.parameters.iter();
        let named = [
            ("offset", 1.0, "N"),
            ("slope", 1e6, "N per million grey levels"),
        ];
        for (estimate, (name, scale, unit)) in parameters.zip(named) {
            context.row(name, format_args!("{} {unit}", in_unit(*estimate, scale)));
        }
        context.row("R²", format_args!("{:.6}", report.r_squared));
        let residual = digits(1e3 * report.residual_sd_n, 3);
        context.row("residual", residual + " mN (standard deviation)");
        let linearity = digits(100.0 * report.linearity_error, 3);
        context.row(
            "linearity",
            linearity + " % of full scale at most from the line",
        );
        let resolution = digits(1e3 * report.smallest_force_n, 3);
        context.row(
            "resolution",
            resolution + " mN, the smallest force that differs from none",
        );
        if let Some(h) = report.hysteresis {
            let share = digits(100.0 * h.share_of_full_scale, 3);
            let mean = in_unit(h.mean_n, 1e3);
            let text = format!("{mean} mN on average, {share} % of full scale at most");
            context.row("hysteresis", text);
        }
        // Outside this range the line is an extrapolation.
        let [low, high] = self.line.range().map(|grey| four_digits(1e-6 * grey));
        let full = four_digits(report.full_scale_n);
        let range = format!("{low} to {high} million grey levels, up to {full} N");
        context.answer("range", range);
    }

    pub(crate) fn value(&self) -> Value {
        let report = self.line.report();
        let [offset, slope] = [0, 1].map(|k| report.parameters.get(k));
        json!({
            "pairs": report.pairs, "offset_n": offset, "slope_n_per_grey_level": slope,
            "r_squared": report.r_squared, "residual_sd_n": report.residual_sd_n,
            "linearity_error": report.linearity_error,
            "sensitivity_n_per_grey_level": report.sensitivity_n,
            "smallest_force_n": report.smallest_force_n, "full_scale_n": report.full_scale_n,
            "range_grey_levels": self.line.range(), "residuals_n": report.residuals_n,
            "hysteresis": report.hysteresis.map(|h| json!({
                "mean_n": h.mean_n, "greatest_n": h.greatest_n,
                "share_of_full_scale": h.share_of_full_scale,
            })),
        })
    }

    /// Pairs and line above, residuals below.
    pub(crate) fn page(&self) -> Page {
        let residuals = &self.line.report().residuals_n;
        let x = "integrated pixel value (million grey levels)";
        let ends = self.line.range();
        let line = ends.map(|v| [1e-6 * v, self.line.force_n(v)]);
        let zero = ends.map(|v| [1e-6 * v, 0.0]);
        let mut top =
            Panel::new("Calibration", x, "force (N)").line(line, Colour::Black, "fitted line");
        let mut bottom =
            Panel::new("Residuals", x, "measured − fitted (mN)").line(zero, Colour::Black, "");
        for (branch, colour, name) in BRANCHES {
            let all = self.pairs.iter().zip(residuals);
            let chosen = all.filter(|(pair, _)| pair.branch == branch);
            let at = |p: &CalibrationPair, y| [1e-6 * p.integrated_pixel_value, y];
            let (forces, rest): (Vec<_>, Vec<_>) = chosen
                .map(|(p, r)| (at(p, p.force_n), at(p, 1e3 * r)))
                .unzip();
            if !forces.is_empty() {
                top = top.points(forces, colour, name);
                bottom = bottom.points(rest, colour, "");
            }
        }
        Page::new("Force calibration", 1, vec![top, bottom])
    }
}

fn calibrate_sensor(path: &Path, context: &mut Context) -> Result<Exit, Failure> {
    let mut file = PathBuf::new();
    if let Some(out) = context.outputs.folder().map(Path::to_path_buf) {
        let toml = out.extension().is_some_and(|e| e == "toml") && !out.is_dir();
        let Some(name) = out.file_name().filter(|_| toml) else {
            return Err(Failure::input(format!(
                "--out {} is not the name of a sensor file: it ends with .toml",
                out.display()
            )));
        };
        file = name.into();
        let folder = out.parent().filter(|f| !f.as_os_str().is_empty());
        let names = [file.clone(), file.with_extension("svg")];
        let folder = folder.unwrap_or(Path::new("."));
        context.outputs.plan_in(folder, &names, &[path])?;
    } else {
        context.outputs.plan(&[""; 0], &[path])?;
    }
    if GelPresses::names_kind(path) {
        return gel::calibrate(path, &file, context);
    }
    let failed = |error: SensorError| match error {
        // The error itself names its file.
        SensorError::File(error) => Failure::input(error),
        error => Failure::in_file(path, error),
    };
    let calibration = SensorCalibration::read(path)?;
    let found = calibration.run().map_err(failed)?;
    print_sensor(&found, context);
    context.value(&sensor_value(&found)?);
    let text = toml::to_string(&found.sensor).map_err(Failure::output)?;
    context.outputs.add(&file, text.into_bytes());
    context
        .outputs
        .page(file.with_extension("svg"), || sensor_page(&found))?;
    Ok(Exit::Complete)
}

fn print_sensor(found: &CalibratedSensor, context: &mut Context) {
    let sensor = &found.sensor;
    let presses = found.presses.len();
    let empty = found.presses.iter().filter(|p| p.read_force_n.is_none());
    let left_out = match empty.count() {
        0 => String::new(),
        empty => format!(", {empty} of them without a visible contact and left out"),
    };
    let date = &sensor.date;
    context.line(format_args!(
        "sensor of {date}, from {presses} presses{left_out}:"
    ));
    let [width, height] = sensor.geometry.frame_px;
    let [x, y] = sensor
        .geometry
        .lens
        .pixel_size_m()
        .map(|m| four_digits(1e6 * m));
    let error = digits(100.0 * sensor.geometry.length_scale_error(), 2);
    let pixels = format!("{width} × {height} of {x} × {y} µm, known to {error} %");
    context.row("pixels", pixels);
    let distortion = found.lens.map(|lens| {
        let [k1, k2] = lens.distortion.map(|k| in_unit(k, 1.0));
        format!("k1 {k1}, k2 {k2}")
    });
    let no_target = "not identified: there is no target".into();
    context.row("distortion", distortion.unwrap_or(no_target));
    let report = &sensor.curve.report;
    let [low, high] = report.identified_grey;
    let largest = in_unit(sensor.curve.pressure_pa(high), 1e-3);
    let light = format!("identified from {low:.0} to {high:.0} grey levels, {largest} kPa there");
    context.answer("light", light);
    let [residual, parameters] =
        [report.residual_sd, report.effective_parameters].map(|v| digits(v, 2));
    let text = format!("{residual} times the gauge's error, {parameters} effective parameters");
    context.row("residuals", text);
    let hysteresis = report.hysteresis.map(|h| {
        let difference = in_unit(h.relative, 100.0);
        format!("{difference} % between loading and unloading")
    });
    let too_few = "not identified: a branch has fewer than three presses".into();
    context.row("hysteresis", hysteresis.unwrap_or(too_few));
    for finding in &found.layers {
        let [name, says] = layer_words(finding);
        context.line(format_args!("{name:<24} {says}"));
    }
    let accuracy = Accuracy::of(found);
    let [bare, force, soft, modulus] = [
        accuracy.force(accuracy.coupling),
        accuracy.force(0.0),
        accuracy.modulus(accuracy.coupling),
        accuracy.modulus(0.0),
    ]
    .map(|share| digits(100.0 * share, 2));
    context.line("standard errors with this calibration:");
    context.row(
        "under a skin",
        format_args!("force {force} %, modulus of a ball as stiff as the guide {modulus} %"),
    );
    context.row(
        "bare guide",
        format_args!("force {bare} %, modulus {soft} %; a [[check]] press replaces the coupling"),
    );
    context.line("presses, with the sum of grey levels above the reference:");
    for (k, press) in found.presses.iter().enumerate() {
        let (Some(value), Some(read)) = (press.integrated_pixel_value, press.read_force_n) else {
            continue;
        };
        let [value, gauge] = [value, press.force_n].map(four_digits);
        let off = digits(100.0 * (read.value / press.force_n - 1.0), 2);
        let text = format!("{gauge} N, {value} grey levels, {off} % by the curve");
        context.row(&format!("press {}", k + 1), text);
    }
}

/// Relative standard errors of later measurements.
struct Accuracy {
    /// Of the curve under the largest press, and of the gauge.
    curve: f64,
    /// Of lengths.
    length: f64,
    /// Of the layers' moduli.
    guide: f64,
    /// Of the light that another object couples on a bare guide.
    coupling: f64,
}

impl Accuracy {
    fn of(found: &CalibratedSensor) -> Self {
        let sensor = &found.sensor;
        let read = found.presses.iter().filter_map(|p| p.read_force_n);
        let largest = read.max_by(|a, b| a.value.total_cmp(&b.value));
        let of_layers = sensor.layer_covariance.iter().enumerate();
        let of_layers = of_layers.take(sensor.layers.len()).map(|(k, row)| row[k]);
        let assumptions = Assumptions::default();
        Self {
            curve: largest
                .map_or(0.0, |force| force.relative_error())
                .hypot(sensor.gauge_error),
            length: sensor.geometry.length_scale_error(),
            guide: of_layers.fold(0.0, f64::max).sqrt(),
            coupling: (sensor.coupling_error)
                .unwrap_or_else(|| assumptions.error(Source::Coupling)),
        }
    }

    fn force(&self, coupling: f64) -> f64 {
        self.curve.hypot(coupling)
    }

    /// For a ball as stiff as the guide, E* = F R / (4/3 a³) contains its compliance and that of the
    /// guide in equal parts, so that the error of E* counts twice and that of the guide once.
    fn modulus(&self, coupling: f64) -> f64 {
        let of_both = self.force(coupling).hypot(3.0 * self.length);
        (2.0 * of_both).hypot(self.guide)
    }
}

fn sensor_value(found: &CalibratedSensor) -> Result<Value, Failure> {
    let press = |p: &PressFinding| {
        let (shape, radius_m) = match p.indenter {
            Indenter::Ball { radius_m, .. } => ("ball", Some(radius_m)),
            Indenter::Punch { radius_m } => ("punch", Some(radius_m)),
            Indenter::Body => ("body", None),
        };
        let branch = BRANCHES.iter().find(|b| b.0 == p.branch).map(|b| b.2);
        json!({
            "indenter": shape, "radius_m": radius_m, "branch": branch, "force_n": p.force_n,
            "integrated_pixel_value": p.integrated_pixel_value,
            "read_force_n": p.read_force_n.map(|read| read.value),
            "contact_radius_m": p.contact_radius_m,
            "layers_force_n": p.layers_force_n,
        })
    };
    let layer = |l: &LayerFinding| {
        json!({
            "layer": l.layer + 1, "parameter": l.parameter, "stated": l.stated,
            "fitted": l.fitted, "identified": l.identified,
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

/// Curve, residuals, contact radii, and the results for every layer.
fn sensor_page(found: &CalibratedSensor) -> Page {
    let mut panels = vec![
        curve_panel(found),
        residual_panel(found),
        radius_panel(found),
    ];
    if !found.layers.is_empty() {
        let lines = found.layers.iter().map(|f| layer_words(f).join("\t"));
        panels.push(Panel::of_text("Layers", lines));
    }
    let title = format!("Sensor calibration of {}", found.sensor.date);
    Page::new(title, 2, panels)
}

/// Pressure over grey level with its 95 % band.
fn curve_panel(found: &CalibratedSensor) -> Panel {
    let [low, high] = &found.sensor.curve.report.identified_grey;
    let line = |sds: f64| {
        (0..=128).map(move |k| {
            let grey = high * f64::from(k) / 128.0;
            let pressure = found.sensor.curve.pressure_pa(grey);
            [
                grey,
                1e-3 * (pressure.value + sds * pressure.standard_error),
            ]
        })
    };
    let title = format!("Light to pressure, known to 5 % from {low:.0} to {high:.0} grey levels");
    Panel::new(title, "grey level above the reference", "pressure (kPa)")
        .line(line(0.0), Colour::Black, "fitted curve")
        .dashed(line(1.96), Colour::Blue, "95 % interval")
        .dashed(line(-1.96), Colour::Blue, "")
}

/// Adds one point per press to a panel, in the colour of its branch.
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

/// Force from the curve compared with the gauge.
fn residual_panel(found: &CalibratedSensor) -> Panel {
    let error = |press: &PressFinding| {
        let read = press.read_force_n.filter(|_| press.force_n > 0.0)?;
        Some([press.force_n, 100.0 * (read.value / press.force_n - 1.0)])
    };
    let largest = found.presses.iter().map(|p| p.force_n).fold(0.0, f64::max);
    let title = "Force by the curve against the gauge";
    let panel = Panel::new(title, "gauge (N)", "by the curve − gauge (%)");
    let panel = panel.line([[0.0, 0.0], [largest, 0.0]], Colour::Black, "");
    with_presses(panel, found, error)
}

/// Contact radius over the force of the gauge, and the force of the fitted layers at that radius.
fn radius_panel(found: &CalibratedSensor) -> Panel {
    let radius = |press: &PressFinding| Some([press.force_n, 1e3 * press.contact_radius_m?.value]);
    let law = |p: &PressFinding| Some([p.layers_force_n?, 1e3 * p.contact_radius_m?.value]);
    let law: Vec<_> = found.presses.iter().filter_map(law).collect();
    let panel = Panel::new("Contact radii", "force (N)", "contact radius (mm)");
    let panel = with_presses(panel, found, radius);
    if law.is_empty() {
        return panel;
    }
    panel.rings(law, Colour::Black, "fitted layers")
}

/// A parameter of a layer, and its result.
fn layer_words(finding: &LayerFinding) -> [String; 2] {
    let (name, scale, unit) = match finding.parameter {
        "youngs_modulus_pa" => ("Young's modulus", 1e-3, " kPa"),
        "thickness_m" => ("thickness", 1e3, " mm"),
        _ => ("Poisson's ratio", 1.0, ""),
    };
    let [stated, fitted] = [finding.stated, finding.fitted].map(|e| in_unit(e, scale));
    let says = if finding.identified {
        format!("{fitted}{unit} (stated {stated})")
    } else if finding.stated.standard_error > 0.0 {
        format!("not identified, stays as stated: {fitted}{unit}")
    } else {
        format!("stated as exact: {stated}{unit}")
    };
    [format!("layer {} {name}", finding.layer + 1), says]
}
