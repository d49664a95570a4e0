//! How a computation ended, and its progress.

/// Why an iteration ended. A lack of convergence is not an error.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(rename_all = "snake_case")
)]
#[non_exhaustive]
pub enum StopReason {
    /// The method is not iterative: the result is exact up to rounding.
    Direct,
    /// The last change or the residual is below the tolerance.
    #[default]
    Converged,
    /// The residual is at rounding level: the data contain no noise.
    Exact,
    /// The maximum number of iterations was reached.
    IterationLimit,
    /// Further iterations no longer reduced the residual.
    Stagnated,
    /// The callback of the caller requested a stop.
    Cancelled,
    /// The data do not determine the result: the points are too few, or all lie on a line.
    Degenerate,
}

/// Progress of a long computation, as passed to its callback.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Progress {
    /// Completed steps.
    pub done: usize,
    /// Expected number of steps: the maximum if the number is limited, an estimate otherwise.
    pub total: usize,
    /// Residual or change after the last step. `None` if the method has none.
    pub residual: Option<f64>,
}

impl Progress {
    /// Creates a progress without a residual.
    #[must_use]
    pub const fn new(done: usize, total: usize) -> Self {
        Self {
            done,
            total,
            residual: None,
        }
    }

    /// Sets the residual after the last step.
    #[must_use]
    pub const fn with_residual(mut self, residual: f64) -> Self {
        self.residual = Some(residual);
        self
    }
}

/// Sign of the signal in a contact.
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
    /// 1 if contact is brighter, −1 if it is darker.
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
