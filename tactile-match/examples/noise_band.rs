//! The default matcher compared with coherent point drift for noise from 10⁻⁵ to a tenth of the
//! size.
//!
//! ```text
//! cargo run --release -p tactile-match --example noise_band -- [FIRST_SEED SEEDS]
//! ```
//!
//! Random points of the unit square and cube under a mild affine map, with and without a bend,
//! without outliers. Each row is a number of points and a noise. It contains the fractions of
//! points without a partner and of wrong partners, and the ratio of the estimated and the true
//! standard deviation of the noise (geometric mean). It also contains the mean distance of the warp
//! from the true positions divided by the noise, and the ratio of this distance to that of coherent
//! point drift with its standard error. The last column is the number of scenes with a doubt.
#![allow(clippy::print_stdout)]
use nalgebra::{Point, SVector};
use tactile_match::{AnnealedSoftassign, CoherentPointDrift, MatchError, Matching, PointMatcher};

#[path = "support/scene.rs"]
mod scene;
#[path = "support/stream.rs"]
mod stream;
use scene::Scene;
use stream::Stream;

impl<const D: usize> Scene<D> {
    fn new(points: usize, noise: f64, bent: bool, seed: u64) -> Self {
        let mut stream = Stream(seed.wrapping_mul(7919) + 17);
        let model: Vec<Point<f64, D>> = (0..points)
            .map(|_| Point::from(SVector::from_fn(|_, _| stream.next())))
            .collect();
        let linear: Vec<SVector<f64, D>> = (0..D)
            .map(|_| SVector::from_fn(|_, _| 0.1 * (stream.next() - 0.5)))
            .collect();
        let wave = if bent { 0.05 } else { 0.0 };
        let truth: Vec<_> = model
            .iter()
            .map(|p| {
                p + SVector::from_fn(|d, _| {
                    linear[d].dot(&p.coords)
                        + wave * (2.3 * p[(d + 1) % D] + d as f64).sin() * (2.1 * p[d]).cos()
                })
            })
            .collect();
        let order = stream.permutation(points);
        let target = order
            .iter()
            .map(|&i| truth[i] + SVector::from_fn(|_, _| noise * stream.normal()))
            .collect();
        Self {
            model,
            truth,
            target,
            order,
        }
    }

    fn error(&self, found: &Matching<D>) -> f64 {
        let apart = found.warped.iter().zip(&self.truth);
        apart.map(|(at, truth)| (at - truth).norm()).sum::<f64>() / self.truth.len() as f64
    }
}

#[derive(Default)]
struct Row {
    unmatched: f64,
    wrong: f64,
    log_sigma: f64,
    error: f64,
    log_ratios: Vec<f64>,
    doubted: usize,
}

impl Row {
    fn of<const D: usize>(
        points: usize,
        noise: f64,
        bent: bool,
        seeds: std::ops::Range<u64>,
    ) -> Result<Self, MatchError> {
        let mut row = Self::default();
        let count = (seeds.end - seeds.start) as f64;
        for seed in seeds {
            let scene = Scene::<D>::new(points, noise, bent, seed);
            let found = AnnealedSoftassign::default().match_points(&scene.model, &scene.target)?;
            let drift = CoherentPointDrift::default().match_points(&scene.model, &scene.target)?;
            let per_point = 1.0 / (points as f64 * count);
            for (i, partner) in found.assignment.iter().enumerate() {
                match *partner {
                    None => row.unmatched += per_point,
                    Some(j) if !scene.is_right(i, j) => row.wrong += per_point,
                    Some(_) => {}
                }
            }
            row.log_sigma += (found.report.sigma / noise).ln() / count;
            row.error += scene.error(&found) / noise / count;
            row.log_ratios
                .push((scene.error(&found) / scene.error(&drift)).ln());
            row.doubted += usize::from(found.report.doubt().is_some());
        }
        Ok(row)
    }

    fn print(&self) {
        let count = self.log_ratios.len() as f64;
        let mean = self.log_ratios.iter().sum::<f64>() / count;
        let square = |x: &f64| (x - mean).powi(2);
        let spread = self.log_ratios.iter().map(square).sum::<f64>() / (count - 1.0).max(1.0);
        println!(
            "  {:5.2} %  {:5.2} %  {:.3}  {:8.4}  {:.3} ± {:.3}  {}",
            100.0 * self.unmatched,
            100.0 * self.wrong,
            self.log_sigma.exp(),
            self.error,
            mean.exp(),
            mean.exp() * (spread / count).sqrt(),
            self.doubted
        );
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let first: u64 = arguments.next().map_or(Ok(100), |text| text.parse())?;
    let count: u64 = arguments.next().map_or(Ok(10), |text| text.parse())?;
    let seeds = first..first + count;
    println!("dimension, points, bent, noise: unmatched, wrong, sigma, error, over drift, doubted");
    for points in [30, 50, 105, 200, 500] {
        for bent in [false, true] {
            for noise in [
                1e-5, 1e-4, 5e-4, 1e-3, 2e-3, 3e-3, 5e-3, 1e-2, 2e-2, 3e-2, 5e-2, 1e-1,
            ] {
                print!("2 {points:>3} {bent:>5} {noise:7.0e}");
                Row::of::<2>(points, noise, bent, seeds.clone())?.print();
                print!("3 {points:>3} {bent:>5} {noise:7.0e}");
                Row::of::<3>(points, noise, bent, seeds.clone())?.print();
            }
        }
    }
    Ok(())
}
