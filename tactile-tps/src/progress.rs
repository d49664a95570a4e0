//! What a long fit tells while it runs.

/// How far a fit has come, given to the caller's watch.
///
/// Units of `done` and `total` are points while the stage is preparation, steps of the iteration after.
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
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Stage {
    /// Factoring or building the preconditioner.
    Preparation,
    /// Conjugate gradients; they usually stop long before the total.
    Iteration,
}

/// A watch over a fit; it breaks the fit off by its answer.
pub(crate) type Watch<'a> = dyn FnMut(&Progress) -> core::ops::ControlFlow<()> + 'a;
