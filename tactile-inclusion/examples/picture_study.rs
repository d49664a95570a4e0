//! Errors of the search in the whole face, on a folder of blocks solved in three dimensions.
//!
//! ```text
//! cargo run --release -p tactile-inclusion --example picture_study -- FOLDER [SEEDS] [NAMES]
//! ```
//!
//! FOLDER contains `scenes.csv` and for every scene a file `NAME.csv` (load_index, x_m, y_m,
//! pressure_pa), as created by `evidence/inclusion_pictures.py` with CalculiX. The grid of 0.5 mm
//! covers half of the face, or a quarter if the lump has a twin. Every scene is rotated about the
//! axis, sampled on cells of 1 mm, and searched with SEEDS draws of the errors of the sensor. NAMES
//! selects the scenes whose names begin with one of them, separated by commas.
#![allow(clippy::print_stdout)]

#[path = "inclusion_study/shared.rs"]
mod shared;

use core::ops::ControlFlow;
use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};
use shared::{guide, normal, number, table, wave};
use std::collections::HashMap;
use std::error::Error;
use std::path::Path;
use tactile_fem::Interface;
use tactile_inclusion::{
    Identifiable, Inclusion, InclusionSearch, PressureProfile, Scan, ScanPress, SensorErrors,
    TissueBlock,
};

/// Pressures of each load on cells of 1 mm, with the given centres.
struct Picture {
    positions_m: Vec<[f64; 2]>,
    pressures_pa: Vec<Vec<f64>>,
}

/// The pressure image of a scene's file, mirrored to the whole face.
fn picture(path: &Path, loads: usize, is_quarter: bool) -> Result<Picture, Box<dyn Error>> {
    let mut known: Vec<HashMap<[i64; 2], f64>> = vec![HashMap::new(); loads];
    for row in table(path)? {
        let load = number(&row, "load_index")? as usize - 1;
        // Grid indices.
        let [x, y] = [number(&row, "x_m")?, number(&row, "y_m")?];
        let [x, y] = [x, y].map(|value| (value / 0.5e-3).round() as i64);
        // Near the outer part of the mirror plane between two lumps, the pressure is that of nodes
        // whose elements are cut there: it is wrong by up to a tenth within a millimetre.
        if is_quarter && x <= 2 && y > 11 {
            continue;
        }
        let pressure = number(&row, "pressure_pa")?;
        for sign_x in if is_quarter { vec![-1, 1] } else { vec![1] } {
            for sign_y in [-1, 1] {
                known[load].insert([sign_x * x, sign_y * y], pressure);
            }
        }
    }
    let mut positions_m = Vec::new();
    let mut pressures_pa = vec![Vec::new(); loads];
    for i in -14..14i64 {
        for k in -14..14i64 {
            // Four points of the grid around the centre of a cell.
            let corners = [[0, 0], [1, 0], [0, 1], [1, 1]].map(|[a, b]| [2 * i + a, 2 * k + b]);
            let mean = |known: &HashMap<[i64; 2], f64>| -> Option<f64> {
                let values: Option<Vec<f64>> =
                    corners.iter().map(|at| known.get(at).copied()).collect();
                Some(values?.iter().sum::<f64>() / 4.0)
            };
            let means: Option<Vec<f64>> = known.iter().map(mean).collect();
            if let Some(means) = means {
                let middle = |index: i64| 1e-3 * index as f64 + 0.25e-3;
                positions_m.push([middle(i), middle(k)]);
                pressures_pa
                    .iter_mut()
                    .zip(means)
                    .for_each(|(all, p)| all.push(p));
            }
        }
    }
    Ok(Picture {
        positions_m,
        pressures_pa,
    })
}

/// A smooth random field of unit variance.
fn smooth_field(positions_m: &[[f64; 2]], length_m: f64, rng: &mut ChaCha8Rng) -> Vec<f64> {
    let waves = 400;
    let mut field = vec![0.0; positions_m.len()];
    for _ in 0..waves {
        let (wave, phase) = wave(length_m, rng);
        for (value, [x, y]) in field.iter_mut().zip(positions_m) {
            *value += (2.0 / f64::from(waves)).sqrt() * (wave[0] * x + wave[1] * y + phase).cos();
        }
    }
    field
}

/// Frames with the errors of the sensor: white noise of 0.75 % of the largest pressure on pixels of
/// 86 µm, and the smooth errors of a calibration.
fn measured(
    picture: &Picture,
    approaches_m: &[f64],
    zero_m: f64,
    rng: &mut ChaCha8Rng,
) -> Vec<PressureProfile> {
    let sensor = SensorErrors::default();
    let common = smooth_field(&picture.positions_m, sensor.correlation_m, rng);
    let inner = |[x, y]: &[f64; 2]| x.hypot(*y) < 12e-3;
    let largest = picture.pressures_pa.iter().flat_map(|frame| {
        let pairs = frame.iter().zip(&picture.positions_m);
        pairs.filter(|(_, at)| inner(at)).map(|(p, _)| *p)
    });
    let white = 7.5e-3 * largest.fold(0.0, f64::max) * 86e-6 / 1e-3;
    let frames = picture.pressures_pa.iter().zip(approaches_m);
    let frames = frames.map(|(pressures, approach)| {
        let own = smooth_field(&picture.positions_m, sensor.correlation_m, rng);
        let each = pressures.iter().zip(common.iter().zip(&own));
        let read = each.map(|(pressure, (common, own))| {
            let smooth = sensor.common * common + sensor.each_frame * own;
            pressure * (1.0 + smooth) + white * normal(rng)
        });
        PressureProfile {
            approach_m: approach - zero_m,
            force_n: None,
            pressure_pa: read.collect(),
            standard_error_pa: vec![white; pressures.len()],
        }
    });
    frames.collect()
}

/// Prints the results for a lump and the true values.
fn print_lump(inclusion: &Inclusion, centre_m: [f64; 2], truth: [f64; 3]) {
    if let Some(position) = &inclusion.position_m {
        let off = [0, 1].map(|k| position[k].value - centre_m[k]);
        let error = position[0].standard_error.hypot(position[1].standard_error);
        let aside = centre_m[0].hypot(centre_m[1]);
        let outwards = (off[0] * centre_m[0] + off[1] * centre_m[1]) / aside.max(1e-9);
        let [away, outwards, error] = [off[0].hypot(off[1]), outwards, error].map(|x| 1e3 * x);
        print!("; {away:.3} mm away, {outwards:.3} outwards (error {error:.3})");
    }
    let told = [
        inclusion.diameter_m,
        inclusion.depth_m,
        inclusion.youngs_modulus_pa,
    ];
    for ((name, told), truth) in ["D", "d", "E1"].iter().zip(told).zip(truth) {
        let estimated = told.estimate();
        let [low, high] = estimated.interval;
        let is_wrong = !(low..=high).contains(&truth);
        print!(
            "; {name} {}{:.3e} [{low:.3e} {high:.3e}]{}",
            if matches!(told, Identifiable::No(_)) {
                "open "
            } else {
                ""
            },
            estimated.value,
            if is_wrong { " WRONG" } else { "" }
        );
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let folder = arguments.next().ok_or("usage: FOLDER [SEEDS] [NAMES]")?;
    let seeds: u64 = arguments.next().map_or(Ok(1), |text| text.parse())?;
    let names = arguments.next().unwrap_or_default();
    let folder = Path::new(&folder);
    for (index, row) in table(&folder.join("scenes.csv"))?.iter().enumerate() {
        let name = row.get("scene").ok_or("no column scene")?;
        if !names.split(',').any(|begin| name.starts_with(begin)) {
            continue;
        }
        let numbers = |what: &str| -> Result<Vec<f64>, Box<dyn Error>> {
            (1..=3)
                .map(|load| number(row, &what.replace('#', &load.to_string())))
                .collect()
        };
        let approaches_m = numbers("approach_#_m")?;
        let is_pair = number(row, "twin_at_minus_x")? > 0.0;
        let picture = picture(
            &folder.join(format!("{name}.csv")),
            approaches_m.len(),
            is_pair,
        )?;
        let axes = [
            number(row, "axis_x_m")?,
            number(row, "axis_y_m")?,
            number(row, "axis_z_m")?,
        ];
        let diameter = (axes[0] * axes[1] * axes[2]).cbrt();
        let truth = [diameter, number(row, "depth_m")?, number(row, "E1_pa")?];
        for seed in 0..seeds {
            let mut rng = ChaCha8Rng::seed_from_u64(1000 * seed + index as u64);
            // The lump is at a random angle around the axis.
            let turn = core::f64::consts::TAU * rng.random::<f64>();
            let turned = |[x, y]: [f64; 2]| {
                [
                    x * turn.cos() - y * turn.sin(),
                    x * turn.sin() + y * turn.cos(),
                ]
            };
            let positions: Vec<[f64; 2]> =
                picture.positions_m.iter().map(|&at| turned(at)).collect();
            let height = number(row, "block_height_m")? * (0.02 * normal(&mut rng)).exp();
            let zero_m = 20e-6 * normal(&mut rng);
            let frames = measured(&picture, &approaches_m, zero_m, &mut rng);
            let specimen = TissueBlock::new(height, number(row, "block_radius_m")?)?;
            let specimen = match row.get("contact").map(String::as_str) {
                Some("bonded") => specimen.with_interface(Interface::Bonded),
                _ => specimen.with_interface(Interface::Frictionless),
            };
            let search = InclusionSearch::new(specimen, guide(number(row, "disc_radius_m")?)?)?;
            let begun = std::time::Instant::now();
            let progress = &mut |_| ControlFlow::Continue(());
            let press = ScanPress {
                axis_m: [0.0; 2],
                positions_m: positions,
                frames,
            };
            let scan = Scan {
                presses: vec![press],
                position_error_m: 0.0,
            };
            let estimate = search.search_scan(&scan, progress)?;
            print!(
                "{name} {seed}: {:.0} s, {:?}, p {:.3}, misfit {:.2}",
                begun.elapsed().as_secs_f64(),
                estimate.verdict(),
                estimate.probability,
                estimate.misfit
            );
            for inclusion in &estimate.inclusions() {
                let x = number(row, "x_m")?;
                // The nearer lump of a pair.
                let places = [
                    turned([x, 0.0]),
                    turned([if is_pair { -x } else { x }, 0.0]),
                ];
                let away = |place: &[f64; 2]| {
                    let told = inclusion
                        .position_m
                        .map_or([0.0; 2], |at| at.map(|x| x.value));
                    (told[0] - place[0]).hypot(told[1] - place[1])
                };
                let nearest = places
                    .into_iter()
                    .min_by(|a, b| away(a).total_cmp(&away(b)));
                print_lump(inclusion, nearest.unwrap_or_default(), truth);
            }
            println!("; {:?}", estimate.warnings);
        }
    }
    Ok(())
}
