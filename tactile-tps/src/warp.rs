//! Maps of space onto itself, and models that find one from pairs of points.

use core::any::Any;
use core::ops::Deref;

use nalgebra::{Point, SMatrix};

use crate::{FitOptions, Kernel, Spline, ThinPlateSpline, TpsError, error::same_length};

/// A map of `D`-dimensional space onto itself. Object safe: a `Box<dyn Warp<3>>` is a warp.
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

    /// The Jacobian ∂fᵢ/∂xⱼ at a point (row i, column j). For a deformation this is the
    /// deformation gradient.
    fn jacobian(&self, point: &Point<f64, D>) -> SMatrix<f64, D, D>;

    /// Rank of [1 X] of the points that the warp was fitted to: one more than the number of
    /// directions they span. `D + 1` if they span space, which is the default.
    ///
    /// Along other directions the points determine nothing. The crate's warps move the whole line
    /// (or plane) across the points with its foot and leave lengths across as they are.
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

    /// The images of many points, into the caller's memory.
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

    /// The Jacobians at many points, into the caller's memory.
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

/// Boxed, shared and borrowed warps.
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

/// A family of warps with a rule to choose one from weighted pairs of points.
///
/// Object safe: a pipeline holds an `Arc<dyn WarpModel<3> + Send + Sync>`.
/// Where the kind of warp is fixed, fit it by its own type:
/// [`Spline::fit`], [`Affine::fit`](crate::Affine::fit), [`Affine::fit_rigid`](crate::Affine::fit_rigid).
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
    /// The warp that takes each source to its target as nearly as the model allows. Without weights
    /// all count alike.
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
    /// A model may work in what it keeps in `memory`, and then allocates nothing from the second
    /// set on.
    /// By default the warp is fitted as if alone.
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
    /// Those of [`fit`](Self::fit), and [`TpsError::Length`] where `points` and `jacobians` differ
    /// in number.
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

/// Boxed, shared and borrowed models.
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

/// Pairs of points, as many sources as targets and, where given, weights.
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
    /// From where.
    pub sources: &'a [Point<f64, D>],
    /// To where.
    pub targets: &'a [Point<f64, D>],
    /// How much each pair counts. Without weights all count alike.
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
    /// `weights`, where given, replace those of the options.
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

/// Memory of one method along a series, for [`WarpModel::jacobians_through`] and others like it.
///
/// Its content belongs to the method, which asks for its own type with [`state`](Self::state).
/// A method that finds the state of another one starts anew.
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
    /// The state of type `S` that was left here. A default one where there is none, or one of
    /// another type.
    pub fn state<S: Default + Send + Sync + 'static>(&mut self) -> &mut S {
        let kept = self.state.take().and_then(|state| state.downcast().ok());
        let state: Box<S> = kept.unwrap_or_default();
        match self.state.insert(state).downcast_mut() {
            Some(state) => state,
            None => unreachable!("the state was put there as this type"),
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
