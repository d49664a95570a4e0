//! One fit from targets to spline, by factor, spectrum or iteration.

use core::ops::ControlFlow;

use nalgebra::Point;

use crate::{
    Factorization, Kernel, Scalar, Smoothing, Spline, TpsError,
    centres::finite,
    equations::{Buffers, Equations, Solution},
    iterative::{Iterative, Run},
    progress::Watch,
    reweight::Reweighting,
    spline::Fitted,
    system::System,
};

/// A fit to be done: its system, weights and λ.
pub(crate) struct Task<'a, T, const D: usize> {
    pub(crate) system: &'a System<D>,
    pub(crate) weights: Option<&'a [T]>,
    pub(crate) smoothing: Smoothing<T>,
    /// Measure the residual and refine sooner.
    pub(crate) careful: bool,
    /// Other weights than the system's, to be met by the spectrum.
    pub(crate) reweighting: Option<Reweighting<'a>>,
    /// Where there is no factor.
    pub(crate) iterative: Option<&'a Iterative<D>>,
}

impl<'a, T: Scalar, const D: usize> Task<'a, T, D> {
    /// A quick interpolation without weights.
    pub(crate) fn new(system: &'a System<D>) -> Self {
        let (weights, smoothing) = (None, Smoothing::None);
        Self {
            system,
            weights,
            smoothing,
            careful: false,
            reweighting: None,
            iterative: None,
        }
    }
}

impl<T: Scalar, const D: usize, K: Kernel> Factorization<T, D, K> {
    /// A quick fit with what the factorisation was made with.
    pub(crate) fn task(&self) -> Task<'_, T, D> {
        let gcv = self.smoothing == Smoothing::Gcv;
        let system = self.spectral.get().filter(|_| gcv).unwrap_or(&self.system);
        Task {
            weights: self.weights.as_deref(),
            smoothing: self.smoothing,
            iterative: self.iterative.as_ref(),
            ..Task::new(system)
        }
    }

    /// Solves and fills the spline; `false` if the task was to go by the spectrum and that takes too many steps.
    pub(crate) fn finish<const M: usize>(
        &self,
        task: &Task<'_, T, D>,
        buffers: &mut Buffers,
        targets: &[Point<T, M>],
        spline: &mut Spline<T, D, M, K>,
    ) -> Result<bool, TpsError> {
        self.watched(task, buffers, targets, spline, &mut |_| {
            ControlFlow::Continue(())
        })
    }

    /// As [`finish`](Self::finish), reporting an iteration's progress to `watch`.
    pub(crate) fn watched<const M: usize>(
        &self,
        task: &Task<'_, T, D>,
        buffers: &mut Buffers,
        targets: &[Point<T, M>],
        spline: &mut Spline<T, D, M, K>,
        watch: &mut Watch<'_>,
    ) -> Result<bool, TpsError> {
        let (system, lambda) = (task.system, self.inner_lambda(task.smoothing));
        let gcv = task.smoothing == Smoothing::Gcv;
        self.check(targets, task.weights, lambda == 0.0 && !gcv)?;
        let origin: [f64; M] = core::array::from_fn(|k| targets[0][k].widen());
        self.centres.gather(targets, task.weights, &origin, buffers);
        let lambda = if gcv {
            self.validated::<M>(system, buffers)?
        } else {
            lambda
        };
        let Some(solution) = self.solution::<M>(task, lambda, buffers, watch)? else {
            return Ok(false);
        };
        let level = targets
            .iter()
            .flat_map(|t| t.iter())
            .fold(0.0, |m, x| f64::max(m, x.widen().abs()));
        let (centres, unit) = (&self.centres, self.unit());
        spline.kernel.clone_from(&self.kernel);
        spline.assign(
            &Fitted {
                centres,
                system,
                lambda,
                unit,
                solution,
                origin,
                level,
            },
            buffers,
        );
        Ok(true)
    }

    /// One finite target for each source, and the same one for coinciding sources if the spline is to go `through` them.
    pub(crate) fn check<const M: usize>(
        &self,
        targets: &[Point<T, M>],
        weights: Option<&[T]>,
        through: bool,
    ) -> Result<(), TpsError> {
        if targets.len() != self.len() {
            let (expected, found) = (self.len(), targets.len());
            return Err(TpsError::Length {
                input: "target points",
                expected,
                found,
            });
        }
        finite(targets, "target points")?;
        if through {
            self.centres.agree(targets, weights)
        } else {
            Ok(())
        }
    }

    /// Solves for the targets in `buffers` with the task's factor, spectrum or preconditioner.
    fn solution<const M: usize>(
        &self,
        task: &Task<'_, T, D>,
        lambda: f64,
        buffers: &mut Buffers,
        watch: &mut Watch<'_>,
    ) -> Result<Option<Solution<M>>, TpsError> {
        let (system, tolerance) = (task.system, self.tolerance);
        if let Some(iterative) = task.iterative {
            let run = Run {
                kernel: &self.kernel,
                system,
                iterative,
                tolerance,
            };
            return Ok(Some(run.solve(buffers, watch)));
        }
        let equations = Equations {
            kernel: &self.kernel,
            centres: &self.centres,
            system,
            lambda,
        };
        match &task.reweighting {
            Some(reweighting) => Ok(equations.resolve(buffers, reweighting)),
            None => match equations.solve(buffers, task.careful) {
                None => Err(TpsError::NotDefinite {
                    column: system.null.q,
                }),
                solution => Ok(solution),
            },
        }
    }

    /// The λ of least generalised cross-validation.
    fn validated<const M: usize>(
        &self,
        system: &System<D>,
        buffers: &mut Buffers,
    ) -> Result<f64, TpsError> {
        let (needed, found) = (system.null.q, system.active.len());
        if found <= needed {
            return Err(TpsError::TooFewForValidation { needed, found });
        }
        let Buffers {
            targets,
            work,
            spare,
            ..
        } = buffers;
        let lambda = system.cross_validate::<M>(targets, self.centres.len(), work, spare);
        Ok(lambda.unwrap_or(0.0))
    }
}
