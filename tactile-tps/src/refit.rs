//! Other weights and other λ for the same source points.

use core::ops::ControlFlow;

use nalgebra::Point;

use crate::{
    Factorization, Kernel, Scalar, Smoothing, Spline, TpsError, Workspace,
    options::validate_weights, smoothing::validate_smoothing, task::Task,
};

/// Points up to which a refit with another λ decomposes the matrix by itself: a few milliseconds.
const DECOMPOSE_POINTS: usize = 256;

impl<T: Scalar, const D: usize, K: Kernel> Factorization<T, D, K> {
    /// New targets, weights and smoothing (`None`: those of the factorisation) for the same sources, into a spline that
    /// is already there; allocates nothing once workspace and spline have grown.
    ///
    /// Unlike [`fit`](Self::fit) it measures no residual, and refines only where the condition number exceeds 10⁸. The same
    /// weights and λ cost two triangular solves; another λ without weights two products once the matrix is
    /// decomposed into eigenvectors. Positive weights leave an interpolating spline as it is, and cost the two solves. With
    /// λ > 0, up to sixteen weights that differ from the rest are met by a small system of their own, weights near each other
    /// by conjugate gradients on the decomposed matrix, to 1e-13 of the targets; weights far apart, or of zero, cost a
    /// factorisation. An iterative solver builds its preconditioner anew for another λ, or other weights beside one.
    ///
    /// ```
    /// # use nalgebra::Point2;
    /// # use tactile_tps::{Factorization, FitOptions, Smoothing, Spline, Workspace};
    /// # fn main() -> Result<(), tactile_tps::TpsError> {
    /// # let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.4, 0.6]].map(Point2::from);
    /// let targets = sources.map(|p| Point2::new(p.x + 0.1 * p.y * p.y, p.y));
    /// let factorization = Factorization::new(&sources, &FitOptions::default().with_smoothing(Smoothing::Lambda(0.01))?)?;
    /// let (mut workspace, mut spline) = (Workspace::default(), Spline::default());
    /// let mut miss = |weight: f64| {
    ///     let weights = [1.0, 1.0, 1.0, 1.0, weight];
    ///     factorization
    ///         .refit_with(&mut workspace, &targets, Some(&weights), None, &mut spline)
    ///         .map(|()| (spline.apply(&sources[4]) - targets[4]).norm())
    /// };
    /// // Trusted more, the point is met more closely.
    /// assert!(miss(100.0)? < 0.1 * miss(1.0)?);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// [`TpsError`] for invalid targets, weights or smoothing; the spline is then left as it was.
    pub fn refit_with<const M: usize>(
        &self,
        workspace: &mut Workspace<D>,
        targets: &[Point<T, M>],
        weights: Option<&[T]>,
        smoothing: Option<Smoothing<T>>,
        spline: &mut Spline<T, D, M, K>,
    ) -> Result<(), TpsError> {
        let smoothing = smoothing.unwrap_or(self.smoothing);
        validate_smoothing(&smoothing)?;
        if let Some(weights) = weights {
            validate_weights(weights, self.len())?;
        }
        if weights.is_none() && smoothing == self.smoothing {
            return self
                .finish(&self.task(), &mut workspace.buffers, targets, spline)
                .map(drop);
        }
        if let Some(weights) = weights {
            let Workspace {
                buffers,
                centre_weights,
                ..
            } = workspace;
            self.centres.weigh(Some(weights), centre_weights);
            if let Some(task) = self.cheap(weights, centre_weights, smoothing, &mut buffers.excess)
                && self.finish(&task, buffers, targets, spline)?
            {
                return Ok(());
            }
        }
        self.rebuilt(workspace, targets, weights, smoothing, spline)
    }

    /// A fit by a system made for it: the spectrum at hand where it serves, else a new factor or preconditioner.
    fn rebuilt<const M: usize>(
        &self,
        workspace: &mut Workspace<D>,
        targets: &[Point<T, M>],
        weights: Option<&[T]>,
        smoothing: Smoothing<T>,
        spline: &mut Spline<T, D, M, K>,
    ) -> Result<(), TpsError> {
        let gcv = smoothing == Smoothing::Gcv;
        let spectral = weights.is_none() && (gcv || self.decomposes(smoothing));
        let weights = weights.or(self.weights.as_deref());
        if spectral {
            self.decompose();
        } else {
            self.build(workspace, weights, smoothing)?;
        }
        let Workspace {
            buffers,
            system,
            iterative,
            ..
        } = workspace;
        let iterates = !spectral && !gcv && self.iterative.is_some();
        let task = Task {
            weights,
            smoothing,
            iterative: iterates.then_some(&*iterative),
            ..Task::new(self.spectral.get().filter(|_| spectral).unwrap_or(system))
        };
        self.finish(&task, buffers, targets, spline).map(drop)
    }

    /// A new factor, spectrum or preconditioner in the workspace.
    fn build(
        &self,
        workspace: &mut Workspace<D>,
        weights: Option<&[T]>,
        smoothing: Smoothing<T>,
    ) -> Result<(), TpsError> {
        let Workspace {
            system,
            iterative,
            centre_weights,
            ..
        } = workspace;
        self.centres.weigh(weights, centre_weights);
        let (setting, lambda) = (self.setting(), self.inner_lambda(smoothing));
        if smoothing == Smoothing::Gcv {
            system.decompose(&setting, centre_weights);
        } else if self.iterative.is_none() {
            system.factor(&setting, centre_weights, lambda)?;
        } else {
            // Without a callback nothing stops it.
            let _ = iterative.build(&setting, centre_weights, lambda, system, &mut |_| {
                ControlFlow::Continue(())
            });
        }
        Ok(())
    }

    /// A fit with other weights by what is already there, if it can be had.
    ///
    /// An interpolating spline asks only which weights are positive; a smoothing one changes on a diagonal.
    fn cheap<'a>(
        &'a self,
        weights: &'a [T],
        centre_weights: &[f64],
        smoothing: Smoothing<T>,
        excess: &mut Vec<f64>,
    ) -> Option<Task<'a, T, D>> {
        if smoothing == Smoothing::Gcv || centre_weights.contains(&0.0) {
            return None;
        }
        let task = |system, reweighting| {
            Some(Task {
                weights: Some(weights),
                smoothing,
                reweighting,
                ..Task::new(system)
            })
        };
        if self.inner_lambda(smoothing) == 0.0 {
            let same = self.system.lambda == 0.0 && self.system.active.len() == self.centres.len();
            let task = task(&self.system, None).filter(|_| same);
            return task.map(|task| Task {
                iterative: self.iterative.as_ref(),
                ..task
            });
        }
        if !self.decomposes(smoothing) {
            return None;
        }
        self.decompose();
        let system = self.spectral.get()?;
        let reweighting =
            system.reweighting(self.inner_lambda(smoothing), centre_weights, excess)?;
        task(system, Some(reweighting))
    }

    /// Whether a refit with this smoothing and the factorisation's own weights is to go by the spectrum.
    fn decomposes(&self, smoothing: Smoothing<T>) -> bool {
        let few = self.spectral.get().is_some() || self.centres.len() <= DECOMPOSE_POINTS;
        few && self.iterative.is_none()
            && self.centre_weights.is_empty()
            && self.inner_lambda(smoothing) > 0.0
    }
}
