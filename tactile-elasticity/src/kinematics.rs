//! Quantities derived from a deformation besides its strain, each with its standard error.

use crate::error::ElasticityError;
use crate::strain::{Deformation, PrincipalStretches, StrainMeasure, symmetric_eigen};
use nalgebra::{Matrix3, SymmetricEigen, Vector3};

/// Step along an unknown derivative. Quantities that depend on it change with a step of any size.
const UNKNOWN_STEP: f64 = 1e-3;

/// Rotation, principal strains, volume change and equivalent strain at a point, with errors.
///
/// Errors are propagated from the displacement gradient to first order. They are infinite for
/// quantities that depend on a derivative of infinite variance, along an axis that the points do
/// not span.
///
/// In the plane nothing changes along z: H has zeros there, the ratio is of areas, and the
/// equivalent strain assumes plane strain.
///
/// ```
/// use nalgebra::Matrix3;
/// use tactile_elasticity::kinematics::StrainQuantities;
/// use tactile_elasticity::strain::GreenLagrange;
/// // A sheet in shear: x moves by 2 % of y.
/// let h = Matrix3::new(0.0, 0.02, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
/// let variance = Matrix3::from_diagonal(&[1e-6, 1e-6, 0.0].into());
/// let found = StrainQuantities::of(&h, &variance, 2, &GreenLagrange)?;
/// // It rotates clockwise by about half of that, with the error of half a sum of two derivatives.
/// assert!((found.rotation_rad + 0.01).abs() < 1e-5);
/// assert!((found.rotation_error_rad - 1e-3 / 2_f64.sqrt()).abs() < 1e-6);
/// // Its area is unchanged, and it is stretched most along the diagonal.
/// assert!((found.size_ratio - 1.0).abs() < 1e-15);
/// assert!((found.principal[0] - 0.01).abs() < 2e-4 && found.directions[(0, 0)].abs() > 0.7);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct StrainQuantities {
    /// Displacement gradient H, row i of displacement i.
    pub gradient: Matrix3<f64>,
    /// Standard errors of the gradient.
    pub gradient_error: Matrix3<f64>,
    /// Angle of the rotation R of F = R U: counter-clockwise from x to y in the plane, about its own
    /// axis and from 0 to π in space.
    pub rotation_rad: f64,
    /// Standard error of the rotation.
    pub rotation_error_rad: f64,
    /// Principal strains, largest first: two in the plane and 0.
    pub principal: [f64; 3],
    /// Standard errors of the principal strains.
    pub principal_error: [f64; 3],
    /// Principal directions, one per column, up to sign.
    pub directions: Matrix3<f64>,
    /// Standard errors of the directions' angles. Directions of equal strains are undetermined.
    pub direction_error_rad: [f64; 3],
    /// det F: the volume (in the plane, the area) relative to the undeformed one.
    pub size_ratio: f64,
    /// Standard error of the ratio.
    pub size_ratio_error: f64,
    /// Von Mises' equivalent strain √(⅔ e′:e′), e′ the deviator.
    pub equivalent: f64,
    /// Standard error of the equivalent strain.
    pub equivalent_error: f64,
}

/// Quantities derived from a gradient.
#[derive(Clone, Copy)]
struct Followers {
    rotation: f64,
    principal: [f64; 3],
    directions: Matrix3<f64>,
    ratio: f64,
    equivalent: f64,
}

impl StrainQuantities {
    /// Computes the quantities from a displacement gradient. Each of its rows has this covariance,
    /// and the rows are independent. `axes` is 2 in the plane and 3 in space. Strains are computed
    /// by `measure`.
    ///
    /// # Errors
    /// Those of [`StrainMeasure::of`].
    pub fn of(
        h: &Matrix3<f64>,
        row_covariance: &Matrix3<f64>,
        axes: usize,
        measure: &dyn StrainMeasure,
    ) -> Result<Self, ElasticityError> {
        let centre = Followers::of(h, axes, measure)?;
        let mut squares = Squares::default();
        for (direction, factor) in steps(row_covariance, axes) {
            for row in 0..axes {
                let mut moved = *h;
                (0..axes).for_each(|axis| moved[(row, axis)] += direction[axis]);
                match Followers::of(&moved, axes, measure) {
                    Ok(moved) => squares.add(&centre, &moved, factor),
                    // The deformation folds within the error.
                    Err(_) => squares.add(&centre, &centre, f64::NAN),
                }
            }
        }
        let gradient_error = Matrix3::from_fn(|i, j| match i < axes && j < axes {
            true => row_covariance[(j, j)].max(0.0).sqrt(),
            false => 0.0,
        });
        Ok(Self {
            gradient: *h,
            gradient_error,
            rotation_rad: centre.rotation,
            rotation_error_rad: squares.rotation.sqrt(),
            principal: centre.principal,
            principal_error: squares.principal.map(f64::sqrt),
            directions: centre.directions,
            direction_error_rad: squares.directions.map(f64::sqrt),
            size_ratio: centre.ratio,
            size_ratio_error: squares.ratio.sqrt(),
            equivalent: centre.equivalent,
            equivalent_error: squares.equivalent.sqrt(),
        })
    }

    /// All quantities undetermined: NaN throughout, as for a deformation that folds.
    ///
    /// ```
    /// use tactile_elasticity::kinematics::StrainQuantities;
    /// assert!(StrainQuantities::undefined().size_ratio.is_nan());
    /// ```
    #[must_use]
    pub fn undefined() -> Self {
        let (tensor, three) = (Matrix3::from_element(f64::NAN), [f64::NAN; 3]);
        Self {
            gradient: tensor,
            gradient_error: tensor,
            rotation_rad: f64::NAN,
            rotation_error_rad: f64::NAN,
            principal: three,
            principal_error: three,
            directions: tensor,
            direction_error_rad: three,
            size_ratio: f64::NAN,
            size_ratio_error: f64::NAN,
            equivalent: f64::NAN,
            equivalent_error: f64::NAN,
        }
    }
}

/// Steps of one standard deviation along the principal directions of a row's covariance, and steps
/// along unknown derivatives, whose squares have infinite weight.
fn steps(covariance: &Matrix3<f64>, axes: usize) -> Vec<(Vector3<f64>, f64)> {
    let known = |a: usize| a < axes && covariance[(a, a)].is_finite();
    let finite = Matrix3::from_fn(|a, b| match known(a) && known(b) {
        true => covariance[(a, b)],
        false => 0.0,
    });
    let eigen = SymmetricEigen::new(finite);
    let columns = eigen.eigenvectors.column_iter();
    let pairs = eigen.eigenvalues.iter().zip(columns);
    let sized = pairs.map(|(size, direction)| (direction * size.max(0.0).sqrt(), 1.0));
    let unknown = (0..axes).filter(|&a| !known(a));
    let unit = |a: usize| Vector3::from_fn(|b, _| if a == b { UNKNOWN_STEP } else { 0.0 });
    sized
        .filter(|(step, _)| step.norm() > 0.0)
        .chain(unknown.map(|a| (unit(a), f64::INFINITY)))
        .collect()
}

/// Variances of the quantities.
#[derive(Default)]
struct Squares {
    rotation: f64,
    principal: [f64; 3],
    directions: [f64; 3],
    ratio: f64,
    equivalent: f64,
}

impl Squares {
    fn add(&mut self, centre: &Followers, moved: &Followers, factor: f64) {
        let square = |change: f64| match change == 0.0 && !factor.is_nan() {
            true => 0.0,
            false => factor * change * change,
        };
        self.rotation += square(moved.rotation - centre.rotation);
        self.ratio += square(moved.ratio - centre.ratio);
        self.equivalent += square(moved.equivalent - centre.equivalent);
        for k in 0..3 {
            self.principal[k] += square(moved.principal[k] - centre.principal[k]);
            let (before, after) = (centre.directions.column(k), moved.directions.column(k));
            // Directions have no sign.
            let turn = before.cross(&after).norm().atan2(before.dot(&after).abs());
            self.directions[k] += square(turn);
        }
    }
}

impl Followers {
    fn of(
        h: &Matrix3<f64>,
        axes: usize,
        measure: &dyn StrainMeasure,
    ) -> Result<Self, ElasticityError> {
        let deformation = Deformation::from_displacement_gradient(*h);
        let strain = measure.of(&deformation)?;
        let (principal, directions) = if axes == 2 {
            principal_in_plane(&strain)
        } else {
            symmetric_eigen(&strain)
        };
        let deviator = strain - Matrix3::identity() * (strain.trace() / 3.0);
        Ok(Self {
            rotation: if axes == 2 {
                (h[(1, 0)] - h[(0, 1)]).atan2(2.0 + h[(0, 0)] + h[(1, 1)])
            } else {
                rotation_angle(&deformation)
            },
            principal,
            directions,
            ratio: 1.0 + deformation.volume_change(),
            equivalent: (2.0 / 3.0 * deviator.norm_squared()).sqrt(),
        })
    }
}

/// The two principal strains of the plane with their directions, then zero along z.
fn principal_in_plane(e: &Matrix3<f64>) -> ([f64; 3], Matrix3<f64>) {
    let (middle, half) = (0.5 * (e[(0, 0)] + e[(1, 1)]), 0.5 * (e[(0, 0)] - e[(1, 1)]));
    let radius = half.hypot(e[(0, 1)]);
    let (sine, cosine) = (0.5 * e[(0, 1)].atan2(half)).sin_cos();
    let directions = Matrix3::new(cosine, -sine, 0.0, sine, cosine, 0.0, 0.0, 0.0, 1.0);
    ([middle + radius, middle - radius, 0.0], directions)
}

/// The angle of R in F = R U, from 0 to π.
fn rotation_angle(deformation: &Deformation) -> f64 {
    let stretches = PrincipalStretches::from(deformation);
    let inverse = Vector3::from(stretches.stretches.map(f64::recip));
    let v = stretches.directions;
    let r =
        deformation.deformation_gradient() * v * Matrix3::from_diagonal(&inverse) * v.transpose();
    let twice = Vector3::new(
        r[(2, 1)] - r[(1, 2)],
        r[(0, 2)] - r[(2, 0)],
        r[(1, 0)] - r[(0, 1)],
    );
    // tan of the angle is 2 sin / 2 cos: exact for small angles, where the cosine is not.
    twice.norm().atan2(r.trace() - 1.0)
}
