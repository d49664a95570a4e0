//! Points and maps used by the tests.

use nalgebra::{Point, SVector};
use tactile_tps::{FitOptions, Kernel, Smoothing, ThinPlateSpline};

/// Uniform numbers in [-1, 1) from a fixed seed (xorshift, Marsaglia 2003).
pub(crate) struct Uniform(pub(crate) u64);

impl Uniform {
    pub(crate) fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    pub(crate) fn point<const D: usize>(&mut self) -> Point<f64, D> {
        Point::from(SVector::from_fn(|_, _| self.next()))
    }

    pub(crate) fn points<const D: usize>(&mut self, n: usize) -> Vec<Point<f64, D>> {
        (0..n).map(|_| self.point()).collect()
    }
}

/// A smooth map that is far from every affine map.
pub(crate) fn bend<const D: usize>(p: &Point<f64, D>) -> Point<f64, D> {
    Point::from(SVector::from_fn(|k, _| {
        p[k] + 0.2 * (2.0 * p[(k + 1) % D] + k as f64).sin()
    }))
}

pub(crate) fn largest(values: impl IntoIterator<Item = f64>) -> f64 {
    values.into_iter().fold(0.0, |m, x| f64::max(m, x.abs()))
}

pub(crate) fn fit<const D: usize, K: Kernel>(
    sources: &[Point<f64, D>],
    targets: &[Point<f64, D>],
    options: &FitOptions<K>,
) -> ThinPlateSpline<D, K> {
    ThinPlateSpline::fit(sources, targets, options).expect("a spline")
}

/// Options with this smoothing and, if given, these weights.
pub(crate) fn options<K>(
    kernel: K,
    smoothing: Smoothing,
    weights: Option<&[f64]>,
) -> FitOptions<K> {
    let smooth = FitOptions::new(kernel).with_smoothing(smoothing);
    let smooth = smooth.expect("a smoothing");
    match weights {
        Some(weights) => smooth.with_weights(weights.to_vec()).expect("weights"),
        None => smooth,
    }
}

/// Runs a check with every kernel in both dimensions.
macro_rules! for_all {
    ($check:ident $(, $argument:expr)*) => {
        $check::<2, _>(R2LogR $(, $argument)*);
        $check::<2, _>(R3 $(, $argument)*);
        $check::<3, _>(R2LogR $(, $argument)*);
        $check::<3, _>(NegR $(, $argument)*);
        $check::<3, _>(R3 $(, $argument)*);
    };
}
pub(crate) use for_all;
