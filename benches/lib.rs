//! Problems used by several benches: points to be matched, and maps of space.

use nalgebra::{Point, Point3, SVector, Vector3};
use rand::{RngExt, SeedableRng, rngs::SmallRng};
use tactile_imaging::tps::{Kernel, ThinPlateSpline};

/// A model, a target, and the true image of each model point.
pub struct Scene<const D: usize> {
    /// The points to be matched.
    pub model: Vec<Point<f64, D>>,
    /// Their images in another order, with noise and outliers.
    pub target: Vec<Point<f64, D>>,
    /// Their images without noise, in the order of the model.
    pub truth: Vec<Point<f64, D>>,
}

impl<const D: usize> Scene<D> {
    /// `n` points of a jittered sunflower disc of radius 1 (bell-shaped in space), warped by six
    /// broad Gaussians.
    pub fn new(seed: u64, n: usize, jitter: f64, outliers: usize, noise: f64) -> Self {
        let mut random = SmallRng::seed_from_u64(seed);
        let mut uniform = |size: f64| random.random_range(-size..size);
        let model: Vec<Point<f64, D>> = (0..n)
            .map(|i| {
                let (r, angle) = (((i as f64 + 0.5) / n as f64).sqrt(), 2.399_963 * i as f64);
                let x = r * angle.cos() + uniform(jitter);
                let y = r * angle.sin() + uniform(jitter);
                let bell = 0.6 * (-(x * x + y * y) / 0.4).exp();
                Point::from(std::array::from_fn(|k| [x, y, bell][k]))
            })
            .collect();
        let mut vector = |size: f64| SVector::<f64, D>::from_fn(|_, _| uniform(size));
        let bumps: Vec<_> = (0..6).map(|_| (vector(1.2), vector(0.2))).collect();
        let warp = |p: &Point<f64, D>| {
            bumps.iter().fold(*p, |q, (c, a)| {
                q + a * (-(p.coords - c).norm_squared() / 1.28).exp()
            })
        };
        let truth: Vec<_> = model.iter().map(warp).collect();
        let noise = noise.max(1e-300);
        let mut target: Vec<_> = truth.iter().map(|p| p + vector(noise)).collect();
        target.reverse();
        target.extend((0..outliers).map(|_| Point::from(vector(1.3))));
        Self {
            model,
            target,
            truth,
        }
    }

    /// Mean distance of the warped points from the truth.
    pub fn error(&self, warped: &[Point<f64, D>]) -> f64 {
        let distances = warped.iter().zip(&self.truth).map(|(w, t)| (w - t).norm());
        distances.sum::<f64>() / self.truth.len() as f64
    }
}

/// Uniform points of the cube [−1, 1]³ displaced by five Gaussian bumps, and other points with
/// their true images.
pub struct Problem {
    /// Points with a known image.
    pub sources: Vec<Point3<f64>>,
    /// Their images, with noise.
    pub targets: Vec<Point3<f64>>,
    /// Other points.
    pub queries: Vec<Point3<f64>>,
    /// The true images of the other points.
    pub truth: Vec<Point3<f64>>,
}

impl Problem {
    /// `n` sources and `queries` other points. The noise of targets is at most `noise` along each
    /// axis.
    pub fn new(seed: u64, n: usize, noise: f64, queries: usize) -> Self {
        let mut random = SmallRng::seed_from_u64(seed);
        let mut point =
            |size: f64| Point3::from(Vector3::from_fn(|_, _| random.random_range(-size..size)));
        let bumps: Vec<_> = (0..5).map(|_| (point(1.0), point(0.17).coords)).collect();
        let map = |p: &Point3<f64>| {
            bumps.iter().fold(*p, |q, (c, a)| {
                q + a * (-(p - c).norm_squared() / 0.72).exp()
            })
        };
        let sources: Vec<_> = (0..n).map(|_| point(1.0)).collect();
        let noise = noise.max(1e-300);
        let targets = sources
            .iter()
            .map(|p| map(p) + point(noise).coords)
            .collect();
        let queries: Vec<_> = (0..queries).map(|_| point(0.95)).collect();
        let truth = queries.iter().map(map).collect();
        Self {
            sources,
            targets,
            queries,
            truth,
        }
    }

    /// Root mean square error at the queries.
    pub fn error<K: Kernel>(&self, spline: &ThinPlateSpline<3, K>) -> f64 {
        let mut values = vec![Point3::origin(); self.queries.len()];
        spline
            .apply_into(&self.queries, &mut values)
            .expect("equal lengths");
        self.error_of(&values)
    }

    /// Root mean square distance of values at the queries from the true values.
    pub fn error_of(&self, values: &[Point3<f64>]) -> f64 {
        let both = values.iter().zip(&self.truth);
        let squares = both.map(|(v, t)| (v - t).norm_squared());
        (squares.sum::<f64>() / values.len() as f64).sqrt()
    }
}
