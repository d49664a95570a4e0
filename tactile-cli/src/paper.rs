//! `tactile paper`: the experiments of the paper's section 5 on the simulated sensor.
use crate::console::{Bar, Context, median_ms};
use crate::failure::{Exit, Failure};
use crate::plot::{Colour, Page, Panel};
use crate::text::{digits, in_unit};
use clap::Args;
use nalgebra::Point3;
use serde_json::{Map, Value, json};
use std::error::Error;
use std::time::Instant;
use tactile_imaging::Pipeline;
use tactile_imaging::force::{CalibrationPair, LinearCalibration};
use tactile_imaging::matching::labelling::Compatibility;
use tactile_imaging::matching::{AnnealedSoftassign, PointMatcher, RelaxationLabelling};
use tactile_imaging::optics::{SensorParameters, SensorSpecification, acceptance_angle, led_cone};
use tactile_imaging::pipeline::{EstimatorChoice, StagesConfig, interval_text};
use tactile_simulate::{
    CalibrationRun, ContactModel, ContactState, Elastic, ElasticSphere, PressLoad, PressOptions,
    PressScene, PressTruth, Trial,
};

/// Fraction of the radius of a punch from which its pressure is taken as constant: at the rim it is
/// infinite.
const LEVEL_FROM: f64 = 0.98;

/// Repeat the experiments of the paper's section 5 on the simulated sensor
///
/// Prints the values reported in the paper and those of the simulated sensor: the calibration with
/// a flat tip (Fig. 9), the line through the centroid of a contact (Fig. 8), the moduli of both
/// polymers by the printed method and by the default one (Figs 10 to 12), a match of 105 to 105
/// points, the specification of the sensor (Table 1), and the angles of total internal reflection
/// (§3.4). The truth of the balls is computed by finite elements. --out gets paper.svg.
#[derive(Args)]
#[command(after_help = "\
Example:
  tactile paper --out target/paper

Every part also has its own command:
  calibration with your own sensor   tactile calibrate examples/data/sensor/calibration.toml
  force and contact of a frame       tactile force --help
  modulus by the printed stages      tactile measure SCENE.toml   with `stages.as_printed = true`
  modulus by the default stages      tactile measure
  a match of 105 to 105 points       tactile match examples/data/cases.txt
  light and angles                   tactile light")]
pub(crate) struct PaperArguments {
    /// Also run the labelling over all candidates. Without it, only the 12 likeliest of each point
    /// are used.
    #[arg(long)]
    dense: bool,
    /// Seed of the camera noise.
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

/// One experiment: its rows of text, its panels, and its numbers.
struct Experiment {
    title: &'static str,
    key: &'static str,
    /// Name, value of the paper, and value here.
    rows: Vec<[String; 3]>,
    panels: Vec<Panel>,
    values: Map<String, Value>,
}

impl Experiment {
    fn new(title: &'static str, key: &'static str) -> Self {
        Self {
            title,
            key,
            rows: Vec::new(),
            panels: Vec::new(),
            values: Map::new(),
        }
    }

    fn row(&mut self, what: impl Into<String>, paper: &str, here: impl Into<String>) {
        self.rows.push([what.into(), paper.into(), here.into()]);
    }

    fn value(&mut self, key: &str, value: impl Into<Value>) {
        self.values.insert(key.to_owned(), value.into());
    }
}

type Found<T> = Result<T, Box<dyn Error>>;

pub(crate) fn run(arguments: &PaperArguments, context: &mut Context) -> Result<Exit, Failure> {
    context.outputs.plan(&["paper.svg"], &[""; 0])?;
    let mut bar = Bar::of(6, "repeating the paper's experiments");
    let polymers = [("CL2000X", Elastic::CL2000X), ("CL2003X", Elastic::CL2003X)];
    let mut trials = Vec::new();
    for (name, material) in polymers {
        let trial = trial(material, arguments.seed).map_err(Failure::no_answer)?;
        trials.push((name, trial));
    }
    let first = &trials[0].1;
    let parts: [&dyn Fn() -> Found<Experiment>; 6] = [
        &|| flat_tip(arguments.seed),
        &|| centroid_line(first),
        &|| moduli(&trials, arguments.dense),
        &|| labelling(first, arguments.dense),
        &|| specification(first),
        &light,
    ];
    let (mut values, mut panels) = (Map::new(), Vec::new());
    for (done, part) in parts.iter().enumerate() {
        let experiment = part().map_err(Failure::no_answer)?;
        bar.done(done + 1);
        context.line(format_args!("\n{}", experiment.title));
        context.line(format_args!("  {:54} {:>22}   {}", "", "paper", "here"));
        for [what, paper, here] in experiment.rows {
            context.line(format_args!("  {what:54} {paper:>22}   {here}"));
        }
        values.insert(experiment.key.to_owned(), experiment.values.into());
        panels.extend(experiment.panels);
    }
    context.value(&values);
    if context.outputs.draws() {
        let page = Page::new("The paper's experiments on the simulated sensor", 2, panels);
        context.outputs.page("paper.svg", || page)?;
    }
    Ok(Exit::Complete)
}

/// A ball of 3 mm at 0.7 N and 1.2 N (§5), its contacts by finite elements.
fn trial(material: Elastic, seed: u64) -> Found<Trial> {
    let object = ElasticSphere {
        radius_m: 3e-3,
        material,
    };
    let options = PressOptions {
        object,
        loads: [0.7, 1.2].map(PressLoad::normal).to_vec(),
        law: ContactModel::FiniteElements,
        seed,
        ..PressOptions::default()
    };
    Ok(Trial::new(options, &CalibrationRun::default())?)
}

/// §5.1 and Fig. 9: a flat tip of 2 mm radius from 0 to 2 N and back in steps of 0.1 N.
fn flat_tip(seed: u64) -> Found<Experiment> {
    let (radius_m, steps) = (2e-3, 20_u32);
    let forces: Vec<f64> = (1..=steps).map(|k| 0.1 * f64::from(k)).collect();
    let options = PressOptions {
        law: ContactModel::Tabulated(forces.iter().map(|&f| punch(f, radius_m)).collect()),
        loads: forces.iter().map(|&f| PressLoad::normal(f)).collect(),
        seed,
        ..PressOptions::default()
    };
    let scene = PressScene::new(options)?;
    let reference = scene.reference(0);
    let sum = |frame: ndarray::Array2<u8>| -> f64 {
        let pixels = frame.iter().zip(&reference);
        pixels.map(|(&f, &r)| f64::from(f) - f64::from(r)).sum()
    };
    // Every reading is a frame with different noise. The gauge is treated as exact.
    let up = (0..forces.len()).map(|k| CalibrationPair::loading(sum(scene.frame(k, 0)), forces[k]));
    let down = (0..forces.len())
        .rev()
        .map(|k| CalibrationPair::unloading(sum(scene.frame(k, 1)), forces[k]));
    let mut pairs = vec![CalibrationPair::loading(sum(scene.reference(1)), 0.0)];
    pairs.extend(up.chain(down));
    pairs.push(CalibrationPair::unloading(sum(scene.reference(2)), 0.0));
    let line = LinearCalibration::fit(&pairs)?;
    let report = line.report();
    let loop_percent = loop_percent(&line);
    let departure_percent = 100.0 * report.linearity_error;
    let mut found = Experiment::new(
        "Calibration with a flat tip of 2 mm radius (§5.1, Fig. 9)",
        "flat_tip",
    );
    found.row(
        "response",
        "nearly linear",
        format!("R² {:.6}", report.r_squared),
    );
    let departure = format!("{departure_percent:.2} % of 2 N");
    found.row("largest departure from the line", "not stated", departure);
    let here = format!("{loop_percent:.2} % of 2 N");
    found.row("loop between loading and unloading", "none seen", here);
    found.value("r_squared", report.r_squared);
    found.value("linearity_error_percent", departure_percent);
    found.value("hysteresis_percent", loop_percent);
    let place = |p: &CalibrationPair| [p.force_n, 1e-6 * p.integrated_pixel_value];
    let (loading, unloading) = pairs.split_at(pairs.len() / 2);
    let ends = [0.0, 2.0].map(|f| [f, 1e-6 * line.integrated_pixel_value(f).unwrap_or(f64::NAN)]);
    let panel = Panel::new(
        "Fig. 9: a flat tip of 2 mm radius, 0 to 2 N and back",
        "force (N)",
        "integrated pixel value (10⁶ grey levels)",
    )
    .line(ends, Colour::Grey, "line")
    .points(loading.iter().map(place), Colour::Blue, "loading")
    .rings(unloading.iter().map(place), Colour::Orange, "unloading");
    found.panels.push(panel);
    Ok(found)
}

/// The loop between loading and unloading in per cent of the full scale.
fn loop_percent(line: &LinearCalibration) -> f64 {
    let hysteresis = line.report().hysteresis.as_ref();
    100.0 * hysteresis.map_or(f64::NAN, |h| h.share_of_full_scale)
}

/// A rigid flat punch on an elastic half-space (Boussinesq): p = F/(2πa √(a² − r²)).
///
/// The pressure at the rim is infinite. Beyond s = 0.98 of the radius, where a fraction 1 − ½√(1 −
/// s²) of the force remains, it is constant and scaled to carry all of it.
fn punch(force_n: f64, radius_m: f64) -> ContactState {
    let radii: Vec<f64> = (0..=100).map(|k| 1e-2 * f64::from(k) * radius_m).collect();
    let rim = |share: f64| (1.0 - share * share).sqrt();
    let mean_pa = force_n / (std::f64::consts::PI * radius_m * radius_m);
    let scale_pa = 0.5 * mean_pa / (1.0 - 0.5 * rim(LEVEL_FROM));
    let pressure = |r: &f64| scale_pa / rim((r / radius_m).min(LEVEL_FROM));
    // The outermost layer of the guide, incompressible.
    let indentation_m = force_n * 0.75 / (2.0 * radius_m * 136e3);
    ContactState {
        force_n,
        contact_radius_m: radius_m,
        indentation_m,
        pressure_pa: radii.iter().map(pressure).collect(),
        height_m: vec![-indentation_m; radii.len()],
        radius_m: radii,
    }
}

/// Fig. 8: the grey levels along the row through the centroid, and three curves through them.
fn centroid_line(trial: &Trial) -> Found<Experiment> {
    let simulation = &trial.simulation;
    let pipeline = trial.pipeline()?;
    let press = trial.press(&pipeline)?;
    let contact = press.contact(0)?;
    let contact = contact.ok_or("the frame shows no contact")?;
    let [x, y] = contact.centroid_px.map(|c| c.value);
    let (row_px, pixel_mm) = (y.round() as usize, 1e3 * simulation.pixel_size_m[0]);
    let line: Vec<[f64; 2]> = simulation.frames[0]
        .row(row_px)
        .iter()
        .zip(simulation.reference.row(row_px))
        .enumerate()
        .map(|(k, (&f, &r))| [(k as f64 - x) * pixel_mm, f64::from(f) - f64::from(r)])
        .collect();
    let inside = |u: f64| (1.0 - u * u).max(0.0);
    let curves: [(&str, &str, Colour, Basis<'_>); 3] = [
        ("Gaussian", "gaussian", Colour::Orange, &|u| {
            vec![(-0.5 * u * u).exp()]
        }),
        ("Hertz, √(1 − r²/a²)", "hertz", Colour::Green, &|u| {
            vec![inside(u).sqrt()]
        }),
        (
            "bent, √(1 − r²/a²)(1 − c r²/a²)",
            "bent",
            Colour::Red,
            &|u| vec![inside(u).sqrt(), inside(u).sqrt() * u * u],
        ),
    ];
    let mut panel = Panel::new(
        "Fig. 8: the row through the centroid, 0.7 N",
        "distance from the centroid (mm)",
        "grey levels above the reference",
    )
    .points(
        line.iter().copied().step_by(8),
        Colour::Grey,
        "pixels, every eighth",
    );
    let title = "Fig. 8: residuals of the curves";
    let axes = (
        "distance from the centroid (mm)",
        "pixel − curve (grey levels)",
    );
    let mut residuals = Panel::new(title, axes.0, axes.1);
    let title = "The line through the centroid at 0.7 N (Fig. 8)";
    let mut found = Experiment::new(title, "centroid_line");
    for (name, key, colour, basis) in curves {
        let (scale_mm, fitted, rms) = fit_line(&line, basis);
        let paper = if key == "gaussian" { "drawn" } else { "" };
        let here = format!("{rms:.2} grey levels");
        found.row(format!("{name}: rms residual"), paper, here);
        found.value(key, json!({ "rms_grey": rms, "scale_mm": scale_mm }));
        let left = line.iter().zip(&fitted).map(|(p, f)| [p[0], p[1] - f[1]]);
        residuals = residuals.line(left, colour, name);
        panel = panel.line(fitted, colour, name);
    }
    found.panels = vec![panel, residuals];
    Ok(found)
}

/// The functions of r/s whose sum is a profile.
type Basis<'a> = &'a dyn Fn(f64) -> Vec<f64>;

/// Least squares of a profile Σ c_k b_k(x/s) with its scale s, over a centred line of pixels.
/// Returns the scale, the fitted line, and the root mean square of the residuals.
fn fit_line(line: &[[f64; 2]], basis: Basis<'_>) -> (f64, Vec<[f64; 2]>, f64) {
    let fit = |scale: f64| {
        let rows: Vec<Vec<f64>> = line.iter().map(|[x, _]| basis(x / scale)).collect();
        let columns = rows[0].len();
        let a = nalgebra::DMatrix::from_fn(line.len(), columns, |i, k| rows[i][k]);
        let b = nalgebra::DVector::from_iterator(line.len(), line.iter().map(|p| p[1]));
        // For a profile that covers no pixel, the whole line remains.
        let c = a.clone().svd(true, true).solve(&b, 1e-12);
        let fitted = c.map_or_else(|_| b.map(|_| 0.0), |c| a * c);
        let rms = ((&fitted - &b).norm_squared() / line.len() as f64).sqrt();
        (fitted, rms)
    };
    // The residual has one minimum in the scale: golden-section search between 0.5 and 8 mm.
    let golden = 0.5 * (5_f64.sqrt() - 1.0);
    let (mut low, mut high) = (0.5, 8.0);
    while high - low > 1e-3 {
        let step = golden * (high - low);
        if fit(high - step).1 < fit(low + step).1 {
            high = low + step;
        } else {
            low = high - step;
        }
    }
    let scale = 0.5 * (low + high);
    let (fitted, rms) = fit(scale);
    let places = line.iter().zip(&fitted).map(|(p, &f)| [p[0], f]);
    (scale, places.collect(), rms)
}

/// Figs 10 to 12: both polymers at 1392 × 1042 pixels with 200 control points, by the printed
/// stages and by the default ones.
fn moduli(trials: &[(&str, Trial)], dense: bool) -> Found<Experiment> {
    let mut found = Experiment::new(
        "Young's modulus of both polymers, 200 control points (Figs 10 to 12)",
        "moduli",
    );
    let kpa = |pa: f64| 1e-3 * pa;
    let title = "Figs 10 to 12: Young's modulus of both polymers";
    let mut panel = Panel::new(title, "true modulus (kPa)", "measured modulus (kPa)").dashed(
        [[50.0, 50.0], [115.0, 115.0]],
        Colour::Grey,
        "truth",
    );
    let (mut printed_places, mut ratio_places) = (Vec::new(), Vec::new());
    let (mut default_places, mut intervals) = (Vec::new(), Vec::new());
    for ((name, trial), paper) in trials.iter().zip(["4.23 % off", "5.38 % off"]) {
        let truth = trial.simulation.youngs_modulus_pa;
        let pipeline = trial.pipeline()?;
        let measured = trial.press(&pipeline).and_then(|press| press.modulus())?;
        let stated = printed(&pipeline, dense)?;
        let (printed, printed_strain) = stress_over_strain(trial, &stated)?;
        let ratio = StagesConfig {
            estimator: EstimatorChoice::PaperRatio,
            ..StagesConfig::default()
        };
        let pipeline = pipeline.with_stages(&ratio)?;
        let (ratio, strain) = stress_over_strain(trial, &pipeline)?;
        let percent = |e: f64| 100.0 * (e / truth - 1.0);
        let beside = |pa: f64, strain: f64| {
            format!(
                "{:.1} kPa ({:+.0} %), mean e_zz {strain:.3}",
                kpa(pa),
                percent(pa)
            )
        };
        let ball = format!("{name}, {:.0} kPa", kpa(truth));
        let here = beside(printed, printed_strain);
        found.row(format!("{ball}: printed stages, (31)"), paper, here);
        let what = format!("{name}: (31) on the default surface and match");
        found.row(what, "", beside(ratio, strain));
        let estimate = measured.youngs_modulus_pa;
        let interval = measured.interval_95;
        let ends = (interval.lower, interval.upper);
        let ends = interval_text(ends, measured.standard_error_pa, 1e-3);
        let here = format!(
            "{} kPa ({:+.2} %), 95 %: {ends}",
            digits(kpa(estimate), 4),
            percent(estimate),
        );
        found.row(format!("{ball}: default stages"), "", here);
        printed_places.push([kpa(truth), kpa(printed)]);
        ratio_places.push([kpa(truth), kpa(ratio)]);
        default_places.push([kpa(truth), kpa(estimate)]);
        let ends = [interval.lower, interval.upper.unwrap_or(interval.lower)];
        intervals.push(ends.map(|end| [kpa(truth), kpa(end)]));
        found.value(
            name,
            json!({
                "true_pa": truth,
                "printed_pa": printed, "printed_mean_strain_zz": printed_strain,
                "stress_over_strain_pa": ratio, "mean_strain_zz": strain,
                "default_pa": estimate, "default_interval_95_pa": interval,
            }),
        );
    }
    // Between two loads the apparent surface of any ball scales by (F₂/F₁)^⅓.
    found.row(
        "e_zz of Hertz's contact, ½((F₂/F₁)^⅔ − 1), for any ball",
        "",
        format!("{:.3}", 0.5 * ((1.2_f64 / 0.7).powf(2.0 / 3.0) - 1.0)),
    );
    panel = panel
        .segments(intervals, Colour::Blue, "")
        .points(default_places, Colour::Blue, "default stages, 95 %")
        .rings(ratio_places, Colour::Orange, "(31) on the default surface")
        .rings(printed_places, Colour::Red, "printed stages, (31)");
    found.panels.push(panel);
    Ok(found)
}

/// The modulus of (31) and the mean strain along z that it divides by.
fn stress_over_strain(trial: &Trial, pipeline: &Pipeline) -> Found<(f64, f64)> {
    let press = trial.press(pipeline)?;
    let modulus = press.modulus()?;
    let strain = press.strain(1)?;
    Ok((modulus.youngs_modulus_pa, strain.summary.mean[(2, 2)]))
}

/// The printed stages, with the labelling over few candidates unless `dense`.
fn printed(pipeline: &Pipeline, dense: bool) -> Found<Pipeline> {
    let pipeline = pipeline.clone().with_stages(&StagesConfig::as_printed())?;
    Ok(if dense {
        pipeline
    } else {
        pipeline.with_matcher(printed_labelling().with_candidates(12)?)
    })
}

fn printed_labelling() -> RelaxationLabelling {
    RelaxationLabelling::default().with_compatibility(Compatibility::Printed)
}

/// 105 control points at 0.7 N matched to their true positions at 1.2 N, in another order.
fn labelling(trial: &Trial, dense: bool) -> Found<Experiment> {
    let pipeline = trial.pipeline()?;
    let press = trial.press(&pipeline.with_control_points(105))?;
    let model = press.control_points(0)?;
    let [first, second]: &[PressTruth; 2] = trial.simulation.truth[..].try_into()?;
    let scaling = first.scaling_to(second);
    let moved: Vec<Point3<f64>> = model.iter().map(|p| scaling.apply(p)).collect();
    let target: Vec<Point3<f64>> = moved.iter().rev().copied().collect();
    let full = printed_labelling();
    let sparse = full.with_candidates(12)?;
    let default = AnnealedSoftassign::default();
    let mut matchers: Vec<(&str, &str, &dyn PointMatcher<3>)> = vec![
        (
            "printed labelling, all candidates",
            "dense_labelling",
            &full,
        ),
        (
            "printed labelling, 12 candidates",
            "sparse_labelling",
            &sparse,
        ),
        ("default matcher", "default", &default),
    ];
    if !dense {
        matchers.remove(0);
    }
    let title = "A match of 105 to 105 control points (§5)";
    let mut answer = Experiment::new(title, "match_105");
    for (name, key, matcher) in matchers {
        let start = Instant::now();
        let found = matcher.match_points(model, &target)?;
        let seconds = start.elapsed().as_secs_f64();
        let count = model.len();
        let right = (0..count).filter(|&i| found.assignment[i] == Some(count - 1 - i));
        let right = right.count();
        let errors = found.warped.iter().zip(&moved).map(|(w, m)| (w - m).norm());
        let error_um = 1e6 * errors.sum::<f64>() / count as f64;
        let here = format!(
            "{} s, {right} of {count} right, {error_um:.2} µm off",
            digits(seconds, 3)
        );
        answer.row(format!("{name}: time"), "1.69 s", here);
        let value = json!({
            "time_s": seconds, "right": right, "points": count, "mean_error_um": error_um,
        });
        answer.value(key, value);
    }
    Ok(answer)
}

/// Table 1, measured on the simulated sensor.
fn specification(trial: &Trial) -> Found<Experiment> {
    let simulation = &trial.simulation;
    let pipeline = trial.pipeline()?;
    let line = LinearCalibration::fit(&trial.pairs)?;
    let second = trial.scene.reference(1);
    let squares = second.iter().zip(&simulation.reference).map(|(&a, &b)| {
        let difference = f64::from(a) - f64::from(b);
        difference * difference
    });
    let noise_grey = (0.5 * squares.sum::<f64>() / second.len() as f64).sqrt();
    let press = trial.press(&pipeline)?;
    let (mut times, mut contact) = (Vec::new(), None);
    for _ in 0..20 {
        let again = press.renewed();
        let start = Instant::now();
        contact = again.contact(0)?.copied();
        times.push(start.elapsed());
    }
    let contact = contact.ok_or("the frame shows no contact")?;
    let area_m2 = std::f64::consts::PI * contact.contact_radius_m.value.powi(2);
    let specification = SensorSpecification::new(
        &SensorParameters {
            side_m: 30e-3,
            pixel_m: simulation.pixel_size_m[0],
            frame_rate_hz: 1e3 / median_ms(times),
            largest_force_n: 2.0,
            newton_per_grey: line.report().parameters[1].value,
            pixel_noise_grey: noise_grey,
            summed_pixels: area_m2 / simulation.pixel_size_m.iter().product::<f64>(),
        },
        3.0,
    )?;
    let rate_hz = 1.0 / specification.temporal_resolution_s;
    let (loop_percent, pixel_m) = (loop_percent(&line), simulation.pixel_size_m[0]);
    let force_n = specification.force_resolution_n;
    let mut found = Experiment::new("Specification of the sensor (Table 1)", "specification");
    let smallest = format!("{} mN", digits(1e3 * force_n, 2));
    found.row(
        "smallest force, three standard deviations",
        "2.5 mN",
        smallest,
    );
    found.row("hysteresis", "none", format!("{loop_percent:.2} % of 2 N"));
    let rate = digits(rate_hz, 3);
    found.row(
        "frames per second (forces of whole frames here)",
        "80",
        rate,
    );
    let pixel = format!("{:.2} µm", 1e6 * pixel_m);
    found.row(
        "pixel on the sensing surface",
        "4.65 µm (on the chip)",
        pixel,
    );
    let radius = format!("{} mm", in_unit(contact.contact_radius_m.total(), 1e3));
    found.row("contact radius at 0.7 N", "", radius);
    found.value("force_resolution_n", force_n);
    found.value("hysteresis_percent", loop_percent);
    found.value("forces_per_second", rate_hz);
    found.value("pixel_m", pixel_m);
    Ok(found)
}

/// (1) to (4): the angle within which each layer traps light, and whether the cone of the LED fits.
fn light() -> Found<Experiment> {
    let indices = [1.38, 1.39, 1.40, 1.41];
    let printed = ["71.98°", "74.89°", "78.46°", "83.73°"];
    let mut found = Experiment::new(
        "Total internal reflection in the guide (§3.4, (1) to (4))",
        "light",
    );
    let mut angles = Vec::new();
    for (index, paper) in indices.iter().zip(printed) {
        let degrees = acceptance_angle(*index, 1.0)?.radians.to_degrees();
        let what = format!("acceptance angle of a layer of index {index:.2}");
        found.row(what, paper, format!("{degrees:.2}°"));
        angles.push(degrees);
    }
    let trapped = led_cone(&indices, 1.0, 140_f64.to_radians())?.trapped;
    found.row(
        "an LED cone of 140° is trapped by every layer",
        "yes, below 143.96°",
        if trapped { "yes" } else { "no" },
    );
    found.value("acceptance_degrees", angles);
    found.value("cone_of_140_degrees_is_trapped", trapped);
    Ok(found)
}
