//! Splines to any targets by an existing factorisation: with and without progress reports.

use core::ops::ControlFlow;

use nalgebra::Point;

use crate::{
    Factorization, Kernel, Progress, Scalar, Spline, TpsError, equations::Buffers, task::Task,
};

impl<T: Scalar, const D: usize, K: Kernel> Factorization<T, D, K> {
    /// The spline to these targets, with the weights and smoothing of the factorisation.
    ///
    /// Measures the residual, and refines the solution where the condition number is large.
    ///
    /// ```
    /// # use nalgebra::Point2;
    /// # use tactile_tps::{Factorization, FitOptions};
    /// # fn main() -> Result<(), tactile_tps::TpsError> {
    /// # let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.4, 0.6]].map(Point2::from);
    /// let factorization = Factorization::new(&sources, &FitOptions::default())?;
    /// // Any number of outputs: here a height.
    /// let heights = sources.map(|p| nalgebra::Point1::new(p.x * p.y));
    /// let surface = factorization.fit(&heights)?;
    /// assert!((surface.apply(&sources[3]) - heights[3]).norm() < 1e-14);
    /// assert!(surface.report.residual < Some(1e-14));
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// [`TpsError`] for invalid targets.
    pub fn fit<const M: usize>(
        &self,
        targets: &[Point<T, M>],
    ) -> Result<Spline<T, D, M, K>, TpsError> {
        self.fit_watched(targets, |_| ControlFlow::Continue(()))
    }

    /// As [`fit`](Self::fit), reporting the progress of an iterative solver to `watch`.
    pub(crate) fn fit_watched<const M: usize>(
        &self,
        targets: &[Point<T, M>],
        mut watch: impl FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<Spline<T, D, M, K>, TpsError> {
        let mut spline = Spline::zero(self.kernel.clone());
        let task = Task {
            careful: true,
            ..self.task()
        };
        self.watched(
            &task,
            &mut Buffers::default(),
            targets,
            &mut spline,
            &mut watch,
        )?;
        Ok(spline)
    }
}
