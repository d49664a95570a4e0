//! Coherent point drift: non-rigid registration by maximum likelihood.
//!
//! The model points `y_m` (`M` of them) are the centres of a Gaussian mixture of one variance `σ²`,
//! with a uniform component of weight `w` for outliers. The target points `x_n` (`N`) are its
//! sample. Expectation maximisation alternates (Myronenko & Song, Point set registration: coherent
//! point drift, IEEE PAMI 32, 2262–2275, 2010):
//!
//! ```text
//! P_mn = exp(−|x_n − T(y_m)|²/2σ²) / (Σ_k exp(−|x_n − T(y_k)|²/2σ²) + (2πσ²)^{D/2} w M / ((1−w) N))
//! T    = the motion that minimises Σ P_mn |x_n − T(y_m)|² / 2σ² + ½ λ |T|²
//! σ²   = Σ P_mn |x_n − T(y_m)|² / (D Σ P_mn)
//! ```
//!
//! The motion is `T(y) = y + Σ_k w_k exp(−|y − y_k|²/2β²)`, neighbours moving coherently. All
//! parameters refer to sets of root mean square radius one ([`Normalization`]): the same settings
//! mean the same in every unit. Two things differ from the usual programs, neither in the answer:
//! `P` is never stored while iterating, and the Gaussian kernel is factorised once, to the rank it
//! numerically has, instead of solving an `M × M` system in every iteration.

use crate::error::{at_least_one, option_within, point_sets};
use crate::{Axes, Frame, spread};
use crate::{
    Judgement, MatchError, MatchReport, Matching, PointMatcher, SoftMatches, StopReason,
    linear_assignment, unmatched_rows,
};
use nalgebra::{Cholesky, DMatrix, Dyn, Point, SMatrix, SVector, VecStorage};
use tactile_core::{Loop, vectorised};
use tactile_tps::Warp;

/// How the two sets are brought to size one.
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
    /// Each set by its own centre and root mean square radius: customary in coherent point drift,
    /// and right whatever lies between the sets.
    #[default]
    Each,
    /// Both by the centre and the root mean square radius of the model: for sets that nearly lie on
    /// one another, where points without a partner would shift the centre of one of them.
    Model,
    /// None: the parameters are in the units of the points.
    Off,
}

impl CoherentPointDrift {
    /// [`PointMatcher::match_points`] with the memory of the iterations kept between calls.
    ///
    /// ```
    /// use nalgebra::{Point2, Vector2};
    /// use tactile_match::{CoherentPointDrift, DriftWorkspace};
    /// let model: Vec<_> = (0..12)
    ///     .map(f64::from)
    ///     .map(|k| Point2::new(k % 4.0 + 0.2 * k.sin(), (k / 4.0).floor()))
    ///     .collect();
    /// let (matcher, mut workspace) = (CoherentPointDrift::default(), DriftWorkspace::default());
    /// for shift in [0.5, 5.0] {
    ///     let target: Vec<_> = model.iter().map(|p| p + Vector2::new(shift, 0.0)).collect();
    ///     let matching = matcher.match_with(&mut workspace, &model, &target)?;
    ///     assert!((0..12).all(|i| matching.assignment[i] == Some(i)));
    /// }
    /// # Ok::<(), tactile_match::MatchError>(())
    /// ```
    ///
    /// # Errors
    /// As [`PointMatcher::match_points`].
    pub fn match_with<const D: usize>(
        &self,
        workspace: &mut DriftWorkspace<D>,
        model: &[Point<f64, D>],
        target: &[Point<f64, D>],
    ) -> Result<Matching<D>, MatchError> {
        self.register_in(workspace, model, target)
    }

    pub(crate) fn register<const D: usize>(
        &self,
        workspace: &mut DriftWorkspace<D>,
        model: &[Point<f64, D>],
        target: &[Point<f64, D>],
    ) -> Result<Matching<D>, MatchError> {
        point_sets(model, target)?;
        workspace.register(self, model, target);
        let mut found = matching(workspace);
        found.report.judgement = Judgement::of_pairs(model, target, &found.assignment);
        Ok(found)
    }
}

impl<const D: usize> PointMatcher<D> for CoherentPointDrift {
    fn match_points(
        &self,
        model: &[Point<f64, D>],
        target: &[Point<f64, D>],
    ) -> Result<Matching<D>, MatchError> {
        self.match_with(&mut DriftWorkspace::default(), model, target)
    }
}

/// Coherent point drift as a [`PointMatcher`](crate::PointMatcher).
///
/// Where the sets are far apart in rotation it finds a local optimum, as every method of its kind
/// does. The time is `O((M N + M r²) · iterations)`, with `r` the rank of the kernel.
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
/// All are independent of the units of the points.
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
    /// Width of the Gaussian kernel, in root mean square radii: how far neighbours move together.
    beta: f64,
    /// Weight of smoothness against likelihood.
    lambda: f64,
    /// Greatest rank of the kernel. `None` for the rank it numerically has.
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
    /// Sets the width β of the kernel, in root mean square radii of the model: how far neighbours
    /// move together (default 2), and the weight λ of smoothness against likelihood (default 3).
    ///
    /// # Errors
    /// [`MatchError::InvalidOption`] unless both are positive and finite.
    pub fn with_field(mut self, beta: f64, lambda: f64) -> Result<Self, MatchError> {
        option_within("beta", beta, f64::MIN_POSITIVE, f64::MAX, "(0, ∞)")?;
        option_within("lambda", lambda, f64::MIN_POSITIVE, f64::MAX, "(0, ∞)")?;
        (self.beta, self.lambda) = (beta, lambda);
        Ok(self)
    }

    /// Sets the greatest rank of the kernel (default: the rank it numerically has). Thirty is
    /// customary for speed.
    ///
    /// # Errors
    /// [`MatchError::InvalidOption`] for 0.
    pub fn with_rank(mut self, rank: usize) -> Result<Self, MatchError> {
        at_least_one("rank", rank)?;
        self.rank = Some(rank);
        Ok(self)
    }

    /// Sets the weight `w` of the uniform component (default 0.1): about the share of target points
    /// that are outliers.
    ///
    /// # Errors
    /// [`MatchError::InvalidOption`] outside `[0, 1)`.
    pub fn with_outlier_weight(mut self, weight: f64) -> Result<Self, MatchError> {
        option_within("outlier_weight", weight, 0.0, 1.0 - f64::EPSILON, "[0, 1)")?;
        self.outlier_weight = weight;
        Ok(self)
    }

    /// Sets the change of `σ²` at which the iterations end (default 10⁻⁵).
    ///
    /// # Errors
    /// [`MatchError::InvalidOption`] unless it is finite and not negative.
    pub fn with_tolerance(mut self, tolerance: f64) -> Result<Self, MatchError> {
        option_within("tolerance", tolerance, 0.0, f64::MAX, "[0, ∞)")?;
        self.tolerance = tolerance;
        Ok(self)
    }

    /// Sets the most iterations (default 150).
    ///
    /// # Errors
    /// [`MatchError::InvalidOption`] for 0.
    pub fn with_max_iterations(mut self, limit: usize) -> Result<Self, MatchError> {
        at_least_one("max_iterations", limit)?;
        self.max_iterations = limit;
        Ok(self)
    }

    /// Sets the frame of the registration (default [`Normalization::Each`]).
    #[must_use]
    pub fn with_normalization(mut self, normalization: Normalization) -> Self {
        self.normalization = normalization;
        self
    }
}

// Expectation maximisation: the loop, and the memory it needs.

/// Memory of [`CoherentPointDrift`](super::CoherentPointDrift), to be reused: the iterations do not
/// allocate once it has seen the largest sets.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_match::{CoherentPointDrift, DriftWorkspace};
/// let model: Vec<_> = (0..12)
///     .map(f64::from)
///     .map(|k| Point2::new(k % 4.0 + 0.2 * k.sin(), (k / 4.0).floor()))
///     .collect();
/// let target: Vec<_> = model
///     .iter()
///     .map(|p| Point2::new(p.x + 0.1 * p.y, p.y + 2.0))
///     .collect();
/// let mut workspace = DriftWorkspace::default();
/// let found = CoherentPointDrift::default().match_with(&mut workspace, &model, &target)?;
/// assert!(found.report.iterations > 1 && found.report.sigma < 0.2); // in the units of the points
/// assert!((found.warp.apply(&model[5]) - found.warped[5]).norm() < 1e-6);
/// # Ok::<(), tactile_match::MatchError>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct DriftWorkspace<const D: usize> {
    /// Those of the last registration.
    options: CoherentPointDrift,
    model_frame: Frame<D>,
    target_frame: Frame<D>,
    model: Axes<D>,
    target: Axes<D>,
    moved: Axes<D>,
    posterior: Posterior<D>,
    sigma2: f64,
    energy: Vec<f64>,
    stop: StopReason,
    kernel: KernelFactor,
    non_rigid: NonRigidStep,
}

impl<const D: usize> DriftWorkspace<D> {
    /// Registers `model` to `target`. Both have points and finite coordinates.
    fn register(
        &mut self,
        options: &CoherentPointDrift,
        model: &[Point<f64, D>],
        target: &[Point<f64, D>],
    ) {
        self.options = *options;
        self.enter_frames(model, target);
        self.kernel.build(
            &self.model.0,
            options.beta,
            options.rank.unwrap_or(model.len()),
            // What is left of the kernel's diagonal when its factorisation ends: far below what the
            // ridge `λσ²` lets through.
            1e-12,
        );
        self.energy.clear();
        self.sigma2 = self.initial_variance();
        self.stop = StopReason::Exact;
        if self.sigma2 <= 0.0 {
            return; // all points of both sets coincide
        }
        self.stop = StopReason::IterationLimit;
        for _ in 0..options.max_iterations {
            let before = self.sigma2;
            self.iterate();
            if (self.sigma2 - before).abs() <= options.tolerance {
                self.stop = StopReason::Converged;
                break;
            }
        }
    }

    fn enter_frames(&mut self, model: &[Point<f64, D>], target: &[Point<f64, D>]) {
        let options = &self.options;
        self.model_frame = Frame::of(model);
        self.target_frame = match options.normalization {
            Normalization::Each => Frame::of(target),
            Normalization::Model => self.model_frame,
            Normalization::Off => Frame::default(),
        };
        if options.normalization == Normalization::Off {
            self.model_frame = Frame::default();
        }
        self.model_frame.enter(model, &mut self.model);
        self.target_frame.enter(target, &mut self.target);
        self.moved.0.clone_from(&self.model.0);
    }

    /// Mean squared distance of all pairs, per axis.
    fn initial_variance(&self) -> f64 {
        let mut sum = 0.0;
        for (y, x) in self.model.0.iter().zip(&self.target.0) {
            let moments = |v: &[f64]| {
                let n = v.len() as f64;
                (
                    v.iter().sum::<f64>() / n,
                    v.iter().map(|c| c * c).sum::<f64>() / n,
                )
            };
            let ((mean_y, square_y), (mean_x, square_x)) = (moments(y), moments(x));
            sum += square_y + square_x - 2.0 * mean_y * mean_x;
        }
        sum / D as f64
    }

    /// One E-step and one M-step.
    fn iterate(&mut self) {
        let uniform = self.uniform();
        self.posterior
            .update(&self.moved.0, &self.target.0, self.sigma2, uniform);
        self.energy.push(self.posterior.energy);
        let (posterior, model, moved) = (&self.posterior, &self.model.0, &mut self.moved.0);
        let ridge = self.options.lambda * self.sigma2;
        self.non_rigid
            .solve(&self.kernel, posterior, model, ridge, moved);
        self.update_variance();
    }

    /// Weight of the uniform component relative to one Gaussian's peak at the present variance,
    /// `(2πσ²)^{D/2} w M / ((1 − w) N)`.
    fn uniform(&self) -> f64 {
        let (w, [m, n]) = (self.options.outlier_weight, self.lengths());
        let volume = (std::f64::consts::TAU * self.sigma2).powf(0.5 * D as f64);
        volume * w / (1.0 - w) * m as f64 / n as f64
    }

    /// Points of the model and of the target.
    fn lengths(&self) -> [usize; 2] {
        [self.model.0[0].len(), self.target.0[0].len()]
    }

    /// `σ² = Σ P_mn |x_n − T(y_m)|² / (D Σ P_mn)`. A tenth of the tolerance where rounding makes it
    /// zero or less.
    fn update_variance(&mut self) {
        let mass: f64 = self.posterior.model_mass.iter().sum();
        if mass <= f64::MIN_POSITIVE {
            return; // all are outliers: nothing to learn from
        }
        let weighted = |w: &[f64], a: &[f64], b: &[f64]| -> f64 {
            w.iter().zip(a).zip(b).map(|((w, a), b)| w * a * b).sum()
        };
        let mut sum = 0.0;
        for d in 0..D {
            let (x, t) = (&self.target.0[d], &self.moved.0[d]);
            let cross: f64 = self.posterior.weighted.0[d]
                .iter()
                .zip(t)
                .map(|(p, t)| p * t)
                .sum();
            sum += weighted(&self.posterior.target_mass, x, x) - 2.0 * cross
                + weighted(&self.posterior.model_mass, t, t);
        }
        // Coordinates of size one are not known better than ε, and 1/σ² must stay finite.
        let least = f64::EPSILON * f64::EPSILON;
        let variance = sum / (mass * D as f64);
        self.sigma2 = if variance > 0.0 {
            variance
        } else {
            0.1 * self.options.tolerance
        }
        .max(least);
    }

    /// The model points where the last registration left them.
    fn warped(&self) -> Vec<Point<f64, D>> {
        (0..self.lengths()[0])
            .map(|m| self.target_frame.leave(at(&self.moved.0, m)))
            .collect()
    }

    /// The map the last registration found, for any point.
    fn warp(&self) -> DriftWarp<D> {
        let mut warp = DriftWarp {
            model: self.model_frame,
            target: self.target_frame,
            centres: Vec::new(),
            weights: Vec::new(),
            beta: 1.0,
        };
        if !self.energy.is_empty() {
            warp.beta = self.options.beta;
            let coefficients: Vec<_> = (0..self.kernel.rank())
                .map(|k| self.non_rigid.coefficient(k))
                .collect();
            warp.weights = self
                .kernel
                .pivot_weights(&coefficients)
                .into_iter()
                .map(SVector::from)
                .collect();
            let pivots = self.kernel.pivots.iter();
            warp.centres = pivots.map(|&m| at(&self.model.0, m)).collect();
        }
        warp
    }
}

// The E-step: which target point belongs to which model point, as sums over the posterior `P`
// without storing it.

/// `D` coordinates, each contiguous over the points.
type Columns<const D: usize> = [Vec<f64>; D];

/// Point `m` of these.
fn at<const D: usize>(columns: &Columns<D>, m: usize) -> SVector<f64, D> {
    SVector::from_fn(|d, _| columns[d][m])
}

/// The sums over the posterior that the M-steps need, for `M` model and `N` target points.
#[derive(Clone, Debug, Default)]
struct Posterior<const D: usize> {
    /// `P 1`: how much of the target every model point has.
    model_mass: Vec<f64>,
    /// `Pᵀ 1`: how much of every target point is no outlier.
    target_mass: Vec<f64>,
    /// `P X`.
    weighted: Axes<D>,
    /// Negative log-likelihood, up to a constant that depends on the sizes alone.
    energy: f64,
    /// One column of `P`.
    column: Vec<f64>,
}

impl<const D: usize> Posterior<D> {
    /// All sums for model points that have moved to `moved`. `O(M N)`.
    fn update(&mut self, moved: &Columns<D>, target: &Columns<D>, sigma2: f64, uniform: f64) {
        let (model_len, target_len) = (moved[0].len(), target[0].len());
        for sums in self
            .weighted
            .0
            .iter_mut()
            .chain([&mut self.model_mass, &mut self.column])
        {
            sums.clear();
            sums.resize(model_len, 0.0);
        }
        self.target_mass.clear();
        self.target_mass.resize(target_len, 0.0);
        vectorised(Accumulate {
            posterior: self,
            moved,
            target,
            sigma2,
            uniform,
        });
        self.energy += 0.5 * (D * target_len) as f64 * sigma2.ln();
    }
}

/// The pass over all pairs.
struct Accumulate<'a, const D: usize> {
    posterior: &'a mut Posterior<D>,
    moved: &'a Columns<D>,
    target: &'a Columns<D>,
    sigma2: f64,
    uniform: f64,
}

impl<const D: usize> Loop for Accumulate<'_, D> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let sums = self.posterior;
        sums.energy = 0.0;
        for n in 0..sums.target_mass.len() {
            let x: [f64; D] = std::array::from_fn(|d| self.target[d][n]);
            let sum = gaussians(&mut sums.column, self.moved, x, self.sigma2);
            let total = sum + self.uniform;
            if total <= 0.0 {
                continue; // out of reach of every model point, and no outlier component to take it
            }
            sums.energy -= total.ln();
            sums.target_mass[n] = sum / total;
            scale_and_add(&mut sums.column, &mut sums.model_mass, 1.0 / total);
            for (weighted, x) in sums.weighted.0.iter_mut().zip(x) {
                for (sum, &p) in weighted.iter_mut().zip(&sums.column) {
                    *sum += p * x;
                }
            }
        }
    }
}

/// `exp(−|x − y_m|² / 2σ²)` for every model point. Returns their sum.
#[inline(always)]
fn gaussians<const D: usize>(
    column: &mut [f64],
    moved: &Columns<D>,
    x: [f64; D],
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

/// The sum in eight lanes, which vectorise without reordering: the same bits on every machine.
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

// eˣ in loops that vectorise.

/// `e^x` for `x <= 0`, to about one unit in the last place. Exactly zero below −708, where a
/// product with anything of size one would be lost anyway. No branch and no table, so that a loop
/// over it vectorises. Plain products and sums, so that every machine gives the same bits.
#[inline(always)]
fn exp_of_negative(x: f64) -> f64 {
    const LOWEST: f64 = -708.0;
    // Adding 1.5·2⁵² rounds to an integer and leaves it, offset by the exponent's bias, in the
    // lowest bits.
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

/// Σ rⁿ/n! to n = 13: below 2⁻⁵³ of eʳ for |r| ≤ ½ ln 2.
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

// The Gaussian kernel `G` of the non-rigid motion, as a product `L Lᵀ` of low rank.
//
// `G_mk = exp(−|y_m − y_k|² / 2β²)` of smooth motion (β about the size of the set) has few
// eigenvalues above rounding, so that a pivoted Cholesky factor `L` of `r ≪ M` columns holds all of
// it that double precision can use. With it one M-step costs `O(M r²)` instead of `O(M³)`, and
// needs no difference of large terms.

/// `G ≈ L Lᵀ`, and what evaluates the motion at other points.
#[derive(Clone, Debug, Default)]
struct KernelFactor {
    /// `L`, column after column of `M` entries.
    columns: Vec<f64>,
    /// `L`, row after row of `r` entries.
    rows: Vec<f64>,
    /// The model points the columns stem from.
    pivots: Vec<usize>,
    /// What is left of the diagonal of `G − L Lᵀ`.
    residual: Vec<f64>,
    len: usize,
}

impl KernelFactor {
    /// Rank of the factor.
    #[inline(always)]
    fn rank(&self) -> usize {
        self.pivots.len()
    }

    /// Column `k` of `L`.
    #[inline(always)]
    fn column(&self, k: usize) -> &[f64] {
        &self.columns[k * self.len..][..self.len]
    }

    /// Row `m` of `L`.
    #[inline(always)]
    fn row(&self, m: usize) -> &[f64] {
        &self.rows[m * self.rank()..][..self.rank()]
    }

    /// Factorises the kernel of `model`: columns are added, largest remainder first, until none
    /// exceeds `tolerance` or there are `rank` of them. `O(M r²)`.
    fn build<const D: usize>(
        &mut self,
        model: &Columns<D>,
        beta: f64,
        rank: usize,
        tolerance: f64,
    ) {
        self.len = model[0].len();
        self.columns.clear();
        self.pivots.clear();
        self.residual.clear();
        self.residual.resize(self.len, 1.0);
        while self.rank() < rank.min(self.len) {
            let (pivot, &largest) = match self
                .residual
                .iter()
                .enumerate()
                .max_by(|a, b| a.1.total_cmp(b.1).then(b.0.cmp(&a.0)))
            {
                Some(found) if *found.1 > tolerance => found,
                _ => break,
            };
            self.append(model, beta, pivot, largest.sqrt());
        }
        self.rows.clear();
        let (columns, len, rank) = (&self.columns, self.len, self.pivots.len());
        self.rows
            .extend((0..len).flat_map(|m| (0..rank).map(move |k| columns[k * len + m])));
    }

    fn append<const D: usize>(&mut self, model: &Columns<D>, beta: f64, pivot: usize, root: f64) {
        let done = self.columns.len();
        self.columns.resize(done + self.len, 0.0);
        let (before, column) = self.columns.split_at_mut(done);
        vectorised(NextColumn {
            before,
            column,
            model,
            beta,
            pivot,
            root,
        });
        for (rest, c) in self.residual.iter_mut().zip(column.iter()) {
            *rest -= c * c;
        }
        for &earlier in &self.pivots {
            column[earlier] = 0.0; // exactly, so that the pivots' rows are triangular
        }
        column[pivot] = root;
        self.residual[pivot] = 0.0;
        self.pivots.push(pivot);
    }

    /// Weights `w` at the pivots with `Σ_k G(x, y_k) w_k = (L z)(x)`: solves `Cᵀ w = z`, `C` the
    /// pivots' rows of `L`.
    fn pivot_weights<const D: usize>(&self, coefficients: &[[f64; D]]) -> Vec<[f64; D]> {
        let mut weights = coefficients.to_vec();
        for k in (0..self.rank()).rev() {
            let column = self.column(k);
            let mut w = weights[k];
            for (later, weight) in weights.iter().enumerate().skip(k + 1) {
                let factor = column[self.pivots[later]];
                (0..D).for_each(|d| w[d] -= factor * weight[d]);
            }
            weights[k] = w.map(|w| w / column[self.pivots[k]]);
        }
        weights
    }
}

/// A new column of the factor: that of the kernel, less what the columns before it hold.
struct NextColumn<'a, const D: usize> {
    before: &'a [f64],
    column: &'a mut [f64],
    model: &'a Columns<D>,
    beta: f64,
    pivot: usize,
    root: f64,
}

impl<const D: usize> Loop for NextColumn<'_, D> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let len = self.column.len();
        let scale = -0.5 / (self.beta * self.beta);
        let model: [&[f64]; D] = std::array::from_fn(|d| &self.model[d][..len]);
        for m in 0..len {
            let mut squared = 0.0;
            for axis in model {
                let step = axis[self.pivot] - axis[m];
                squared += step * step;
            }
            self.column[m] = exp_of_negative(squared * scale);
        }
        for earlier in self.before.chunks_exact(len) {
            let factor = earlier[self.pivot];
            self.column
                .iter_mut()
                .zip(earlier)
                .for_each(|(c, e)| *c -= factor * e);
        }
        self.column.iter_mut().for_each(|c| *c /= self.root);
    }
}

// The M-step of non-rigid motion: `y ↦ y + (G W)(y)` with a smooth Gaussian kernel.
//
// Myronenko & Song (2010), eq. 22–23: `(diag(P1) G + λσ² I) W = P X − diag(P1) Y`. With `G = L Lᵀ`
// the motion is `G W = L z`, `(Lᵀ diag(P1) L + λσ² I) z = Lᵀ (P X − diag(P1) Y)`: symmetric,
// positive definite, `r × r`.

/// The coefficients `z`, a row per column of `L`, and the memory of the step.
#[derive(Clone, Debug, Default)]
struct NonRigidStep {
    /// `z`, column by column of `r` entries.
    coefficients: Vec<f64>,
    normal: Vec<f64>,
}

impl NonRigidStep {
    /// Row `k` of `z`.
    fn coefficient<const D: usize>(&self, k: usize) -> [f64; D] {
        let rank = self.coefficients.len() / D;
        std::array::from_fn(|d| self.coefficients[d * rank + k])
    }

    /// Solves for `z` and moves `model` into `moved`. `O(M r²)`.
    fn solve<const D: usize>(
        &mut self,
        kernel: &KernelFactor,
        posterior: &Posterior<D>,
        model: &Columns<D>,
        ridge: f64,
        moved: &mut Columns<D>,
    ) {
        let rank = kernel.rank();
        self.normal.clear();
        self.normal.resize(rank * rank, 0.0);
        self.coefficients.clear();
        self.coefficients.resize(rank * D, 0.0);
        vectorised(Assemble {
            step: self,
            kernel,
            posterior,
            model,
            ridge,
        });
        let storage = VecStorage::new(Dyn(rank), Dyn(rank), std::mem::take(&mut self.normal));
        // Positive definite by construction; were it not, z = 0 leaves the model where it was.
        if let Some(factor) = Cholesky::new(DMatrix::from_data(storage)) {
            let storage =
                VecStorage::new(Dyn(rank), Dyn(D), std::mem::take(&mut self.coefficients));
            let mut coefficients = DMatrix::from_data(storage);
            factor.solve_mut(&mut coefficients);
            self.coefficients = coefficients.data.into();
            self.normal = factor.unpack_dirty().data.into();
        } else {
            self.coefficients.fill(0.0);
        }
        vectorised(Apply {
            coefficients: &self.coefficients,
            kernel,
            model,
            moved,
        });
    }
}

/// `Lᵀ diag(P1) L + ridge I` (lower half) and `Lᵀ (P X − diag(P1) Y)`.
struct Assemble<'a, const D: usize> {
    step: &'a mut NonRigidStep,
    kernel: &'a KernelFactor,
    posterior: &'a Posterior<D>,
    model: &'a Columns<D>,
    ridge: f64,
}

impl<const D: usize> Loop for Assemble<'_, D> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let rank = self.kernel.rank();
        let NonRigidStep {
            coefficients,
            normal,
            ..
        } = self.step;
        let mass = &self.posterior.model_mass;
        for (m, &p) in mass.iter().enumerate() {
            let row = self.kernel.row(m);
            for d in 0..D {
                let residual = self.posterior.weighted.0[d][m] - p * self.model[d][m];
                add_scaled(&mut coefficients[d * rank..][..rank], row, residual);
            }
        }
        let (blocks, rest) = mass.as_chunks::<4>();
        for (block, p) in blocks.iter().enumerate() {
            let rows: [&[f64]; 4] = std::array::from_fn(|v| self.kernel.row(4 * block + v));
            for k in 0..rank {
                add_four(
                    &mut normal[k * rank..][k..rank],
                    rows.map(|row| &row[k..]),
                    p,
                );
            }
        }
        for (at, p) in rest.iter().enumerate() {
            let row = self.kernel.row(4 * blocks.len() + at);
            for k in 0..rank {
                add_scaled(&mut normal[k * rank..][k..rank], &row[k..], p * row[k]);
            }
        }
        for k in 0..rank {
            normal[k * rank + k] += self.ridge;
        }
    }
}

/// `sum += factor · row`.
#[inline(always)]
fn add_scaled(sum: &mut [f64], row: &[f64], factor: f64) {
    sum.iter_mut().zip(row).for_each(|(s, r)| *s += factor * r);
}

/// `sum += Σ_v p_v row_v[0] · row_v`: four model points at a time, to load and store the sum less
/// often.
#[inline(always)]
fn add_four(sum: &mut [f64], rows: [&[f64]; 4], p: &[f64; 4]) {
    let [a, b, c, d] = rows.map(|row| &row[..sum.len()]);
    let [pa, pb, pc, pd] = [p[0] * a[0], p[1] * b[0], p[2] * c[0], p[3] * d[0]];
    for k in 0..sum.len() {
        sum[k] += (pa * a[k] + pb * b[k]) + (pc * c[k] + pd * d[k]);
    }
}

/// `moved = Y + L z`.
struct Apply<'a, const D: usize> {
    coefficients: &'a [f64],
    kernel: &'a KernelFactor,
    model: &'a Columns<D>,
    moved: &'a mut Columns<D>,
}

impl<const D: usize> Loop for Apply<'_, D> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        let rank = self.kernel.rank();
        for d in 0..D {
            self.moved[d].copy_from_slice(&self.model[d]);
            for (k, z) in self.coefficients[d * rank..][..rank].iter().enumerate() {
                self.moved[d]
                    .iter_mut()
                    .zip(self.kernel.column(k))
                    .for_each(|(t, l)| *t += l * z);
            }
        }
    }
}

// The map a registration found, for any point of space.

/// The map found by [`CoherentPointDrift`](super::CoherentPointDrift): in the frame of the
/// registration `y ↦ y + Σ_k w_k exp(−|y − p_k|² / 2β²)`. It takes the model points to
/// where the registration left them, and any other point along.
#[derive(Clone, Debug, PartialEq)]
struct DriftWarp<const D: usize> {
    model: Frame<D>,
    target: Frame<D>,
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
        let y = self.model.inside(point);
        let mut image = y;
        for (centre, weight) in self.centres.iter().zip(&self.weights) {
            image += weight * self.gaussian(&(y - centre));
        }
        self.target.leave(image)
    }

    fn jacobian(&self, point: &Point<f64, D>) -> SMatrix<f64, D, D> {
        let y = self.model.inside(point);
        let mut jacobian = SMatrix::identity();
        for (centre, weight) in self.centres.iter().zip(&self.weights) {
            let step = y - centre;
            jacobian -=
                weight * step.transpose() * (self.gaussian(&step) / (self.beta * self.beta));
        }
        jacobian * (self.target.scale / self.model.scale)
    }
}

// From the mixture at its end to a [`Matching`]: posterior, pairs, confidences, covariances.

/// The posterior `P` at the end, a row of `M` entries per target point.
fn posterior<const D: usize>(workspace: &DriftWorkspace<D>) -> Vec<f64> {
    let [model_len, target_len] = workspace.lengths();
    let sigma2 = workspace.sigma2.max(f64::MIN_POSITIVE);
    let uniform = workspace.uniform();
    let mut rows = vec![0.0; model_len * target_len];
    for (n, row) in rows.chunks_exact_mut(model_len).enumerate() {
        let x = at(&workspace.target.0, n).into();
        let total = gaussians(row, &workspace.moved.0, x, sigma2) + uniform;
        if total > 0.0 {
            row.iter_mut().for_each(|p| *p /= total);
        }
    }
    rows
}

/// Distinct targets for the model points with the most posterior in sum. A pair stays only if its
/// target is at least as likely the model point's as an outlier.
fn pairs(posterior: &[f64], model_len: usize, target_len: usize) -> Vec<Option<usize>> {
    let costs: Vec<f64> = posterior.iter().map(|p| -p).collect();
    let mut assignment = vec![None; model_len];
    // The costs are probabilities: finite, and of the right number.
    let columns = linear_assignment(&costs, target_len, model_len).unwrap_or_default();
    for (n, m) in columns
        .iter()
        .enumerate()
        .filter_map(|(n, m)| m.map(|m| (n, m)))
    {
        let row = &posterior[n * model_len..][..model_len];
        let outlier = 1.0 - row.iter().sum::<f64>();
        if row[m] > 0.0 && row[m] >= outlier {
            assignment[m] = Some(n);
        }
    }
    assignment
}

/// Assembles the result.
fn matching<const D: usize>(workspace: &DriftWorkspace<D>) -> Matching<D> {
    let [model_len, target_len] = workspace.lengths();
    let posterior = posterior(workspace);
    let assignment = pairs(&posterior, model_len, target_len);
    let scale = workspace.target_frame.scale;
    let (mut soft, mut confidence, mut covariance) =
        (SoftMatches::default(), Vec::new(), Vec::new());
    for (m, partner) in assignment.iter().enumerate() {
        // Soft matches below this weight are left out.
        let row: Vec<(usize, f64)> = (0..target_len)
            .map(|n| (n, posterior[n * model_len + m]))
            .filter(|p| p.1 > 1e-4)
            .collect();
        let mass = row.iter().map(|p| p.1).sum::<f64>();
        // Many targets may have one model point; a row of M has sum one.
        let share = |p: f64| p / mass.max(1.0);
        soft.push_row(row.iter().map(|&(n, p)| (n, share(p))));
        let sure = partner.map_or(1.0 - mass.min(1.0), |n| share(posterior[n * model_len + m]));
        confidence.push(sure.clamp(0.0, 1.0));
        // The spread of the soft matches about their mean, and the noise σ² of the mixture.
        let spread = spread(row.iter().map(|&(n, p)| (at(&workspace.target.0, n), p)));
        let noise = SMatrix::identity() * workspace.sigma2;
        covariance.push((spread + noise) * (scale * scale));
    }
    let (unmatched_model, unmatched_target) = unmatched_rows(&assignment, target_len);
    Matching {
        warp: Box::new(workspace.warp()),
        warped: workspace.warped(),
        confidence,
        soft,
        unmatched_model,
        unmatched_target,
        displacement_covariance: covariance,
        transformation: None,
        energy: workspace.energy.to_vec(),
        report: report(workspace, &assignment),
        assignment,
    }
}

fn report<const D: usize>(
    workspace: &DriftWorkspace<D>,
    assignment: &[Option<usize>],
) -> MatchReport {
    let squares = assignment
        .iter()
        .enumerate()
        .filter_map(|(m, n)| n.map(|n| (m, n)))
        .map(|(m, n)| (at(&workspace.moved.0, m) - at(&workspace.target.0, n)).norm_squared());
    let (count, sum) = squares.fold((0.0_f64, 0.0), |(count, sum), s| (count + 1.0, sum + s));
    let scale = workspace.target_frame.scale;
    MatchReport {
        stop: workspace.stop,
        iterations: workspace.energy.len(),
        starts: 1,
        residual: scale * (sum / count.max(1.0)).sqrt(),
        sigma: scale * workspace.sigma2.sqrt(),
        judgement: Judgement::NotJudged,
    }
}

#[cfg(test)]
mod tests;
