//! Point sets of the unit cube and their transformations.

use crate::stream::Stream;
use nalgebra::{Point, SVector};

/// Points of the unit cube: random, or a jittered grid.
pub(crate) fn cube<const D: usize>(
    n: usize,
    random: bool,
    stream: &mut Stream,
) -> Vec<Point<f64, D>> {
    let side = (n as f64).powf(1.0 / D as f64).ceil() as usize;
    let cells = stream.permutation(side.pow(D as u32));
    let mut place = |cell: usize| {
        Point::from(SVector::from_fn(|d, _| {
            let at = (cell / side.pow(d as u32) % side) as f64;
            if random {
                stream.next()
            } else {
                (at + 0.25 + 0.5 * stream.next()) / side as f64
            }
        }))
    };
    cells[..n].iter().map(|&cell| place(cell)).collect()
}

pub(crate) fn bend<const D: usize>(p: &Point<f64, D>) -> Point<f64, D> {
    let wave = |x: f64, phase: f64| (2.1 * x + phase).sin();
    Point::from(SVector::from_fn(|d, _| {
        p[d] + 0.06 * wave(p[(d + 1) % D], d as f64) * wave(p[d], 0.7)
    }))
}

/// Bent, and rotated about the centre.
pub(crate) fn turn<const D: usize>(p: &Point<f64, D>, degrees: f64) -> Point<f64, D> {
    let (sin, cos) = degrees.to_radians().sin_cos();
    let mut q = bend(p);
    let (x, y) = (q[0] - 0.5, q[1] - 0.5);
    (q[0], q[1]) = (0.5 + cos * x - sin * y, 0.5 + sin * x + cos * y);
    q
}

/// Stretched along x.
pub(crate) fn stretch<const D: usize>(p: &Point<f64, D>, factor: f64) -> Point<f64, D> {
    let mut q = *p;
    q[0] = 0.5 + factor * (p[0] - 0.5);
    q
}
