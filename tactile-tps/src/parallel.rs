//! Parallel evaluation of many queries, bit for bit as in serial.

use nalgebra::{Point, SMatrix};
use rayon::prelude::*;

use crate::{Kernel, Scalar, Spline, TpsError, evaluate::BLOCK, warp::same_length};

/// Queries a thread takes at a time.
const CHUNK: usize = 8 * BLOCK;

impl<T: Scalar, const D: usize, const M: usize, K: Kernel> Spline<T, D, M, K> {
    /// As [`apply_into`](Self::apply_into), over the threads of the current rayon pool.
    ///
    /// ```
    /// # use nalgebra::Point2;
    /// # use tactile_tps::{FitOptions, ThinPlateSpline};
    /// # fn main() -> Result<(), tactile_tps::TpsError> {
    /// # let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.4, 0.6]].map(Point2::from);
    /// # let targets = sources.map(|p| Point2::new(p.x + 0.1 * p.y * p.y, p.y));
    /// let warp = ThinPlateSpline::fit(&sources, &targets, &FitOptions::default())?;
    /// let queries: Vec<_> = (0..1000).map(|i| Point2::new(f64::from(i) / 1000.0, 0.5)).collect();
    /// let mut values = vec![Point2::origin(); 1000];
    /// warp.par_apply_into(&queries, &mut values)?;
    /// assert_eq!(values[999], warp.apply(&queries[999]));
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// [`TpsError::Length`] if the slices differ in length.
    pub fn par_apply_into(
        &self,
        points: &[Point<T, D>],
        values: &mut [Point<T, M>],
    ) -> Result<(), TpsError> {
        same_length(points.len(), values.len())?;
        let chunks = points.par_chunks(CHUNK).zip(values.par_chunks_mut(CHUNK));
        chunks.try_for_each(|(points, values)| self.apply_into(points, values))
    }

    /// As [`apply_and_jacobian_into`](Self::apply_and_jacobian_into), over the threads of the current rayon pool.
    ///
    /// ```
    /// # use nalgebra::Point2;
    /// # use tactile_tps::{FitOptions, ThinPlateSpline};
    /// # fn main() -> Result<(), tactile_tps::TpsError> {
    /// # let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.4, 0.6]].map(Point2::from);
    /// # let targets = sources.map(|p| Point2::new(p.x + 0.1 * p.y * p.y, p.y));
    /// let warp = ThinPlateSpline::fit(&sources, &targets, &FitOptions::default())?;
    /// let queries: Vec<_> = (0..1000).map(|i| Point2::new(f64::from(i) / 1000.0, 0.5)).collect();
    /// let mut values = vec![Point2::origin(); 1000];
    /// let mut jacobians = vec![nalgebra::Matrix2::zeros(); 1000];
    /// warp.par_apply_and_jacobian_into(&queries, &mut values, &mut jacobians)?;
    /// assert_eq!(jacobians[7], warp.jacobian(&queries[7]));
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// [`TpsError::Length`] if the slices differ in length.
    pub fn par_apply_and_jacobian_into(
        &self,
        points: &[Point<T, D>],
        values: &mut [Point<T, M>],
        jacobians: &mut [SMatrix<T, M, D>],
    ) -> Result<(), TpsError> {
        same_length(points.len(), values.len())?;
        same_length(points.len(), jacobians.len())?;
        let outputs = values
            .par_chunks_mut(CHUNK)
            .zip(jacobians.par_chunks_mut(CHUNK));
        points
            .par_chunks(CHUNK)
            .zip(outputs)
            .try_for_each(|(points, (values, jacobians))| {
                self.apply_and_jacobian_into(points, values, jacobians)
            })
    }
}
