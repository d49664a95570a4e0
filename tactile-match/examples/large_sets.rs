//! Time, memory and correct pairs of large sets in space under a smooth deformation of a tenth of
//! their size, shuffled.
//!
//! ```text
//! cargo run --release -p tactile-match --example large_sets -- POINTS [surface|volume] [NOISE OUTLIERS [SEED]]
//! ```
//!
//! Noise is a standard deviation per axis as a fraction of the size (the largest extent), and
//! outliers are a fraction of the points. Memory is the peak of the whole process (Linux).
#![allow(clippy::print_stdout)]
use nalgebra::{Point3, Vector3};
use std::ops::ControlFlow;
use std::time::Instant;
use tactile_match::{AnnealedSoftassign, SoftassignWorkspace};

#[path = "support/disc.rs"]
mod disc;
#[path = "support/stream.rs"]
mod stream;
use disc::disc;
use stream::Stream;

/// A bell over a jittered disc of diameter 2, or random points in a cube of side 2.
fn points(n: usize, surface: bool, stream: &mut Stream) -> Vec<Point3<f64>> {
    if surface {
        return disc(n, 0.15, stream);
    }
    let mut place = || Point3::from(Vector3::from_fn(|_, _| 2.0 * stream.next() - 1.0));
    (0..n).map(|_| place()).collect()
}

/// Six broad Gaussian bumps whose root mean square displacement is a tenth of the size.
fn deform(model: &[Point3<f64>], stream: &mut Stream) -> Vec<Point3<f64>> {
    let mut vector = |size: f64| Vector3::from_fn(|_, _| size * (2.0 * stream.next() - 1.0));
    let bumps: Vec<_> = (0..6).map(|_| (vector(1.2), vector(1.0))).collect();
    let field = |p: &Point3<f64>| -> Vector3<f64> {
        let at = |(c, a): &(Vector3<f64>, Vector3<f64>)| {
            a * (-(p.coords - c).norm_squared() / 1.28).exp()
        };
        bumps.iter().map(at).sum()
    };
    let squares: f64 = model.iter().map(|p| field(p).norm_squared()).sum();
    let factor = 0.1 * 2.0 / (squares / model.len() as f64).sqrt();
    model.iter().map(|p| p + field(p) * factor).collect()
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |at: usize| {
        arguments
            .get(at)
            .map_or(Ok(0.0), |text| text.parse::<f64>())
    };
    let n = number(0)? as usize;
    let surface = arguments.get(1).is_none_or(|kind| kind == "surface");
    let (noise, outliers) = (2.0 * number(2)?, number(3)?);
    let mut stream = Stream(n as u64 + 7919 * number(4)? as u64);
    let model = points(n, surface, &mut stream);
    let truth = deform(&model, &mut stream);
    let order = stream.permutation(n);
    let mut target: Vec<_> = order
        .iter()
        .map(|&i| truth[i] + Vector3::from_fn(|_, _| noise * stream.normal()))
        .collect();
    let clutter = (outliers * n as f64) as usize;
    target.extend(
        (0..clutter).map(|_| Point3::from(Vector3::from_fn(|_, _| 2.4 * stream.next() - 1.2))),
    );

    let mut workspace = SoftassignWorkspace::default();
    let start = Instant::now();
    let found =
        AnnealedSoftassign::default().match_points_with(&mut workspace, &model, &target, || {
            ControlFlow::Continue(())
        })?;
    let searched = start.elapsed();
    let is_right = |(i, j): (usize, &Option<usize>)| j.and_then(|j| order.get(j)) == Some(&i);
    let right = found
        .assignment
        .iter()
        .enumerate()
        .filter(|&pair| is_right(pair))
        .count();
    let width = 3.0 * noise.max(1e-3);
    let within = found
        .warped()
        .zip(&truth)
        .filter(|(w, t)| (w - *t).norm() < width)
        .count();
    let report = &found.report;
    let share = |count: usize| 100.0 * count as f64 / n as f64;
    println!("{n} points, noise {noise}, {clutter} outliers");
    println!(
        "  search {:.2} s, {:.2} % right, {:.2} % within {width}",
        searched.as_secs_f64(),
        share(right),
        share(within)
    );
    println!(
        "  {:?}, {} iterations, sigma {:.2e}, doubt {:?}",
        report.stop,
        report.iterations,
        report.sigma,
        report.doubt()
    );
    let peak = || {
        let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
        status.lines().find_map(|line| {
            line.strip_prefix("VmHWM:")
                .map(|rest| rest.trim().to_owned())
        })
    };
    println!("  memory {}", peak().unwrap_or_default());
    let matching = found.to_matching(&model);
    let error = matching
        .warped
        .iter()
        .zip(&truth)
        .map(|(w, t)| (w - t).norm())
        .sum::<f64>()
        / n as f64;
    println!(
        "  with spline, soft matches and covariances {:.2} s, memory {}, mean error {error:.2e}",
        start.elapsed().as_secs_f64(),
        peak().unwrap_or_default()
    );
    Ok(())
}
