//! Progress of a long fit.

/// How far a fit has come, as reported to the caller.
///
/// Units of `done` and `total` are points while the stage is preparation, steps of the iteration after.
///
/// ```
/// # use core::ops::ControlFlow;
/// # use nalgebra::Point2;
/// # use tactile_tps::{Factorization, FitOptions, Solver};
/// # fn main() -> Result<(), tactile_tps::TpsError> {
/// let sources: Vec<Point2<f64>> =
///     (0..900).map(|i| Point2::new(f64::from(i % 30), f64::from(i / 30) + 0.3 * f64::from(i % 7))).collect();
/// let options = FitOptions::<f64>::default().with_solver(Solver::Iterative);
/// let (mut steps, mut residuals) = (0, Vec::new());
/// let targets: Vec<_> = sources.iter().map(|p| Point2::new(p.x.sin(), p.y.cos())).collect();
/// Factorization::new(&sources, &options)?.fit_watched(&targets, |progress| {
///     eprintln!("step {} of at most {}", progress.done, progress.total);
///     steps = progress.done;
///     residuals.extend(progress.residual);
///     ControlFlow::Continue(())
/// })?;
/// assert!(residuals.len() == steps + 1 && residuals.last() < residuals.first());
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Progress {
    /// What is being done.
    pub stage: Stage,
    /// So much of it is done.
    pub done: usize,
    /// So much there is at most.
    pub total: usize,
    /// Largest residual so far relative to the largest target, once there is one.
    pub residual: Option<f64>,
}

/// A part of a fit.
///
/// ```
/// # use core::ops::ControlFlow;
/// # use nalgebra::Point2;
/// # use tactile_tps::{Factorization, FitOptions, Solver, Stage};
/// # fn main() -> Result<(), tactile_tps::TpsError> {
/// let sources: Vec<Point2<f64>> =
///     (0..900).map(|i| Point2::new(f64::from(i % 30), f64::from(i / 30) + 0.3 * f64::from(i % 7))).collect();
/// let options = FitOptions::<f64>::default().with_solver(Solver::Iterative);
/// let mut stages = Vec::new();
/// Factorization::new_watched(&sources, &options, |progress| {
///     stages.push(progress.stage);
///     ControlFlow::Continue(())
/// })?;
/// assert!(!stages.is_empty() && stages.iter().all(|&stage| stage == Stage::Preparation));
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Stage {
    /// Factoring or building the preconditioner.
    Preparation,
    /// Conjugate gradients; they usually stop long before the total.
    Iteration,
}

/// A callback that hears of a fit's progress and may stop it.
pub(crate) type Watch<'a> = dyn FnMut(&Progress) -> core::ops::ControlFlow<()> + 'a;
