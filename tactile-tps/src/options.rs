//! Options of a fit (kernel, smoothing, weights, solver) and its report.

use crate::{
    R2LogR, Smoothing, StopReason, TpsError,
    error::{validate_smoothing, validate_weights},
};

/// Solution method of the equations.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_tps::{FitOptions, Solver, ThinPlateSpline};
/// # fn main() -> Result<(), tactile_tps::TpsError> {
/// let sources: Vec<Point2<f64>> =
///     (0..900).map(|i| Point2::new(f64::from(i % 30), f64::from(i / 30)
///         + 0.3 * f64::from(i % 7))).collect();
/// let targets: Vec<_> = sources.iter().map(|p| Point2::new(p.x.sin(), p.y.cos())).collect();
/// let fit = |solver| ThinPlateSpline::fit(&sources, &targets,
///     &FitOptions::default().with_solver(solver));
/// let (direct, iterative) = (fit(Solver::Direct)?, fit(Solver::Iterative)?);
/// let query = Point2::new(7.3, 11.9);
/// assert!((direct.apply(&query) - iterative.apply(&query)).norm() < 1e-8);
/// assert!(iterative.report.iterations > 0 && direct.report.iterations == 0);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum Solver {
    /// Direct for up to 3000 points and for cross-validation, otherwise iterative.
    #[default]
    Automatic,
    /// A dense factor: n³/3 operations and 8n² bytes, accurate to rounding.
    Direct,
    /// Preconditioned conjugate gradients: n² kernel evaluations per step, O(n) memory, accurate to
    /// the [tolerance](FitOptions::with_tolerance).
    Iterative,
}

/// Kernel, smoothing and weights of a fit.
///
/// ```
/// use tactile_tps::{FitOptions, NegR, Smoothing};
/// let options = FitOptions::new(NegR)
///     .with_smoothing(Smoothing::Lambda(1e-3))?
///     .with_weights(vec![1.0, 1.0, 0.2, 1.0])?;
/// assert!(options.with_smoothing(Smoothing::Lambda(f64::NAN)).is_err());
/// # Ok::<(), tactile_tps::TpsError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(
        try_from = "Unchecked<K>",
        bound(deserialize = "K: serde::Deserialize<'de>")
    )
)]
pub struct FitOptions<K = R2LogR> {
    pub(crate) kernel: K,
    pub(crate) smoothing: Smoothing,
    pub(crate) weights: Option<Vec<f64>>,
    pub(crate) rank_tolerance: f64,
    pub(crate) solver: Solver,
    pub(crate) tolerance: f64,
}

/// Options as read from a file, before validation by the setters.
#[cfg(feature = "serde")]
#[derive(serde::Deserialize)]
struct Unchecked<K> {
    kernel: K,
    smoothing: Smoothing,
    weights: Option<Vec<f64>>,
    rank_tolerance: f64,
    solver: Solver,
    tolerance: f64,
}

#[cfg(feature = "serde")]
impl<K> TryFrom<Unchecked<K>> for FitOptions<K> {
    type Error = TpsError;

    fn try_from(read: Unchecked<K>) -> Result<Self, TpsError> {
        let options = Self::new(read.kernel)
            .with_smoothing(read.smoothing)?
            .with_rank_tolerance(read.rank_tolerance)?
            .with_solver(read.solver)
            .with_tolerance(read.tolerance)?;
        match read.weights {
            Some(weights) => options.with_weights(weights),
            None => Ok(options),
        }
    }
}

impl Default for FitOptions<R2LogR> {
    fn default() -> Self {
        Self::new(R2LogR)
    }
}

impl<K> FitOptions<K> {
    /// Interpolation with this kernel and equal weights.
    ///
    /// ```
    /// use tactile_tps::{FitOptions, R3};
    /// let options = FitOptions::<_>::new(R3);
    /// let _ = options;
    /// ```
    pub fn new(kernel: K) -> Self {
        Self {
            kernel,
            smoothing: Smoothing::None,
            weights: None,
            rank_tolerance: 0.0,
            solver: Solver::Automatic,
            tolerance: (1e-10),
        }
    }

    /// Sets the smoothing.
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use tactile_tps::{FitOptions, Smoothing, ThinPlateSpline};
    /// # fn main() -> Result<(), tactile_tps::TpsError> {
    /// let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.4,
    ///     0.6]].map(Point2::from);
    /// let targets = sources.map(|p| Point2::new(p.x + 0.1 * p.y * p.y, p.y));
    /// let options = FitOptions::default().with_smoothing(Smoothing::Lambda(0.5))?;
    /// let warp = ThinPlateSpline::fit(&sources, &targets, &options)?;
    /// assert!((warp.report.lambda - 0.5).abs() < 1e-15 && warp.bending_energy() < 1e-3);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// [`TpsError::Lambda`] for a λ that is negative, NaN or infinite.
    pub fn with_smoothing(mut self, smoothing: Smoothing) -> Result<Self, TpsError> {
        validate_smoothing(&smoothing)?;
        self.smoothing = smoothing;
        Ok(self)
    }

    /// Sets the weight of each point, at least zero. A point of weight zero is ignored.
    ///
    /// Weights act relative to λ: an interpolating spline passes through every point of positive
    /// weight.
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use tactile_tps::{FitOptions, ThinPlateSpline};
    /// # fn main() -> Result<(), tactile_tps::TpsError> {
    /// let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.4,
    ///     0.6]].map(Point2::from);
    /// let targets = sources.map(|p| Point2::new(p.x + 0.1 * p.y * p.y, p.y));
    /// let warp = ThinPlateSpline::fit(&sources, &targets,
    ///     &FitOptions::default().with_weights(vec![1.0, 1.0, 1.0, 1.0, 0.0])?)?;
    /// assert_eq!(warp.report.ignored, 1);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// [`TpsError::Weight`] for a weight that is negative, NaN or infinite, [`TpsError::Empty`] if
    /// none is positive. The fit checks that there are as many weights as points.
    pub fn with_weights(mut self, weights: Vec<f64>) -> Result<Self, TpsError> {
        validate_weights(&weights, weights.len())?;
        self.weights = Some(weights);
        Ok(self)
    }

    /// Drops directions in which the extent of the points is less than this fraction of their
    /// largest extent.
    ///
    /// The default 0 drops only directions that could come from rounding of the coordinates. A
    /// nearly flat surface needs a larger value: normal to it, the gradient of the spline is noise
    /// divided by thickness.
    ///
    /// ```
    /// use nalgebra::Point3;
    /// use tactile_tps::{FitOptions, NegR, ThinPlateSpline};
    /// # fn main() -> Result<(), tactile_tps::TpsError> {
    /// let sources = [[0.0, 0.0, 0.0], [1.0, 0.0, 1e-5], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.4,
    ///     0.6, 1e-5]].map(Point3::from);
    /// let rank = |tolerance| {
    ///     let options = FitOptions::new(NegR).with_rank_tolerance(tolerance)?;
    ///     ThinPlateSpline::fit(&sources, &sources, &options).map(|spline| spline.report.rank)
    /// };
    /// assert_eq!((rank(0.0)?, rank(1e-3)?), (4, 3));
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// [`TpsError::RankTolerance`] unless in [0, 1).
    pub fn with_rank_tolerance(mut self, tolerance: f64) -> Result<Self, TpsError> {
        let value = tolerance;
        if !(0.0..1.0).contains(&value) {
            return Err(TpsError::RankTolerance { value });
        }
        self.rank_tolerance = tolerance;
        Ok(self)
    }

    /// Sets the solution method of the equations.
    ///
    /// ```
    /// use tactile_tps::{FitOptions, Solver};
    /// let to_rounding = FitOptions::default().with_solver(Solver::Direct);
    /// assert_ne!(to_rounding, FitOptions::default());
    /// ```
    #[must_use]
    pub fn with_solver(mut self, solver: Solver) -> Self {
        self.solver = solver;
        self
    }

    /// Sets the residual at which an iterative solver stops: the largest at a point, relative to
    /// the largest target.
    ///
    /// The default is 10⁻¹⁰, which is also the approximate error of the spline's values. The report
    /// contains the residual that was reached.
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use tactile_tps::{FitOptions, Solver, ThinPlateSpline};
    /// # fn main() -> Result<(), tactile_tps::TpsError> {
    /// let sources: Vec<Point2<f64>> =
    ///     (0..900).map(|i| Point2::new(f64::from(i % 30), f64::from(i / 30)
    ///         + 0.3 * f64::from(i % 7))).collect();
    /// let targets: Vec<_> = sources.iter().map(|p| Point2::new(p.x.sin(), p.y.cos())).collect();
    /// let options = FitOptions::default().with_solver(Solver::Iterative).with_tolerance(1e-4)?;
    /// let warp = ThinPlateSpline::fit(&sources, &targets, &options)?;
    /// assert!(warp.report.converged() && warp.report.residual <= Some(1e-4));
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// [`TpsError::Tolerance`] unless in (0, 1).
    pub fn with_tolerance(mut self, tolerance: f64) -> Result<Self, TpsError> {
        let value = tolerance;
        if !(value > 0.0 && value < 1.0) {
            return Err(TpsError::Tolerance { value });
        }
        self.tolerance = tolerance;
        Ok(self)
    }

    /// Whether the iterative solver is used for this many points.
    pub(crate) fn iterates(&self, points: usize) -> bool {
        match self.solver {
            _ if self.smoothing == Smoothing::Gcv => false,
            // Above this number iteration is faster than the factor.
            Solver::Automatic => points > 3000,
            Solver::Direct => false,
            Solver::Iterative => true,
        }
    }
}

/// Report of a fit, with its accuracy.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_tps::{FitOptions, ThinPlateSpline};
/// # fn main() -> Result<(), tactile_tps::TpsError> {
/// // Three points on a line determine nothing normal to it.
/// let sources = [[0.0, 0.0], [1.0, 1.0], [3.0, 3.0], [3.0, 3.0]].map(Point2::from);
/// let warp = ThinPlateSpline::fit(&sources, &sources, &FitOptions::default())?;
/// let report = warp.report;
/// assert_eq!((report.points, report.merged, report.rank), (4, 1, 2));
/// assert!(report.extents[1] < 1e-15 && report.residual < Some(1e-14) && report.digits > 14.0);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct FitReport {
    /// Number of points given.
    pub points: usize,
    /// Number of points merged with an earlier one at the same position.
    pub merged: usize,
    /// Number of points ignored because their weight is zero.
    pub ignored: usize,
    /// Rank of [1 X]: one more than the number of directions that the points span. D + 1 if they
    /// span space.
    pub rank: usize,
    /// Root mean square extent of the points along their principal directions, relative to the
    /// largest, in descending order.
    ///
    /// If the last entry is tiny, the gradient along that direction is noise over thickness.
    pub extents: Vec<f64>,
    /// The smoothing parameter λ used, in the units of the points and the kernel. 0 for
    /// interpolation.
    pub lambda: f64,
    /// Estimated 2-norm condition number of the solved matrix, in internal units. 1 for the
    /// iterative solver.
    ///
    /// Above 10¹⁰ some points nearly coincide. Values keep their digits then, single weights do
    /// not. Infinite if rounding made the matrix indefinite, so that λ was raised to the size of
    /// this rounding.
    pub condition: f64,
    /// Largest residual of the spline's equations, relative to the largest target.
    ///
    /// It is measured at up to 64 evenly distributed points. If the solution was refined, it is
    /// measured at all points before the last step. `None` after a quick refit, which skips it.
    pub residual: Option<f64>,
    /// Number of iterative refinement steps.
    pub refinements: usize,
    /// Number of conjugate-gradient steps of the iterative solver. Zero for a direct solve.
    pub iterations: usize,
    /// Why the solver stopped: [`StopReason::Direct`] for a direct solve.
    pub stop: StopReason,
    /// Number of accurate decimal digits of the sum of the spline's terms near the points.
    ///
    /// It is −log₁₀ of the rounding error relative to the size of the targets.
    pub digits: f64,
}

impl FitReport {
    /// Whether the solver reached its tolerance. Direct solves always do.
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use tactile_tps::{FitOptions, StopReason, ThinPlateSpline};
    /// let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]].map(Point2::from);
    /// let report = ThinPlateSpline::fit(&sources, &sources, &FitOptions::default())?.report;
    /// assert!(report.converged() && report.stop == StopReason::Direct);
    /// # Ok::<(), tactile_tps::TpsError>(())
    /// ```
    #[must_use]
    pub fn converged(&self) -> bool {
        matches!(self.stop, StopReason::Direct | StopReason::Converged)
    }
}
