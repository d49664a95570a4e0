//! The identity is kept in directions that the points do not determine, and barely determined
//! directions are fitted.

use crate::common::Uniform;
use nalgebra::{Matrix3, Point, Point2, Point3, Rotation3, SVector, Vector3};
use tactile_tps::{Affine, FitOptions, Kernel, NegR, R2LogR, R3, Smoothing, ThinPlateSpline, Warp};

type Warps<const D: usize> = Vec<Box<dyn Warp<D>>>;

fn spline<const D: usize, K: Kernel + 'static>(
    kernel: K,
    sources: &[Point<f64, D>],
    targets: &[Point<f64, D>],
) -> Warps<D> {
    let plain = FitOptions::new(kernel.clone());
    let smooth = FitOptions::new(kernel).with_smoothing(Smoothing::Lambda(0.1));
    let fit = |options| -> Box<dyn Warp<D>> {
        Box::new(ThinPlateSpline::fit(sources, targets, &options).expect("a spline"))
    };
    vec![fit(plain), fit(smooth.expect("a λ"))]
}

/// Every warp of the crate.
fn warps<const D: usize>(sources: &[Point<f64, D>], targets: &[Point<f64, D>]) -> Warps<D> {
    let mut all = spline(R2LogR, sources, targets);
    all.extend(spline(NegR, sources, targets));
    all.extend(spline(R3, sources, targets));
    all.push(Box::new(
        Affine::fit(sources, targets, None).expect("a map"),
    ));
    let rigid = Affine::fit_rigid(sources, targets, None);
    all.push(Box::new(rigid.expect("a motion")));
    all
}

/// A shift of points of `rank` 1 to D shifts the whole space: rounding, times the condition number
/// of a dozen points.
fn shifted<const D: usize>(rank: usize, size: f64, offset: f64) {
    let mut random = Uniform(rank as u64);
    let directions: [SVector<f64, D>; D] = core::array::from_fn(|_| random.point::<D>().coords);
    let shift = SVector::from_fn(|k, _| 1.0 + k as f64) * size;
    let mut point = |rank: usize| {
        let along = directions.iter().take(rank - 1);
        let place = along.fold(SVector::zeros(), |sum, d| sum + d * random.next());
        Point::from((place + SVector::repeat(offset)) * size)
    };
    let mut sources: Vec<_> = (0..12).map(|_| point(rank)).collect();
    sources.push(sources[3]);
    let targets: Vec<_> = sources.iter().map(|p| p + shift).collect();
    let queries: Vec<_> = (0..5).map(|_| point(D + 1)).collect();
    for (i, warp) in warps(&sources, &targets).iter().enumerate() {
        assert_eq!(warp.rank(), rank, "warp {i}, size {size:e}");
        for query in &queries {
            let missed = (warp.apply(query) - query - shift).norm() / size;
            assert!(
                missed < 1e-9,
                "warp {i}, rank {rank}, size {size:e}: {missed:e}"
            );
        }
    }
}

#[test]
fn a_shift_of_few_directions_shifts_all_of_space() {
    for size in [1e-160, 1e-9, 1.0, 1e9, 1e160] {
        for offset in [0.0, 100.0] {
            // A single point has no size for scaling: squares must not overflow.
            let least = if size > 1e100 { 2 } else { 1 };
            (least..=3).for_each(|rank| shifted::<2>(rank, size, offset));
            (least..=4).for_each(|rank| shifted::<3>(rank, size, offset));
        }
    }
}

/// Landmarks on a diagonal that stretch along it: transverse lengths are kept.
#[test]
fn displacements_are_interpolated_along_a_line_and_kept_across() {
    let line = [[0.0, 0.0], [1.0, 1.0], [2.0, 2.0], [4.0, 4.0]].map(Point2::from);
    let doubled = line.map(|p| p * 2.0);
    let mut all = spline(R2LogR, &line, &doubled);
    all.push(Box::new(Affine::fit(&line, &doubled, None).unwrap()));
    for warp in all {
        // (0, 1) is (0.5, 0.5) along the line and (−0.5, 0.5) across it.
        let image = warp.apply(&Point2::new(0.0, 1.0));
        assert!((image - Point2::new(0.5, 1.5)).norm() < 1e-13, "{image}");
    }
}

/// In double precision, differences of extent up to 3e-7 are not noise.
#[test]
fn a_thin_direction_is_fitted() {
    let mut random = Uniform(3);
    let linear = Matrix3::new(1.1, 0.2, 0.0, -0.1, 0.9, 0.3, 0.2, 0.0, 1.2);
    let turn = Rotation3::from_euler_angles(0.4, -1.0, 2.0);
    for thin in [3e-7, 1e-3] {
        for scale in [1e-160, 1.0, 1e160] {
            let mut sources = random.points::<3>(20);
            sources
                .iter_mut()
                .for_each(|p| *p = Point3::new(p.x, p.y, thin * p.z) * scale);
            let targets: Vec<_> = sources.iter().map(|p| linear * p).collect();
            let found = Affine::fit(&sources, &targets, None).unwrap();
            // Rounding of targets of size one divided by the thin extent.
            assert!(
                (found.linear - linear).norm() < 1e-14 / thin,
                "{thin:e}, {scale:e}"
            );
            assert_eq!(found.rank(), 4);
            // A needle: the rotation about it depends on the thin directions.
            let needle = sources.iter().map(|p| Point3::new(p.x, thin * p.y, p.z));
            let needle: Vec<_> = needle.collect();
            let turned: Vec<_> = needle.iter().map(|p| turn * p).collect();
            let found = Affine::fit_rigid(&needle, &turned, None).unwrap();
            assert!(
                (found.linear - turn.matrix()).norm() < 1e-14 / thin,
                "{thin:e}, {scale:e}"
            );
        }
    }
}

/// A line rotates by the smallest rotation, even if it is reversed.
#[test]
fn a_line_turns_without_twist() {
    let at = |direction: Vector3<f64>| [-1.0, 0.5, 2.0].map(|t| Point3::from(direction * t));
    for (from, to) in [
        (Vector3::x(), Vector3::y()),
        (Vector3::x(), -Vector3::x()),
        (
            Vector3::new(1.0, 2.0, 2.0) / 3.0,
            Vector3::new(2.0, 1.0, -2.0) / 3.0,
        ),
    ] {
        let found = Affine::fit_rigid(&at(from), &at(to), None).unwrap().linear;
        assert!((found.determinant() - 1.0).abs() < 1e-14 && (found * from - to).norm() < 1e-14);
        let angle = from.dot(&to).acos();
        // tr R = 1 + 2 cos of its angle, and no rotation from one line to the other has a smaller
        // angle.
        assert!((found.trace() - 1.0 - 2.0 * angle.cos()).abs() < 1e-14);
    }
}
