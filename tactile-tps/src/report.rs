//! The report of a fit: condition, residual, iterations.

/// How a spline was fitted and how far it can be trusted.
///
/// ```
/// # use nalgebra::Point2;
/// # use tactile_tps::{FitOptions, ThinPlateSpline};
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
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct FitReport {
    /// Points given.
    pub points: usize,
    /// Points merged into an earlier one at the same place.
    pub merged: usize,
    /// Points left out because their weight is zero.
    pub ignored: usize,
    /// Rank of [1 X]: one more than the number of directions the points span; D + 1 when they span space.
    pub rank: usize,
    /// Root mean square extent of the points along their principal directions relative to the largest, falling.
    ///
    /// A tiny last entry says that the gradient along that direction is noise over thickness.
    pub extents: Vec<f64>,
    /// The smoothing parameter λ used, in the units of the points and the kernel; 0 for interpolation.
    pub lambda: f64,
    /// Estimated 2-norm condition number of the matrix solved with, in the inner units; 1 if there was none, as for the
    /// iterative solver. A bound for a refit with other weights by the spectrum.
    pub condition: f64,
    /// Largest residual of the spline's equations relative to the largest target: at up to 64 points spread evenly, or,
    /// where the solution was refined, at all of them before the last step. `None` after a quick refit, which does
    /// not spend the time.
    pub residual: Option<f64>,
    /// Steps of iterative refinement taken.
    pub refinements: usize,
    /// Steps of conjugate gradients taken, by the iterative solver or by a refit with other weights that went by the
    /// spectrum; zero for a direct solve.
    pub iterations: usize,
    /// Whether the iterative solver reached its tolerance; if not, it was stopped, or rounding allows no more, and
    /// `residual` says how far it came. Direct solves always do.
    pub converged: bool,
    /// Whether the equations were solved in twice the working precision because plain arithmetic had no digits left.
    pub precise: bool,
    /// Decimal digits left in a plain sum of the spline's terms near the points: −log₁₀ of its rounding error
    /// relative to the targets' size.
    pub digits: f64,
}
