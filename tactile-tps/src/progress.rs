//! Progress of a long fit.

/// How far a fit has come, as reported to the caller.
///
/// First the preconditioner is prepared: there is no residual yet, and `done` and `total` count points, each twice (when it is ordered
/// and when it gets its weights). Then conjugate gradients iterate: there is one, and they count steps; usually they stop long before
/// the total, when the residual falls below the [tolerance](crate::FitOptions::with_tolerance). Within a step of many points the
/// callback is called again with the same numbers every few seconds, so that it can stop the fit.
///
/// ```
/// # use core::ops::ControlFlow;
/// # use nalgebra::Point2;
/// # use tactile_tps::{FitOptions, Solver, ThinPlateSpline};
/// # fn main() -> Result<(), tactile_tps::TpsError> {
/// let sources: Vec<Point2<f64>> =
///     (0..900).map(|i| Point2::new(f64::from(i % 30), f64::from(i / 30) + 0.3 * f64::from(i % 7))).collect();
/// let options = FitOptions::<f64>::default().with_solver(Solver::Iterative);
/// let (mut steps, mut residuals) = (0, Vec::new());
/// let targets: Vec<_> = sources.iter().map(|p| Point2::new(p.x.sin(), p.y.cos())).collect();
/// ThinPlateSpline::fit_watched(&sources, &targets, &options, |progress| {
///     let unit = if progress.residual.is_some() { "step" } else { "point" };
///     eprintln!("{unit} {} of at most {}", progress.done, progress.total);
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
    /// So much of it is done.
    pub done: usize,
    /// So much there is at most.
    pub total: usize,
    /// Largest residual so far relative to the largest target; `None` while the fit is prepared.
    pub residual: Option<f64>,
}

/// A callback that hears of a fit's progress and may stop it.
pub(crate) type Watch<'a> = dyn FnMut(&Progress) -> core::ops::ControlFlow<()> + 'a;
