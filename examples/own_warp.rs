//! A user-defined warp for the pipeline: growth about the centroid.
#![allow(clippy::print_stdout)]
use tactile_imaging::tps::nalgebra::{Matrix3, Point3, Vector3};
use tactile_imaging::tps::{TpsError, Warp, WarpModel};

/// f(x) = c' + s (x − c): the map of a sphere that swells.
struct Growth {
    from: Vector3<f64>,
    to: Vector3<f64>,
    scale: f64,
}

impl Warp<3> for Growth {
    fn apply(&self, point: &Point3<f64>) -> Point3<f64> {
        Point3::from(self.to + (point.coords - self.from) * self.scale)
    }
    fn jacobian(&self, _: &Point3<f64>) -> Matrix3<f64> {
        Matrix3::identity() * self.scale
    }
}

struct GrowthModel;

impl WarpModel<3> for GrowthModel {
    fn fit(
        &self,
        sources: &[Point3<f64>],
        targets: &[Point3<f64>],
        _weights: Option<&[f64]>,
    ) -> Result<Box<dyn Warp<3> + Send + Sync>, TpsError> {
        let mean =
            |p: &[Point3<f64>]| p.iter().map(|p| p.coords).sum::<Vector3<f64>>() / p.len() as f64;
        let (from, to) = (mean(sources), mean(targets));
        let pairs = || sources.iter().zip(targets);
        let spread: f64 = sources
            .iter()
            .map(|x| (x.coords - from).norm_squared())
            .sum();
        if spread == 0.0 {
            return Err(TpsError::custom("all points are one"));
        }
        let along: f64 = pairs()
            .map(|(x, y)| (x.coords - from).dot(&(y.coords - to)))
            .sum();
        let scale = along / spread;
        Ok(Box::new(Growth { from, to, scale }))
    }
}

fn main() -> Result<(), TpsError> {
    let sources: Vec<_> = (0..50)
        .map(|i| f64::from(i) * 0.4)
        .map(|a| Point3::new(a.cos(), a.sin(), 0.1 * a))
        .collect();
    let targets: Vec<_> = sources.iter().map(|p| p * 1.1).collect();
    let warp = GrowthModel.fit(&sources, &targets, None)?;
    let stretch = warp.jacobian(&sources[0])[(0, 0)];
    println!("the points grow by a factor of {stretch:.3}, 1.1 in truth");
    assert!((stretch - 1.1).abs() < 1e-12);
    // In a pipeline: `pipeline.with_warp(GrowthModel)`.
    assert!(GrowthModel.fit(&sources[..1], &targets[..1], None).is_err());
    Ok(())
}
