//! Where a run may start: first guesses of the affine part of the warp.

use super::frame::mean;
use nalgebra::{Matrix3, SMatrix, SVector, SymmetricEigen};

/// The model moved so that the centroids meet.
pub(crate) fn centred<const D: usize>(
    model: &[[f64; D]],
    target: &[[f64; D]],
    base: &mut Vec<[f64; D]>,
) {
    let (from, to) = (mean(model), mean(target));
    base.clear();
    base.extend(
        model
            .iter()
            .map(|x| std::array::from_fn(|k| x[k] - from[k] + to[k])),
    );
}

/// The model stretched so that centroid and covariance are the target's, and turned by `rotation` before the stretch.
///
/// `A = S C^½ R C^−½` with S the symmetric map that takes the model's covariance C to the target's: for R = 1 the
/// affine map without rotation.
pub(crate) fn moments<const D: usize>(
    model: &[[f64; D]],
    target: &[[f64; D]],
    rotation: &SMatrix<f64, D, D>,
    base: &mut Vec<[f64; D]>,
) {
    let (from, to) = (mean(model), mean(target));
    let [root, inverse, _] = roots(&covariance(model, &from));
    let spread = covariance(target, &to);
    let [middle, ..] = roots(&(root * spread * root));
    let [.., span] = roots(&spread);
    let map = span * inverse * middle * inverse * root * rotation * inverse;
    base.clear();
    base.extend(model.iter().map(|x| {
        let image = map * SVector::from_fn(|k, _| x[k] - from[k]);
        std::array::from_fn(|k| image[k] + to[k])
    }));
}

fn covariance<const D: usize>(points: &[[f64; D]], centre: &[f64; D]) -> SMatrix<f64, D, D> {
    let mut sum = SMatrix::zeros();
    for p in points {
        let d = SVector::<f64, D>::from_fn(|k, _| p[k] - centre[k]);
        sum += d * d.transpose();
    }
    sum / points.len() as f64
}

/// Square root and inverse square root of a covariance, in which directions without extent get a thousandth of the largest,
/// and the projection onto the other directions.
fn roots<const D: usize>(matrix: &SMatrix<f64, D, D>) -> [SMatrix<f64, D, D>; 3] {
    // Up to three dimensions, the missing ones filled up with zeros: no allocation.
    let entry = |r: usize, c: usize| if r < D && c < D { matrix[(r, c)] } else { 0.0 };
    let eigen = SymmetricEigen::new(Matrix3::from_fn(entry));
    let floor = (1e-6 * eigen.eigenvalues.max()).max(f64::MIN_POSITIVE);
    let function = |f: &dyn Fn(f64) -> f64| {
        SMatrix::from_fn(|r, c| {
            let v = &eigen.eigenvectors;
            (0..3)
                .map(|k| v[(r, k)] * f(eigen.eigenvalues[k]) * v[(c, k)])
                .sum()
        })
    };
    [
        function(&|value| value.max(floor).sqrt()),
        function(&|value| value.max(floor).sqrt().recip()),
        function(&|value| if value < floor { 0.0 } else { 1.0 }),
    ]
}

/// Rotations to try: in the plane, or in space.
pub(crate) struct Choice {
    plane: &'static [f64],
    space: usize,
}

/// All angles: every 30° in the plane, the 24 rotations of the cube in space.
pub(crate) const ANY: Choice = Choice {
    plane: &[
        0., 30., -30., 60., -60., 90., -90., 120., -120., 150., -150., 180.,
    ],
    space: 24,
};
/// Little: none, and 30° each way in the plane.
pub(crate) const LIMITED: Choice = Choice {
    plane: &[0., -30., 30.],
    space: 1,
};

/// The rotations of a choice.
pub(crate) fn rotations<const D: usize>(
    choice: Choice,
) -> impl Iterator<Item = SMatrix<f64, D, D>> {
    let count = match D {
        2 => choice.plane.len(),
        3 => choice.space,
        _ => 1,
    };
    (0..count).map(move |k| match D {
        2 => turn(0, 1, choice.plane[k].to_radians()),
        3 => cube(k),
        _ => SMatrix::identity(),
    })
}

fn turn<const D: usize>(a: usize, b: usize, angle: f64) -> SMatrix<f64, D, D> {
    let mut r = SMatrix::identity();
    (r[(a, a)], r[(a, b)], r[(b, a)], r[(b, b)]) =
        (angle.cos(), -angle.sin(), angle.sin(), angle.cos());
    r
}

/// Rotation `k` of the 24 that map a cube onto itself, the identity first.
fn cube<const D: usize>(k: usize) -> SMatrix<f64, D, D> {
    let quarter = std::f64::consts::FRAC_PI_2;
    let face = k / 4;
    let up = if face < 4 {
        turn(0, 2, face as f64 * quarter)
    } else {
        turn(1, 2, (2.0 * face as f64 - 9.0) * quarter)
    };
    up * turn::<D>(0, 1, (k % 4) as f64 * quarter)
}
