//! Matchers, point sets and checks used by the test files.

pub(crate) mod contract;

#[allow(unused_imports)] // the tests inside the crate share the point sets alone
pub(crate) use contract::{assert_consistent, matchers};
use nalgebra::{Point, SMatrix, SVector};
use proptest::prelude::*;
use tactile_match::{Matching, PointMatcher};

/// Largest distance between two points of the same row.
pub(crate) fn largest_step<const D: usize>(a: &[Point<f64, D>], b: &[Point<f64, D>]) -> f64 {
    a.iter()
        .zip(b)
        .map(|(a, b)| (a - b).norm())
        .fold(0.0, f64::max)
}

/// A reproducible stream of numbers in [0, 1), the same for every scalar type.
pub(crate) struct Stream(u64);

impl Stream {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ 0x2545_f491_4f6c_dd1d)
    }

    /// SplitMix64.
    pub(crate) fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// An approximately normal deviate: the sum of twelve uniform ones.
    pub(crate) fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.next()).sum::<f64>() - 6.0
    }

    /// A permutation of `0..n`.
    pub(crate) fn permutation(&mut self, n: usize) -> Vec<usize> {
        let mut order: Vec<usize> = (0..n).collect();
        for k in (1..n).rev() {
            order.swap(k, (self.next() * (k + 1) as f64) as usize);
        }
        order
    }
}

/// A model, the true positions of its points, and targets. `order[j]` is the model row of target
/// `j`; further targets are outliers.
pub(crate) struct Scene<const D: usize> {
    pub(crate) model: Vec<Point<f64, D>>,
    pub(crate) truth: Vec<Point<f64, D>>,
    pub(crate) target: Vec<Point<f64, D>>,
    pub(crate) order: Vec<usize>,
}

impl<const D: usize> Scene<D> {
    /// The true positions in this order, with Gaussian noise of the given standard deviation, and
    /// outliers in the unit cube.
    pub(crate) fn new(
        model: Vec<Point<f64, D>>,
        truth: Vec<Point<f64, D>>,
        order: Vec<usize>,
        noise: impl Fn(usize) -> f64,
        outliers: usize,
        stream: &mut Stream,
    ) -> Self {
        let mut target = reordered(&truth, &order);
        for (j, p) in target.iter_mut().enumerate() {
            *p += SVector::from_fn(|_, _| noise(j) * stream.normal());
        }
        target.extend((0..outliers).map(|_| Point::from(SVector::from_fn(|_, _| stream.next()))));
        Self {
            model,
            truth,
            target,
            order,
        }
    }

    /// `n` points of the unit cube, bent and in another order.
    pub(crate) fn bent(n: usize, size: f64, seed: u64) -> Self {
        let (model, mut stream) = (scattered(n, seed), Stream::new(seed));
        let (truth, order) = (bend(&model, size), stream.permutation(n));
        Self::new(model, truth, order, |_| 0.0, 0, &mut stream)
    }

    pub(crate) fn is_right(&self, i: usize, j: usize) -> bool {
        self.order.get(j) == Some(&i)
    }

    /// Number of model points with their own partner.
    pub(crate) fn right(&self, assignment: &[Option<usize>]) -> usize {
        let rows = assignment.iter().enumerate();
        rows.filter(|&(i, partner)| partner.is_some_and(|j| self.is_right(i, j)))
            .count()
    }

    /// Root mean square distance of the warped points from the truth.
    pub(crate) fn error(&self, warped: &[Point<f64, D>]) -> f64 {
        let pairs = warped.iter().zip(&self.truth);
        let squares: f64 = pairs.map(|(w, t)| (w - t).norm_squared()).sum();
        (squares / warped.len() as f64).sqrt()
    }
}

/// Matches the scene. The match must succeed and be consistent.
pub(crate) fn matched<const D: usize>(
    name: &str,
    matcher: &dyn PointMatcher<D>,
    model: &[Point<f64, D>],
    target: &[Point<f64, D>],
) -> Matching<D> {
    let matching = matcher
        .match_points(model, target)
        .unwrap_or_else(|error| panic!("{name}: {error}"));
    assert_consistent(name, model, target, &matching);
    matching
}

/// `n` points of a jittered lattice of the unit cube, no two of which are closer than about half of
/// the regular spacing.
pub(crate) fn scattered<const D: usize>(n: usize, seed: u64) -> Vec<Point<f64, D>> {
    let side = (n as f64).powf(1.0 / D as f64).ceil() as usize;
    let mut stream = Stream::new(seed);
    let cells = stream.permutation(side.pow(D as u32));
    cells[..n]
        .iter()
        .map(|&cell| {
            let at = |d: usize| (cell / side.pow(d as u32) % side) as f64;
            Point::from(SVector::from_fn(|d, _| {
                (at(d) + 0.5 + 0.5 * (stream.next() - 0.5)) / side as f64
            }))
        })
        .collect()
}

/// A regular grid of `side`^D points.
pub(crate) fn grid<const D: usize>(side: usize) -> Vec<Point<f64, D>> {
    (0..side.pow(D as u32))
        .map(|cell| {
            Point::from(SVector::from_fn(|d, _| {
                (cell / side.pow(d as u32) % side) as f64
            }))
        })
        .collect()
}

/// A smooth, fold-free deformation of the unit cube. `size` is the largest displacement.
pub(crate) fn bend<const D: usize>(points: &[Point<f64, D>], size: f64) -> Vec<Point<f64, D>> {
    let wave = |x: f64, phase: f64| (x * 2.1 + phase).sin();
    points
        .iter()
        .map(|p| {
            Point::from(SVector::from_fn(|d, _| {
                p[d] + size * wave(p[(d + 1) % D], d as f64) * wave(p[d], 0.7)
            }))
        })
        .collect()
}

/// The points in another order: `result[k] = points[order[k]]`.
pub(crate) fn reordered<P: Copy>(points: &[P], order: &[usize]) -> Vec<P> {
    order.iter().map(|&k| points[k]).collect()
}

/// A rotation by `angle` in the plane of the first two axes.
pub(crate) fn rotation<const D: usize>(angle: f64) -> SMatrix<f64, D, D> {
    let (sin, cos): (f64, f64) = (angle.sin(), angle.cos());
    let mut r = SMatrix::identity();
    (r[(0, 0)], r[(0, 1)], r[(1, 0)], r[(1, 1)]) = (cos, -sin, sin, cos);
    r
}

/// Coordinates that a caller may pass by mistake.
pub(crate) fn hostile_coordinate() -> impl Strategy<Value = f64> {
    prop_oneof![
        8 => -1.0..1.0_f64,
        2 => (-3..3_i32).prop_map(f64::from),
        1 => Just(0.0),
        1 => Just(-0.0),
        1 => prop_oneof![Just(1e-300), Just(f64::MIN_POSITIVE), Just(5e-324)],
        1 => prop_oneof![Just(1e9), Just(-1e12), Just(1e100), Just(f64::MAX), Just(-f64::MAX)],
    ]
}

/// Up to `most` points with such coordinates, many of them equal.
pub(crate) fn hostile_points<const D: usize>(
    most: usize,
) -> impl Strategy<Value = Vec<Point<f64, D>>> {
    prop::collection::vec(prop::collection::vec(hostile_coordinate(), D), 1..=most).prop_flat_map(
        |points| {
            let points: Vec<Point<f64, D>> = points.iter().map(|p| Point::from_slice(p)).collect();
            let len = points.len();
            (
                Just(points),
                prop::collection::vec(0..len, len),
                any::<bool>(),
            )
                .prop_map(|(points, pick, repeat)| {
                    if repeat {
                        reordered(&points, &pick)
                    } else {
                        points
                    }
                })
        },
    )
}
