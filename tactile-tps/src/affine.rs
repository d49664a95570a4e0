//! Affine maps and rigid motions, fitted by weighted least squares.

use nalgebra::{Point, SMatrix, SVector};

use crate::{Scalar, TpsError, Warp, centres::finite, options::validate_weights};

/// The affine map f(x) = A x + b; a rigid motion where A is a rotation. [`Default`] is the identity.
///
/// ```
/// # use nalgebra::{Matrix2, Point2, Vector2};
/// # use tactile_tps::{Affine, Warp};
/// let shear = Affine { linear: Matrix2::new(1.0, 0.5, 0.0, 1.0), offset: Vector2::new(0.0, 2.0) };
/// assert_eq!(shear.apply(&Point2::new(1.0, 4.0)), Point2::new(3.0, 6.0));
/// assert_eq!(shear.jacobian(&Point2::origin()), shear.linear);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(bound = "T: Scalar + serde::Serialize + serde::de::DeserializeOwned")
)]
pub struct Affine<T: Scalar, const D: usize> {
    /// The Jacobian A.
    pub linear: SMatrix<T, D, D>,
    /// The image b of the origin.
    pub offset: SVector<T, D>,
}

impl<T: Scalar, const D: usize> Default for Affine<T, D> {
    /// The map that leaves every point where it is.
    fn default() -> Self {
        Self {
            linear: SMatrix::identity(),
            offset: SVector::zeros(),
        }
    }
}

impl<T: Scalar, const D: usize> Affine<T, D> {
    /// The map of least Σ wᵢ |A xᵢ + b − yᵢ|²: A = C S⁺ with S = Σ w x xᵀ and C = Σ w y xᵀ about the weighted means.
    ///
    /// Along directions that the points do not span the map moves points with their mean (the pseudo-inverse S⁺). O(n).
    ///
    /// ```
    /// # use nalgebra::Point2;
    /// # use tactile_tps::{Affine, Warp};
    /// # fn main() -> Result<(), tactile_tps::TpsError> {
    /// let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.4, 0.6]].map(Point2::from);
    /// let targets = sources.map(|p| Point2::new(2.0 * p.x - p.y, p.y + 3.0));
    /// let map = Affine::fit(&sources, &targets, None)?;
    /// assert!((map.apply(&Point2::new(5.0, 1.0)) - Point2::new(9.0, 4.0)).norm() < 1e-14);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// [`TpsError`] for no points, lengths that differ, or numbers that are not finite.
    pub fn fit(
        sources: &[Point<T, D>],
        targets: &[Point<T, D>],
        weights: Option<&[T]>,
    ) -> Result<Self, TpsError> {
        let moments = Moments::new(sources, targets, weights)?;
        let (values, vectors) = symmetric_eigen(&moments.scatter);
        let largest = values.iter().copied().fold(0.0, f64::max);
        let mut linear = SMatrix::<f64, D, D>::zeros();
        for (k, &value) in values.iter().enumerate() {
            // Below this the extent is the rounding of the moments.
            if value > largest * 1e-13 {
                let axis = SVector::<f64, D>::from_fn(|i, _| vectors[(i, k)]);
                linear += moments.cross * axis * axis.transpose() / value;
            }
        }
        Ok(Self {
            linear: linear.map(T::narrow),
            offset: moments.offset(&linear),
        })
    }

    /// The rigid motion of least Σ wᵢ |R xᵢ + b − yᵢ|², R a rotation (no reflection): the one nearest to C = Σ w y xᵀ
    /// (Kabsch 1976; Umeyama 1991). O(n).
    ///
    /// ```
    /// # use nalgebra::{Point2, Rotation2};
    /// # use tactile_tps::Affine;
    /// # fn main() -> Result<(), tactile_tps::TpsError> {
    /// let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.4, 0.6]].map(Point2::from);
    /// let turn = Rotation2::new(0.3);
    /// let motion = Affine::fit_rigid(&sources, &sources.map(|p| turn * p), None)?;
    /// assert!((motion.linear - turn.matrix()).norm() < 1e-15);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// [`TpsError`] for no points, lengths that differ, or numbers that are not finite.
    pub fn fit_rigid(
        sources: &[Point<T, D>],
        targets: &[Point<T, D>],
        weights: Option<&[T]>,
    ) -> Result<Self, TpsError> {
        let moments = Moments::new(sources, targets, weights)?;
        let rotation = nearest_rotation(&moments.cross);
        Ok(Self {
            linear: rotation.map(T::narrow),
            offset: moments.offset(&rotation),
        })
    }
}

impl<T: Scalar, const D: usize> Warp<T, D> for Affine<T, D> {
    fn apply(&self, point: &Point<T, D>) -> Point<T, D> {
        Point::from(self.linear * point.coords + self.offset)
    }
    fn jacobian(&self, _: &Point<T, D>) -> SMatrix<T, D, D> {
        self.linear
    }
}

/// Weighted moments of pairs about their means, in `f64`.
struct Moments<const D: usize> {
    source_mean: SVector<f64, D>,
    target_mean: SVector<f64, D>,
    cross: SMatrix<f64, D, D>,
    scatter: SMatrix<f64, D, D>,
}

impl<const D: usize> Moments<D> {
    fn new<T: Scalar>(
        sources: &[Point<T, D>],
        targets: &[Point<T, D>],
        weights: Option<&[T]>,
    ) -> Result<Self, TpsError> {
        validate(sources, targets, weights)?;
        let weight = |i: usize| weights.map_or(1.0, |w| w[i].widen());
        let vector = |p: &Point<T, D>| p.coords.map(T::widen);
        let total: f64 = (0..sources.len()).map(weight).sum();
        let mean = |points: &[Point<T, D>]| {
            let origin = vector(&points[0]);
            let sum =
                |sum: SVector<f64, D>, (i, p)| sum + (vector(p) - origin) * (weight(i) / total);
            origin + points.iter().enumerate().fold(SVector::zeros(), sum)
        };
        let (source_mean, target_mean) = (mean(sources), mean(targets));
        let (mut cross, mut scatter) = (SMatrix::zeros(), SMatrix::zeros());
        for (i, (x, y)) in sources.iter().zip(targets).enumerate() {
            let (x, y) = (vector(x) - source_mean, vector(y) - target_mean);
            cross += y * x.transpose() * (weight(i) / total);
            scatter += x * x.transpose() * (weight(i) / total);
        }
        Ok(Self {
            source_mean,
            target_mean,
            cross,
            scatter,
        })
    }

    fn offset<T: Scalar>(&self, linear: &SMatrix<f64, D, D>) -> SVector<T, D> {
        (self.target_mean - linear * self.source_mean).map(T::narrow)
    }
}

fn validate<T: Scalar, const D: usize>(
    sources: &[Point<T, D>],
    targets: &[Point<T, D>],
    weights: Option<&[T]>,
) -> Result<(), TpsError> {
    if sources.is_empty() {
        return Err(TpsError::Empty("source points"));
    }
    if targets.len() != sources.len() {
        return Err(TpsError::Length {
            input: "target points",
            expected: sources.len(),
            found: targets.len(),
        });
    }
    finite(sources, "source points")?;
    finite(targets, "target points")?;
    weights.map_or(Ok(()), |weights| validate_weights(weights, sources.len()))
}

/// Eigenvalues and vectors of a symmetric `D` × `D` matrix.
fn symmetric_eigen<const D: usize>(
    matrix: &SMatrix<f64, D, D>,
) -> (Vec<f64>, nalgebra::DMatrix<f64>) {
    let dynamic = nalgebra::DMatrix::from_fn(D, D, |i, j| matrix[(i, j)]);
    let eigen = dynamic.symmetric_eigen();
    (
        eigen.eigenvalues.iter().copied().collect(),
        eigen.eigenvectors,
    )
}

/// The rotation R that maximises tr(Rᵀ C): U diag(1, …, det(U Vᵀ)) Vᵀ of the singular value decomposition.
fn nearest_rotation<const D: usize>(cross: &SMatrix<f64, D, D>) -> SMatrix<f64, D, D> {
    let svd = nalgebra::DMatrix::from_fn(D, D, |i, j| cross[(i, j)]).svd(true, true);
    let (Some(mut u), Some(vt)) = (svd.u, svd.v_t) else {
        return SMatrix::identity();
    };
    if (&u * &vt).determinant() < 0.0 {
        let smallest = svd.singular_values.imin();
        u.column_mut(smallest).neg_mut();
    }
    let rotation = u * vt;
    SMatrix::from_fn(|i, j| rotation[(i, j)])
}
