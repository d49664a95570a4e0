//! Errors of the inclusion search on a folder of solved scenes, compared with the Cramér–Rao bound.
//!
//! ```text
//! cargo run --release -p tactile-inclusion --example inclusion_study -- FOLDER [SEEDS] [NAMES] [balls] [FACE] [KERNEL]
//! ```
//!
//! FOLDER contains `scenes.csv` (scene, D_m, depth_m, E1_pa, E0_pa, block_height_m, block_radius_m,
//! disc_radius_m, nu, contact, approach_1_m …, force_1_n …). D_m is 0 for a plain block, and cells
//! of missing loads are empty. For every scene there is a file `NAME.csv` (load_index, r_m,
//! pressure_pa), solved by another program: `evidence/inclusion_scenes.py` creates such folders
//! with CalculiX.
//!
//! Every scene is searched with SEEDS draws (default 1) of the errors of the sensor: white noise of
//! pixels, smooth errors of the calibration, and errors of the force, of the height of the block
//! and of the zero of the approaches. Poisson's ratio is stated as 0.495 ± 0.005 for every scene.
//! NAMES selects the scenes whose names begin with one of them, separated by commas. With `balls`,
//! the search assumes that an inclusion is a ball. FACE is `stated` if the search is given the true
//! contact condition, and `misstated` if it is given the other.
//!
//! KERNEL draws the errors of the calibration differently from the model of the search: `1mm` and
//! `6mm` with another correlation length, `vignetting` as the square of the radius, and `speckle`
//! of 1 % over 0.3 mm.
#![allow(clippy::print_stdout)]

mod scenes;
mod shared;
mod tally;

use rand::{SeedableRng, rngs::ChaCha8Rng};
use scenes::{SolvedScene, scenes};
use shared::{guide, normal, wave};
use std::error::Error;
use std::path::Path;
use tactile_fem::Interface;
use tactile_inclusion::{
    AssumedInclusion, ExpectedErrors, InclusionSearch, PressureProfile, SensorErrors, TissueBlock,
};
use tally::{Tally, parameters};

/// Pixel size of the camera in metres, and its noise relative to the largest pressure.
const PIXEL_M: f64 = 86e-6;
const PIXEL_NOISE: f64 = 7.5e-3;
/// Number of scenes after which intermediate results are printed.
const SUMMARY_EVERY: usize = 10;

/// Ring means of a smooth random field of unit variance.
fn smooth_field(radii_m: &[f64], length_m: f64, rng: &mut ChaCha8Rng) -> Vec<f64> {
    const WAVES: usize = 400;
    const ANGLES: usize = 32;
    let mut means = vec![0.0; radii_m.len()];
    for _ in 0..WAVES {
        let ([x, y], phase) = wave(length_m, rng);
        let wave_number = x.hypot(y);
        for (mean, radius) in means.iter_mut().zip(radii_m) {
            let around: f64 = (0..ANGLES)
                .map(|k| {
                    let angle = core::f64::consts::PI * (k as f64 + 0.5) / ANGLES as f64;
                    (wave_number * radius * angle.cos()).cos()
                })
                .sum();
            // The average of the sine around the ring vanishes.
            *mean += (2.0 / WAVES as f64).sqrt() * phase.cos() * around / ANGLES as f64;
        }
    }
    means
}

/// Distribution of the errors of the calibration.
#[derive(Clone, Copy, PartialEq)]
enum Kernel {
    /// Correlated over a length in metres, and larger by a factor than the search assumes.
    Smooth(f64, f64),
    Vignetting,
}

impl Kernel {
    fn named(name: &str) -> Option<Self> {
        Some(match name {
            "1mm" => Self::Smooth(1e-3, 1.0),
            "6mm" => Self::Smooth(6e-3, 1.0),
            "speckle" => Self::Smooth(0.3e-3, 3.3),
            "vignetting" => Self::Vignetting,
            _ => return None,
        })
    }

    /// Ring means of unit variance, times a factor.
    fn draw(self, radii_m: &[f64], rng: &mut ChaCha8Rng) -> Vec<f64> {
        match self {
            Self::Smooth(length_m, scale) => {
                let mut field = smooth_field(radii_m, length_m, rng);
                field.iter_mut().for_each(|value| *value *= scale);
                field
            }
            Self::Vignetting => {
                let (size, rim) = (3.0_f64.sqrt() * normal(rng), radii_m[radii_m.len() - 1]);
                let at = |r: &f64| size * (2.0 * (r / rim).powi(2) - 1.0);
                radii_m.iter().map(at).collect()
            }
        }
    }
}

/// White errors of the ring means.
fn white_errors(scene: &SolvedScene) -> Vec<f64> {
    let width = scene.radii_m[1] - scene.radii_m[0];
    let inner = scene.pressures_pa.iter().flat_map(|frame| {
        let within = frame.iter().zip(&scene.radii_m);
        within
            .filter(|(_, r)| **r < 0.75 * scene.face_radius_m)
            .map(|(p, _)| *p)
    });
    let full_scale = inner.fold(0.0, f64::max);
    let errors = scene.radii_m.iter().map(|radius| {
        let pixels = core::f64::consts::TAU * radius * width / PIXEL_M.powi(2);
        PIXEL_NOISE * full_scale / pixels.sqrt()
    });
    errors.collect()
}

/// The measurement of a scene: frames with errors, and the stated properties of the block.
fn measured(
    scene: &SolvedScene,
    seed: u64,
    kernel: Kernel,
) -> Result<(TissueBlock, Vec<PressureProfile>), Box<dyn Error>> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let sensor = SensorErrors::default();
    let said_height = scene.height_m * (0.02 * normal(&mut rng)).exp();
    let zero = 20e-6 * normal(&mut rng);
    let specimen = TissueBlock::new(said_height, scene.radius_m)?;
    let common = kernel.draw(&scene.radii_m, &mut rng);
    let white = white_errors(scene);
    let mut frames = Vec::new();
    for (load, pressures) in scene.pressures_pa.iter().enumerate() {
        let own = kernel.draw(&scene.radii_m, &mut rng);
        let mut read = Vec::new();
        for (k, pressure) in pressures.iter().enumerate() {
            let smooth = sensor.common * common[k] + sensor.each_frame * own[k];
            read.push(pressure * (1.0 + smooth) + white[k] * normal(&mut rng));
        }
        frames.push(PressureProfile {
            approach_m: scene.approaches_m[load] - zero,
            force_n: Some(scene.forces_n[load] * (1.0 + sensor.force * normal(&mut rng))),
            pressure_pa: read,
            standard_error_pa: white.clone(),
        });
    }
    Ok((specimen, frames))
}

/// Cramér–Rao bounds of ln D, ln d and ln E₁ at the true values, from the errors of the sensor
/// alone, for an inclusion that is known to be a ball.
fn bounds(scene: &SolvedScene, lump: [f64; 4]) -> Result<ExpectedErrors, Box<dyn Error>> {
    let specimen =
        TissueBlock::new(scene.height_m, scene.radius_m)?.with_interface(scene.interface);
    let errors = SensorErrors {
        model: 0.0,
        ..SensorErrors::default()
    };
    let search =
        InclusionSearch::new(specimen, guide(scene.face_radius_m)?)?.with_sensor_errors(errors)?;
    let search = search.with_shape_error(0.0)?;
    let assumed = AssumedInclusion {
        diameter_m: lump[0],
        depth_m: lump[1],
        youngs_modulus_pa: lump[2],
        block_modulus_pa: scene.block_modulus_pa,
    };
    let white = white_errors(scene);
    Ok(search.expected_errors(&assumed, &scene.approaches_m, &scene.radii_m, &white)?)
}

/// Processor time on Linux, otherwise wall-clock time.
fn seconds() -> f64 {
    let told = std::fs::read_to_string("/proc/self/schedstat").ok();
    let nanoseconds = told.and_then(|text| text.split(' ').next()?.parse::<f64>().ok());
    let clock = || std::time::UNIX_EPOCH.elapsed().unwrap_or_default();
    nanoseconds.map_or_else(|| clock().as_secs_f64(), |n| 1e-9 * n)
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let folder = arguments
        .next()
        .ok_or("usage: FOLDER [SEEDS] [NAMES] [balls] [FACE] [KERNEL]")?;
    let seeds: u64 = arguments.next().map_or(Ok(1), |text| text.parse())?;
    let names = arguments.next().unwrap_or_default();
    let mut is_ball = false;
    let mut is_stated_well = None;
    let mut kernel = Kernel::Smooth(SensorErrors::default().correlation_m, 1.0);
    for word in arguments {
        match Kernel::named(&word) {
            Some(named) => kernel = named,
            None if word == "balls" => is_ball = true,
            None if word == "stated" => is_stated_well = Some(true),
            None if word == "misstated" => is_stated_well = Some(false),
            None => return Err(format!("{word} is neither balls, a face nor a kernel").into()),
        }
    }
    let mut tally = Tally::default();
    let mut searched = 0;
    for (index, scene) in scenes(Path::new(&folder))?.iter().enumerate() {
        if !names.split(',').any(|name| scene.name.starts_with(name)) {
            continue;
        }
        let bounds = match scene.lump {
            Some(lump) => {
                let begun = seconds();
                let bounds = bounds(scene, lump)?;
                tally.model_seconds.push(seconds() - begun);
                [bounds.diameter, bounds.depth, bounds.youngs_modulus]
            }
            None => [f64::INFINITY; 3],
        };
        for seed in 0..seeds {
            let (specimen, frames) = measured(scene, seed * 1000 + index as u64, kernel)?;
            let specimen = match is_stated_well {
                Some(true) => specimen.with_interface(scene.interface),
                Some(false) => specimen.with_interface(match scene.interface {
                    Interface::Bonded => Interface::Frictionless,
                    Interface::Frictionless => Interface::Bonded,
                }),
                None => specimen,
            };
            let search = InclusionSearch::new(specimen, guide(scene.face_radius_m)?)?;
            let search = if is_ball {
                search.with_shape_error(0.0)?
            } else {
                search
            };
            let begun = seconds();
            let estimate = search.search(&scene.radii_m, &frames)?;
            let seconds = seconds() - begun;
            tally.search_seconds.push(seconds);
            print!(
                "{} {seed} {:?}: {seconds:.1} s, p {:.3}, {:?}, misfit {:.2}",
                scene.name,
                scene.interface,
                estimate.probability,
                estimate.interface,
                estimate.misfit
            );
            match scene.lump {
                Some(lump) => tally.add(lump, bounds, &estimate),
                None => tally.add_plain(&estimate),
            }
            if let (Some(lump), Some(inclusion)) = (scene.lump, &estimate.inclusion) {
                for ((name, told), (truth, bound)) in ["D", "d", "E1"]
                    .iter()
                    .zip(parameters(inclusion))
                    .zip(lump.iter().zip(bounds))
                {
                    let estimated = told.estimate();
                    let error = (estimated.value / truth).ln();
                    let reach = estimated.interval.map(|end| 100.0 * (end / truth).ln());
                    print!(
                        "; {name} {}{:+.1} [{:+.1} {:+.1}] % (bound {:.1}, z {:+.2})",
                        if told.value().is_some() { "" } else { "open " },
                        100.0 * error,
                        reach[0],
                        reach[1],
                        100.0 * bound,
                        error / estimated.relative_error()
                    );
                }
                let [_, _, _, aspect] = lump;
                if let Some(shape) = &inclusion.height_over_width {
                    let [low, high] = shape.interval;
                    print!(
                        "; κ {:.3} [{low:.3} {high:.3}] for {aspect:.3}",
                        shape.value
                    );
                    tally.add_shape(aspect, shape.interval);
                }
                print!(", ball {:.2}", inclusion.ball_probability);
            } else if let Some(inclusion) = &estimate.inclusion {
                for (name, told) in ["D", "d", "E1"].iter().zip(parameters(inclusion)) {
                    print!("; {name} {:.3e}", told.estimate().value);
                }
                print!("; found where there is none");
            } else {
                print!("; none");
            }
            println!("; {:?}", estimate.warnings);
        }
        searched += 1;
        if searched % SUMMARY_EVERY == 0 {
            tally.print();
        }
    }
    tally.print();
    Ok(())
}
