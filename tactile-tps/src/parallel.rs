//! Batches of queries spread over threads; every query's sum runs as it does alone, so the bits are the same.

use nalgebra::{Point, SMatrix};
use rayon::prelude::*;

use crate::{Kernel, Scalar, Spline, TpsError, evaluate::BLOCK, warp::same_length};

/// Queries a thread takes at a time.
const CHUNK: usize = 8 * BLOCK;

impl<T: Scalar, const D: usize, const M: usize, K: Kernel> Spline<T, D, M, K> {
    /// As [`apply_into`](Self::apply_into), over the threads of the current rayon pool.
    ///
    /// # Errors
    /// [`TpsError::Length`] if the slices differ in length.
    pub fn par_apply_into(&self, points: &[Point<T, D>], values: &mut [Point<T, M>]) -> Result<(), TpsError> {
        same_length(points.len(), values.len())?;
        let chunks = points.par_chunks(CHUNK).zip(values.par_chunks_mut(CHUNK));
        chunks.try_for_each(|(points, values)| self.apply_into(points, values))
    }

    /// As [`apply_and_jacobian_into`](Self::apply_and_jacobian_into), over the threads of the current rayon pool.
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
        let outputs = values.par_chunks_mut(CHUNK).zip(jacobians.par_chunks_mut(CHUNK));
        points.par_chunks(CHUNK).zip(outputs).try_for_each(|(points, (values, jacobians))| {
            self.apply_and_jacobian_into(points, values, jacobians)
        })
    }
}
