//! `tactile inclusion`: size, depth and stiffness of a lump under the surface of a block.
mod design;
mod report;
mod source;

use crate::context::Context;
use crate::failure::{Exit, Failure};
use crate::numbers::positive;
use crate::outputs::Outputs;
use crate::progress::Progress;
use clap::Args;
use source::Source;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use tactile_imaging::elasticity::ElasticityError;
use tactile_imaging::inclusion::InclusionScene;
use tactile_imaging::inclusion::{AssumedInclusion, InclusionEstimate, InclusionSearch};

/// Find a lump under the surface of a block: its size, depth and stiffness
///
/// SCENE.toml names frames of the guide pressed onto a flat block at known approaches, the block's size and the guide's
/// layers (examples/data/inclusion/scene.toml is one); without it a block with a lump is simulated. The pressure over the radius is compared with finite elements at
/// finite strain; the answer is whether there is a lump, its diameter, depth and modulus with 95 % intervals, or which of them the
/// frames leave open. --out gets profiles.csv and inclusion.svg. A search takes some five seconds for each kind of interface.
#[derive(Args)]
#[command(after_help = "\
Examples:
  tactile inclusion --design examples/data/inclusion/scene.toml
The scene file:
  reference = \"reference.png\"
  pixel_size_m = [3.44e-4, 3.44e-4]
  frames = [{ image = \"frame_1.png\", approach_m = 1e-3, force_N = 0.35 }]     growing approaches; three tell most
  [calibration]
  pairs = \"calibration.csv\"; without it the force_N of every frame, spread over its light, gives the pressure
  [object]
  shape = \"block\"; height_m, radius_m; interface = \"bonded\" or \"frictionless\" (both are tried where it is absent);
  height_error_m (2 % if absent), poisson_ratio and poisson_ratio_error (0.495, 0.005), approach_error_m (2e-5),
  youngs_modulus_pa and youngs_modulus_error_pa where the tissue's modulus is known
  [waveguide]
  radius_m; layers = [{ thickness_m, youngs_modulus_pa, poisson_ratio }], from the block's side to the glass")]
pub struct Arguments {
    /// Scene file.
    #[arg(value_name = "SCENE.toml")]
    scene: Option<PathBuf>,
    /// Folder for profiles.csv and inclusion.svg.
    #[arg(long, value_name = "DIR", conflicts_with = "design")]
    out: Option<PathBuf>,
    /// Instead of searching, compare what scans with other approaches would tell of a lump in this block.
    #[arg(long)]
    design: bool,
    /// Design: diameter of the lump, in millimetres.
    #[arg(long, value_name = "MM", default_value = "10", value_parser = positive, requires = "design")]
    diameter_mm: f64,
    /// Design: depth of its top, in millimetres.
    #[arg(long, value_name = "MM", default_value = "4", value_parser = positive, requires = "design")]
    depth_mm: f64,
    /// Design: its modulus, in kPa.
    #[arg(long, value_name = "KPA", default_value = "40", value_parser = positive, requires = "design")]
    lump_kpa: f64,
    /// Design: the tissue's modulus, in kPa.
    #[arg(long, value_name = "KPA", default_value = "5", value_parser = positive, requires = "design")]
    tissue_kpa: f64,
    /// Simulation: seed of the camera's noise.
    #[arg(long, default_value_t = 1, conflicts_with = "scene")]
    seed: u64,
}

const FILES: [&str; 2] = ["profiles.csv", "inclusion.svg"];

pub fn run(arguments: &Arguments, context: &mut Context) -> Result<Exit, Failure> {
    let file = arguments.scene.as_deref();
    let inputs: Vec<&Path> = file.into_iter().collect();
    let mut outputs = Outputs::plan(arguments.out.as_deref(), &FILES, &inputs)?;
    let scene = match file {
        Some(path) => Some(InclusionScene::read(path).map_err(Failure::input)?),
        None => None,
    };
    if let Some(scene) = &scene {
        outputs.check(&scene.images())?;
    }
    if arguments.design {
        return plan(arguments, scene.as_ref(), context);
    }
    let source = match &scene {
        Some(scene) => Source::of_scene(scene)?,
        None => Source::simulated(arguments.seed).map_err(|error| unusable(file, &error))?,
    };
    let search = InclusionSearch::new(source.specimen, source.guide.clone())
        .map_err(|error| unusable(file, &error))?;
    let estimate = match found(&search, &source, context) {
        Ok(estimate) => estimate.with_asymmetry(source.asymmetry),
        Err(ElasticityError::Cancelled) => return Ok(Exit::Interrupted),
        Err(error @ ElasticityError::NoSolution) => return Err(Failure::no_answer(error)),
        Err(error) => return Err(unusable(file, &error)),
    };
    outputs.write(FILES[0], &report::table(&estimate, &source))?;
    outputs.page(FILES[1], || report::page(&estimate, &source))?;
    context.console.value(&report::as_json(&estimate, &source));
    report::print(&estimate, &source, context);
    if let Some(summary) = outputs.summary() {
        context.console.line(summary);
    }
    Ok(Exit::Complete)
}

/// The search with its progress; Ctrl-C ends it.
fn found(
    search: &InclusionSearch,
    source: &Source,
    context: &mut Context,
) -> Result<InclusionEstimate, ElasticityError> {
    let mut progress: Option<Progress> = None;
    context.interrupt.hear(true);
    let interrupt = context.interrupt.clone();
    let found = search.search_with_progress(&source.radii_m, &source.profiles, &mut |now| {
        let bar = progress.get_or_insert_with(|| Progress::of(now.expected, "searching"));
        bar.done(now.done);
        if interrupt.requested() {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    });
    context.interrupt.hear(false);
    found
}

fn plan(
    arguments: &Arguments,
    scene: Option<&InclusionScene>,
    context: &mut Context,
) -> Result<Exit, Failure> {
    let file = arguments.scene.as_deref();
    let (specimen, guide) = match scene {
        Some(scene) => (scene.specimen, scene.guide.clone()),
        None => source::simulated_block().map_err(|error| unusable(file, &error))?,
    };
    let sizes = (specimen.height_m(), guide.radius_m());
    let search = InclusionSearch::new(specimen, guide).map_err(|error| unusable(file, &error))?;
    let assumed = AssumedInclusion {
        diameter_m: 1e-3 * arguments.diameter_mm,
        depth_m: 1e-3 * arguments.depth_mm,
        youngs_modulus_pa: 1e3 * arguments.lump_kpa,
        block_modulus_pa: 1e3 * arguments.tissue_kpa,
    };
    design::run(&search, sizes, &assumed, file, context)
}

fn unusable(file: Option<&Path>, error: &ElasticityError) -> Failure {
    match file {
        Some(file) => Failure::input(format!("{}: {error}", file.display())),
        None => Failure::input(error),
    }
}
