//! Where a run may start: first guesses of the affine part of the warp.

use super::frame::mean;
use nalgebra::{SMatrix, SVector, SymmetricEigen};

/// The model moved so that the centroids meet.
pub(crate) fn centred<const D: usize>(model: &[[f64; D]], target: &[[f64; D]], base: &mut Vec<[f64; D]>) {
    let (from, to) = (mean(model), mean(target));
    base.clear();
    base.extend(model.iter().map(|x| std::array::from_fn(|k| x[k] - from[k] + to[k])));
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
    let (root, inverse) = roots(&covariance(model, &from));
    let middle = roots(&(root * covariance(target, &to) * root)).0;
    let map = inverse * middle * inverse * root * rotation * inverse;
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

/// Square root and inverse square root of a covariance; directions without extent get a thousandth of the largest.
fn roots<const D: usize>(matrix: &SMatrix<f64, D, D>) -> (SMatrix<f64, D, D>, SMatrix<f64, D, D>) {
    let dynamic = nalgebra::DMatrix::from_fn(D, D, |r, c| matrix[(r, c)]);
    let eigen = SymmetricEigen::new(dynamic);
    let floor = (1e-6 * eigen.eigenvalues.max()).max(f64::MIN_POSITIVE);
    let power = |exponent: f64| {
        SMatrix::from_fn(|r, c| {
            let term = |k: usize| {
                let v = &eigen.eigenvectors;
                v[(r, k)] * eigen.eigenvalues[k].max(floor).powf(exponent) * v[(c, k)]
            };
            (0..D).map(term).sum()
        })
    };
    (power(0.5), power(-0.5))
}

/// Rotations that cover all angles (`Any`): every 30° in the plane, the 24 of the cube in space.
pub(crate) fn rotations<const D: usize>() -> Vec<SMatrix<f64, D, D>> {
    match D {
        2 => (0..12).map(|k| turn(0, 1, f64::from(k) * std::f64::consts::PI / 6.0)).collect(),
        3 => cube(),
        _ => vec![SMatrix::identity()],
    }
}

/// Rotations tried where the target is turned by little: none, and 30° each way in the plane.
pub(crate) fn limited_rotations<const D: usize>() -> Vec<SMatrix<f64, D, D>> {
    let mut out = vec![SMatrix::identity()];
    if D == 2 {
        out.extend([-1.0, 1.0].map(|sign| turn(0, 1, sign * std::f64::consts::PI / 6.0)));
    }
    out
}

fn turn<const D: usize>(a: usize, b: usize, angle: f64) -> SMatrix<f64, D, D> {
    let mut r = SMatrix::identity();
    (r[(a, a)], r[(a, b)], r[(b, a)], r[(b, b)]) = (angle.cos(), -angle.sin(), angle.sin(), angle.cos());
    r
}

fn cube<const D: usize>() -> Vec<SMatrix<f64, D, D>> {
    let quarter = std::f64::consts::FRAC_PI_2;
    let mut out = Vec::with_capacity(24);
    for face in 0..6 {
        let up = if face < 4 {
            turn(0, 2, f64::from(face) * quarter)
        } else {
            turn(1, 2, (2 * face - 9) as f64 * quarter)
        };
        out.extend((0..4).map(|k| up * turn::<D>(0, 1, f64::from(k) * quarter)));
    }
    out
}
