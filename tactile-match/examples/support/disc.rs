//! Nearly regular surfaces.

use crate::stream::Stream;
use nalgebra::{Point, SVector};

/// A jittered sunflower disc of radius 1, in space with the shape of a bell.
pub(crate) fn disc<const D: usize>(
    n: usize,
    jitter: f64,
    stream: &mut Stream,
) -> Vec<Point<f64, D>> {
    let place = |i: usize| {
        let (r, angle) = (
            ((i as f64 + 0.5) / n as f64).sqrt(),
            2.399_963_229_728_653 * i as f64,
        );
        let step = jitter * (std::f64::consts::PI / n as f64).sqrt();
        let [x, y] = [angle.cos(), angle.sin()].map(|c| r * c + step * stream.normal());
        Point::from(SVector::from_fn(|k, _| {
            [x, y, 0.6 * (-(x * x + y * y).min(1.0) / 0.405).exp()][k]
        }))
    };
    (0..n).map(place).collect()
}
