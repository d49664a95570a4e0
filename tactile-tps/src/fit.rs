//! Splines to any targets by an existing factorisation: a new spline, one with progress reports, one refilled in place.

use core::ops::ControlFlow;

use nalgebra::Point;

use crate::{
    Factorization, Kernel, Progress, Scalar, Spline, TpsError, Workspace, equations::Buffers,
    task::Task,
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
    /// assert!(surface.report().residual < Some(1e-14));
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

    /// As [`fit`](Self::fit), reporting the progress of an iterative solver to `watch`. If `watch` returns `Break`, the spline
    /// is the best so far and its report says how good it is. A direct solver does not report.
    ///
    /// ```
    /// use core::ops::ControlFlow;
    /// use nalgebra::Point2;
    /// use tactile_tps::{Factorization, FitOptions, Solver};
    /// # fn main() -> Result<(), tactile_tps::TpsError> {
    /// let sources: Vec<Point2<f64>> =
    ///     (0..900).map(|i| Point2::new(f64::from(i % 30), f64::from(i / 30) + 0.3 * f64::from(i % 7))).collect();
    /// let targets: Vec<_> = sources.iter().map(|p| Point2::new(p.x.sin(), p.y.cos())).collect();
    /// let options = FitOptions::default().with_solver(Solver::Iterative);
    /// let spline = Factorization::new(&sources, &options)?.fit_watched(&targets, |progress| {
    ///     // Good enough for a first look.
    ///     if progress.residual < Some(1e-3) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    /// })?;
    /// assert!(!spline.report().converged && spline.report().residual < Some(1e-2));
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// [`TpsError`] for invalid targets.
    pub fn fit_watched<const M: usize>(
        &self,
        targets: &[Point<T, M>],
        mut watch: impl FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<Spline<T, D, M, K>, TpsError> {
        let mut spline = Spline::empty(self.kernel.clone());
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

    /// As [`fit`](Self::fit), into an existing spline: two triangular solves, and no allocation once
    /// workspace and spline have grown. Refines only where the condition number exceeds 10⁸.
    ///
    /// ```
    /// # use nalgebra::Point2;
    /// # use tactile_tps::{Factorization, FitOptions, R2LogR, Spline, Workspace};
    /// # fn main() -> Result<(), tactile_tps::TpsError> {
    /// # let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.4, 0.6]].map(Point2::from);
    /// # let targets = sources.map(|p| Point2::new(p.x + 0.1 * p.y * p.y, p.y));
    /// let factorization = Factorization::new(&sources, &FitOptions::default())?;
    /// let mut spline = Spline::empty(R2LogR);
    /// factorization.fit_with(&mut Workspace::default(), &targets, &mut spline)?;
    /// assert!((spline.apply(&sources[4]) - targets[4]).norm() < 1e-14);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// [`TpsError`] for invalid targets; the spline is then left as it was.
    pub fn fit_with<const M: usize>(
        &self,
        workspace: &mut Workspace<D>,
        targets: &[Point<T, M>],
        spline: &mut Spline<T, D, M, K>,
    ) -> Result<(), TpsError> {
        self.finish(&self.task(), &mut workspace.buffers, targets, spline)
            .map(drop)
    }
}
