//! Options of a fit (kernel, smoothing, weights, solver) and its report.

use crate::{
    R2LogR, Smoothing, StopReason, TpsError,
    error::{validate_smoothing, validate_weights},
};

/// How the equations are solved.
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
    /// Direct up to 3000 points and for cross-validation, iterative beyond.
    #[default]
    Automatic,
    /// A dense factor: n³/3 operations and 8n² bytes, to rounding.
    Direct,
    /// Preconditioned conjugate gradients: n² kernels a step, O(n) memory, to the
    /// [tolerance](FitOptions::with_tolerance).
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

/// Options as they are read, before the setters have checked them.
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
    /// Interpolation with this kernel, all points alike.
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

    /// Gives every point a weight of at least zero. Zero leaves the point out.
    ///
    /// Weights act against λ: an interpolating spline passes through every point of positive
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
    /// none is positive. Whether there are as many weights as points is checked by the fit.
    pub fn with_weights(mut self, weights: Vec<f64>) -> Result<Self, TpsError> {
        validate_weights(&weights, weights.len())?;
        self.weights = Some(weights);
        Ok(self)
    }

    /// Drops directions in which the points extend less than this fraction of their largest extent.
    ///
    /// The default 0 drops those that rounding of the coordinates alone could have made. A nearly
    /// flat surface needs more: across it the spline's gradient is noise divided by thickness.
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

    /// Sets how the equations are solved.
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
    /// The default is 10⁻¹⁰. The spline's values are off by about as much. Its report has the
    /// residual that was reached.
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
            // From here on iteration is faster than the factor.
            Solver::Automatic => points > 3000,
            Solver::Direct => false,
            Solver::Iterative => true,
        }
    }
}

/// How a spline was fitted and how far it can be trusted.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_tps::{FitOptions, ThinPlateSpline};
/// # fn main() -> Result<(), tactile_tps::TpsError> {
/// // Three points on a line: nothing is known across it.
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
    /// Points given.
    pub points: usize,
    /// Points merged into an earlier one at the same place.
    pub merged: usize,
    /// Points left out because their weight is zero.
    pub ignored: usize,
    /// Rank of [1 X]: one more than the number of directions the points span. D + 1 when they span
    /// space.
    pub rank: usize,
    /// Root mean square extent of the points along their principal directions relative to the
    /// largest, falling.
    ///
    /// With a tiny last entry the gradient along that direction is noise over thickness.
    pub extents: Vec<f64>,
    /// The smoothing parameter λ used, in the units of the points and the kernel. 0 for
    /// interpolation.
    pub lambda: f64,
    /// Estimated 2-norm condition number of the matrix solved with, in the inner units. 1 for the
    /// iterative solver.
    ///
    /// Beyond 10¹⁰ some points nearly coincide. Values keep their digits there, single weights do
    /// not.
    /// Infinite where rounding left the matrix indefinite and λ was raised to the size of that
    /// rounding.
    pub condition: f64,
    /// Largest residual of the spline's equations relative to the largest target.
    ///
    /// It is measured at up to 64 points spread evenly. Where the solution was refined, at all
    /// before the last step.
    /// `None` after a quick refit, which does not spend the time.
    pub residual: Option<f64>,
    /// Steps of iterative refinement taken.
    pub refinements: usize,
    /// Steps of conjugate gradients of the iterative solver. Zero for a direct solve.
    pub iterations: usize,
    /// Why the solver ended: [`StopReason::Direct`] for a direct solve.
    pub stop: StopReason,
    /// Decimal digits of the sum of the spline's terms near the points.
    ///
    /// That is −log₁₀ of its rounding error relative to the targets' size.
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
