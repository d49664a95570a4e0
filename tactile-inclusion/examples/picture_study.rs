//! Errors of the search in the whole face, on a folder of blocks solved in three dimensions.
//!
//! ```text
//! cargo run --release -p tactile-inclusion --example picture_study -- FOLDER [DRAWS] [NAMES] [scan] [hand=MM] [wide]
//! ```
//!
//! FOLDER contains `scenes.csv` and for every scene a file `NAME.csv` (load_index, x_m, y_m,
//! pressure_pa), as created by `evidence/inclusion_pictures.py` with CalculiX. The grid of 0.5 mm
//! covers half of the face, or a quarter if the lump has a twin. Every scene is rotated about the
//! axis, sampled on cells of 1 mm, and searched with DRAWS draws of the errors of the sensor. NAMES
//! selects the scenes whose names begin with one of them, separated by commas.
//!
//! With `scan`, scenes of one lump at several distances from the axis, with names `LUMP_x…`, are the
//! presses of scans. Each draw has one to four presses in random directions from the lump, on cells
//! of 2 mm, placed with an error of 0.2 mm. With `hand=MM` this error is MM mm, and each approach of
//! each press has an error of 0.2 mm.
//!
//! With `wide`, each draw is a scan of 60 × 60 mm with five or nine presses, 22 mm apart along x and
//! y. Those at two opposite corners have a lump beside them, on the outer side. The others show the
//! scene `plain`.
#![allow(clippy::print_stdout)]

#[path = "inclusion_study/shared.rs"]
mod shared;

use core::ops::ControlFlow;
use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};
use shared::{Row, guide, normal, number, table, text, wave};
use std::collections::{BTreeMap, HashMap};
use std::error::Error;
use std::path::Path;
use tactile_fem::Interface;
use tactile_inclusion::{
    Identifiable, Inclusion, InclusionSearch, PressureProfile, Scan, ScanPress, SensorErrors,
    TissueBlock,
};

/// Distance of neighbouring presses of a wide scan along x and y, in metres.
const WIDE_STEP_M: f64 = 22e-3;

type Outcome<T> = Result<T, Box<dyn Error>>;

/// A solved scene: pressures of each load over the approach, on cells with the given centres.
struct Picture {
    row: Row,
    /// Distance of the lump's centre from the axis, along x.
    aside_m: f64,
    approaches_m: Vec<f64>,
    positions_m: Vec<[f64; 2]>,
    pressures_pa: Vec<Vec<f64>>,
}

impl Picture {
    /// The pressure image of a scene's file, mirrored to the whole face, on cells `width` mm wide.
    fn new(folder: &Path, row: &Row, width: i64) -> Outcome<Self> {
        let is_quarter = number(row, "twin_at_minus_x")? > 0.0;
        let approaches_m: Outcome<Vec<f64>> = (1..=3)
            .map(|load| number(row, &format!("approach_{load}_m")))
            .collect();
        let approaches_m = approaches_m?;
        let mut known: Vec<HashMap<[i64; 2], f64>> = vec![HashMap::new(); approaches_m.len()];
        for point in table(&folder.join(format!("{}.csv", text(row, "scene")?)))? {
            let load = number(&point, "load_index")? as usize - 1;
            // Grid indices.
            let [x, y] = [number(&point, "x_m")?, number(&point, "y_m")?];
            let [x, y] = [x, y].map(|value| (value / 0.5e-3).round() as i64);
            // Near the outer part of the mirror plane between two lumps, the pressure is that of
            // nodes whose elements are cut there: it is wrong by up to a tenth within a millimetre.
            if is_quarter && x <= 2 && y > 11 {
                continue;
            }
            let pressure = number(&point, "pressure_pa")?;
            for sign_x in if is_quarter { vec![-1, 1] } else { vec![1] } {
                for sign_y in [-1, 1] {
                    known[load].insert([sign_x * x, sign_y * y], pressure);
                }
            }
        }
        let mut picture = Self {
            row: row.clone(),
            aside_m: number(row, "x_m")?,
            pressures_pa: vec![Vec::new(); approaches_m.len()],
            approaches_m,
            positions_m: Vec::new(),
        };
        let side = 2 * width;
        let points = || (0..side).flat_map(|a| (0..side).map(move |b| [a, b]));
        for i in -14 / width..14 / width {
            for k in -14 / width..14 / width {
                let mean = |known: &HashMap<[i64; 2], f64>| -> Option<f64> {
                    let at = |[a, b]: [i64; 2]| known.get(&[side * i + a, side * k + b]).copied();
                    let values: Option<Vec<f64>> = points().map(at).collect();
                    Some(values?.iter().sum::<f64>() / (side * side) as f64)
                };
                let means: Option<Vec<f64>> = known.iter().map(mean).collect();
                if let Some(means) = means {
                    let middle =
                        |index: i64| 0.5e-3 * ((side * index) as f64 + 0.5 * (side - 1) as f64);
                    picture.positions_m.push([middle(i), middle(k)]);
                    let pairs = picture.pressures_pa.iter_mut().zip(means);
                    pairs.for_each(|(all, p)| all.push(p));
                }
            }
        }
        Ok(picture)
    }

    /// Pressures at another approach: pressure over approach is a parabola through three loads.
    fn at(&self, approach_m: f64) -> Vec<f64> {
        let weight = |k: usize| {
            let others = (0..3)
                .filter(|other| *other != k)
                .map(|other| self.approaches_m[other]);
            let here = self.approaches_m[k];
            let factors = others.map(|other| (approach_m - other) / (here - other));
            factors.product::<f64>() * approach_m / here
        };
        let weights = [0, 1, 2].map(weight);
        let value = |cell: usize| {
            (0..3)
                .map(|k| weights[k] * self.pressures_pa[k][cell])
                .sum()
        };
        (0..self.positions_m.len()).map(value).collect()
    }
}

/// A smooth random field of unit variance.
struct Field(Vec<([f64; 2], f64)>);

impl Field {
    fn drawn(rng: &mut ChaCha8Rng) -> Self {
        let length_m = SensorErrors::default().correlation_m;
        Self((0..400).map(|_| wave(length_m, rng)).collect())
    }

    fn at(&self, [x, y]: [f64; 2]) -> f64 {
        let waves = self
            .0
            .iter()
            .map(|(wave, phase)| (wave[0] * x + wave[1] * y + phase).cos());
        (2.0 / self.0.len() as f64).sqrt() * waves.sum::<f64>()
    }
}

/// Standard errors of a person or a stage, in metres.
struct Hand {
    place_m: f64,
    each_approach_m: f64,
}

/// A press on this axis, with its lump at an angle from it.
struct Placed<'a> {
    picture: &'a Picture,
    angle: f64,
    axis_m: [f64; 2],
}

impl Placed<'_> {
    fn lump_m(&self) -> [f64; 2] {
        let aside = self.picture.aside_m;
        let [x, y] = self.axis_m;
        [x + aside * self.angle.cos(), y + aside * self.angle.sin()]
    }
}

/// A press with the errors of the sensor: white noise of 0.75 % of the largest pressure on pixels of
/// 86 µm, and the smooth errors of a calibration.
fn press(
    placed: &Placed<'_>,
    stated_m: &[f64],
    common: &Field,
    hand: &Hand,
    rng: &mut ChaCha8Rng,
) -> ScanPress {
    let picture = placed.picture;
    let (sine, cosine) = placed.angle.sin_cos();
    let turned = |[x, y]: [f64; 2]| [x * cosine - y * sine, x * sine + y * cosine];
    let positions_m: Vec<[f64; 2]> = picture.positions_m.iter().map(|at| turned(*at)).collect();
    let sensor = SensorErrors::default();
    let inner = picture.positions_m.iter().map(|[x, y]| x.hypot(*y) < 12e-3);
    let last = picture.pressures_pa.last().into_iter().flatten();
    let largest = last
        .zip(inner)
        .filter(|(_, is_inner)| *is_inner)
        .map(|(p, _)| *p);
    let cell_m = (picture.positions_m[1][1] - picture.positions_m[0][1]).abs();
    let white = 7.5e-3 * largest.fold(0.0, f64::max) * 86e-6 / cell_m;
    let frames = stated_m.iter().map(|stated| {
        let own = Field::drawn(rng);
        let true_m = stated + hand.each_approach_m * normal(rng);
        let each = picture.at(true_m).into_iter().zip(&positions_m);
        let read = each.map(|(pressure, at)| {
            let smooth = sensor.common * common.at(*at) + sensor.each_frame * own.at(*at);
            pressure * (1.0 + smooth) + white * normal(rng)
        });
        let pressure_pa: Vec<f64> = read.collect();
        PressureProfile {
            approach_m: *stated,
            force_n: None,
            standard_error_pa: vec![white; pressure_pa.len()],
            pressure_pa,
        }
    });
    let frames = frames.collect();
    let axis_m = placed.axis_m.map(|x| x + hand.place_m * normal(rng));
    ScanPress {
        axis_m,
        positions_m,
        frames,
    }
}

/// How often the 95 % intervals of each quantity hold.
#[derive(Default)]
struct Tally {
    held: BTreeMap<&'static str, [usize; 2]>,
    confidently_wrong: usize,
}

impl Tally {
    /// Prints and counts a quantity with its true value.
    fn add(&mut self, name: &'static str, value: f64, [low, high]: [f64; 2], truth: f64) -> bool {
        // The interval of a ball's shape may be a single point.
        let slack = 1e-9 * truth.abs();
        let holds = (low - slack..=high + slack).contains(&truth);
        print!(
            "; {name} {value:.3e} [{low:.3e} {high:.3e}]{}",
            if holds { "" } else { " WRONG" }
        );
        let [held, all] = self.held.entry(name).or_default();
        *held += usize::from(holds);
        *all += 1;
        holds
    }

    /// Prints and counts the results for a lump: its true centre and D, d, E₁ and height over width.
    fn add_lump(&mut self, inclusion: &Inclusion, centre_m: [f64; 2], truth: [f64; 4]) {
        if let Some([x, y]) = &inclusion.position_m {
            self.add("x", x.value, x.interval, centre_m[0]);
            self.add("y", y.value, y.interval, centre_m[1]);
            let away = (x.value - centre_m[0]).hypot(y.value - centre_m[1]);
            print!("; {:.3} mm away", 1e3 * away);
        }
        let told = [
            inclusion.diameter_m,
            inclusion.depth_m,
            inclusion.youngs_modulus_pa,
        ];
        for ((name, told), truth) in ["D", "d", "E1"].into_iter().zip(told).zip(truth) {
            let estimated = told.estimate();
            let holds = self.add(name, estimated.value, estimated.interval, truth);
            if matches!(told, Identifiable::No(_)) {
                print!(" open");
            } else {
                self.confidently_wrong += usize::from(!holds);
            }
        }
        if let Some(shape) = &inclusion.height_over_width {
            self.add("κ", shape.value, shape.interval, truth[3]);
            print!(", ball {:.2}", inclusion.ball_probability);
        }
    }

    fn print(&self) {
        for (name, [held, all]) in &self.held {
            print!("{name}: {held} of {all} hold; ");
        }
        println!("told and wrong {}", self.confidently_wrong);
    }
}

/// Presses of a scan with two lumps, beside the presses at two opposite corners.
fn wide<'a>(
    pictures: &'a [Picture],
    is_nine: bool,
    rng: &mut ChaCha8Rng,
) -> Outcome<Vec<Placed<'a>>> {
    let (plain, others): (Vec<&Picture>, Vec<&Picture>) = (pictures.iter())
        .partition(|picture| text(&picture.row, "scene").is_ok_and(|name| name == "plain"));
    let plain = plain.first().ok_or("no plain block")?;
    let lattice = (-1..=1).flat_map(|i: i32| (-1..=1).map(move |k: i32| [i, k]));
    let pressed = lattice.filter(|[i, k]| is_nine || i.abs() == k.abs());
    let placed = pressed.map(|[i, k]| {
        let turn = core::f64::consts::FRAC_PI_2 * (rng.random::<f64>() - 0.5);
        Placed {
            picture: if i + k == 0 && i != 0 {
                others[rng.random_range(0..others.len())]
            } else {
                plain
            },
            angle: f64::from(k).atan2(f64::from(i)) + turn,
            axis_m: [i, k].map(|index| WIDE_STEP_M * f64::from(index)),
        }
    });
    Ok(placed.collect())
}

/// Searches presses, and prints the results.
fn search(
    pictures: &[Placed<'_>],
    stated_m: &[f64],
    hand: &Hand,
    rng: &mut ChaCha8Rng,
    tally: &mut Tally,
) -> Outcome<()> {
    let row = &pictures[0].picture.row;
    let height = number(row, "block_height_m")? * (0.02 * normal(rng)).exp();
    let zero_m = 20e-6 * normal(rng);
    let common = Field::drawn(rng);
    let presses = pictures.iter().map(|placed| {
        let mut press = press(placed, stated_m, &common, hand, rng);
        press
            .frames
            .iter_mut()
            .for_each(|frame| frame.approach_m -= zero_m);
        press
    });
    let mut scan = Scan {
        presses: presses.collect(),
        position_error_m: hand.place_m,
    };
    let is_single = scan.presses.len() == 1;
    if is_single {
        // The place of a single press is the origin.
        scan.presses[0].axis_m = [0.0; 2];
        scan.position_error_m = 0.0;
    }
    let specimen = TissueBlock::new(height, number(row, "block_radius_m")?)?
        .with_each_approach_error_m(hand.each_approach_m)?;
    let specimen = specimen.with_interface(match text(row, "contact")? {
        "bonded" => Interface::Bonded,
        _ => Interface::Frictionless,
    });
    let search = InclusionSearch::new(specimen, guide(number(row, "disc_radius_m")?)?)?;
    let begun = std::time::Instant::now();
    let estimate = search.search_scan(&scan, &mut |_| ControlFlow::Continue(()))?;
    print!(
        "{:.0} s, {:?}, p {:.3}, misfit {:.2}",
        begun.elapsed().as_secs_f64(),
        estimate.verdict(),
        estimate.probability,
        estimate.misfit
    );
    // Place, D, d, E₁ and height over width of each lump.
    let mut truths = Vec::new();
    for placed in pictures {
        let (row, lump_m) = (&placed.picture.row, placed.lump_m());
        let axes = ["axis_x_m", "axis_y_m", "axis_z_m"].map(|name| number(row, name));
        let [x, y, z] = axes;
        let (x, y, z) = (x?, y?, z?);
        let modulus = number(row, "E1_pa")?;
        let diameter = (x * y * z).cbrt();
        let aspect = z / (x * y).sqrt();
        let truth = [diameter, number(row, "depth_m")?, modulus, aspect];
        if modulus != number(row, "E0_pa")? {
            truths.push((lump_m, truth));
        }
        if number(row, "twin_at_minus_x")? > 0.0 {
            truths.push((lump_m.map(|x| -x), truth));
        }
    }
    for inclusion in &estimate.inclusions() {
        let away = |place: [f64; 2]| {
            let known = inclusion.position_m.map(|told| told.map(|x| x.value));
            let [x, y] = known.unwrap_or(place);
            (x - place[0]).hypot(y - place[1])
        };
        let nearest = (truths.iter()).min_by(|a, b| away(a.0).total_cmp(&away(b.0)));
        match nearest {
            Some((place, truth)) => tally.add_lump(inclusion, *place, *truth),
            None => print!("; found where there is none"),
        }
    }
    println!("; {:?}", estimate.warnings);
    Ok(())
}

fn main() -> Outcome<()> {
    let (words, mut arguments): (Vec<String>, Vec<String>) = std::env::args()
        .skip(1)
        .partition(|word| ["scan", "wide"].contains(&word.as_str()) || word.starts_with("hand="));
    arguments.resize(3, String::new());
    let is_wide = words.contains(&"wide".to_owned());
    let is_scan = is_wide || words.contains(&"scan".to_owned());
    let by_hand = words.iter().find_map(|word| word.strip_prefix("hand="));
    let place_mm = by_hand.map_or(Ok(if is_scan { 0.2 } else { 0.0 }), str::parse::<f64>)?;
    let hand = Hand {
        place_m: 1e-3 * place_mm,
        each_approach_m: if by_hand.is_some() { 0.2e-3 } else { 0.0 },
    };
    let [folder, draws, names] = [0, 1, 2].map(|k| arguments[k].as_str());
    let draws: u64 = if draws.is_empty() { 1 } else { draws.parse()? };
    let folder = Path::new(folder);
    let mut lumps: BTreeMap<String, Vec<Picture>> = BTreeMap::new();
    for row in table(&folder.join("scenes.csv"))? {
        let name = text(&row, "scene")?;
        if names.split(',').any(|begin| name.starts_with(begin)) {
            let lump = match (is_wide, is_scan) {
                (true, _) => Some("wide"),
                (_, true) => name.split("_x").next(),
                _ => None,
            };
            let pictures = lumps.entry(lump.unwrap_or(name).to_owned()).or_default();
            pictures.push(Picture::new(folder, &row, if is_scan { 2 } else { 1 })?);
        }
    }
    let mut tally = Tally::default();
    for (index, (name, pictures)) in lumps.iter().enumerate() {
        for draw in 0..draws {
            let mut rng = ChaCha8Rng::seed_from_u64(1000 * draw + index as u64);
            let (mut chosen, count) = match (is_wide, is_scan) {
                (true, _) => (wide(pictures, draw % 2 == 1, &mut rng)?, 0),
                (_, true) => (Vec::new(), rng.random_range(1..=4)),
                _ => (Vec::new(), 1),
            };
            for _ in 0..count {
                let mut placed = Placed {
                    picture: &pictures[rng.random_range(0..pictures.len())],
                    angle: core::f64::consts::TAU * rng.random::<f64>(),
                    axis_m: [0.0; 2],
                };
                if count > 1 {
                    // The lump of a scan is the origin.
                    placed.axis_m = placed.lump_m().map(|x| -x);
                }
                chosen.push(placed);
            }
            print!("{name} {draw}: presses");
            for placed in &chosen {
                print!(" {:.0}", 1e3 * placed.picture.aside_m);
            }
            print!(" mm aside, ");
            // Scans have two approaches.
            let all_m = &pictures[0].approaches_m;
            let stated_m = if is_scan { &all_m[1..] } else { all_m };
            search(&chosen, stated_m, &hand, &mut rng, &mut tally)?;
        }
    }
    tally.print();
    Ok(())
}
