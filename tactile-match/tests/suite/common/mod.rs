//! Matchers, point sets and checks that the test files share.

use nalgebra::{Point, RealField, SMatrix, SVector};
use proptest::prelude::*;
use tactile_match::labelling::Neighbourhood;
use tactile_match::{
    AnnealedSoftassign, CoherentPointDrift, DriftOptions, LabellingOptions, LinearAssignment,
    Matching, Motion, NearestNeighbour, PointMatcher, RelaxationLabelling,
    SparseRelaxationLabelling,
};
use tactile_tps::Scalar;

pub(crate) type Matchers<T, const D: usize> = Vec<(&'static str, Box<dyn PointMatcher<T, D>>)>;

/// The matchers that every test file runs; a new one is added here and nowhere else.
pub(crate) fn matchers<T: Scalar, const D: usize>() -> Matchers<T, D> {
    let drift = |motion| {
        let options = DriftOptions::default().with_motion(motion);
        CoherentPointDrift::new(options.expect("a valid motion"))
    };
    // Eight neighbours instead of half of all points: what is checked here does not need the time of the latter.
    let options = LabellingOptions::default().with_neighbourhood(Neighbourhood::Nearest(8));
    let dense = RelaxationLabelling::new(options.expect("neighbours"));
    vec![
        ("relaxation", Box::new(AnnealedSoftassign::default())),
        ("dense relaxation", Box::new(dense)),
        (
            "sparse relaxation",
            Box::new(SparseRelaxationLabelling::default()),
        ),
        ("nearest neighbour", Box::new(NearestNeighbour::new())),
        ("linear assignment", Box::new(LinearAssignment::new())),
        (
            "coherent point drift",
            Box::new(CoherentPointDrift::default()),
        ),
        (
            "coherent point drift, rigid",
            Box::new(drift(Motion::Rigid)),
        ),
        (
            "coherent point drift, similarity",
            Box::new(drift(Motion::Similarity)),
        ),
        (
            "coherent point drift, affine",
            Box::new(drift(Motion::Affine)),
        ),
    ]
}

/// Largest distance of two points of the same row.
pub(crate) fn largest_step<T: Scalar, const D: usize>(a: &[Point<T, D>], b: &[Point<T, D>]) -> f64 {
    a.iter()
        .zip(b)
        .map(|(a, b)| nalgebra::convert_unchecked::<T, f64>((a - b).norm()))
        .fold(0.0, f64::max)
}

/// A repeatable stream of numbers in [0, 1), the same for every scalar type.
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

    /// A permutation of `0..n`.
    pub(crate) fn permutation(&mut self, n: usize) -> Vec<usize> {
        let mut order: Vec<usize> = (0..n).collect();
        for k in (1..n).rev() {
            order.swap(k, (self.next() * (k + 1) as f64) as usize);
        }
        order
    }
}

/// `n` points, no two closer than about half the spacing of a regular arrangement: a jittered lattice of the unit cube.
pub(crate) fn scattered<T: RealField + Copy, const D: usize>(
    n: usize,
    seed: u64,
) -> Vec<Point<T, D>> {
    let side = (n as f64).powf(1.0 / D as f64).ceil() as usize;
    let mut stream = Stream::new(seed);
    let cells = stream.permutation(side.pow(D as u32));
    cells[..n]
        .iter()
        .map(|&cell| {
            let at = |d: usize| (cell / side.pow(d as u32) % side) as f64;
            Point::from(SVector::from_fn(|d, _| {
                nalgebra::convert((at(d) + 0.5 + 0.5 * (stream.next() - 0.5)) / side as f64)
            }))
        })
        .collect()
}

/// A regular grid of `side`^D points.
pub(crate) fn grid<T: RealField + Copy, const D: usize>(side: usize) -> Vec<Point<T, D>> {
    (0..side.pow(D as u32))
        .map(|cell| {
            Point::from(SVector::from_fn(|d, _| {
                nalgebra::convert((cell / side.pow(d as u32) % side) as f64)
            }))
        })
        .collect()
}

/// A smooth, fold-free deformation of the unit cube; `size` is the largest displacement.
pub(crate) fn bend<T: RealField + Copy, const D: usize>(
    points: &[Point<T, D>],
    size: f64,
) -> Vec<Point<T, D>> {
    let size: T = nalgebra::convert(size);
    let wave = |x: T, phase: f64| (x * nalgebra::convert(2.1) + nalgebra::convert(phase)).sin();
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
pub(crate) fn rotation<T: RealField + Copy, const D: usize>(angle: f64) -> SMatrix<T, D, D> {
    let (sin, cos): (T, T) = (
        nalgebra::convert(angle.sin()),
        nalgebra::convert(angle.cos()),
    );
    let mut r = SMatrix::identity();
    (r[(0, 0)], r[(0, 1)], r[(1, 0)], r[(1, 1)]) = (cos, -sin, sin, cos);
    r
}

/// What holds of every [`Matching`], whatever it was made from.
pub(crate) fn assert_consistent<T: Scalar, const D: usize>(
    name: &str,
    model: &[Point<T, D>],
    target: &[Point<T, D>],
    matching: &Matching<T, D>,
) {
    let (rows, columns) = (model.len(), target.len());
    let lengths = [
        matching.warped.len(),
        matching.assignment.len(),
        matching.confidence.len(),
        matching.soft.rows(),
    ];
    assert_eq!(lengths, [rows; 4], "{name}: one entry per model point");
    assert_eq!(
        matching.displacement_covariance.len(),
        rows,
        "{name}: one covariance per model point"
    );
    assert_partition(name, columns, matching);
    let probability = |p: T| p >= T::zero() && p <= T::one() + nalgebra::convert(1e-5);
    assert!(
        matching.confidence.iter().all(|&p| probability(p)),
        "{name}: confidence {:?}",
        matching.confidence
    );
    for i in 0..rows {
        let sum = matching.soft.row(i).fold(T::zero(), |sum, (j, p)| {
            assert!(
                j < columns && probability(p),
                "{name}: soft match ({i}, {j}) = {p}"
            );
            sum + p
        });
        assert!(probability(sum), "{name}: soft row {i} sums to {sum}");
    }
    let finite = |p: &Point<T, D>| p.iter().all(|c| c.is_finite());
    assert!(
        matching.warped.iter().all(finite),
        "{name}: warped points {:?}",
        matching.warped
    );
    for (i, (point, warped)) in model.iter().zip(&matching.warped).enumerate() {
        // Rounding of a spline's sum, whose terms may exceed the set's size by some orders of magnitude.
        let size = target
            .iter()
            .chain(&matching.warped)
            .chain([point])
            .fold(T::zero(), |m, p| m.max(p.coords.amax()));
        let step = (matching.warp.apply(point) - warped).norm();
        let tolerance: T = nalgebra::convert(1e10 * T::UNIT_ROUNDOFF);
        assert!(
            step <= tolerance.min(nalgebra::convert(1e-3)) * size,
            "{name}: the warp takes point {i} {step} astray"
        );
    }
    for covariance in &matching.displacement_covariance {
        assert!(
            covariance.iter().all(|c| c.is_finite()),
            "{name}: covariance {covariance}"
        );
        assert!(
            (0..D).all(|d| covariance[(d, d)] >= T::zero()),
            "{name}: covariance {covariance}"
        );
    }
    assert!(
        matching.energy.iter().all(|e| e.is_finite()),
        "{name}: energy {:?}",
        matching.energy
    );
    let report = &matching.report;
    assert!(
        report.residual.is_finite() && report.sigma.is_finite(),
        "{name}: {report:?}"
    );
}

/// No target twice; matched and unmatched rows together are all rows.
fn assert_partition<T: Scalar, const D: usize>(
    name: &str,
    columns: usize,
    matching: &Matching<T, D>,
) {
    let mut seen = vec![false; columns];
    for &j in matching
        .assignment
        .iter()
        .flatten()
        .chain(&matching.unmatched_target)
    {
        assert!(
            !std::mem::replace(&mut seen[j], true),
            "{name}: target {j} twice"
        );
    }
    assert!(
        seen.iter().all(|s| *s),
        "{name}: a target is neither matched nor unmatched"
    );
    let unmatched: Vec<usize> = (0..matching.assignment.len())
        .filter(|&i| matching.assignment[i].is_none())
        .collect();
    assert_eq!(
        unmatched, matching.unmatched_model,
        "{name}: unmatched model rows"
    );
}

/// Coordinates a caller may come with by mistake.
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
