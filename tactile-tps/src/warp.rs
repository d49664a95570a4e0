//! Maps of space onto itself, and models that fit them to pairs of points.

use core::any::Any;
use core::ops::Deref;

use nalgebra::{Point, SMatrix};

use crate::{FitOptions, Kernel, Spline, ThinPlateSpline, TpsError, error::same_length};

/// A map of `D`-dimensional space onto itself. The trait is object safe, and `Box<dyn Warp<3>>`
/// implements it.
///
/// ```
/// use nalgebra::{Point2, Matrix2, Vector2};
/// use tactile_tps::{Affine, Warp};
/// let warp: Box<dyn Warp<2>> = Box::new(Affine::new(Matrix2::identity() * 2.0,
///     Vector2::new(1.0, 0.0)));
/// assert_eq!(warp.apply(&Point2::new(1.0, 3.0)), Point2::new(3.0, 6.0));
/// ```
pub trait Warp<const D: usize>: Send + Sync {
    /// The image of a point.
    fn apply(&self, point: &Point<f64, D>) -> Point<f64, D>;

    /// The Jacobian ∂fᵢ/∂xⱼ at a point (row i, column j). For a deformation it is the deformation
    /// gradient.
    fn jacobian(&self, point: &Point<f64, D>) -> SMatrix<f64, D, D>;

    /// Rank of the matrix [1 X] of the points used for the fit: one more than the number of
    /// directions that they span. The default is `D + 1`, for points that span space.
    ///
    /// Along other directions the points determine nothing. There the crate's warps move each
    /// normal line (or plane) with its foot point, without a change of length.
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use tactile_tps::{FitOptions, ThinPlateSpline, Warp};
    /// // Landmarks on a diagonal: the identity there is the identity everywhere.
    /// let line = [[0.0, 0.0], [1.0, 1.0], [3.0, 3.0]].map(Point2::from);
    /// let warp = ThinPlateSpline::fit(&line, &line, &FitOptions::default())?;
    /// assert_eq!(warp.rank(), 2);
    /// assert!((warp.apply(&Point2::new(0.0, 1.0)) - Point2::new(0.0, 1.0)).norm() < 1e-14);
    /// # Ok::<(), tactile_tps::TpsError>(())
    /// ```
    fn rank(&self) -> usize {
        D + 1
    }

    /// Writes the images of many points into the caller's memory.
    ///
    /// # Errors
    /// [`TpsError::Length`] if the slices differ in length.
    fn apply_into(
        &self,
        points: &[Point<f64, D>],
        images: &mut [Point<f64, D>],
    ) -> Result<(), TpsError> {
        same_length(points.len(), images.len())?;
        points
            .iter()
            .zip(images)
            .for_each(|(point, image)| *image = self.apply(point));
        Ok(())
    }

    /// Writes the Jacobians at many points into the caller's memory.
    ///
    /// ```
    /// use nalgebra::{Matrix2, Point2, Vector2};
    /// use tactile_tps::{Affine, Warp};
    /// let shear = Affine::new(Matrix2::new(1.0, 0.2, 0.0, 1.0), Vector2::zeros());
    /// let points = [[0.0, 0.0], [1.0, 2.0], [3.0, 1.0]].map(Point2::from);
    /// let (mut images, mut jacobians) = (points, [Matrix2::zeros(); 3]);
    /// shear.apply_into(&points, &mut images)?;
    /// shear.jacobian_into(&points, &mut jacobians)?;
    /// assert_eq!(images[1], Point2::new(1.4, 2.0));
    /// assert_eq!((jacobians[1], shear.jacobian(&points[1]).determinant()), (jacobians[0], 1.0));
    /// // shear keeps areas
    /// assert!(shear.apply_into(&points, &mut images[..2]).is_err());
    /// # Ok::<(), tactile_tps::TpsError>(())
    /// ```
    ///
    /// # Errors
    /// [`TpsError::Length`] if the slices differ in length.
    fn jacobian_into(
        &self,
        points: &[Point<f64, D>],
        jacobians: &mut [SMatrix<f64, D, D>],
    ) -> Result<(), TpsError> {
        same_length(points.len(), jacobians.len())?;
        points
            .iter()
            .zip(jacobians)
            .for_each(|(point, jacobian)| *jacobian = self.jacobian(point));
        Ok(())
    }
}

/// Implements the trait for boxed, shared and borrowed warps.
impl<const D: usize, P: Deref<Target: Warp<D>> + Send + Sync> Warp<D> for P {
    fn apply(&self, point: &Point<f64, D>) -> Point<f64, D> {
        (**self).apply(point)
    }

    fn jacobian(&self, point: &Point<f64, D>) -> SMatrix<f64, D, D> {
        (**self).jacobian(point)
    }

    fn rank(&self) -> usize {
        (**self).rank()
    }

    fn apply_into(
        &self,
        points: &[Point<f64, D>],
        images: &mut [Point<f64, D>],
    ) -> Result<(), TpsError> {
        (**self).apply_into(points, images)
    }

    fn jacobian_into(
        &self,
        points: &[Point<f64, D>],
        jacobians: &mut [SMatrix<f64, D, D>],
    ) -> Result<(), TpsError> {
        (**self).jacobian_into(points, jacobians)
    }
}

/// A family of warps, with a rule that selects one from weighted pairs of points.
///
/// The trait is object safe, so that a pipeline can hold an `Arc<dyn WarpModel<3> + Send + Sync>`.
/// If the kind of warp is fixed, use the fit of its own type: [`Spline::fit`],
/// [`Affine::fit`](crate::Affine::fit), [`Affine::fit_rigid`](crate::Affine::fit_rigid).
///
/// ```
/// use nalgebra::Point2;
/// use std::sync::Arc;
/// use tactile_tps::{AffineModel, FitOptions, Warp, WarpModel};
/// # fn main() -> Result<(), tactile_tps::TpsError> {
/// let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.4, 0.6]].map(Point2::from);
/// let targets = sources.map(|p| Point2::new(p.x + 0.1 * p.y * p.y, p.y));
/// let models: [Arc<dyn WarpModel<2> + Send + Sync>; 2] = [Arc::new(FitOptions::default()),
///     Arc::new(AffineModel::General)];
/// let mut misfits = Vec::new();
/// for model in models {
///     let warp = model.fit(&sources, &targets, None)?;
///     misfits.push((warp.apply(&sources[4]) - targets[4]).norm());
/// }
/// assert!(misfits[0] < 1e-14 && misfits[1] > 1e-3); // a spline interpolates, an affine map cannot
/// # Ok(())
/// # }
/// ```
pub trait WarpModel<const D: usize>: Send + Sync {
    /// The warp that maps each source to its target as closely as the model permits. Without
    /// weights all pairs count equally.
    ///
    /// # Errors
    /// See [`TpsError`].
    fn fit(
        &self,
        sources: &[Point<f64, D>],
        targets: &[Point<f64, D>],
        weights: Option<&[f64]>,
    ) -> Result<Box<dyn Warp<D> + Send + Sync>, TpsError>;

    /// The Jacobians at `points` of the warp that [`fit`](Self::fit) finds, for one set of pairs of
    /// a series.
    ///
    /// A model may keep its state in `memory`; it then allocates nothing from the second set on.
    /// The default implementation calls `fit`.
    ///
    /// ```
    /// use nalgebra::{Matrix2, Point2};
    /// use tactile_tps::{AffineModel, SeriesMemory, Pairs, WarpModel};
    /// let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]].map(Point2::from);
    /// let (mut memory, mut jacobians) = (SeriesMemory::default(), [Matrix2::zeros()]);
    /// for stretch in [1.1_f64, 1.2] {
    ///     let targets = sources.map(|p| Point2::new(stretch * p.x, p.y));
    ///     let pairs = Pairs { sources: &sources, targets: &targets, weights: None };
    ///     AffineModel::General.jacobians_through(&mut memory, pairs, &sources[..1],
    ///         &mut jacobians)?;
    ///     assert!((jacobians[0][(0, 0)] - stretch).abs() < 1e-14);
    /// }
    /// # Ok::<(), tactile_tps::TpsError>(())
    /// ```
    ///
    /// # Errors
    /// Those of [`fit`](Self::fit), and [`TpsError::Length`] if `points` and `jacobians` differ in
    /// number.
    fn jacobians_through(
        &self,
        memory: &mut SeriesMemory,
        pairs: Pairs<'_, D>,
        points: &[Point<f64, D>],
        jacobians: &mut [SMatrix<f64, D, D>],
    ) -> Result<(), TpsError> {
        let _ = memory;
        self.fit(pairs.sources, pairs.targets, pairs.weights)?
            .jacobian_into(points, jacobians)
    }
}

/// Implements the trait for boxed, shared and borrowed models.
impl<const D: usize, P: Deref<Target: WarpModel<D>> + Send + Sync> WarpModel<D> for P {
    fn fit(
        &self,
        sources: &[Point<f64, D>],
        targets: &[Point<f64, D>],
        weights: Option<&[f64]>,
    ) -> Result<Box<dyn Warp<D> + Send + Sync>, TpsError> {
        (**self).fit(sources, targets, weights)
    }

    fn jacobians_through(
        &self,
        memory: &mut SeriesMemory,
        pairs: Pairs<'_, D>,
        points: &[Point<f64, D>],
        jacobians: &mut [SMatrix<f64, D, D>],
    ) -> Result<(), TpsError> {
        (**self).jacobians_through(memory, pairs, points, jacobians)
    }
}

/// Pairs of points: equal numbers of sources and targets and, optionally, weights.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_tps::Pairs;
/// let (sources, targets) = ([Point2::new(0.0, 0.0)], [Point2::new(1.0, 0.0)]);
/// assert_eq!(Pairs { sources: &sources, targets: &targets, weights: Some(&[0.5]) }.weights,
///     Some(&[0.5][..]));
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Pairs<'a, const D: usize> {
    /// Source points.
    pub sources: &'a [Point<f64, D>],
    /// Target points.
    pub targets: &'a [Point<f64, D>],
    /// Weight of each pair. `None` for equal weights.
    pub weights: Option<&'a [f64]>,
}

impl<const D: usize, K: Kernel> Warp<D> for Spline<D, D, K> {
    fn apply(&self, point: &Point<f64, D>) -> Point<f64, D> {
        Spline::apply(self, point)
    }
    fn jacobian(&self, point: &Point<f64, D>) -> SMatrix<f64, D, D> {
        Spline::jacobian(self, point)
    }
    fn rank(&self) -> usize {
        self.report.rank
    }
    fn apply_into(
        &self,
        points: &[Point<f64, D>],
        images: &mut [Point<f64, D>],
    ) -> Result<(), TpsError> {
        Spline::apply_into(self, points, images)
    }
    fn jacobian_into(
        &self,
        points: &[Point<f64, D>],
        jacobians: &mut [SMatrix<f64, D, D>],
    ) -> Result<(), TpsError> {
        Spline::jacobian_into(self, points, jacobians)
    }
}

impl<const D: usize, K: Kernel + 'static> WarpModel<D> for FitOptions<K> {
    /// If `weights` are given, they replace those of the options.
    fn fit(
        &self,
        sources: &[Point<f64, D>],
        targets: &[Point<f64, D>],
        weights: Option<&[f64]>,
    ) -> Result<Box<dyn Warp<D> + Send + Sync>, TpsError> {
        let spline: ThinPlateSpline<D, K> = match weights {
            None => Spline::fit(sources, targets, self),
            Some(weights) => {
                let weighted = self.clone().with_weights(weights.to_vec())?;
                Spline::fit(sources, targets, &weighted)
            }
        }?;
        Ok(Box::new(spline))
    }
}

/// State of one method along a series, for [`WarpModel::jacobians_through`] and similar methods.
///
/// The content belongs to the method, which gets a value of its own type from
/// [`state`](Self::state). A method that finds the state of another one starts anew.
///
/// ```
/// use tactile_tps::SeriesMemory;
/// let mut memory = SeriesMemory::default();
/// memory.state::<Vec<f64>>().push(7.0);
/// assert_eq!(memory.state::<Vec<f64>>(), &[7.0]);
/// assert_eq!(memory.state::<String>(), "", "another method's");
/// assert!(memory.state::<Vec<f64>>().is_empty());
/// ```
#[derive(Default)]
pub struct SeriesMemory {
    state: Option<Box<dyn Any + Send + Sync>>,
}

impl SeriesMemory {
    /// The state of type `S` that was left here. Returns the default if there is none, or if it has
    /// another type.
    pub fn state<S: Default + Send + Sync + 'static>(&mut self) -> &mut S {
        let kept = self.state.take().and_then(|state| state.downcast().ok());
        let state: Box<S> = kept.unwrap_or_default();
        match self.state.insert(state).downcast_mut() {
            Some(state) => state,
            None => unreachable!("the state is stored with this type"),
        }
    }
}

impl core::fmt::Debug for SeriesMemory {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("SeriesMemory")
            .field("is_empty", &self.state.is_none())
            .finish()
    }
}
