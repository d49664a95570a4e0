//! Accuracy of gels lit in colours, on scenes with exactly known results.
//!
//! `cargo run --release -p tactile-gel --example exact_worlds -- [WORLDS] [FIRST SEED]` renders
//! contacts of 10 to 80 px with slopes from 0.03 to 1.2, on a half-space and on a bonded layer,
//! under many lamps. It also renders untouched frames, frames of this sensor and frames of other
//! sensors. It prints which results are within their bounds.

#![allow(clippy::print_stdout)]

use std::collections::BTreeMap;
use std::time::Instant;

use ndarray::{Array2, Array3, Axis, s};
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use tactile_core::Estimate;
use tactile_gel::simulate::{ColourGel, ElasticFace, HertzPress};
use tactile_gel::{BallPress, GelForce, GelLayer, GelSensor};

const PIXEL_M: f64 = 5e-5;
const BALL_PX: f64 = 40.0;
const LAYER_M: f64 = 4e-3;
const RATIO: f64 = 0.48;
const MODULUS_PA: f64 = 1e5;
/// Number of scenes under the same lamps.
const WORLDS_PER_GEL: u64 = 20;

fn main() {
    let mut arguments = std::env::args().skip(1).filter_map(|n| n.parse().ok());
    let worlds: u64 = arguments.next().unwrap_or(200);
    let seed: u64 = arguments.next().unwrap_or(5_000_000);
    exact(worlds, seed);
    frames(5 * worlds, seed);
    times(seed);
}

/// A gel under its own lamps, and its calibration on twenty balls.
struct Unit {
    gel: ColourGel,
    sensor: GelSensor,
    layer: bool,
    /// Duration of the calibration in seconds.
    seconds: f64,
}

fn face(layer: bool) -> ElasticFace {
    match layer {
        true => ElasticFace {
            thickness_px: LAYER_M / PIXEL_M,
            poisson_ratio: RATIO,
        },
        false => ElasticFace::HALF_SPACE,
    }
}

fn flat(gel: &ColourGel, seed: u64) -> Array3<u8> {
    gel.frame(&Array2::zeros((gel.shape[0], gel.shape[1])), seed)
}

impl Unit {
    fn new(shape: [usize; 2], seed: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut draw = |low: f64, high: f64| low + (high - low) * random.random::<f64>();
        let gel = ColourGel {
            shape,
            elevation: draw(28.0, 50.0).to_radians(),
            fall_off: draw(0.2, 0.6),
            turn: draw(0.0, 2.0),
            lamps: [(); 3].map(|()| draw(0.8, 1.1)),
            noise: draw(0.6, 1.5),
            ..ColourGel::default()
        };
        let layer = draw(0.0, 1.0) < 0.5;
        let frames = (0..20_u64).map(|k| {
            let at = [
                draw(0.15, 0.85) * shape[1] as f64,
                draw(0.2, 0.8) * shape[0] as f64,
            ];
            // Every fifth press is deep, for steep slopes.
            let reach = if k % 5 == 0 {
                draw(0.8, 1.2)
            } else {
                draw(0.2, 0.7)
            };
            let press = HertzPress::ball(at, BALL_PX, reach * BALL_PX);
            gel.frame(&face(layer).depth_px(shape, &[press]), seed + k)
        });
        let frames: Vec<_> = frames.collect();
        let presses = frames
            .iter()
            .map(|frame| BallPress::new(frame, BALL_PX * PIXEL_M));
        let presses: Vec<_> = presses.collect();
        let reference = flat(&gel, seed + 90);
        let start = Instant::now();
        let found = GelSensor::calibrate(reference.view(), PIXEL_M, &presses);
        let seconds = start.elapsed().as_secs_f64();
        let (sensor, report) = found.expect("twenty presses");
        if !report.doubts.is_empty() {
            println!("calibration {seed}: {:?}", report.doubts);
        }
        Self {
            gel,
            sensor,
            layer,
            seconds,
        }
    }
}

/// Relative errors, and the number of intervals that contain the true value.
#[derive(Default)]
struct Tally {
    errors: Vec<f64>,
    z: Vec<f64>,
}

impl Tally {
    fn add(&mut self, found: Estimate, truth: f64) -> String {
        self.errors.push(found.value / truth - 1.0);
        self.z.push((found.value - truth) / found.standard_error);
        format!(
            "{:.3} ± {:.3}",
            found.value / truth,
            found.standard_error / truth
        )
    }

    fn print(&self, name: &str) {
        let mut sorted: Vec<f64> = self.errors.iter().map(|e| e.abs()).collect();
        sorted.sort_by(f64::total_cmp);
        let n = sorted.len();
        let within = |bound: f64| sorted.iter().filter(|e| **e < bound).count();
        let held = self.z.iter().filter(|z| z.abs() < 1.96).count();
        let mean = self.errors.iter().sum::<f64>() / n as f64;
        println!(
            "{name:12} {n}: median error {:.2} %, mean {:+.2} %, within 10 % {:.1} %, intervals hold {:.1} %",
            100.0 * sorted[n / 2],
            100.0 * mean,
            100.0 * within(0.1) as f64 / n as f64,
            100.0 * held as f64 / n as f64
        );
    }
}

fn exact(worlds: u64, seed: u64) {
    let layer = GelLayer::new(LAYER_M, RATIO, [MODULUS_PA, 0.0]);
    let stiff = MODULUS_PA / (1.0 - RATIO * RATIO);
    let mut tallies: BTreeMap<&str, Tally> = BTreeMap::new();
    let (mut missed, mut doubted, mut more) = (0, 0, 0);
    let mut unit = Unit::new([240, 320], seed);
    let mut law = GelForce::new(&layer, &unit.sensor).expect("a layer");
    for k in 0..worlds {
        if k > 0 && k % WORLDS_PER_GEL == 0 {
            unit = Unit::new([240, 320], seed + 1000 * k);
            law = GelForce::new(&layer, &unit.sensor).expect("a layer");
        }
        let mut random = ChaCha8Rng::seed_from_u64(seed + 7 * k + 3);
        let mut draw = |low: f64, high: f64| low + (high - low) * random.random::<f64>();
        let radius = 10.0 * 8_f64.powf(draw(0.0, 1.0));
        let slope = 0.03 * 40_f64.powf(draw(0.0, 1.0));
        let room = radius + 12.0;
        let at = [
            draw(room.min(150.0), (320.0 - room).max(170.0)),
            draw(room.min(110.0), (240.0 - room).max(130.0)),
        ];
        let press = HertzPress::ball(at, radius / slope, radius);
        let face = face(unit.layer);
        let truth = face.depth_px(unit.gel.shape, &[press]);
        let frame = unit.gel.frame(&truth, seed + 11 * k);
        let frame = unit.sensor.read(&frame).expect("its shape");
        doubted += usize::from(!frame.doubts.is_empty());
        more += usize::from(frame.contacts.len() > 1);
        let start = format!(
            "{k} {} a {radius:.1} slope {slope:.3}",
            if unit.layer { "layer" } else { "half" }
        );
        let Some(contact) = frame.contacts.first() else {
            missed += 1;
            println!("{start}: missed, {:?}", frame.doubts);
            continue;
        };
        let ring = HertzPress {
            at_px: [0.0, 0.0],
            ..press
        };
        let ring = face.depth_px([1, 200], &[ring]);
        let (low, share) = (radius.floor() as usize, radius.fract());
        let rim = ring[[0, low]] + share * (ring[[0, low + 1]] - ring[[0, low]]);
        let top = ring[[0, 0]];
        let mut tally = |name, found, truth| tallies.entry(name).or_default().add(found, truth);
        let area = core::f64::consts::PI * (radius * PIXEL_M).powi(2);
        let area = tally("area", contact.area_m2, area);
        let rim = tally("below rim", contact.depth_m, (top - rim) * PIXEL_M);
        let far = tally("below far", contact.depth_below_far_m, top * PIXEL_M);
        let mut force = String::new();
        if unit.layer {
            let found = law.forces(&frame)[0];
            force = tally("force", found, press.force_n(stiff, PIXEL_M));
        }
        println!(
            "{start}: area {area} rim {rim} far {far} force {force} contacts {} {:?}",
            frame.contacts.len(),
            frame.doubts
        );
    }
    println!("{worlds} worlds: {missed} missed, {doubted} doubted, {more} with further contacts");
    tallies.iter().for_each(|(name, tally)| tally.print(name));
}

/// A press at a random position.
fn pressed(unit: &Unit, gel: &ColourGel, seed: u64) -> Array3<u8> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut draw = |low: f64, high: f64| low + (high - low) * random.random::<f64>();
    let at = [draw(80.0, 240.0), draw(70.0, 170.0)];
    let radius = draw(10.0, 30.0);
    let press = HertzPress::ball(at, radius / draw(0.1, 0.8), radius);
    gel.frame(&face(unit.layer).depth_px(gel.shape, &[press]), seed)
}

/// Untouched frames, valid and invalid.
fn frames(untouched: u64, seed: u64) {
    let units: Vec<Unit> = (0..5)
        .map(|k| Unit::new([240, 320], seed + 77_000 + 500 * k))
        .collect();
    let unit = |k: u64| &units[(k % 5) as usize];
    let touched = (0..untouched).filter(|k| {
        let frame = flat(&unit(*k).gel, seed + 13 * k);
        let found = unit(*k).sensor.read(&frame).expect("its shape");
        !found.contacts.is_empty() || !found.doubts.is_empty()
    });
    println!(
        "{untouched} untouched frames: {} with a contact or a doubt",
        touched.count()
    );
    let mut flagged: BTreeMap<String, usize> = BTreeMap::new();
    for k in 0..untouched / 2 {
        let mut random = ChaCha8Rng::seed_from_u64(seed + 17 * k);
        let gel = ColourGel {
            gain: 0.9 + 0.2 * random.random::<f64>(),
            noise: 0.5 + 1.5 * random.random::<f64>(),
            ..unit(k).gel.clone()
        };
        let frame = pressed(unit(k), &gel, seed + 19 * k);
        let found = unit(k).sensor.read(&frame).expect("its shape");
        for doubt in found.doubts {
            *flagged.entry(doubt.kind().to_owned()).or_default() += 1;
        }
    }
    println!("{} right frames, flagged: {flagged:?}", untouched / 2);
    let mut table: BTreeMap<&str, BTreeMap<String, usize>> = BTreeMap::new();
    for k in 0..untouched / 10 {
        let this = unit(k);
        let other = unit(k + 1);
        let frame = match k % 2 {
            0 => pressed(this, &this.gel, seed + 23 * k),
            _ => flat(&this.gel, seed + 23 * k),
        };
        let scaled = |factor: f64| frame.mapv(|v| (factor * f64::from(v)).round().min(255.0) as u8);
        let mut tinted = frame.clone();
        tinted
            .index_axis_mut(Axis(2), (k % 3) as usize)
            .mapv_inplace(|v| (0.75 * f64::from(v)) as u8);
        let noise = {
            let mut random = ChaCha8Rng::seed_from_u64(seed + k);
            Array3::from_shape_simple_fn(frame.dim(), || random.random::<u8>())
        };
        let wrong: [(&str, Array3<u8>); 13] = [
            ("red and blue", frame.slice(s![.., .., ..;-1]).to_owned()),
            ("red and green", {
                Array3::from_shape_fn(frame.dim(), |(r, c, k)| frame[[r, c, [1, 0, 2][k]]])
            }),
            ("half a turn", frame.slice(s![..;-1, ..;-1, ..]).to_owned()),
            ("left to right", frame.slice(s![.., ..;-1, ..]).to_owned()),
            ("top to bottom", frame.slice(s![..;-1, .., ..]).to_owned()),
            ("times 0.5", scaled(0.5)),
            ("times 0.7", scaled(0.7)),
            ("times 1.4", scaled(1.4)),
            ("tinted", tinted),
            ("black", frame.mapv(|_| 0)),
            ("white", frame.mapv(|_| 255)),
            ("noise", noise),
            ("another unit", pressed(other, &other.gel, seed + 29 * k)),
        ];
        for (name, frame) in wrong {
            let found = this.sensor.read(&frame).expect("its shape");
            let kinds: Vec<_> = found.doubts.iter().map(|doubt| doubt.kind()).collect();
            let word = if kinds.is_empty() {
                "SILENT".into()
            } else {
                kinds.join(" ")
            };
            *table.entry(name).or_default().entry(word).or_default() += 1;
        }
    }
    for (name, found) in table {
        println!("{name:14} {found:?}");
    }
}

fn times(seed: u64) {
    for shape in [[240, 320], [480, 640]] {
        let unit = Unit::new(shape, seed);
        let frame = pressed(&unit, &unit.gel, seed);
        let mut each: Vec<f64> = (0..200)
            .map(|_| {
                let start = Instant::now();
                let found = unit.sensor.read(&frame).expect("its shape");
                assert!(!found.contacts.is_empty());
                1e3 * start.elapsed().as_secs_f64()
            })
            .collect();
        each.sort_by(f64::total_cmp);
        println!(
            "{shape:?}: a frame {:.2} ms in the median, {:.2} ms at least; calibration of 20 presses {:.2} s",
            each[100], each[0], unit.seconds
        );
    }
}
