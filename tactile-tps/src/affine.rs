//! Least-squares affine maps and rigid motions.

use nalgebra::{DMatrix, Point, SMatrix, SVector};

use crate::{
    Pairs, SeriesMemory, TpsError, Warp, WarpModel,
    error::{same_length, validate_pairs},
    frame::Frame,
    lanes::dot,
    span::{principal_axes, rounding},
};

/// The affine map f(x) = A x + b. It is a rigid motion if A is a rotation. [`Default`] is the
/// identity.
///
/// ```
/// use nalgebra::{Matrix2, Point2, Vector2};
/// use tactile_tps::{Affine, Warp};
/// let shear = Affine::new(Matrix2::new(1.0, 0.5, 0.0, 1.0), Vector2::new(0.0, 2.0));
/// assert_eq!(shear.apply(&Point2::new(1.0, 4.0)), Point2::new(3.0, 6.0));
/// assert_eq!(shear.jacobian(&Point2::origin()), shear.linear);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Affine<const D: usize> {
    /// The Jacobian A.
    pub linear: SMatrix<f64, D, D>,
    /// The image b of the origin.
    pub offset: SVector<f64, D>,
    /// Rank of the matrix [1 X] of the points used for the fit.
    rank: usize,
}

impl<const D: usize> Default for Affine<D> {
    /// The identity.
    fn default() -> Self {
        Self::new(SMatrix::identity(), SVector::zeros())
    }
}

impl<const D: usize> Affine<D> {
    /// The map x ↦ `linear` x + `offset`.
    ///
    /// ```
    /// use nalgebra::{Matrix2, Point2, Vector2};
    /// use tactile_tps::{Affine, Warp};
    /// let double = Affine::new(Matrix2::identity() * 2.0, Vector2::new(1.0, 0.0));
    /// assert_eq!((double.apply(&Point2::new(1.0, 4.0)), double.rank()), (Point2::new(3.0, 8.0), 3));
    /// ```
    #[must_use]
    pub fn new(linear: SMatrix<f64, D, D>, offset: SVector<f64, D>) -> Self {
        Self {
            linear,
            offset,
            rank: D + 1,
        }
    }

    /// The map that minimises Σ wᵢ |A xᵢ + b − yᵢ|²: A = Yᵀ X (XᵀX)⁺ + N for sources X and targets
    /// Y, taken relative to their weighted means and multiplied by √w.
    ///
    /// It is computed from the singular values of X, so that directions with a millionth of the
    /// extent keep their digits. Along directions that the points do not span it is the identity: N
    /// projects on them. See [`Warp::rank`]. O(n).
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use tactile_tps::{Affine, Warp};
    /// # fn main() -> Result<(), tactile_tps::TpsError> {
    /// let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.4,
    ///     0.6]].map(Point2::from);
    /// let targets = sources.map(|p| Point2::new(2.0 * p.x - p.y, p.y + 3.0));
    /// let map = Affine::fit(&sources, &targets, None)?;
    /// assert!((map.apply(&Point2::new(5.0, 1.0)) - Point2::new(9.0, 4.0)).norm() < 1e-14);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// [`TpsError`] for no points, lengths that differ, or non-finite numbers.
    pub fn fit(
        sources: &[Point<f64, D>],
        targets: &[Point<f64, D>],
        weights: Option<&[f64]>,
    ) -> Result<Self, TpsError> {
        let mut clouds = Clouds::default();
        clouds.take(sources, targets, weights)?;
        Ok(clouds.map(clouds.general()))
    }

    /// The rigid motion that minimises Σ wᵢ |R xᵢ + b − yᵢ|², with a rotation R (no reflection). R
    /// is the rotation closest to C = Σ w y xᵀ (Kabsch 1976; Umeyama 1991). O(n).
    ///
    /// If the points do not determine the rotation, the smallest possible rotation is chosen.
    ///
    /// ```
    /// use nalgebra::{Point2, Rotation2};
    /// use tactile_tps::Affine;
    /// # fn main() -> Result<(), tactile_tps::TpsError> {
    /// let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.4,
    ///     0.6]].map(Point2::from);
    /// let turn = Rotation2::new(0.3);
    /// let motion = Affine::fit_rigid(&sources, &sources.map(|p| turn * p), None)?;
    /// assert!((motion.linear - turn.matrix()).norm() < 1e-15);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// [`TpsError`] for no points, lengths that differ, or non-finite numbers.
    pub fn fit_rigid(
        sources: &[Point<f64, D>],
        targets: &[Point<f64, D>],
        weights: Option<&[f64]>,
    ) -> Result<Self, TpsError> {
        let mut clouds = Clouds::default();
        clouds.take(sources, targets, weights)?;
        Ok(clouds.map(rotation(&clouds.sources, &clouds.targets)))
    }
}

impl<const D: usize> Warp<D> for Affine<D> {
    fn apply(&self, point: &Point<f64, D>) -> Point<f64, D> {
        Point::from(self.linear * point.coords + self.offset)
    }
    fn jacobian(&self, _: &Point<f64, D>) -> SMatrix<f64, D, D> {
        self.linear
    }
    fn rank(&self) -> usize {
        self.rank
    }
}

/// Sources and targets of a fit.
#[derive(Default)]
struct Clouds<const D: usize> {
    sources: Cloud<D>,
    targets: Cloud<D>,
}

impl<const D: usize> Clouds<D> {
    /// Stores pairs, reusing memory.
    fn take(
        &mut self,
        sources: &[Point<f64, D>],
        targets: &[Point<f64, D>],
        weights: Option<&[f64]>,
    ) -> Result<(), TpsError> {
        validate_pairs(sources, targets, weights)?;
        self.sources.take(sources, weights);
        self.targets.take(targets, weights);
        Ok(())
    }

    /// The least-squares Jacobian.
    fn general(&self) -> SMatrix<f64, D, D> {
        let (x, y) = (&self.sources, &self.targets);
        let (mut linear, mut across) = (SMatrix::zeros(), SMatrix::identity());
        for &(direction, size, k) in x.spanned() {
            // The image of the direction, in the units of the frames.
            let column = x.column(k);
            let image = SVector::from_fn(|i, _| dot(y.plain(i), column) / size / size);
            linear += image * direction.transpose() * (y.frame.scale / x.frame.scale);
            across -= direction * direction.transpose();
        }
        // Avoids the rounding of I − I.
        if x.spanned().len() < D {
            linear += across;
        }
        linear
    }

    /// The map with this Jacobian that maps the mean of the sources to that of the targets.
    fn map(&self, linear: SMatrix<f64, D, D>) -> Affine<D> {
        Affine {
            linear,
            offset: self.targets.mean - linear * self.sources.mean,
            rank: 1 + self.sources.spanned().len(),
        }
    }
}

/// Points relative to their weighted mean, multiplied by the roots of their weights, in a frame of
/// unit size.
struct Cloud<const D: usize> {
    frame: Frame<D>,
    mean: SVector<f64, D>,
    /// Coordinates, by axes.
    plain: Vec<f64>,
    /// Coordinates along the principal directions, in the order of their computation.
    turned: Vec<f64>,
    /// Principal directions, the extent along each and its column, in descending order. The first
    /// `rank` of them are spanned.
    directions: [(SVector<f64, D>, f64, usize); D],
    rank: usize,
}

impl<const D: usize> Default for Cloud<D> {
    fn default() -> Self {
        Self {
            frame: Frame::default(),
            mean: SVector::zeros(),
            plain: Vec::new(),
            turned: Vec::new(),
            directions: [(SVector::zeros(), 0.0, 0); D],
            rank: 0,
        }
    }
}

impl<const D: usize> Cloud<D> {
    fn take(&mut self, points: &[Point<f64, D>], weights: Option<&[f64]>) {
        let n = points.len();
        let frame = Frame::around(points, true);
        let most = weights.map_or(1.0, |w| w.iter().fold(0.0, |m, &w| f64::max(m, w)));
        let weight = |i: usize| weights.map_or(1.0, |w| w[i] / most);
        let total: f64 = (0..n).map(weight).sum();
        self.plain.clear();
        self.plain.resize(D * n, 0.0);
        for (k, column) in self.plain.chunks_exact_mut(n).enumerate() {
            let places = column.iter_mut().zip(points);
            places.for_each(|(x, p)| *x = frame.inside(p)[k]);
            let middle = (0..n).map(|i| column[i] * weight(i)).sum::<f64>() / total;
            let places = column.iter_mut().enumerate();
            places.for_each(|(i, x)| *x = (*x - middle) * weight(i).sqrt());
            self.mean[k] = frame.centre[k] + frame.scale * middle;
        }
        self.turned.clone_from(&self.plain);
        let axes = principal_axes::<D>(&mut self.turned);
        let size = |k: usize| {
            let column = &self.turned[k * n..(k + 1) * n];
            dot(column, column).sqrt()
        };
        self.directions = core::array::from_fn(|k| (SVector::from(axes[k]), size(k), k));
        self.directions.sort_unstable_by(|a, b| b.1.total_cmp(&a.1));
        let noise = rounding(n, frame.grain(points));
        self.rank = self.directions.iter().filter(|d| d.1 > noise).count();
        self.frame = frame;
    }

    fn spanned(&self) -> &[(SVector<f64, D>, f64, usize)] {
        &self.directions[..self.rank]
    }

    /// Coordinates along the `k`-th principal direction.
    fn column(&self, k: usize) -> &[f64] {
        let n = self.turned.len() / D;
        &self.turned[k * n..(k + 1) * n]
    }

    /// Coordinates along axis `k`.
    fn plain(&self, k: usize) -> &[f64] {
        let n = self.plain.len() / D;
        &self.plain[k * n..(k + 1) * n]
    }
}

/// The rotation R that maximises tr(Rᵀ C), with C = Σ w y xᵀ = U S Vᵀ.
///
/// C is computed along the principal directions of both clouds, whose sizes may differ by many
/// decades. If a singular value is below rounding, R is as close to the identity as the other
/// directions permit.
fn rotation<const D: usize>(x: &Cloud<D>, y: &Cloud<D>) -> SMatrix<f64, D, D> {
    let rank = x.rank.min(y.rank);
    let (from, to) = (&x.directions[..rank], &y.directions[..rank]);
    // Column b of C, along the directions of the targets.
    let mut columns = vec![0.0; D * D];
    for (b, &(.., source)) in from.iter().enumerate() {
        for (a, &(.., target)) in to.iter().enumerate() {
            columns[b * D + a] = dot(y.column(target), x.column(source));
        }
    }
    let axes = principal_axes::<D>(&mut columns);
    let mut pairs: Vec<(SVector<f64, D>, SVector<f64, D>, f64)> = Vec::new();
    for (column, axis) in columns.chunks_exact(D).zip(axes) {
        let size = dot(column, column).sqrt();
        let sum = |directions: &[(SVector<f64, D>, f64, usize)], parts: &[f64]| {
            let terms = directions.iter().zip(parts);
            terms.fold(SVector::zeros(), |sum, (d, part)| sum + d.0 * *part)
        };
        if size > 0.0 {
            pairs.push((sum(to, column) / size, sum(from, &axis), size));
        }
    }
    pairs.sort_by(|a, b| b.2.total_cmp(&a.2));
    // Rounding error of the sums, for directions of these sizes.
    let count = (x.plain.len() / D) as f64;
    let noise = |k: usize| 4.0 * f64::EPSILON * count.sqrt() * from[k].1 * to[k].1;
    let found = pairs.iter().enumerate();
    let found = found.take_while(|(k, pair)| pair.2 > noise(*k)).count();
    let mut turned = SMatrix::<f64, D, D>::zeros();
    let (mut left, mut right) = (SMatrix::identity(), SMatrix::identity());
    for (k, (u, v, _)) in pairs[..found].iter().enumerate() {
        // Descending factors above one, so that a reflection reverses the weakest direction.
        turned += u * v.transpose() * (1 + D - k) as f64;
        left -= u * u.transpose();
        right -= v * v.transpose();
    }
    if found < D {
        turned += left * right;
    }
    nearest_rotation(&turned)
}

/// The rotation R that maximises tr(Rᵀ C): U diag(1, …, det(U Vᵀ)) Vᵀ from the singular value
/// decomposition.
fn nearest_rotation<const D: usize>(cross: &SMatrix<f64, D, D>) -> SMatrix<f64, D, D> {
    let svd = DMatrix::from_fn(D, D, |i, j| cross[(i, j)]).svd(true, true);
    let (Some(mut u), Some(vt)) = (svd.u, svd.v_t) else {
        return SMatrix::identity();
    };
    // A reflection would be closer. Reversing the weakest direction costs the least.
    if (&u * &vt).determinant() < 0.0 {
        let smallest = svd.singular_values.imin();
        u.column_mut(smallest).neg_mut();
    }
    let rotation = u * vt;
    SMatrix::from_fn(|i, j| rotation[(i, j)])
}

/// The [`WarpModel`] of affine maps: all of them, or rotations and translations only.
///
/// ```
/// use nalgebra::{Point2, Vector2};
/// use tactile_tps::{AffineModel, Warp, WarpModel};
/// # fn main() -> Result<(), tactile_tps::TpsError> {
/// let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.4, 0.6]].map(Point2::from);
/// let doubled = sources.map(|p| p * 2.0 + Vector2::new(1.0, 2.0));
/// let warp: Box<dyn Warp<2> + Send + Sync> = AffineModel::General.fit(&sources, &doubled,
///     None)?;
/// assert!((warp.apply(&Point2::new(5.0, 1.0)) - Point2::new(11.0, 4.0)).norm() < 1e-14);
/// let motion = AffineModel::Rigid.fit(&sources, &doubled, None)?;
/// assert!((motion.jacobian(&Point2::origin()).determinant() - 1.0_f64).abs() < 1e-14);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum AffineModel {
    /// Any affine map: [`Affine::fit`].
    #[default]
    General,
    /// A rotation and a translation: [`Affine::fit_rigid`].
    Rigid,
}

impl<const D: usize> WarpModel<D> for AffineModel {
    fn fit(
        &self,
        sources: &[Point<f64, D>],
        targets: &[Point<f64, D>],
        weights: Option<&[f64]>,
    ) -> Result<Box<dyn Warp<D> + Send + Sync>, TpsError> {
        let fit = match self {
            Self::General => Affine::fit,
            Self::Rigid => Affine::fit_rigid,
        };
        Ok(Box::new(fit(sources, targets, weights)?))
    }

    fn jacobians_through(
        &self,
        memory: &mut SeriesMemory,
        pairs: Pairs<'_, D>,
        points: &[Point<f64, D>],
        jacobians: &mut [SMatrix<f64, D, D>],
    ) -> Result<(), TpsError> {
        same_length(points.len(), jacobians.len())?;
        let clouds: &mut Clouds<D> = memory.state();
        clouds.take(pairs.sources, pairs.targets, pairs.weights)?;
        jacobians.fill(match self {
            Self::General => clouds.general(),
            Self::Rigid => rotation(&clouds.sources, &clouds.targets),
        });
        Ok(())
    }
}
