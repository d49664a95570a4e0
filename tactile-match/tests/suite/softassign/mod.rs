//! Annealed softassign: what it finds, and how it is called.
mod answers;
mod calls;

use nalgebra::Point;

/// Fractional part of a multiple of the golden ratio: points without pattern, the same on every
/// machine.
fn scatter(i: usize, k: usize) -> f64 {
    ((i * 7 + k * 131 + i * i * 3 + 1) as f64
        * [0.618_033_988_75, 0.754_877_666_25, 0.569_840_291][k])
        .fract()
}

fn cloud<const D: usize>(n: usize) -> Vec<Point<f64, D>> {
    (0..n)
        .map(|i| Point::from(std::array::from_fn(|k| scatter(i, k))))
        .collect()
}

/// A smooth warp without folds.
fn bend<const D: usize>(p: &Point<f64, D>) -> Point<f64, D> {
    let bump: f64 = (-p.coords.norm_squared() / 0.3).exp();
    Point::from(std::array::from_fn(|k| {
        1.1 * p[k] + 0.12 * p[(k + 1) % D] + 0.08 * bump - 0.3
    }))
}

/// Row `i` of the model is row `(5 i + 3) mod n` of the target. 5 and n have no common factor.
fn shuffled<const D: usize>(points: &[Point<f64, D>]) -> (Vec<Point<f64, D>>, Vec<usize>) {
    let n = points.len();
    let partner: Vec<usize> = (0..n).map(|i| (5 * i + 3) % n).collect();
    let mut target = vec![Point::origin(); n];
    partner
        .iter()
        .zip(points)
        .for_each(|(&j, p)| target[j] = bend(p));
    (target, partner)
}
