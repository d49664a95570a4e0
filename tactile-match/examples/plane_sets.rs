//! Time and correct pairs of large sets in the plane, unchanged or displaced, with noise and
//! missing points, compared with pairing each target with the point nearest to its true position.
//! With σ in mean spacings, a fraction πσ² of random points have a neighbour that explains their
//! target better: no matcher can distinguish them.
//!
//! ```text
//! cargo run --release -p tactile-match --example plane_sets -- POINTS [NOISE [MOTION [MISSING [SEED]]]]
//! ```
//!
//! Noise is in mean spacings, MOTION is `still`, `drift`, `stretch`, `bend` or `all`.
#![allow(clippy::print_stdout)]
use nalgebra::{Point2, SVector};
use std::f64::consts::{PI, TAU};
use std::ops::ControlFlow;
use std::time::Instant;
use tactile_match::{AnnealedSoftassign, SoftassignWorkspace};

#[path = "support/stream.rs"]
mod stream;
use stream::Stream;

/// Displaced position of a point of the unit square.
fn image(motion: &str, p: &Point2<f64>) -> Point2<f64> {
    let (drift, stretch, bend) = match motion {
        "drift" => (0.05, 1.0, 0.0),
        "stretch" => (0.0, 1.05, 0.0),
        "bend" => (0.0, 1.0, 0.02),
        "all" => (0.05, 1.05, 0.02),
        _ => (0.0, 1.0, 0.0),
    };
    Point2::new(
        stretch * p.x + bend * (PI * p.y).sin() + drift,
        p.y + bend * (TAU * p.x).sin() - 0.5 * drift,
    )
}

/// Row of the nearest point to each position, by cells of a mean spacing.
fn nearest(places: &[Point2<f64>], points: &[Point2<f64>], spacing: f64) -> Vec<Option<usize>> {
    let mut cells = std::collections::HashMap::<[i64; 2], Vec<usize>>::new();
    let cell = |p: &Point2<f64>| [0, 1].map(|k| (p[k] / spacing).floor() as i64);
    for (j, p) in points.iter().enumerate() {
        cells.entry(cell(p)).or_default().push(j);
    }
    let find = |p: &Point2<f64>| {
        let [x, y] = cell(p);
        let around = (-1..=1).flat_map(|a| (-1..=1).map(move |b| [x + a, y + b]));
        let near = around.filter_map(|c| cells.get(&c)).flatten().copied();
        near.min_by(|&a, &b| {
            let square = |j: usize| (points[j] - p).norm_squared();
            square(a).total_cmp(&square(b))
        })
    };
    places.iter().map(find).collect()
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |at: usize, default: f64| {
        arguments
            .get(at)
            .map_or(Ok(default), |text| text.parse::<f64>())
    };
    let n = number(0, 20_000.0)? as usize;
    let noise = number(1, 0.1)? / (n as f64).sqrt();
    let motion = arguments.get(2).map_or("all", String::as_str);
    let (missing, seed) = (number(3, 0.1)?, number(4, 1.0)? as u64);
    let mut stream = Stream(seed);
    let (mut model, mut truth, mut images) = (Vec::new(), Vec::new(), Vec::new());
    for _ in 0..n {
        // Only the unit square is visible, and there are more points outside.
        let p = Point2::new(stream.next(), stream.next()) * 1.2 - SVector::repeat(0.1);
        let inside = |p: &Point2<f64>| p.iter().all(|c| (0.0..1.0).contains(c));
        let place = image(motion, &p);
        let q = place + SVector::<f64, 2>::from_fn(|_, _| noise * stream.normal());
        let (own, other) = (stream.next() >= missing, stream.next() >= missing);
        let row = if inside(&p) && own {
            model.len()
        } else {
            usize::MAX
        };
        if row < n {
            model.push(p);
            truth.push(place);
        }
        if inside(&q) && other {
            images.push((row, q));
        }
    }
    let order = stream.permutation(images.len());
    let mut partner = vec![None; model.len()];
    let target: Vec<_> = order.iter().map(|&k| images[k].1).collect();
    for (j, &k) in order.iter().enumerate() {
        if let Some(own) = partner.get_mut(images[k].0) {
            *own = Some(j);
        }
    }
    let spacing = (n as f64).sqrt().recip();
    let forth = nearest(&truth, &target, spacing);
    let back = nearest(&target, &truth, spacing);
    let mutual = |i: usize| forth[i].filter(|&j| back[j] == Some(i));
    let pairs = partner.iter().flatten().count() as f64;
    let share = |right: usize| 100.0 * right as f64 / pairs;
    let is_right = |i: usize, j: Option<usize>| j.is_some() && j == partner[i];
    let ideal = (0..model.len()).filter(|&i| is_right(i, mutual(i))).count();

    let mut workspace = SoftassignWorkspace::default();
    let start = Instant::now();
    let matcher = AnnealedSoftassign::default();
    let go = || ControlFlow::Continue(());
    let found = matcher.match_points_with(&mut workspace, &model, &target, go)?;
    let seconds = start.elapsed().as_secs_f64();
    let right = (0..model.len())
        .filter(|&i| is_right(i, found.assignment[i]))
        .count();
    println!(
        "{n} {motion} noise {:.2}: {:.2} % right (mutual nearest about the truth {:.2}), {seconds:.2} s, {} iterations, {} starts, {:?}, sigma {:.3}",
        noise / spacing,
        share(right),
        share(ideal),
        found.report.iterations,
        found.report.starts,
        found.report.doubt(),
        found.report.sigma / spacing,
    );
    Ok(())
}
