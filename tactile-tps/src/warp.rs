//! Maps of space onto itself, and models that find one from pairs of points.

use std::sync::Arc;

use nalgebra::{Point, SMatrix};

use crate::{FitOptions, Kernel, Memory, Scalar, Spline, ThinPlateSpline, TpsError};

/// A map of `D`-dimensional space onto itself. Object safe: a `Box<dyn Warp<f64, 3>>` is a warp.
///
/// ```
/// use nalgebra::{Point2, Matrix2, Vector2};
/// use tactile_tps::{Affine, Warp};
/// let warp: Box<dyn Warp<f64, 2>> = Box::new(Affine { linear: Matrix2::identity() * 2.0, offset: Vector2::new(1.0, 0.0) });
/// assert_eq!(warp.apply(&Point2::new(1.0, 3.0)), Point2::new(3.0, 6.0));
/// ```
pub trait Warp<T: Scalar, const D: usize> {
    /// The image of a point.
    fn apply(&self, point: &Point<T, D>) -> Point<T, D>;

    /// The Jacobian ∂fᵢ/∂xⱼ at a point (row i, column j); for a deformation this is the deformation gradient.
    fn jacobian(&self, point: &Point<T, D>) -> SMatrix<T, D, D>;

    /// The images of many points, into the caller's memory.
    ///
    /// # Errors
    /// [`TpsError::Length`] if the slices differ in length.
    fn apply_into(
        &self,
        points: &[Point<T, D>],
        images: &mut [Point<T, D>],
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
    /// let shear = Affine { linear: Matrix2::new(1.0, 0.2, 0.0, 1.0), offset: Vector2::zeros() };
    /// let points = [[0.0, 0.0], [1.0, 2.0], [3.0, 1.0]].map(Point2::from);
    /// let (mut images, mut jacobians) = (points, [Matrix2::zeros(); 3]);
    /// shear.apply_into(&points, &mut images)?;
    /// shear.jacobian_into(&points, &mut jacobians)?;
    /// assert_eq!(images[1], Point2::new(1.4, 2.0));
    /// assert_eq!((jacobians[1], shear.jacobian(&points[1]).determinant()), (jacobians[0], 1.0)); // shear keeps areas
    /// assert!(shear.apply_into(&points, &mut images[..2]).is_err());
    /// # Ok::<(), tactile_tps::TpsError>(())
    /// ```
    ///
    /// # Errors
    /// [`TpsError::Length`] if the slices differ in length.
    fn jacobian_into(
        &self,
        points: &[Point<T, D>],
        jacobians: &mut [SMatrix<T, D, D>],
    ) -> Result<(), TpsError> {
        same_length(points.len(), jacobians.len())?;
        points
            .iter()
            .zip(jacobians)
            .for_each(|(point, jacobian)| *jacobian = self.jacobian(point));
        Ok(())
    }
}

/// A warp or a model behind a pointer is one: what a pipeline holds and shares.
macro_rules! forward {
    ($pointer:ident) => {
        impl<T: Scalar, const D: usize, W: Warp<T, D> + ?Sized> Warp<T, D> for $pointer<W> {
            fn apply(&self, point: &Point<T, D>) -> Point<T, D> {
                (**self).apply(point)
            }
            fn jacobian(&self, point: &Point<T, D>) -> SMatrix<T, D, D> {
                (**self).jacobian(point)
            }
            fn apply_into(
                &self,
                points: &[Point<T, D>],
                images: &mut [Point<T, D>],
            ) -> Result<(), TpsError> {
                (**self).apply_into(points, images)
            }
            fn jacobian_into(
                &self,
                points: &[Point<T, D>],
                jacobians: &mut [SMatrix<T, D, D>],
            ) -> Result<(), TpsError> {
                (**self).jacobian_into(points, jacobians)
            }
        }

        impl<T: Scalar, const D: usize, M: WarpModel<T, D> + ?Sized> WarpModel<T, D>
            for $pointer<M>
        {
            fn fit(
                &self,
                sources: &[Point<T, D>],
                targets: &[Point<T, D>],
                weights: Option<&[T]>,
            ) -> Result<Box<dyn Warp<T, D> + Send + Sync>, TpsError> {
                (**self).fit(sources, targets, weights)
            }
            fn jacobians_through(
                &self,
                memory: &mut Memory,
                pairs: Pairs<'_, T, D>,
                points: &[Point<T, D>],
                jacobians: &mut [SMatrix<T, D, D>],
            ) -> Result<(), TpsError> {
                (**self).jacobians_through(memory, pairs, points, jacobians)
            }
        }
    };
}
forward!(Box);
forward!(Arc);

/// A family of warps with a rule to choose one from weighted pairs of points. Object safe: a pipeline holds an
/// `Arc<dyn WarpModel<f64, 3> + Send + Sync>`.
///
/// Where the kind of warp is known, fit it by its own type: [`Spline::fit`], [`Affine::fit`](crate::Affine::fit),
/// [`Affine::fit_rigid`](crate::Affine::fit_rigid).
///
/// ```
/// # use nalgebra::Point2;
/// use std::sync::Arc;
/// use tactile_tps::{AffineModel, FitOptions, Warp, WarpModel};
/// # fn main() -> Result<(), tactile_tps::TpsError> {
/// # let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.4, 0.6]].map(Point2::from);
/// # let targets = sources.map(|p| Point2::new(p.x + 0.1 * p.y * p.y, p.y));
/// let models: [Arc<dyn WarpModel<f64, 2> + Send + Sync>; 2] = [Arc::new(FitOptions::default()), Arc::new(AffineModel::General)];
/// let mut misfits = Vec::new();
/// for model in models {
///     let warp = model.fit(&sources, &targets, None)?;
///     misfits.push((warp.apply(&sources[4]) - targets[4]).norm());
/// }
/// assert!(misfits[0] < 1e-14 && misfits[1] > 1e-3); // a spline interpolates, an affine map cannot
/// # Ok(())
/// # }
/// ```
pub trait WarpModel<T: Scalar, const D: usize> {
    /// The warp that takes each source to its target as nearly as the model allows; without weights all count alike.
    ///
    /// # Errors
    /// See [`TpsError`].
    fn fit(
        &self,
        sources: &[Point<T, D>],
        targets: &[Point<T, D>],
        weights: Option<&[T]>,
    ) -> Result<Box<dyn Warp<T, D> + Send + Sync>, TpsError>;

    /// The Jacobians at `points` of the warp that [`fit`](Self::fit) finds, for one set of pairs of a series: a model may work in what it
    /// keeps in `memory` ([`Memory`]), and then allocates nothing from the second set on. By default the warp is fitted as if alone.
    ///
    /// ```
    /// use nalgebra::{Matrix2, Point2};
    /// use tactile_tps::{AffineModel, Memory, Pairs, WarpModel};
    /// let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]].map(Point2::from);
    /// let (mut memory, mut jacobians) = (Memory::default(), [Matrix2::zeros()]);
    /// for stretch in [1.1_f64, 1.2] {
    ///     let targets = sources.map(|p| Point2::new(stretch * p.x, p.y));
    ///     let pairs = Pairs { sources: &sources, targets: &targets, weights: None };
    ///     AffineModel::General.jacobians_through(&mut memory, pairs, &sources[..1], &mut jacobians)?;
    ///     assert!((jacobians[0][(0, 0)] - stretch).abs() < 1e-14);
    /// }
    /// # Ok::<(), tactile_tps::TpsError>(())
    /// ```
    ///
    /// # Errors
    /// Those of [`fit`](Self::fit), and [`TpsError::Length`] where `points` and `jacobians` differ in number.
    fn jacobians_through(
        &self,
        memory: &mut Memory,
        pairs: Pairs<'_, T, D>,
        points: &[Point<T, D>],
        jacobians: &mut [SMatrix<T, D, D>],
    ) -> Result<(), TpsError> {
        let _ = memory;
        self.fit(pairs.sources, pairs.targets, pairs.weights)?
            .jacobian_into(points, jacobians)
    }
}

/// Pairs of points, as many sources as targets and, where given, weights.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_tps::Pairs;
/// let (sources, targets) = ([Point2::new(0.0, 0.0)], [Point2::new(1.0, 0.0)]);
/// assert_eq!(Pairs { sources: &sources, targets: &targets, weights: Some(&[0.5]) }.weights, Some(&[0.5][..]));
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Pairs<'a, T: Scalar, const D: usize> {
    /// From where.
    pub sources: &'a [Point<T, D>],
    /// To where.
    pub targets: &'a [Point<T, D>],
    /// How much each pair counts; without weights all count alike.
    pub weights: Option<&'a [T]>,
}

impl<T: Scalar, const D: usize, K: Kernel> Warp<T, D> for Spline<T, D, D, K> {
    fn apply(&self, point: &Point<T, D>) -> Point<T, D> {
        Spline::apply(self, point)
    }
    fn jacobian(&self, point: &Point<T, D>) -> SMatrix<T, D, D> {
        Spline::jacobian(self, point)
    }
    fn apply_into(
        &self,
        points: &[Point<T, D>],
        images: &mut [Point<T, D>],
    ) -> Result<(), TpsError> {
        Spline::apply_into(self, points, images)
    }
    fn jacobian_into(
        &self,
        points: &[Point<T, D>],
        jacobians: &mut [SMatrix<T, D, D>],
    ) -> Result<(), TpsError> {
        same_length(points.len(), jacobians.len())?;
        self.each::<1>(points, |i, sample| jacobians[i] = sample.jacobian());
        Ok(())
    }
}

impl<T: Scalar, const D: usize, K: Kernel + 'static> WarpModel<T, D> for FitOptions<T, K> {
    /// `weights`, where given, replace those of the options.
    fn fit(
        &self,
        sources: &[Point<T, D>],
        targets: &[Point<T, D>],
        weights: Option<&[T]>,
    ) -> Result<Box<dyn Warp<T, D> + Send + Sync>, TpsError> {
        let spline: ThinPlateSpline<T, D, K> = match weights {
            None => Spline::fit(sources, targets, self),
            Some(weights) => {
                let weighted = self.clone().with_weights(weights.to_vec())?;
                Spline::fit(sources, targets, &weighted)
            }
        }?;
        Ok(Box::new(spline))
    }
}

/// The output must be as long as the input.
pub(crate) fn same_length(expected: usize, found: usize) -> Result<(), TpsError> {
    if expected == found {
        Ok(())
    } else {
        Err(TpsError::Length {
            input: "output slice",
            expected,
            found,
        })
    }
}
