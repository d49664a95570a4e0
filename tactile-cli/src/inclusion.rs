//! `tactile inclusion`: size, depth and stiffness of a lump under the surface of a block.
use crate::arguments::{contrast, lump_mm, modulus_kpa};
use crate::console::{Bar, Context};
use crate::failure::{Exit, Failure};
use crate::hidden::Hidden;
use crate::outputs::Csv;
use crate::plot::{Colour, Page, Panel, circle};
use clap::Args;
use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};
use rand_distr::StandardNormal;
use serde_json::json;
use std::path::{Path, PathBuf};
use tactile_files::scene::{InclusionScene, LoadedInclusion};
use tactile_imaging::elasticity::ElasticityError;
use tactile_imaging::fem::{
    AppliedLoad, Block, FemScene, Guide, GuideLayer, Interface, Lump, Material,
};
use tactile_imaging::inclusion::{
    AssumedInclusion, Estimated, Identifiable, Inclusion, InclusionEstimate, InclusionSearch,
    PressureProfile, SearchVerdict, TissueBlock, asymmetry_warnings,
};
use tactile_imaging::pipeline::{interval_text, with_error};

/// Find a lump under the surface of a block: its size, depth and stiffness
///
/// SCENE.toml describes frames of the guide pressed onto a flat block at known approaches, the size
/// of the block and the layers of the guide (for an example see
/// examples/data/inclusion/scene.toml). Without it a block with a lump is simulated. The pressure
/// as a function of the radius is compared with finite elements at finite strain. If it is not
/// symmetric, the whole face is compared, and the lump may lie off the axis. Several presses at
/// stated positions are evaluated together, and the lump may lie under any of them. It may be
/// flatter or taller than a ball; its diameter is that of the ball of equal volume. The result is
/// whether there is a lump, and its position, diameter, depth, modulus and height over width with
/// 95 % intervals. Parameters that the frames do not determine are named. --out gets profiles.csv
/// and inclusion.svg. A search takes several seconds.
#[derive(Args)]
#[command(after_help = "\
Examples:
  tactile inclusion --design examples/data/inclusion/scene.toml
  tactile inclusion examples/data/inclusion/scan.toml --out target/lump
The scene file:
  reference = \"reference.png\"
  pixel_size_m = [3.44e-4, 3.44e-4]
  frames = [{ image = \"frame_1.png\", approach_m = 1e-3, force_N = 0.35 }]     increasing \
                        approaches, at best three
  For a scan, [[presses]] replaces frames: position_m = [x, y] and frames for each press, all with \
                        the same approaches, and position_error_m (2e-4 if absent)
  [calibration]
  pairs = \"calibration.csv\"; without it the force_N of every frame, spread over its light, gives \
                        the pressure
  [object]
  shape = \"block\"; height_m, radius_m; interface = \"bonded\" or \"frictionless\" (both are \
  tried if it is absent);
  height_error_m (2 % if absent), poisson_ratio and poisson_ratio_error (0.495, 0.005), \
                        approach_error_m (2e-5, of their zero), \
                        each_approach_error_m (0),
  youngs_modulus_pa and youngs_modulus_error_pa if the tissue's modulus is known
  [waveguide]
  radius_m; layers = [{ thickness_m, youngs_modulus_pa, poisson_ratio }], from the block's side to \
                        the glass")]
pub(crate) struct InclusionArguments {
    /// Scene file.
    #[arg(value_name = "SCENE.toml")]
    scene: Option<PathBuf>,
    /// Instead of searching, compare how well scans with different approaches would determine a
    /// lump in this block.
    #[arg(long)]
    design: bool,
    /// Design: diameter of the lump, in millimetres.
    #[arg(long, value_name = "MM", default_value = "10", value_parser = lump_mm,
          requires = "design")]
    diameter_mm: f64,
    /// Design: depth of the top of the lump, in millimetres.
    #[arg(long, value_name = "MM", default_value = "4", value_parser = lump_mm,
          requires = "design")]
    depth_mm: f64,
    /// Design: modulus of the lump, in kPa.
    #[arg(long, value_name = "KPA", default_value = "40", value_parser = modulus_kpa,
          requires = "design")]
    lump_kpa: f64,
    /// Design: modulus of the tissue, in kPa.
    #[arg(long, value_name = "KPA", default_value = "5", value_parser = modulus_kpa,
          requires = "design")]
    tissue_kpa: f64,
    /// Simulation: seed of the camera noise.
    #[arg(
        long,
        default_value_t = 1,
        allow_negative_numbers = true,
        conflicts_with = "scene"
    )]
    seed: u64,
    /// Also compute how large a ball could be at each position without being found. RATIO is its
    /// modulus divided by that of the tissue.
    #[arg(long, value_name = "RATIO", requires = "scene", conflicts_with = "design",
          value_parser = contrast, allow_negative_numbers = true)]
    hidden: Option<f64>,
}

/// The input of a search, and the truth if it is known.
struct Scan {
    search: InclusionSearch,
    radii_m: Vec<f64>,
    profiles: Vec<PressureProfile>,
    /// First harmonic of the pressure around the axis relative to its mean, and the higher ones.
    asymmetry: f64,
    harmonics: f64,
    /// Diameter, depth and modulus.
    truth: Option<[f64; 3]>,
    /// The input from a scene.
    loaded: Option<LoadedInclusion>,
}

impl Scan {
    fn of_scene(scene: &InclusionScene) -> Result<Self, Failure> {
        let loaded = scene.load().map_err(Failure::input)?;
        let (asymmetry, harmonics) = (loaded.asymmetry(), loaded.harmonics());
        Ok(Self {
            search: loaded.search.clone(),
            radii_m: loaded.rings[0].radii_m.clone(),
            asymmetry,
            harmonics,
            profiles: if loaded.is_axial() {
                loaded.profiles.clone()
            } else {
                side_by_side(&loaded.scan)
            },
            truth: None,
            loaded: Some(loaded),
        })
    }

    /// Positions of the axis of the guide in the presses.
    fn axes_mm(&self) -> Vec<[f64; 2]> {
        let loaded = self.loaded.as_ref();
        let axes = loaded.map(|loaded| loaded.scan.presses.iter().map(|press| press.axis_m));
        let axes_mm = axes.map(|axes| axes.map(|axis| axis.map(|x| 1e3 * x)).collect());
        axes_mm.unwrap_or_else(|| vec![[0.0; 2]])
    }

    /// Simulated frames of a block with a lump, with white noise of the camera.
    fn simulated(seed: u64) -> Result<Self, ElasticityError> {
        let (specimen, guide) = simulated_block()?;
        // A hard lump of clinical size, shallow enough to be found.
        let truth = [12e-3, 4e-3, 40e3];
        let tissue = |modulus| Material::new(modulus, 0.495);
        let block = Block {
            height_m: specimen.height_m(),
            radius_m: specimen.radius_m(),
            material: tissue(5e3)?,
            lump: Some(Lump {
                diameter_m: truth[0],
                height_m: truth[0],
                depth_m: truth[1],
                material: tissue(truth[2])?,
            }),
        };
        let approaches = [1e-3, 2e-3, 3e-3];
        let scene = FemScene::block_under_guide(&block, &guide, Interface::Bonded)?;
        let solution = scene.solve(&approaches.map(AppliedLoad::Approach));
        let (radii_m, width) = rings(guide.radius_m());
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let profiles = solution
            .states
            .iter()
            .zip(approaches)
            .map(|(state, approach_m)| {
                let clean: Vec<f64> = radii_m.iter().map(|r| state.pressure_at(*r)).collect();
                let largest = clean.iter().copied().fold(0.0, f64::max);
                // 0.75 % of the largest pressure per pixel of 86 µm, many of which form a ring.
                let error = |radius: &f64| {
                    let pixels = std::f64::consts::TAU * radius * width / 86e-6f64.powi(2);
                    7.5e-3 * largest / pixels.sqrt()
                };
                let errors: Vec<f64> = radii_m.iter().map(error).collect();
                let noisy = clean.iter().zip(&errors);
                let noisy = noisy.map(|(p, e)| p + e * rng.sample::<f64, _>(StandardNormal));
                PressureProfile {
                    approach_m,
                    force_n: Some(state.force_n()),
                    pressure_pa: noisy.collect(),
                    standard_error_pa: errors,
                }
            });
        let profiles = profiles.collect();
        Ok(Self {
            search: InclusionSearch::new(specimen, guide)?,
            radii_m,
            profiles,
            asymmetry: 0.0,
            harmonics: 0.0,
            truth: Some(truth),
            loaded: None,
        })
    }
}

/// The frames of all presses, with their cells one press after the other.
fn side_by_side(scan: &tactile_imaging::inclusion::Scan) -> Vec<PressureProfile> {
    let frames = scan.presses.iter().map(|press| press.frames.clone());
    let joined = frames.reduce(|mut joined, frames| {
        for (all, frame) in joined.iter_mut().zip(frames) {
            all.pressure_pa.extend(frame.pressure_pa);
            all.standard_error_pa.extend(frame.standard_error_pa);
        }
        joined
    });
    joined.unwrap_or_default()
}

/// A block of tissue as high as two faces, and a guide of three layers with the stiffest towards
/// the tissue.
fn simulated_block() -> Result<(TissueBlock, Guide), ElasticityError> {
    let layer = |(thickness_m, modulus)| {
        Ok(GuideLayer {
            thickness_m,
            material: Material::new(modulus, 0.495)?,
        })
    };
    let layers = [(2e-3, 136e3), (3e-3, 80e3), (5e-3, 34e3)].map(layer);
    let layers: Result<Vec<GuideLayer>, ElasticityError> = layers.into_iter().collect();
    let specimen = TissueBlock::new(30e-3, 40e-3)?.with_interface(Interface::Bonded);
    Ok((specimen, Guide::new(layers?, 16e-3)?))
}

pub(crate) fn run(arguments: &InclusionArguments, context: &mut Context) -> Result<Exit, Failure> {
    if arguments.design && context.outputs.folder().is_some() {
        return Err(Failure::input(
            "--out has no use with --design, which writes no files",
        ));
    }
    let file = arguments.scene.as_deref();
    let names = ["profiles.csv", "inclusion.svg"];
    context.outputs.plan(&names, arguments.scene.as_slice())?;
    let scene = file.map(InclusionScene::read).transpose();
    let scene = scene.map_err(Failure::input)?;
    if arguments.design {
        return design(arguments, scene.as_ref(), context);
    }
    let scan = match &scene {
        Some(scene) => Scan::of_scene(scene)?,
        None => Scan::simulated(arguments.seed).map_err(|error| unusable(file, &error))?,
    };
    let estimate = match found(&scan, context) {
        Ok(estimate) => estimate,
        Err(ElasticityError::Cancelled) => return Ok(Exit::Interrupted),
        Err(error @ ElasticityError::NoSolution) => return Err(Failure::no_answer(error)),
        Err(error) => return Err(unusable(file, &error)),
    };
    let is_asymmetric = !asymmetry_warnings(scan.asymmetry, scan.harmonics).is_empty();
    print(&estimate, &scan, context);
    let mut exit = Exit::Complete;
    let mut hidden = None;
    if let (Some(contrast), Some(loaded)) = (arguments.hidden, &scan.loaded) {
        // The found inclusion is valid, even if the limits cannot be computed.
        let found = context.reported("what could hide", |report| {
            loaded.hidden(&estimate, contrast, report)
        });
        match found.map(Hidden) {
            Ok(found) => {
                found.print(context);
                hidden = Some(found);
            }
            Err(ElasticityError::Cancelled) => exit = Exit::Interrupted,
            Err(error) => {
                let text = format!("hidden lumps could not be computed: {error}");
                context.warn("hidden_unknown", json!({}), text);
                exit = Exit::Partial;
            }
        }
    }
    for warning in &estimate.warnings {
        let numbers = json!(warning);
        let kind = numbers["kind"].as_str().unwrap_or_default().to_owned();
        context.warn(&kind, numbers, warning.to_string());
    }
    context.value(&json!({
        "verdict": estimate.verdict(), "found": estimate.found,
        "probability": estimate.probability, "inclusion": estimate.inclusion,
        "inclusions": estimate.inclusions(),
        "block_modulus_pa": estimate.block_modulus_pa, "interface": estimate.interface,
        "misfit": estimate.misfit, "asymmetry": scan.asymmetry, "harmonics": scan.harmonics,
        "is_asymmetric": is_asymmetric, "hidden": hidden.as_ref().map(|hidden: &Hidden| &hidden.0),
    }));
    context.outputs.add(names[0], table(&estimate, &scan));
    context
        .outputs
        .page(names[1], || page(&estimate, &scan, hidden.as_ref()))?;
    Ok(exit)
}

fn unusable(file: Option<&Path>, error: &ElasticityError) -> Failure {
    match file {
        Some(file) => Failure::in_file(file, error),
        None => Failure::input(error),
    }
}

fn found(scan: &Scan, context: &Context) -> Result<InclusionEstimate, ElasticityError> {
    context.reported("searching", |report| match &scan.loaded {
        Some(loaded) => loaded.estimate(report),
        None => (scan.search).search_with_progress(&scan.radii_m, &scan.profiles, report),
    })
}

/// Prints the expected errors of scans of this block with the assumed lump.
fn design(
    arguments: &InclusionArguments,
    scene: Option<&InclusionScene>,
    context: &mut Context,
) -> Result<Exit, Failure> {
    let file = arguments.scene.as_deref();
    let (specimen, guide) = match scene {
        Some(scene) => (scene.specimen, scene.guide.clone()),
        None => simulated_block().map_err(|error| unusable(file, &error))?,
    };
    let radii = rings(guide.radius_m()).0;
    let search = InclusionSearch::new(specimen, guide).map_err(|error| unusable(file, &error))?;
    let assumed = AssumedInclusion {
        diameter_m: 1e-3 * arguments.diameter_mm,
        depth_m: 1e-3 * arguments.depth_mm,
        youngs_modulus_pa: 1e3 * arguments.lump_kpa,
        block_modulus_pa: 1e3 * arguments.tissue_kpa,
    };
    // Largest approaches relative to the height of the block, and numbers of frames at equal steps.
    let scans = [0.03, 0.06, 0.1].map(|largest| [1, 2, 3].map(|frames| (largest, frames)));
    let scans = scans.concat();
    let mut bar = Bar::of(scans.len(), "comparing scans");
    let mut rows = Vec::new();
    for (largest, frames) in scans {
        let step = largest * specimen.height_m() / f64::from(frames);
        let approaches: Vec<f64> = (1..=frames).map(|k| step * f64::from(k)).collect();
        // White error of a ring mean relative to the mean pressure: about a thousand pixels with 1
        // % noise.
        let white = vec![3e-4 * assumed.block_modulus_pa * largest; radii.len()];
        let errors = search.expected_errors(&assumed, &approaches, &radii, &white);
        rows.push((approaches, errors.map_err(|error| unusable(file, &error))?));
        bar.done(rows.len());
    }
    drop(bar);
    context.line(format_args!(
        "expected standard errors for a lump of {:.1} mm, {:.1} mm deep, {:.0} kPa in tissue of \
         {:.1} kPa",
        arguments.diameter_mm, arguments.depth_mm, arguments.lump_kpa, arguments.tissue_kpa,
    ));
    context.line("approaches (mm)           diameter    depth  modulus");
    for (approaches, errors) in &rows {
        let list: Vec<String> = approaches
            .iter()
            .map(|a| format!("{:.2}", 1e3 * a))
            .collect();
        let list = list.join(", ");
        let errors = [errors.diameter, errors.depth, errors.youngs_modulus].map(|e| 100.0 * e);
        let [diameter, depth, modulus] = errors;
        context.line(format_args!(
            "{list:<24} {diameter:>8.1} % {depth:>6.1} % {modulus:>6.1} %"
        ));
    }
    context.line(
        "above 25 % a parameter is not determined; a contact that slips or tissue that tears is not \
         in the model",
    );
    let row =
        |(approaches, errors)| json!({ "approaches_m": approaches, "expected_errors": errors });
    let rows: Vec<_> = rows.into_iter().map(row).collect();
    context.value(&json!({ "design": rows }));
    Ok(Exit::Complete)
}

/// Radii of rings over three quarters of a face, and their width.
fn rings(face_radius_m: f64) -> (Vec<f64>, f64) {
    let width = face_radius_m / 60.0;
    let radii = (0..45).map(|k| (f64::from(k) + 0.5) * width).collect();
    (radii, width)
}

fn interval(estimated: &Estimated, scale: f64, unit: &str) -> String {
    let value = with_error(estimated.value, estimated.standard_error, scale);
    format!("{value} {unit}   (95 %: {})", ends(estimated, scale))
}

fn ends(estimated: &Estimated, scale: f64) -> String {
    let [low, high] = estimated.interval;
    interval_text((low, Some(high)), estimated.standard_error, scale)
}

fn parameter(parameter: &Identifiable, scale: f64, unit: &str) -> String {
    match parameter {
        Identifiable::Yes(estimated) => interval(estimated, scale, unit),
        Identifiable::No(estimated) => {
            let ends = ends(estimated, scale);
            format!("not determined by these frames (95 %: {ends} {unit})")
        }
    }
}

fn print(estimate: &InclusionEstimate, scan: &Scan, context: &mut Context) {
    let lumps = estimate.inclusions();
    let verdict = match (estimate.verdict(), estimate.probability) {
        (SearchVerdict::Found, _) if lumps.len() > 1 => "two lumps".to_owned(),
        (SearchVerdict::Found, _) => "a lump".to_owned(),
        (SearchVerdict::Absent, _) => "no lump visible in these frames".to_owned(),
        (SearchVerdict::Uncertain, p) if p > 0.5 => {
            format!("uncertain: a lump with probability {p:.2}")
        }
        (SearchVerdict::Uncertain, _) => {
            "uncertain: the model does not explain the frames".to_owned()
        }
    };
    context.answer("found", verdict);
    for (index, lump) in lumps.iter().enumerate() {
        if lumps.len() > 1 {
            context.answer("lump", format_args!("{} of {}", index + 1, lumps.len()));
        }
        print_lump(lump, context);
    }
    context.row(
        "block's modulus",
        interval(&estimate.block_modulus_pa, 1e-3, "kPa"),
    );
    let interface = match estimate.interface {
        Interface::Bonded => "bonded",
        Interface::Frictionless => "frictionless",
    };
    let misfit = estimate.misfit;
    context.row(
        "interface",
        format_args!("{interface}, misfit χ² {misfit:.2} per value"),
    );
    if let Some([diameter, depth, modulus]) = scan.truth {
        let [diameter, depth, modulus] = [1e3 * diameter, 1e3 * depth, 1e-3 * modulus];
        context.row(
            "truth",
            format_args!(
                "diameter {diameter:.1} mm, depth {depth:.1} mm, modulus {modulus:.0} kPa \
                 (simulated by the same finite elements)"
            ),
        );
    }
}

fn print_lump(inclusion: &Inclusion, context: &mut Context) {
    if let Some([x, y]) = &inclusion.position_m {
        context.answer("its middle, x", interval(x, 1e3, "mm"));
        context.answer("its middle, y", interval(y, 1e3, "mm"));
    }
    context.answer("diameter", parameter(&inclusion.diameter_m, 1e3, "mm"));
    context.answer("depth of its top", parameter(&inclusion.depth_m, 1e3, "mm"));
    context.row(
        "its modulus",
        parameter(&inclusion.youngs_modulus_pa, 1e-3, "kPa"),
    );
    if let Some(shape) = &inclusion.height_over_width {
        let ball = inclusion.ball_probability;
        context.row(
            "height over width",
            format_args!(
                "{}, a ball with probability {ball:.2}",
                interval(shape, 1.0, "")
            ),
        );
    }
    let [[_, depth, modulus], [_, _, both], _] = inclusion.correlation;
    context.row(
        "correlations",
        format_args!(
            "diameter–depth {depth:+.2}, diameter–modulus {modulus:+.2}, depth–modulus {both:+.2}"
        ),
    );
}

fn table(estimate: &InclusionEstimate, scan: &Scan) -> Vec<u8> {
    let mut csv = Csv::new("frame,radius_m,pressure_pa,standard_error_pa,fitted_pa,plain_block_pa");
    for (frame, profile) in scan.profiles.iter().enumerate() {
        for (k, radius) in estimate.radii_m.iter().enumerate() {
            csv.row([
                frame as f64 + 1.0,
                *radius,
                profile.pressure_pa[k],
                profile.standard_error_pa[k],
                estimate.fitted_pa[frame][k],
                estimate.homogeneous_pa[frame][k],
            ]);
        }
    }
    csv.into_bytes()
}

fn page(estimate: &InclusionEstimate, scan: &Scan, hidden: Option<&Hidden>) -> Page {
    let axes = |title, y| Panel::new(title, "distance from the axis (mm)", y);
    let mut pressures = axes("Pressure on the guide's face", "pressure (Pa)");
    let mut residuals = axes("Residuals of all frames", "measured − fitted (Pa)");
    for (frame, profile) in scan.profiles.iter().enumerate() {
        // The legend contains each kind of mark once.
        let name = |text: &'static str| if frame == 0 { text } else { "" };
        let curve = |values: &[f64]| -> Vec<[f64; 2]> {
            let pairs = estimate.radii_m.iter().zip(values);
            pairs
                .map(|(radius, value)| [1e3 * radius, *value])
                .collect()
        };
        let fitted = &estimate.fitted_pa[frame];
        let pairs = profile.pressure_pa.iter().zip(fitted);
        let rest: Vec<f64> = pairs.map(|(measured, fitted)| measured - fitted).collect();
        let plain = curve(&estimate.homogeneous_pa[frame]);
        pressures = pressures.points(curve(&profile.pressure_pa), Colour::Blue, name("measured"));
        // The cells of a face are not ordered by their distance.
        pressures = if estimate.radii_m.is_sorted() {
            pressures
                .line(curve(fitted), Colour::Orange, name("fit"))
                .dashed(plain, Colour::Grey, name("plain block"))
        } else {
            pressures.points(curve(fitted), Colour::Orange, name("fit"))
        };
        residuals = residuals.points(curve(&rest), Colour::Blue, "");
    }
    let mut panels = vec![
        pressures,
        residuals,
        section(scan, estimate),
        above(scan, estimate),
    ];
    panels.extend(hidden.into_iter().flat_map(Hidden::panels));
    Page::new("Inclusion under the surface", 2, panels)
}

/// The block in section, to scale, with the lumps.
fn section(scan: &Scan, estimate: &InclusionEstimate) -> Panel {
    let specimen = scan.search.specimen();
    let (height, radius) = (1e3 * specimen.height_m(), 1e3 * specimen.radius_m());
    let top = [[-radius, 0.0], [radius, 0.0]];
    let outline = top
        .into_iter()
        .chain([[radius, -height], [-radius, -height], top[0]]);
    let face = 1e3 * scan.search.guide().radius_m();
    let mut panel = Panel::new("Section, to scale", "x (mm)", "height (mm)")
        .equal_aspect()
        .line(outline, Colour::Grey, "block");
    for (k, [x, _]) in scan.axes_mm().into_iter().enumerate() {
        let name = if k == 0 { "guide's face" } else { "" };
        panel = panel.line([[x - face, 0.5], [x + face, 0.5]], Colour::Blue, name);
    }
    let of_lump = |inclusion: &Inclusion| {
        let radius = 0.5e3 * inclusion.diameter_m.estimate().value;
        let depth = inclusion.depth_m.estimate();
        let x = inclusion.position_m.map_or(0.0, |[x, _]| 1e3 * x.value);
        let [high, low] = depth.interval.map(|depth| [x, -1e3 * depth]);
        ([x, -1e3 * depth.value - radius], vec![[high, low]])
    };
    with_lumps(panel, estimate, "its top, 95 %", of_lump)
}

/// The faces of all presses and the lumps from above, to scale.
fn above(scan: &Scan, estimate: &InclusionEstimate) -> Panel {
    let face = 1e3 * scan.search.guide().radius_m();
    let mut panel = Panel::new("From above, to scale", "x (mm)", "y (mm)").equal_aspect();
    for (k, axis) in scan.axes_mm().into_iter().enumerate() {
        let name = if k == 0 { "guide's face" } else { "" };
        panel = panel.line(circle(axis, face), Colour::Blue, name);
    }
    let of_lump = |inclusion: &Inclusion| {
        let Some([x, y]) = inclusion.position_m else {
            return ([0.0; 2], vec![]);
        };
        let [[left, right], [down, up]] = [x, y].map(|at| at.interval.map(|end| 1e3 * end));
        let [x, y] = [x, y].map(|at| 1e3 * at.value);
        let cross = vec![[[left, y], [right, y]], [[x, down], [x, up]]];
        ([x, y], cross)
    };
    with_lumps(panel, estimate, "its place, 95 %", of_lump)
}

/// A panel with every lump and the ends of the interval of its diameter. `of_lump` gives its centre
/// and the lines of another interval, which are named.
fn with_lumps(
    mut panel: Panel,
    estimate: &InclusionEstimate,
    name: &'static str,
    of_lump: impl Fn(&Inclusion) -> ([f64; 2], Vec<[[f64; 2]; 2]>),
) -> Panel {
    for (index, inclusion) in estimate.inclusions().iter().enumerate() {
        // The legend contains each kind of line once.
        let named = |text: &'static str| if index == 0 { text } else { "" };
        let (centre, lines) = of_lump(inclusion);
        let diameter = inclusion.diameter_m.estimate();
        let [low, high] = diameter.interval;
        let rim = |diameter_m: f64| circle(centre, 0.5e3 * diameter_m);
        panel = panel
            .segments(lines, Colour::Orange, named(name))
            .line(rim(diameter.value), Colour::Orange, named("lump"))
            .dashed(rim(low), Colour::Grey, named("its size, 95 %"))
            .dashed(rim(high), Colour::Grey, "");
    }
    panel
}
