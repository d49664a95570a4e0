//! A spline's values, Jacobians and Hessians, at one point or many.

use nalgebra::{Point, SMatrix};

use crate::{
    Kernel, Scalar, Spline, TpsError,
    evaluate::Sum,
    sample::{Each, Sample},
    simd::dispatch,
    warp::same_length,
};

impl<T: Scalar, const D: usize, const M: usize, K: Kernel> Spline<T, D, M, K> {
    /// f(x).
    ///
    /// ```
    /// # use nalgebra::Point2;
    /// # use tactile_tps::{FitOptions, ThinPlateSpline};
    /// # fn main() -> Result<(), tactile_tps::TpsError> {
    /// # let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.4, 0.6]].map(Point2::from);
    /// # let targets = sources.map(|p| Point2::new(p.x + 0.1 * p.y * p.y, p.y));
    /// let warp = ThinPlateSpline::fit(&sources, &targets, &FitOptions::default())?;
    /// assert!((warp.apply(&sources[4]) - targets[4]).norm() < 1e-14);
    /// # Ok(())
    /// # }
    /// ```
    pub fn apply(&self, point: &Point<T, D>) -> Point<T, M> {
        let mut value = [Point::origin()];
        self.each::<0>(core::slice::from_ref(point), |_, sample| {
            value[0] = sample.point()
        });
        value[0]
    }

    /// The Jacobian ∂fᵢ/∂xⱼ (row i, column j). At a centre of −r, which has a cusp there, its own term is left out.
    ///
    /// ```
    /// # use nalgebra::Point2;
    /// # use tactile_tps::{FitOptions, ThinPlateSpline};
    /// # fn main() -> Result<(), tactile_tps::TpsError> {
    /// # let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.4, 0.6]].map(Point2::from);
    /// # let targets = sources.map(|p| Point2::new(p.x + 0.1 * p.y * p.y, p.y));
    /// let warp = ThinPlateSpline::fit(&sources, &targets, &FitOptions::default())?;
    /// let (x, h) = (Point2::new(0.5, 0.5), nalgebra::Vector2::new(1e-5, 0.0));
    /// let difference = (warp.apply(&(x + h)) - warp.apply(&(x - h))) / 2e-5;
    /// assert!((warp.jacobian(&x).column(0) - difference).norm() < 1e-9);
    /// # Ok(())
    /// # }
    /// ```
    pub fn jacobian(&self, point: &Point<T, D>) -> SMatrix<T, M, D> {
        let mut jacobian = SMatrix::zeros();
        self.each::<1>(core::slice::from_ref(point), |_, sample| {
            jacobian = sample.jacobian()
        });
        jacobian
    }

    /// The Hessian of every output. At a centre where the kernel has none its own term is left out.
    ///
    /// ```
    /// # use nalgebra::Point2;
    /// # use tactile_tps::{FitOptions, ThinPlateSpline};
    /// # fn main() -> Result<(), tactile_tps::TpsError> {
    /// # let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.4, 0.6]].map(Point2::from);
    /// # let targets = sources.map(|p| Point2::new(p.x + 0.1 * p.y * p.y, p.y));
    /// let warp = ThinPlateSpline::fit(&sources, &targets, &FitOptions::default())?;
    /// let (x, h) = (Point2::<f64>::new(0.5, 0.5), nalgebra::Vector2::new(0.0, 1e-5));
    /// let difference = (warp.jacobian(&(x + h)) - warp.jacobian(&(x - h))) / 2e-5;
    /// // ∂²fₓ/∂x∂y.
    /// assert!((warp.hessian(&x)[0][(0, 1)] - difference[(0, 0)]).abs() < 1e-8);
    /// # Ok(())
    /// # }
    /// ```
    pub fn hessian(&self, point: &Point<T, D>) -> [SMatrix<T, D, D>; M] {
        let mut hessian = [SMatrix::zeros(); M];
        self.each::<2>(core::slice::from_ref(point), |_, sample| {
            hessian = sample.hessian()
        });
        hessian
    }

    /// f at many points, into the caller's memory.
    ///
    /// ```
    /// # use nalgebra::Point2;
    /// # use tactile_tps::{FitOptions, ThinPlateSpline};
    /// # fn main() -> Result<(), tactile_tps::TpsError> {
    /// # let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.4, 0.6]].map(Point2::from);
    /// # let targets = sources.map(|p| Point2::new(p.x + 0.1 * p.y * p.y, p.y));
    /// let warp = ThinPlateSpline::fit(&sources, &targets, &FitOptions::default())?;
    /// let queries = [Point2::new(0.5, 0.5), Point2::new(0.1, 0.9)];
    /// let mut values = [Point2::origin(); 2];
    /// warp.apply_into(&queries, &mut values)?;
    /// assert_eq!(values[1], warp.apply(&queries[1]));
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// [`TpsError::Length`] if the slices differ in length.
    pub fn apply_into(
        &self,
        points: &[Point<T, D>],
        values: &mut [Point<T, M>],
    ) -> Result<(), TpsError> {
        same_length(points.len(), values.len())?;
        self.each::<0>(points, |i, sample| values[i] = sample.point());
        Ok(())
    }

    /// Values and Jacobians at many points in one pass, into the caller's memory.
    ///
    /// ```
    /// # use nalgebra::Point2;
    /// # use tactile_tps::{FitOptions, ThinPlateSpline};
    /// # fn main() -> Result<(), tactile_tps::TpsError> {
    /// # let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.4, 0.6]].map(Point2::from);
    /// # let targets = sources.map(|p| Point2::new(p.x + 0.1 * p.y * p.y, p.y));
    /// let warp = ThinPlateSpline::fit(&sources, &targets, &FitOptions::default())?;
    /// let queries = [Point2::new(0.5, 0.5), Point2::new(0.1, 0.9)];
    /// let (mut values, mut jacobians) = ([Point2::origin(); 2], [nalgebra::Matrix2::zeros(); 2]);
    /// warp.apply_and_jacobian_into(&queries, &mut values, &mut jacobians)?;
    /// // Where the warp keeps orientation and does not fold, the determinant is positive.
    /// assert!(jacobians.iter().all(|j| j.determinant() > 0.5) && (values[0] - queries[0]).norm() < 0.1);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// [`TpsError::Length`] if the slices differ in length.
    pub fn apply_and_jacobian_into(
        &self,
        points: &[Point<T, D>],
        values: &mut [Point<T, M>],
        jacobians: &mut [SMatrix<T, M, D>],
    ) -> Result<(), TpsError> {
        same_length(points.len(), values.len())?;
        same_length(points.len(), jacobians.len())?;
        self.each::<1>(points, |i, sample| {
            values[i] = sample.point();
            jacobians[i] = sample.jacobian();
        });
        Ok(())
    }

    /// Hands the sample at every point to `sink`, with derivatives up to `ORDER`.
    ///
    /// A sample whose plain sum has lost too many digits is taken again in twice the working precision.
    pub(crate) fn each<const ORDER: usize>(
        &self,
        points: &[Point<T, D>],
        mut sink: impl FnMut(usize, Sample<T, D, M>),
    ) {
        let (centres, weights) = self.columns();
        let sum = Sum {
            kernel: &self.kernel,
            centres,
            weights,
        };
        let checked = |i: usize, sample: Sample<T, D, M>| {
            let s = self.distance_squared(&points[i]);
            if s > self.terms.reach && self.terms.lost::<T, K>(&self.kernel, s, sample.size()) {
                sink(i, self.parts().sample(&points[i]));
            } else {
                sink(i, sample);
            }
        };
        dispatch(Each::<_, _, _, D, M, ORDER> {
            sum,
            affine: &self.affine,
            frame: self.frame,
            points,
            sink: checked,
        });
    }
}
