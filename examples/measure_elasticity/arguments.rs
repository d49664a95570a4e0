//! The command line.
use clap::{Parser, ValueEnum};
use std::path::PathBuf;

/// The paper's two polymers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Polymer {
    /// Versaflex CL2000X, 103 kPa.
    Cl2000x,
    /// Versaflex CL2003X, 62 kPa.
    Cl2003x,
}

/// Measures the Young's modulus of an object from frames of an optical tactile sensor at two or more loads.
///
/// Without SCENE.toml it simulates the paper's experiment (a ball of 3 mm radius pressed with 0.7 N and 1.2 N on the layered
/// waveguide), measures the simulated frames blindly, and prints every result beside the truth. With SCENE.toml it
/// measures your own frames. Plots go to target/measure_elasticity/, results to stdout, progress to stderr.
#[derive(Clone, Debug, Parser)]
#[command(version, after_help = AFTER_HELP)]
pub(crate) struct Arguments {
    /// Scene file with your own frames; see below. Without it a press is simulated.
    #[arg(value_name = "SCENE.toml")]
    pub(crate) scene: Option<PathBuf>,
    /// Print one JSON object on stdout instead of text.
    #[arg(long)]
    pub(crate) json: bool,
    /// Measure N times and report the median and the 99th centile of every stage and of the whole.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) repeat: u32,
    /// Folder for the plots.
    #[arg(long, value_name = "DIR", default_value = "target/measure_elasticity")]
    pub(crate) out: PathBuf,
    /// Draw no plots.
    #[arg(long)]
    pub(crate) no_plots: bool,
    /// Number of control points on each surface.
    #[arg(long, value_name = "COUNT", default_value_t = 200, value_parser = clap::value_parser!(u32).range(8..=5000))]
    pub(crate) points: u32,
    /// Simulation: the ball's material.
    #[arg(long, value_enum, default_value_t = Polymer::Cl2000x, conflicts_with = "scene")]
    pub(crate) polymer: Polymer,
    /// Simulation: the ball's Young's modulus in kPa, instead of a polymer's.
    #[arg(long, value_name = "KPA", value_parser = positive, conflicts_with_all = ["scene", "polymer"])]
    pub(crate) modulus_kpa: Option<f64>,
    /// Simulation: the ball's radius in mm.
    #[arg(long, value_name = "MM", default_value_t = 3.0, value_parser = positive, conflicts_with = "scene")]
    pub(crate) radius_mm: f64,
    /// Simulation: the loads in newtons.
    #[arg(long, value_name = "N,N,...", value_delimiter = ',', default_values_t = [0.7, 1.2], value_parser = positive, conflicts_with = "scene")]
    pub(crate) forces: Vec<f64>,
    /// Simulation: seed of the camera's noise.
    #[arg(long, default_value_t = 1, conflicts_with = "scene")]
    pub(crate) seed: u64,
    /// Simulation: no noise, blur, vignetting or background.
    #[arg(long, conflicts_with = "scene")]
    pub(crate) ideal_camera: bool,
}

/// A positive, finite number.
fn positive(text: &str) -> Result<f64, String> {
    let value = text
        .parse()
        .ok()
        .filter(|v: &f64| *v > 0.0 && v.is_finite());
    value.ok_or_else(|| "expected a positive number".into())
}

const AFTER_HELP: &str = "\
SCENE.toml (paths are relative to it; PNG, PGM or JPEG; colour becomes grey by the luma of Rec. 601):

  reference = \"reference.png\"            # the sensor without contact
  pixel_size_m = [21.55e-6, 21.55e-6]    # x, y, on the sensing surface
  [calibration]
  pairs = \"calibration.csv\"              # columns integrated_pixel_value,force_N
  # or: depth_table = \"depth.csv\"        # columns darkness_grey_levels,depth_mm
  [[frames]]
  image = \"frame_1.png\"
  force_N = 0.70                         # optional gauge reading
  [[frames]]
  image = \"frame_2.png\"
  [object]
  shape = \"sphere\"                       # or \"flat_punch\", \"unknown\"
  radius_m = 3e-3
  poisson_ratio = 0.5
  [waveguide]                            # from the object's side to the glass
  layers = [{ refractive_index = 1.41, thickness_m = 2e-3, youngs_modulus_pa = 1.36e5, poisson_ratio = 0.5 }]

Exit status: 0 measured, 2 a wrong argument, file or field (one sentence on stderr says which).";
