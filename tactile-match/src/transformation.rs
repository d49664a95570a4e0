//! The parameters of a fitted rigid motion, similarity or affine map.

use nalgebra::{Matrix3, Point, SMatrix, SVector, Vector3};
use tactile_tps::Affine;

/// The map `x ↦ A x + b` found by a match, with its standard errors from the noise of the pairs. It
/// exists if the matcher allows only translation, rotation, scaling or shear
/// ([`Transformation`](crate::Transformation)).
///
/// ```
/// use nalgebra::{Point2, Rotation2, Vector2};
/// use tactile_match::{AnnealedSoftassign, PointMatcher, Transformation};
/// let model: Vec<_> = (0..12)
///     .map(f64::from)
///     .map(|k| Point2::new(k % 4.0 + 0.3 * k.sin(), (k / 4.0).floor()))
///     .collect();
/// let image = |p: &Point2<f64>| Rotation2::new(0.3) * p * 1.1 + Vector2::new(2.0, 0.0);
/// let target: Vec<_> = model.iter().map(image).collect();
/// let matcher = AnnealedSoftassign::default().with_transformation(Transformation::Similarity);
/// let found = matcher.match_points(&model, &target)?.transformation.unwrap();
/// assert!((found.scale - 1.1).abs() < 1e-6 && (found.rotation[2] - 0.3).abs() < 1e-6);
/// assert!((found.shift - Vector2::new(2.0, 0.0)).norm() < 1e-5);
/// # Ok::<(), tactile_match::MatchError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct FittedTransformation<const D: usize> {
    /// The matrix A.
    pub linear: SMatrix<f64, D, D>,
    /// The image b of the origin, in the units of the points.
    pub shift: SVector<f64, D>,
    /// Standard errors of the shift.
    pub shift_error: SVector<f64, D>,
    /// Scale factor of lengths. For an affine map, their geometric mean.
    pub scale: f64,
    /// Standard error of the scale. 0 for a rigid motion.
    pub scale_error: f64,
    /// The rotation vector, in radians. In the plane the last component is the angle and the others
    /// are zero. For an affine map it belongs to the nearest rotation.
    pub rotation: Vector3<f64>,
    /// Standard errors of the rotation.
    pub rotation_error: Vector3<f64>,
}

impl<const D: usize> FittedTransformation<D> {
    /// Fits the map from the warped model, the rows with a partner, and the noise of a coordinate.
    /// `None` if the points do not determine a map.
    pub(crate) fn of(
        model: &[Point<f64, D>],
        warped: &[Point<f64, D>],
        matched: impl Iterator<Item = usize>,
        sigma: f64,
        grows: bool,
    ) -> Option<Self> {
        let map = Affine::fit(model, warped, None).ok()?;
        let rows: Vec<_> = matched.map(|i| model[i].coords).collect();
        let n = rows.len() as f64;
        if rows.is_empty() {
            return None;
        }
        let centre: SVector<f64, D> = rows.iter().sum::<SVector<f64, D>>() / n;
        let mut scatter = SMatrix::<f64, D, D>::zeros();
        for p in &rows {
            scatter += (p - centre) * (p - centre).transpose();
        }
        let in_space = |v: SVector<f64, D>| Vector3::from_fn(|k, _| if k < D { v[k] } else { 0.0 });
        let whole = filled_up(&map.linear);
        let scale = whole.determinant().abs().powf(1.0 / D as f64);
        let extent = scatter.trace();
        let spread = Matrix3::from_fn(|r, c| if r < D && c < D { scatter[(r, c)] } else { 0.0 });
        // The inertia of the rotated model about each axis determines the error of the rotation.
        let turn = rotation_of(&whole);
        let spread = turn * spread * turn.transpose();
        let inertia = Matrix3::identity() * spread.trace() - spread;
        let unit = (sigma / scale).powi(2);
        let covariance = if D == 2 {
            Matrix3::from_diagonal(&Vector3::new(0.0, 0.0, inertia[(2, 2)].recip()))
        } else {
            inertia.try_inverse()?
        } * unit;
        let scale_error = if grows { sigma / extent.sqrt() } else { 0.0 };
        let arm = in_space(map.linear * centre);
        let turned = arm.cross_matrix() * covariance * arm.cross_matrix().transpose();
        let grown = arm * (scale_error / scale);
        let shift_error = SVector::<f64, D>::from_fn(|k, _| {
            (sigma * sigma / n + turned[(k, k)] + grown[k] * grown[k]).sqrt()
        });
        let finite = shift_error.iter().all(|e| e.is_finite());
        finite.then(|| Self {
            linear: map.linear,
            shift: map.offset,
            shift_error,
            scale,
            scale_error,
            rotation: rotation_vector(&turn),
            rotation_error: covariance.diagonal().map(f64::sqrt),
        })
    }
}

/// Extends a map of the plane by the identity in the third coordinate.
fn filled_up<const D: usize>(linear: &SMatrix<f64, D, D>) -> Matrix3<f64> {
    Matrix3::from_fn(|r, c| match (r < D, c < D) {
        (true, true) => linear[(r, c)],
        _ => f64::from(u8::from(r == c)),
    })
}

/// The rotation nearest to a map.
fn rotation_of(linear: &Matrix3<f64>) -> Matrix3<f64> {
    let decomposition = linear.svd(true, true);
    match (decomposition.u, decomposition.v_t) {
        (Some(u), Some(v_t)) => u * v_t,
        _ => Matrix3::identity(),
    }
}

/// Axis times angle.
fn rotation_vector(turn: &Matrix3<f64>) -> Vector3<f64> {
    nalgebra::Rotation3::from_matrix_unchecked(*turn).scaled_axis()
}
