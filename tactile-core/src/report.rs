//! How a computation went.

/// Why an iteration ended. Not converging is no error.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(rename_all = "snake_case")
)]
#[non_exhaustive]
pub enum StopReason {
    /// The method has no iterations: the answer is exact up to rounding.
    Direct,
    /// The last change or the residual is below the tolerance.
    #[default]
    Converged,
    /// The residual is at rounding level: the data are free of noise.
    Exact,
    /// The limit of iterations was reached.
    IterationLimit,
    /// Further iterations no longer reduced the residual.
    Stagnated,
    /// The caller's callback asked to stop.
    Cancelled,
    /// The data determine less than was asked for: too few distinct points, or all on a line.
    Degenerate,
}

/// How far a long computation has come, as its callback receives it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Progress {
    /// Steps done.
    pub done: usize,
    /// Steps expected in all: at most so many where the number is limited, an estimate otherwise.
    pub total: usize,
    /// Residual or change after the last step, where there is one.
    pub residual: Option<f64>,
}

impl Progress {
    /// Progress without a residual.
    #[must_use]
    pub const fn new(done: usize, total: usize) -> Self {
        Self {
            done,
            total,
            residual: None,
        }
    }

    /// With the residual after the last step.
    #[must_use]
    pub const fn with_residual(mut self, residual: f64) -> Self {
        self.residual = Some(residual);
        self
    }
}

/// The sign of the signal where an object touches.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(rename_all = "snake_case")
)]
pub enum Polarity {
    /// Contact is brighter than the reference.
    #[default]
    Brighter,
    /// Contact is darker than the reference.
    Darker,
}

impl Polarity {
    /// 1 where contact is brighter, −1 where it is darker.
    ///
    /// ```
    /// use tactile_core::Polarity;
    /// assert_eq!((Polarity::Brighter.sign(), Polarity::Darker.sign()), (1, -1));
    /// ```
    #[must_use]
    pub const fn sign(self) -> i32 {
        match self {
            Self::Brighter => 1,
            Self::Darker => -1,
        }
    }
}
