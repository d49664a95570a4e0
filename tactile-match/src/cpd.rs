//! Coherent point drift: non-rigid registration by maximum likelihood.
//!
//! The model points `y_m` (`M` of them) are the centres of a Gaussian mixture with a common
//! variance `σ²` and a uniform component of weight `w` for outliers. The target points `x_n` (`N`
//! of them) are a sample from it. Expectation maximisation alternates these two steps (Myronenko &
//! Song, Point set registration: coherent point drift, IEEE PAMI 32, 2262–2275, 2010):
//!
//! ```text
//! P_mn = exp(−|x_n − T(y_m)|²/2σ²) / (Σ_k exp(−|x_n − T(y_k)|²/2σ²) + (2πσ²)^{D/2} w M / ((1−w) N))
//! T    = the motion that minimises Σ P_mn |x_n − T(y_m)|² / 2σ² + ½ λ |T|²
//! σ²   = Σ P_mn |x_n − T(y_m)|² / (D Σ P_mn)
//! ```
//!
//! The motion is `T(y) = y + Σ_k w_k exp(−|y − y_k|²/2β²)`, so neighbours move coherently. All
//! parameters refer to sets scaled to a root mean square radius of one ([`Normalization`]), so a
//! setting means the same in every unit. The implementation differs from the usual programs in two
//! ways that do not change the result. `P` is never stored during the iterations, and the Gaussian
//! kernel is factorised once, to its numerical rank, instead of solving an `M × M` system in every
//! iteration.

use crate::assignment::assigned;
use crate::error::{all_pairs, at_least_one, option_within, point_sets};
use crate::frame::{Frame, spread};
use crate::gaussian_process::{Axes, Detail, Prior, PriorScales, Regression};
use crate::{Judgement, MatchError, Matching, StopReason, Watch};
use nalgebra::{Point, SMatrix, SVector};
use std::ops::ControlFlow;
use tactile_core::vectorised;
use tactile_tps::Warp;

/// How the two sets are normalised.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_match::{CoherentPointDrift, Normalization, PointMatcher};
/// let model: Vec<_> = (0..24)
///     .map(f64::from)
///     .map(|k| Point2::new(k % 6.0 + 0.2 * k.sin(), (k / 6.0).floor()))
///     .collect();
/// let target: Vec<_> = model.iter().map(|p| Point2::new(p.x + 0.1, p.y)).collect();
/// let options = CoherentPointDrift::default().with_normalization(Normalization::Model);
/// let matching = options.match_points(&model, &target)?;
/// assert!((0..24).all(|i| matching.assignment[i] == Some(i)));
/// # Ok::<(), tactile_match::MatchError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Normalization {
    /// Each set by its own centroid and root mean square radius. This is customary in coherent
    /// point drift, and correct for any motion between the sets.
    #[default]
    Each,
    /// Both sets by the centroid and root mean square radius of the model. Use it for sets that
    /// nearly coincide, where points without a partner would shift the centroid of one set.
    Model,
    /// No normalisation: the parameters are in the units of the points.
    Off,
}

/// Coherent point drift as a [`PointMatcher`](crate::PointMatcher).
///
/// If a large rotation separates the sets, it finds a local optimum, as every method of its kind
/// does. The run time is `O((M N + M r²) · iterations)`, with `r` the rank of the kernel.
///
/// ```
/// use nalgebra::{Point2, Vector2};
/// use tactile_match::{CoherentPointDrift, PointMatcher};
///
/// let model: Vec<_> = (0..40)
///     .map(|k| f64::from(k))
///     .map(|k| Point2::new(k.cos() * k, (1.3 * k).sin() * k))
///     .collect();
/// let target: Vec<_> = model
///     .iter()
///     .rev()
///     .map(|p| p + Vector2::new(7.0 + 0.02 * p.y, -2.0))
///     .collect();
///
/// let matching = CoherentPointDrift::default().match_points(&model, &target)?;
/// assert!((0..40).all(|m| matching.assignment[m] == Some(39 - m)));
/// assert!(
///     matching
///         .warped
///         .iter()
///         .zip(target.iter().rev())
///         .all(|(w, t)| (w - t).norm() < 0.5)
/// );
/// # Ok::<(), tactile_match::MatchError>(())
/// ```
///
/// # Options
/// All options are independent of the units of the points.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_match::{CoherentPointDrift, MatchError, Normalization, PointMatcher};
/// // About a fifth of the target points are outliers, and the object may bend, but gently.
/// let options = CoherentPointDrift::default()
///     .with_field(2.0, 10.0)?
///     .with_rank(30)?
///     .with_normalization(Normalization::Model)
///     .with_outlier_weight(0.2)?
///     .with_tolerance(1e-6)?
///     .with_max_iterations(50)?;
/// let points = [[0.0, 0.0], [1.0, 0.1], [2.5, 0.0], [0.3, 2.0], [1.6, 1.4]].map(Point2::from);
/// let found = options.match_points(&points, &points)?;
/// assert!((0..5).all(|i| found.assignment[i] == Some(i)) && found.report.iterations <= 50);
/// let all_outliers = options.with_outlier_weight(1.0);
/// assert!(matches!(
///     all_outliers,
///     Err(MatchError::InvalidOption {
///         option: "outlier_weight",
///         ..
///     })
/// ));
/// # Ok::<(), MatchError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CoherentPointDrift {
    /// Width of the Gaussian kernel in root mean square radii: the distance over which neighbours
    /// move together.
    beta: f64,
    /// Weight of smoothness against likelihood.
    lambda: f64,
    /// Maximum rank of the kernel. `None` for its numerical rank.
    rank: Option<usize>,
    outlier_weight: f64,
    tolerance: f64,
    max_iterations: usize,
    normalization: Normalization,
}

impl Default for CoherentPointDrift {
    fn default() -> Self {
        Self {
            beta: 2.0,
            lambda: 3.0,
            rank: None,
            outlier_weight: 0.1,
            tolerance: 1e-5,
            max_iterations: 150,
            normalization: Normalization::Each,
        }
    }
}

impl CoherentPointDrift {
    /// Sets the width β of the kernel and the weight λ of smoothness against likelihood. β is the
    /// distance over which neighbours move together, in root mean square radii of the model
    /// (default 2); the default of λ is 3.
    ///
    /// # Errors
    /// [`MatchError::InvalidOption`] unless both are positive and finite.
    pub fn with_field(mut self, beta: f64, lambda: f64) -> Result<Self, MatchError> {
        option_within("beta", beta, f64::MIN_POSITIVE, f64::MAX, "(0, ∞)")?;
        option_within("lambda", lambda, f64::MIN_POSITIVE, f64::MAX, "(0, ∞)")?;
        (self.beta, self.lambda) = (beta, lambda);
        Ok(self)
    }

    /// Sets the maximum rank of the kernel (default: its numerical rank). A rank of thirty is
    /// customary for speed.
    ///
    /// # Errors
    /// [`MatchError::InvalidOption`] for 0.
    pub fn with_rank(mut self, rank: usize) -> Result<Self, MatchError> {
        at_least_one("rank", rank)?;
        self.rank = Some(rank);
        Ok(self)
    }

    /// Sets the weight `w` of the uniform component (default 0.1), approximately the fraction of
    /// target points that are outliers.
    ///
    /// # Errors
    /// [`MatchError::InvalidOption`] outside `[0, 1)`.
    pub fn with_outlier_weight(mut self, weight: f64) -> Result<Self, MatchError> {
        option_within("outlier_weight", weight, 0.0, 1.0 - f64::EPSILON, "[0, 1)")?;
        self.outlier_weight = weight;
        Ok(self)
    }

    /// Sets the change of `σ²` at which the iterations stop (default 10⁻⁵).
    ///
    /// # Errors
    /// [`MatchError::InvalidOption`] unless it is finite and not negative.
    pub fn with_tolerance(mut self, tolerance: f64) -> Result<Self, MatchError> {
        option_within("tolerance", tolerance, 0.0, f64::MAX, "[0, ∞)")?;
        self.tolerance = tolerance;
        Ok(self)
    }

    /// Sets the maximum number of iterations (default 150).
    ///
    /// # Errors
    /// [`MatchError::InvalidOption`] for 0.
    pub fn with_max_iterations(mut self, limit: usize) -> Result<Self, MatchError> {
        at_least_one("max_iterations", limit)?;
        self.max_iterations = limit;
        Ok(self)
    }

    /// Sets the normalisation of the sets (default [`Normalization::Each`]).
    #[must_use]
    pub fn with_normalization(mut self, normalization: Normalization) -> Self {
        self.normalization = normalization;
        self
    }
}

// Expectation maximisation.
//
// For a fixed posterior P the motion is a regression under the prior covariance
// `G_mk = exp(−|y_m − y_k|²/2β²)` with weights `P 1`, targets `P X / P 1 − Y` and noise variance
// λσ² (Myronenko & Song, eq. 22–23: `(diag(P1) G + λσ² I) W = P X − diag(P1) Y`).

/// Residual diagonal of the kernel at which its factorisation stops, far below what the ridge λσ²
/// resolves.
const LEFT_OUT: f64 = 1e-12;
/// Soft matches below this weight are dropped.
const FAINTEST: f64 = 1e-4;

/// A registration in progress, in the normalised frame of the sets.
struct Registration<const D: usize> {
    options: CoherentPointDrift,
    /// Frames of the model and the target.
    frames: [Frame<D>; 2],
    model: Vec<[f64; D]>,
    target: Vec<[f64; D]>,
    moved: Axes<D>,
    kernel: Prior,
    motion: Regression<D>,
    posterior: Posterior<D>,
    sigma2: f64,
    energy: Vec<f64>,
    stop: StopReason,
}

impl<const D: usize> Registration<D> {
    fn new(
        options: &CoherentPointDrift,
        model: &[Point<f64, D>],
        target: &[Point<f64, D>],
    ) -> Self {
        let own = Frame::of(model);
        let frames = match options.normalization {
            Normalization::Each => [own, Frame::of(target)],
            Normalization::Model => [own, own],
            Normalization::Off => [Frame::default(); 2],
        };
        let inside = |frame: &Frame<D>, points: &[Point<f64, D>]| -> Vec<[f64; D]> {
            points.iter().map(|p| frame.inside(p).into()).collect()
        };
        let (model, target) = (inside(&frames[0], model), inside(&frames[1], target));
        let (mut kernel, mut moved) = (Prior::default(), Axes::default());
        let scales = PriorScales {
            length: options.beta,
            bending: 1.0,
            affine: 0.0,
        };
        let detail = Detail {
            rank: options.rank.unwrap_or(model.len()),
            left_out: LEFT_OUT,
            hidden: 0.0,
        };
        kernel.factor(&model, scales, detail);
        moved.fill(model.len(), model.iter().copied());
        Self {
            options: *options,
            frames,
            sigma2: mean_variance(&model, &target),
            model,
            target,
            moved,
            kernel,
            motion: Regression::default(),
            posterior: Posterior::default(),
            energy: Vec::new(),
            stop: StopReason::IterationLimit,
        }
    }

    /// Alternates E-step and M-step until σ² converges or `watch` stops it.
    fn run(&mut self, watch: Watch<'_>) {
        if self.sigma2 <= 0.0 {
            self.stop = StopReason::Exact; // all points of both sets coincide
            return;
        }
        for _ in 0..self.options.max_iterations {
            let (before, uniform) = (self.sigma2, self.uniform());
            let posterior = &mut self.posterior;
            let done = posterior.update(&self.moved.0, &self.target, (before, uniform), watch);
            if done.is_break() {
                self.stop = StopReason::Cancelled;
                return;
            }
            self.energy.push(self.posterior.energy);
            self.move_model();
            self.update_variance();
            if (self.sigma2 - before).abs() <= self.options.tolerance {
                self.stop = StopReason::Converged;
                return;
            }
        }
    }

    /// Fits the motion to the posterior and moves the model.
    fn move_model(&mut self) {
        let (stride, ridge) = (self.kernel.stride, self.options.lambda * self.sigma2);
        let Posterior {
            model_mass: mass,
            weighted,
            wanted,
            ..
        } = &mut self.posterior;
        wanted.fill(
            stride,
            self.model.iter().enumerate().map(|(m, y)| {
                let reached = mass[m] > f64::MIN_POSITIVE;
                std::array::from_fn(|d| match reached {
                    true => weighted.0[d][m] / mass[m] - y[d],
                    false => 0.0,
                })
            }),
        );
        mass.resize(stride, 0.0);
        self.motion.fit(&self.kernel, mass, wanted, ridge);
        mass.truncate(self.model.len());
        for d in 0..D {
            let rows = self.moved.0[d].iter_mut().zip(&self.model);
            for ((t, y), u) in rows.zip(&self.motion.displacement.0[d]) {
                *t = y[d] + u;
            }
        }
    }

    /// Weight of the uniform component relative to the peak of one Gaussian at the current
    /// variance: `(2πσ²)^{D/2} w M / ((1 − w) N)`.
    fn uniform(&self) -> f64 {
        let w = self.options.outlier_weight;
        let volume = (std::f64::consts::TAU * self.sigma2).powf(0.5 * D as f64);
        volume * w / (1.0 - w) * self.model.len() as f64 / self.target.len() as f64
    }

    /// Updates `σ² = Σ P_mn |x_n − T(y_m)|² / (D Σ P_mn)`. If rounding makes it zero or negative, a
    /// tenth of the tolerance takes its place.
    fn update_variance(&mut self) {
        let mass: f64 = self.posterior.model_mass.iter().sum();
        if mass <= f64::MIN_POSITIVE {
            return; // all points are outliers, so the variance has no data
        }
        let mut sum = 0.0;
        for d in 0..D {
            let moved = self.moved.0[d].iter().zip(&self.posterior.model_mass);
            let crosses = self.moved.0[d].iter().zip(&self.posterior.weighted.0[d]);
            let targets = self.target.iter().zip(&self.posterior.target_mass);
            sum += targets.map(|(x, p)| p * x[d] * x[d]).sum::<f64>()
                - 2.0 * crosses.map(|(t, p)| p * t).sum::<f64>()
                + moved.map(|(t, p)| p * t * t).sum::<f64>();
        }
        // Coordinates of unit size carry an error of ε, and 1/σ² must stay finite.
        let least = f64::EPSILON * f64::EPSILON;
        let variance = sum / (mass * D as f64);
        self.sigma2 = if variance > 0.0 {
            variance
        } else {
            0.1 * self.options.tolerance
        }
        .max(least);
    }

    /// The fitted map for any point. Before the first iteration it is the identity.
    fn warp(&self) -> DriftWarp<D> {
        let pivots = &self.kernel.pivots[..self.motion.solution.len()];
        DriftWarp {
            frames: self.frames,
            centres: pivots.iter().map(|&m| self.model[m].into()).collect(),
            weights: self.pivot_weights(pivots),
            beta: self.options.beta,
        }
    }

    /// Weights `w` at the pivots with `Σ_k G(x, y_k) w_k = (L z)(x)`: solves `Cᵀ w = z`, where `C`
    /// holds the pivots' rows of `L`.
    fn pivot_weights(&self, pivots: &[usize]) -> Vec<SVector<f64, D>> {
        let solution = self.motion.solution.iter();
        let mut weights: Vec<SVector<f64, D>> = solution.map(|&z| z.into()).collect();
        for k in (0..weights.len()).rev() {
            let column = self.kernel.column(k);
            for later in k + 1..weights.len() {
                let known = weights[later] * column[pivots[later]];
                weights[k] -= known;
            }
            weights[k] /= column[pivots[k]];
        }
        weights
    }
}

/// Mean squared distance over all pairs, per axis.
fn mean_variance<const D: usize>(model: &[[f64; D]], target: &[[f64; D]]) -> f64 {
    let moments = |points: &[[f64; D]], d: usize| {
        let n = points.len() as f64;
        let sum: f64 = points.iter().map(|p| p[d]).sum();
        let squares: f64 = points.iter().map(|p| p[d] * p[d]).sum();
        (sum / n, squares / n)
    };
    let along = |d: usize| {
        let ((mean_y, square_y), (mean_x, square_x)) = (moments(model, d), moments(target, d));
        square_y + square_x - 2.0 * mean_y * mean_x
    };
    (0..D).map(along).sum::<f64>() / D as f64
}

// The E-step: sums over the posterior `P` (which target point belongs to which model point) without
// storing `P`.

/// Sums over the posterior that the M-step needs, for `M` model and `N` target points.
#[derive(Clone, Debug, Default)]
struct Posterior<const D: usize> {
    /// `P 1`: posterior mass of each model point.
    model_mass: Vec<f64>,
    /// `Pᵀ 1`: probability of each target point that it is not an outlier.
    target_mass: Vec<f64>,
    /// `P X`.
    weighted: Axes<D>,
    /// `P X / P 1 − Y`, the displacements to fit.
    wanted: Axes<D>,
    /// Negative log-likelihood, up to a constant that depends only on the numbers of points.
    energy: f64,
    /// One column of `P`.
    column: Vec<f64>,
}

impl<const D: usize> Posterior<D> {
    /// All sums for model points that have moved to `moved`. `O(M N)`.
    fn update(
        &mut self,
        moved: &[Vec<f64>; D],
        target: &[[f64; D]],
        (sigma2, uniform): (f64, f64),
        watch: Watch<'_>,
    ) -> ControlFlow<()> {
        let vectors = [&mut self.model_mass, &mut self.column];
        for sums in self.weighted.0.iter_mut().chain(vectors) {
            sums.clear();
            sums.resize(moved[0].len(), 0.0);
        }
        self.target_mass.clear();
        self.energy = 0.5 * (D * target.len()) as f64 * sigma2.ln();
        vectorised(
            #[inline(always)]
            || {
                for x in target {
                    watch()?;
                    let sum = gaussians(&mut self.column, moved, x, sigma2);
                    let total = sum + uniform;
                    if total <= 0.0 {
                        // No model point is within reach, and no outlier component takes the point.
                        self.target_mass.push(0.0);
                        continue;
                    }
                    self.energy -= total.ln();
                    self.target_mass.push(sum / total);
                    scale_and_add(&mut self.column, &mut self.model_mass, 1.0 / total);
                    for (weighted, x) in self.weighted.0.iter_mut().zip(x) {
                        for (sum, &p) in weighted.iter_mut().zip(&self.column) {
                            *sum += p * x;
                        }
                    }
                }
                ControlFlow::Continue(())
            },
        )
    }
}

/// `exp(−|x − y_m|² / 2σ²)` for each model point. Returns the sum of these values.
#[inline(always)]
fn gaussians<const D: usize>(
    column: &mut [f64],
    moved: &[Vec<f64>; D],
    x: &[f64; D],
    sigma2: f64,
) -> f64 {
    let scale = -0.5 / sigma2;
    let moved: [&[f64]; D] = std::array::from_fn(|d| &moved[d][..column.len()]);
    for m in 0..column.len() {
        let mut squared = 0.0;
        for d in 0..D {
            let step = x[d] - moved[d][m];
            squared += step * step;
        }
        column[m] = exp_of_negative(squared * scale);
    }
    lane_sum(column)
}

#[inline(always)]
fn scale_and_add(column: &mut [f64], sums: &mut [f64], factor: f64) {
    for (p, sum) in column.iter_mut().zip(sums) {
        *p *= factor;
        *sum += *p;
    }
}

/// Sums in eight lanes. They vectorise without reordering, so every machine gives the same bits.
#[inline(always)]
fn lane_sum(values: &[f64]) -> f64 {
    let mut lanes = [0.0; 8];
    let (chunks, rest) = values.as_chunks::<8>();
    for chunk in chunks {
        for l in 0..8 {
            lanes[l] += chunk[l];
        }
    }
    lanes.iter().sum::<f64>() + rest.iter().sum::<f64>()
}

// eˣ without branches, so that loops over it vectorise.

/// `e^x` for `x <= 0`, to about one unit in the last place. Below −708 it is exactly zero: a
/// product with a number of size one would underflow anyway. It has no branch and no table, so that
/// a loop over it vectorises, and it uses only products and sums, so that every machine gives the
/// same bits.
#[inline(always)]
fn exp_of_negative(x: f64) -> f64 {
    const LOWEST: f64 = -708.0;
    // Adding 1.5·2⁵² rounds to an integer and leaves it, offset by the exponent's bias, in the
    // lowest bits of the sum.
    const SHIFT: f64 = 6_755_399_441_055_744.0;
    const LN2_HIGH: f64 = 6.931_471_803_691_238e-1;
    const LN2_LOW: f64 = 1.908_214_929_270_587_7e-10;
    let clamped = if x > LOWEST { x } else { LOWEST };
    let shifted = clamped * std::f64::consts::LOG2_E + SHIFT;
    let k = shifted - SHIFT;
    let r = clamped - k * LN2_HIGH - k * LN2_LOW;
    let power = f64::from_bits(shifted.to_bits().wrapping_add(1023) << 52);
    let value = taylor(r) * power;
    if x > LOWEST { value } else { 0.0 }
}

/// Σ rⁿ/n! up to n = 13: the truncation error is below 2⁻⁵³ of eʳ for |r| ≤ ½ ln 2.
#[inline(always)]
fn taylor(r: f64) -> f64 {
    const INVERSE_FACTORIAL: [f64; 12] = [
        1.0 / 6_227_020_800.0,
        1.0 / 479_001_600.0,
        1.0 / 39_916_800.0,
        1.0 / 3_628_800.0,
        1.0 / 362_880.0,
        1.0 / 40_320.0,
        1.0 / 5_040.0,
        1.0 / 720.0,
        1.0 / 120.0,
        1.0 / 24.0,
        1.0 / 6.0,
        0.5,
    ];
    let mut sum = INVERSE_FACTORIAL[0];
    for &c in &INVERSE_FACTORIAL[1..] {
        sum = sum * r + c;
    }
    1.0 + (r + r * r * sum)
}

// The map that a registration found, evaluated at any point.

/// The map found by [`CoherentPointDrift`], in the frame of the registration:
/// `y ↦ y + Σ_k w_k exp(−|y − p_k|² / 2β²)`. It takes the model points to their registered
/// positions and interpolates between them.
#[derive(Clone, Debug, PartialEq)]
struct DriftWarp<const D: usize> {
    frames: [Frame<D>; 2],
    centres: Vec<SVector<f64, D>>,
    weights: Vec<SVector<f64, D>>,
    beta: f64,
}

impl<const D: usize> DriftWarp<D> {
    fn gaussian(&self, from_centre: &SVector<f64, D>) -> f64 {
        (-0.5 * from_centre.norm_squared() / (self.beta * self.beta)).exp()
    }
}

impl<const D: usize> Warp<D> for DriftWarp<D> {
    fn apply(&self, point: &Point<f64, D>) -> Point<f64, D> {
        let y = self.frames[0].inside(point);
        let mut image = y;
        for (centre, weight) in self.centres.iter().zip(&self.weights) {
            image += weight * self.gaussian(&(y - centre));
        }
        self.frames[1].leave(image)
    }

    fn jacobian(&self, point: &Point<f64, D>) -> SMatrix<f64, D, D> {
        let y = self.frames[0].inside(point);
        let mut jacobian = SMatrix::identity();
        for (centre, weight) in self.centres.iter().zip(&self.weights) {
            let step = y - centre;
            jacobian -=
                weight * step.transpose() * (self.gaussian(&step) / (self.beta * self.beta));
        }
        jacobian * (self.frames[1].scale / self.frames[0].scale)
    }
}

// From the final mixture to a [`Matching`]: posterior, pairs, confidences and covariances.

impl CoherentPointDrift {
    /// [`PointMatcher::match_points`](crate::PointMatcher::match_points).
    pub(crate) fn once<const D: usize>(
        &self,
        model: &[Point<f64, D>],
        target: &[Point<f64, D>],
        watch: Watch<'_>,
    ) -> Result<Matching<D>, MatchError> {
        point_sets(model, target)?;
        all_pairs(model.len(), target.len())?;
        let mut registration = Registration::new(self, model, target);
        registration.run(watch);
        Ok(registration.matching(model, target, watch))
    }
}

impl<const D: usize> Registration<D> {
    /// The final posterior `P`, one row of `M` entries per target point.
    fn posterior(&self) -> Vec<f64> {
        let sigma2 = self.sigma2.max(f64::MIN_POSITIVE);
        let mut rows = vec![0.0; self.model.len() * self.target.len()];
        for (row, x) in rows.chunks_exact_mut(self.model.len()).zip(&self.target) {
            let total = gaussians(row, &self.moved.0, x, sigma2) + self.uniform();
            if total > 0.0 {
                row.iter_mut().for_each(|p| *p /= total);
            }
        }
        rows
    }

    fn matching(
        &self,
        model: &[Point<f64, D>],
        target: &[Point<f64, D>],
        watch: Watch<'_>,
    ) -> Matching<D> {
        let m_len = model.len();
        // A stopped registration has no posterior, since that takes longer than an iteration.
        let (posterior, assignment) = if self.stop == StopReason::Cancelled {
            (vec![0.0; m_len * target.len()], vec![None; m_len])
        } else {
            let posterior = self.posterior();
            let assignment = pairs(&posterior, m_len, target.len(), watch);
            (posterior, assignment)
        };
        let scale = self.frames[1].scale;
        let moved = |m: usize| SVector::<f64, D>::from_fn(|d, _| self.moved.0[d][m]);
        let warped = (0..m_len).map(|m| self.frames[1].leave(moved(m))).collect();
        let mut found = Matching::new(target, Box::new(self.warp()), warped, assignment);
        for (m, partner) in found.assignment.iter().enumerate() {
            let column = (0..target.len()).map(|n| (n, posterior[n * m_len + m]));
            let row: Vec<(usize, f64)> = column.filter(|p| p.1 > FAINTEST).collect();
            let mass = row.iter().map(|p| p.1).sum::<f64>();
            // Several targets may share one model point, whereas a row of M must sum to one.
            let share = |p: f64| p / mass.max(1.0);
            found.soft.push_row(row.iter().map(|&(n, p)| (n, share(p))));
            let sure = partner.map_or(1.0 - mass.min(1.0), |n| share(posterior[n * m_len + m]));
            found.confidence.push(sure.clamp(0.0, 1.0));
            // The covariance is the spread of the soft matches about their mean plus the noise σ²
            // of the mixture.
            let spread = spread(row.iter().map(|&(n, p)| (self.target[n].into(), p)));
            let covariance = spread + SMatrix::identity() * self.sigma2;
            found
                .displacement_covariance
                .push(covariance * (scale * scale));
        }
        found.energy.clone_from(&self.energy);
        (found.report.judgement, found.report.period) =
            Judgement::of_pairs(model, target, &found.assignment);
        found.report.stop = self.stop;
        found.report.iterations = self.energy.len();
        found.report.sigma = scale * self.sigma2.sqrt();
        found
    }
}

/// Assigns distinct targets to the model points so that the sum of the posterior is largest. A pair
/// is kept only if its target is at least as likely to belong to the model point as to be an
/// outlier.
fn pairs(
    posterior: &[f64],
    model_len: usize,
    target_len: usize,
    watch: Watch<'_>,
) -> Vec<Option<usize>> {
    let mut assignment = vec![None; model_len];
    // The costs are probabilities, hence finite.
    let cost = |n: usize, m: usize| -posterior[n * model_len + m];
    let columns = assigned([target_len, model_len], cost, watch).unwrap_or_default();
    for (n, m) in columns.iter().enumerate() {
        let Some(m) = *m else { continue };
        let row = &posterior[n * model_len..][..model_len];
        let outlier = 1.0 - row.iter().sum::<f64>();
        if row[m] > 0.0 && row[m] >= outlier {
            assignment[m] = Some(n);
        }
    }
    assignment
}

#[cfg(test)]
mod tests;
