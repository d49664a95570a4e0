//! What the default matcher's confidences and standard deviations are worth, on jittered grids under a smooth deformation with noise.
//!
//! ```text
//! cargo run --release -p tactile-match --example confidence
//! ```
//!
//! Prints for every tenth of confidence the pairs, their mean confidence and the share that is right, the share of coordinates within one
//! standard deviation of the truth, and the scenes of stretched and cropped sets with less than 98 % right pairs.
#![allow(clippy::print_stdout)]
use nalgebra::{Point, SVector};
use tactile_match::{AnnealedSoftassign, MatchError, Matching, PointMatcher};

#[path = "support/stream.rs"]
mod stream;
use stream::Stream;

/// A model, where its points truly go, and targets, of which `order` tells the model rows.
struct Scene<const D: usize> {
    model: Vec<Point<f64, D>>,
    truth: Vec<Point<f64, D>>,
    target: Vec<Point<f64, D>>,
    order: Vec<usize>,
}

impl<const D: usize> Scene<D> {
    /// `n` points of a jittered grid of the unit cube, moved by `warp`; seen are those that `window` holds along x.
    fn new(
        n: usize,
        warp: impl Fn(&Point<f64, D>) -> Point<f64, D>,
        noise: f64,
        outliers: f64,
        seed: u64,
        window: std::ops::Range<f64>,
    ) -> Self {
        let mut stream = Stream(seed);
        let side = (n as f64).powf(1.0 / D as f64).ceil() as usize;
        let cells = stream.permutation(side.pow(D as u32));
        let mut place = |cell: usize| {
            let at = |d: usize| (cell / side.pow(d as u32) % side) as f64;
            Point::from(SVector::from_fn(|d, _| {
                (at(d) + 0.25 + 0.5 * stream.next()) / side as f64
            }))
        };
        let model: Vec<Point<f64, D>> = cells[..n].iter().map(|&cell| place(cell)).collect();
        let truth: Vec<_> = model.iter().map(warp).collect();
        let mut order = stream.permutation(n);
        order.retain(|&i| window.contains(&truth[i][0]));
        let spacing = (n as f64).powf(-1.0 / D as f64);
        let mut target: Vec<_> = order
            .iter()
            .map(|&i| truth[i] + SVector::from_fn(|_, _| noise * spacing * stream.normal()))
            .collect();
        let clutter = (outliers * order.len() as f64) as usize;
        target.extend((0..clutter).map(|_| Point::from(SVector::from_fn(|_, _| stream.next()))));
        Self {
            model,
            truth,
            target,
            order,
        }
    }

    fn matched(&self) -> Result<Matching<f64, D>, MatchError> {
        AnnealedSoftassign::default().match_points(&self.model, &self.target)
    }

    fn is_right(&self, i: usize, j: usize) -> bool {
        self.order.get(j) == Some(&i)
    }
}

/// Pairs, sum of confidences, right pairs.
type Tenths = [[f64; 3]; 10];

fn bend<const D: usize>(p: &Point<f64, D>) -> Point<f64, D> {
    let wave = |x: f64, phase: f64| (2.1 * x + phase).sin();
    Point::from(SVector::from_fn(|d, _| {
        p[d] + 0.06 * wave(p[(d + 1) % D], d as f64) * wave(p[d], 0.7)
    }))
}

/// Adds the pairs of noisy scenes; the share of coordinates within one standard deviation.
fn noisy<const D: usize>(
    noise: f64,
    outliers: f64,
    tenths: &mut Tenths,
) -> Result<f64, MatchError> {
    let (mut within, mut all) = (0.0, 0.0);
    for seed in 0..30 {
        let scene = Scene::<D>::new(105, bend, noise, outliers, seed, -1.0..2.0);
        let found = scene.matched()?;
        for &i in &scene.order {
            for k in 0..D {
                let deviation = found.displacement_covariance[i][(k, k)].sqrt();
                within += f64::from(u8::from(
                    (found.warped[i][k] - scene.truth[i][k]).abs() < deviation,
                ));
                all += 1.0;
            }
        }
        enter(&scene, &found, tenths);
    }
    Ok(within / all)
}

fn enter<const D: usize>(scene: &Scene<D>, found: &Matching<f64, D>, tenths: &mut Tenths) {
    for (i, partner) in found.assignment.iter().enumerate() {
        let &Some(j) = partner else { continue };
        let tenth = &mut tenths[((10.0 * found.confidence[i]) as usize).min(9)];
        tenth[0] += 1.0;
        tenth[1] += found.confidence[i];
        tenth[2] += f64::from(u8::from(scene.is_right(i, j)));
    }
}

/// Sets of 300 points stretched along x and cropped to a window: prints those with less than 98 % right; their number, and how many of them
/// have less than 90 % and no doubt.
fn stretched<const D: usize>() -> Result<[usize; 3], MatchError> {
    let mut counts = [0; 3];
    for stretch in [1.25, 1.5, 1.75, 2.0] {
        for outliers in [0.0, 0.1] {
            for seed in 0..5 {
                let warp = |p: &Point<f64, D>| {
                    let mut q = *p;
                    q[0] = 0.5 + stretch * (p[0] - 0.5);
                    q
                };
                let scene = Scene::<D>::new(300, warp, 0.02, outliers, seed, 0.0..1.0);
                let found = scene.matched()?;
                let own =
                    |&(i, j): &(usize, &Option<usize>)| j.is_some_and(|j| scene.is_right(i, j));
                let right = found.assignment.iter().enumerate().filter(own).count() as f64
                    / scene.order.len() as f64;
                counts[0] += 1;
                if right < 0.98 {
                    counts[1] += 1;
                    println!(
                        "  {D}-D stretch {stretch}, outliers {outliers}, seed {seed}: {right:.3} right, {:?}",
                        found.report.doubt
                    );
                }
                counts[2] += usize::from(right < 0.9 && found.report.doubt.is_none());
            }
        }
    }
    Ok(counts)
}

fn main() -> Result<(), MatchError> {
    let mut tenths = Tenths::default();
    for noise in [0.1, 0.15, 0.25] {
        for outliers in [0.0, 0.2] {
            let plane = noisy::<2>(noise, outliers, &mut tenths)?;
            let space = noisy::<3>(noise, outliers, &mut tenths)?;
            println!(
                "noise {noise} spacings, outliers {outliers}: within one standard deviation {plane:.3} (plane) {space:.3} (space)"
            );
        }
    }
    println!("pairs, mean confidence, share right");
    for [pairs, confidence, right] in tenths {
        println!(
            "  {pairs:>6} {:.3} {:.3}",
            confidence / pairs,
            right / pairs
        );
    }
    for [scenes, short, silent] in [stretched::<2>()?, stretched::<3>()?] {
        println!(
            "stretched and cropped: {short} of {scenes} scenes below 98 % right, {silent} below 90 % without a doubt"
        );
    }
    Ok(())
}
