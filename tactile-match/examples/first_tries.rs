//! Inputs on which a new user tries the default matcher: the same points twice, drifts, lattices
//! that extend beyond the view, noisy grids, partial overlaps, stretched and bent planes. For every
//! family, the numbers of results are printed that are correct, refused (with a doubt) and wrong
//! without a doubt.
//!
//! ```text
//! cargo run --release -p tactile-match --example first_tries -- [ROUNDS] [FAMILY ...]
//! ```
//!
//! Every round has seeds, turns and shifts of its own.
//!
//! A result is correct if at least 99 of 100 true pairs are found (97 with noise, because random
//! points closer than the noise are exchanged). It is wrong if fewer than nine of ten found pairs,
//! or fewer than half of the true pairs, are correct.
#![allow(clippy::print_stdout)]
use nalgebra::{Point, Point2, SVector};
use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::time::Instant;
use tactile_match::{AnnealedSoftassign, Doubt, MatchError, SoftassignWorkspace};

#[path = "support/stream.rs"]
mod stream;
use stream::Stream;

/// Results of one family.
#[derive(Default)]
struct Tally {
    scenes: usize,
    right: usize,
    refused: usize,
    silent: usize,
    seconds: f64,
    /// Number of the round, from which seeds, turns and shifts follow.
    round: u32,
    doubts: BTreeMap<String, usize>,
}

/// Matches, prints results that are not correct, and counts.
fn judge<const D: usize>(
    tally: &mut Tally,
    name: &str,
    model: &[Point<f64, D>],
    target: &[Point<f64, D>],
    partner: &[Option<usize>],
    wanted: f64,
) -> Result<(), MatchError> {
    let mut workspace = SoftassignWorkspace::default();
    let start = Instant::now();
    let go = || ControlFlow::Continue(());
    let matcher = AnnealedSoftassign::default();
    let found = matcher.match_points_with(&mut workspace, model, target, go)?;
    let seconds = start.elapsed().as_secs_f64();
    let rows = found.assignment.iter().zip(partner);
    let right = rows
        .filter(|(found, own)| own.is_some() && found == own)
        .count() as f64;
    let pairs = found.assignment.iter().flatten().count() as f64;
    let share = right / partner.iter().flatten().count() as f64;
    let doubt: Option<Doubt> = found.report.doubt();
    tally.scenes += 1;
    tally.seconds += seconds;
    let doubted = doubt.is_some();
    let is_right = share >= wanted;
    tally.right += usize::from(is_right && !doubted);
    tally.refused += usize::from(doubted);
    let silent = !doubted && (right < 0.9 * pairs || share < 0.5);
    tally.silent += usize::from(silent);
    if let Some(doubt) = doubt {
        *tally
            .doubts
            .entry(format!("{doubt:?}").chars().take(8).collect())
            .or_default() += 1;
    }
    if !is_right || doubted {
        println!(
            "  {name}: {:.1} % of the true pairs, {pairs} found, {seconds:.2} s, {} starts, {doubt:?}{}",
            100.0 * share,
            found.report.starts,
            if silent { ", SILENT" } else { "" }
        );
    }
    Ok(())
}

/// Targets in a new order, with the row of the partner of each model point.
fn shuffle<const D: usize>(
    images: &[(usize, Point<f64, D>)],
    points: usize,
    stream: &mut Stream,
) -> (Vec<Point<f64, D>>, Vec<Option<usize>>) {
    let order = stream.permutation(images.len());
    let mut partner = vec![None; points];
    let mut target = Vec::new();
    for &k in &order {
        let (row, image) = images[k];
        if row < points {
            partner[row] = Some(target.len());
        }
        target.push(image);
    }
    (target, partner)
}

/// Random points of the unit cube.
fn random<const D: usize>(n: usize, stream: &mut Stream) -> Vec<Point<f64, D>> {
    (0..n)
        .map(|_| Point::from(SVector::from_fn(|_, _| stream.next())))
        .collect()
}

/// A lattice seen through a window of 20 spacings, before and after `change`.
fn lattice(
    tally: &mut Tally,
    hex: bool,
    noise: f64,
    turn: f64,
    shift: f64,
    seed: u64,
) -> Result<(), MatchError> {
    let mut stream = Stream(seed);
    let (sin, cos) = turn.to_radians().sin_cos();
    let (mut before, mut after) = (Vec::new(), Vec::new());
    let inside = |p: &Point2<f64>| p.iter().all(|c| (0.0..200.0).contains(c));
    for row in -20..40_i32 {
        for column in -20..40_i32 {
            let (x, y) = (10.0 * f64::from(column) + 5.0, 10.0 * f64::from(row) + 5.0);
            let p = if hex {
                Point2::new(x + 5.0 * f64::from(row.rem_euclid(2)), y * 0.75_f64.sqrt())
            } else {
                Point2::new(x, y)
            };
            let q = p - Point2::new(100.0, 100.0);
            let q = Point2::new(
                100.0 + cos * q.x - sin * q.y + 10.0 * shift,
                100.0 + sin * q.x + cos * q.y,
            );
            let mut noisy =
                |p: Point2<f64>| p + SVector::<f64, 2>::from_fn(|_, _| noise * stream.normal());
            let (p, q) = (noisy(p), noisy(q));
            let own = inside(&p);
            if inside(&q) {
                after.push((if own { before.len() } else { usize::MAX }, q));
            }
            if own {
                before.push(p);
            }
        }
    }
    let (target, partner) = shuffle(&after, before.len(), &mut stream);
    let name = format!(
        "{} noise {noise} turn {turn:.2} shift {shift:.2}",
        if hex { "hex" } else { "square" }
    );
    judge(tally, &name, &before, &target, &partner, 0.99)
}

fn lattices(tally: &mut Tally) -> Result<(), MatchError> {
    // In every round other angles and steps, and other seeds.
    let (more, seeds) = (f64::from(tally.round), 100 * u64::from(tally.round));
    for hex in [false, true] {
        for noise in [0.0, 0.02, 0.1, 0.5] {
            for turn in [3.0, 5.0, 9.0, 14.0, 21.0, 26.0] {
                lattice(tally, hex, noise, turn + 0.37 * more, 0.0, 7 + seeds)?;
            }
            for shift in [0.1, 0.3, 0.6, 0.8, 1.4] {
                lattice(tally, hex, noise, 0.0, shift + 0.05 * more, 8 + seeds)?;
            }
        }
    }
    Ok(())
}

/// Points of the unit square and their displaced positions, with noise and missing points on each
/// side.
#[allow(clippy::too_many_arguments)]
fn plane(
    tally: &mut Tally,
    name: &str,
    n: usize,
    image: &dyn Fn(&Point2<f64>) -> Point2<f64>,
    noise: f64,
    missing: f64,
    crop: bool,
    seed: u64,
) -> Result<(), MatchError> {
    let mut stream = Stream(seed);
    let world: Vec<Point2<f64>> = random(n, &mut stream)
        .iter()
        .map(|p| {
            if crop {
                Point2::from(p.coords * 1.4 - SVector::repeat(0.2))
            } else {
                *p
            }
        })
        .collect();
    let noise = noise * if crop { 1.4 } else { 1.0 } / (n as f64).sqrt();
    let inside = |p: &Point2<f64>| !crop || p.iter().all(|c| (0.0..1.0).contains(c));
    let (mut model, mut images) = (Vec::new(), Vec::new());
    for p in &world {
        let q = image(p) + SVector::<f64, 2>::from_fn(|_, _| noise * stream.normal());
        let own = inside(p) && stream.next() >= missing;
        if inside(&q) && stream.next() >= missing {
            images.push((if own { model.len() } else { usize::MAX }, q));
        }
        if own {
            model.push(*p);
        }
    }
    let (target, partner) = shuffle(&images, model.len(), &mut stream);
    let wanted = if noise > 0.0 { 0.95 } else { 0.99 };
    judge(
        tally,
        &format!("{name} {n}"),
        &model,
        &target,
        &partner,
        wanted,
    )
}

fn still(tally: &mut Tally) -> Result<(), MatchError> {
    let seeds = 100 * u64::from(tally.round);
    for n in [10, 30, 100, 1000, 5000, 20_000] {
        plane(tally, "same", n, &|p| *p, 0.0, 0.0, false, 1 + seeds)?;
    }
    for (n, drift) in [
        (16_000, 0.05),
        (32_000, 0.01),
        (32_000, 0.03),
        (60_000, 0.004),
    ] {
        let image = |p: &Point2<f64>| p + SVector::<f64, 2>::new(drift, 0.0);
        plane(
            tally,
            &format!("drift {drift}"),
            n,
            &image,
            0.0,
            0.0,
            true,
            2 + seeds,
        )?;
    }
    Ok(())
}

fn bent(tally: &mut Tally, sizes: &[usize]) -> Result<(), MatchError> {
    for &n in sizes {
        for (stretch, bend, noise, missing) in [
            (1.02, 0.01, 0.1, 0.05),
            (1.05, 0.02, 0.1, 0.1),
            (1.02, 0.02, 0.2, 0.1),
        ] {
            let image = |p: &Point2<f64>| {
                Point2::new(
                    stretch * p.x + bend * (std::f64::consts::PI * p.y).sin(),
                    p.y + bend * (std::f64::consts::TAU * p.x).sin(),
                )
            };
            let before = tally.seconds;
            let name = format!("stretch {stretch} bend {bend} noise {noise}");
            let seed = 3 + 100 * u64::from(tally.round);
            plane(tally, &name, n, &image, noise, missing, false, seed)?;
            println!("  {n} {name}: {:.2} s", tally.seconds - before);
        }
    }
    Ok(())
}

/// Noisy grids of 9 by 7 markers, slightly shifted.
fn grids(tally: &mut Tally) -> Result<(), MatchError> {
    for seed in 0..40 {
        let mut stream = Stream(seed + 1000 * u64::from(tally.round));
        let (mut model, mut target) = (Vec::new(), Vec::new());
        for k in 0..63_u32 {
            let p = Point2::new(10.0 * f64::from(k % 9), 10.0 * f64::from(k / 9));
            let mut noisy =
                |p: Point2<f64>| p + SVector::<f64, 2>::from_fn(|_, _| 0.1 * stream.normal());
            model.push(noisy(p));
            target.push(noisy(p + SVector::<f64, 2>::new(1.3, -0.7)));
        }
        let partner: Vec<_> = (0..63).map(Some).collect();
        judge(
            tally,
            &format!("grid {seed}"),
            &model,
            &target,
            &partner,
            1.0,
        )?;
    }
    Ok(())
}

/// Points in space, 70 % of which are in both sets.
fn overlaps(tally: &mut Tally) -> Result<(), MatchError> {
    for seed in 0..48 {
        let mut stream = Stream(seed + 100 + 1000 * u64::from(tally.round));
        let n = 60 + 20 * (seed as usize % 3);
        let world = random::<3>(n, &mut stream);
        let noise = if seed % 2 == 0 { 0.003 } else { 0.0 };
        let (mut model, mut images) = (Vec::new(), Vec::new());
        for p in &world {
            let own = p.x < 0.85;
            if p.x > 0.15 {
                let q = p + SVector::<f64, 3>::from_fn(|_, _| noise * stream.normal());
                images.push((if own { model.len() } else { usize::MAX }, q));
            }
            if own {
                model.push(*p);
            }
        }
        let (target, partner) = shuffle(&images, model.len(), &mut stream);
        judge(
            tally,
            &format!("overlap {seed}"),
            &model,
            &target,
            &partner,
            0.97,
        )?;
    }
    Ok(())
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut chosen: Vec<String> = std::env::args().skip(1).collect();
    let rounds: u32 = chosen
        .first()
        .and_then(|text| text.parse().ok())
        .unwrap_or(1);
    chosen.retain(|word| word.parse::<u32>().is_err());
    for family in [
        "lattices", "grids", "overlaps", "still", "medium", "large", "huge",
    ] {
        if !chosen.is_empty() && !chosen.iter().any(|name| name == family) {
            continue;
        }
        let mut tally = Tally::default();
        for round in 0..rounds {
            tally.round = round;
            match family {
                "lattices" => lattices(&mut tally)?,
                "grids" => grids(&mut tally)?,
                "overlaps" => overlaps(&mut tally)?,
                "still" => still(&mut tally)?,
                "medium" => bent(&mut tally, &[300, 1000, 3300, 3900, 7600])?,
                "large" => bent(&mut tally, &[20_000])?,
                _ => bent(&mut tally, &[100_000])?,
            }
        }
        println!(
            "{family}: {} scenes, {} right, {} refused, {} silent, {:.2} s, {:?}",
            tally.scenes, tally.right, tally.refused, tally.silent, tally.seconds, tally.doubts
        );
    }
    Ok(())
}
