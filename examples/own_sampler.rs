//! A user-defined sampler of control points, which selects the highest pixels, in the pipeline.
#![allow(clippy::print_stdout)]
use ndarray::{Array2, ArrayView2};
use tactile_imaging::sfs::nalgebra::Point3;
use tactile_imaging::sfs::{ControlPointSampler, Domain, SfsError};

struct Highest;

impl ControlPointSampler<f64> for Highest {
    fn sample(
        &self,
        heights: ArrayView2<'_, f64>,
        domain: &Domain<'_, f64>,
        count: usize,
    ) -> Result<Vec<Point3<f64>>, SfsError> {
        let [hx, hy] = domain.pixel_size_m;
        let mut points: Vec<_> = (domain.bounding_box(heights.dim())?.pixels())
            .filter(|at| domain.contains(at.0, at.1) && heights[*at].is_finite())
            .map(|at| Point3::new(at.1 as f64 * hx, at.0 as f64 * hy, heights[at]))
            .collect();
        let available = points.len();
        if available < count {
            return Err(SfsError::TooManyPoints {
                requested: count,
                available,
            });
        }
        points.sort_by(|a, b| b.z.total_cmp(&a.z));
        points.truncate(count);
        Ok(points)
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let square = |r: usize, c: usize| (r as f64 - 20.0).powi(2) + (c as f64 - 20.0).powi(2);
    let heights = Array2::from_shape_fn((41, 41), |(r, c)| (400.0 - square(r, c)).max(0.0).sqrt());
    let points = Highest.sample(heights.view(), &Domain::default(), 50)?;
    let lowest = points
        .iter()
        .map(|point| point.z)
        .fold(f64::INFINITY, f64::min);
    println!(
        "{} points, the lowest at {lowest:.2} of 20 px",
        points.len()
    );
    assert!(points.len() == 50 && lowest > 19.0);
    // In a pipeline: `pipeline.with_sampler(Highest)`.
    assert!(
        Highest
            .sample(heights.view(), &Domain::default(), 2000)
            .is_err()
    );
    Ok(())
}
