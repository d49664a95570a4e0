//! The equations of a spline: distinct points, the directions they span, and the matrix to solve
//! with.
//!
//! With weights W the equations K w + λW⁻¹w + P a = y, Pᵀw = 0 become, for v = W^-½ w,
//! S v + W^½P a = W^½ y and (W^½P)ᵀv = 0 with S = W^½KW^½ + λI.
//! Scaling by rows keeps weights apart that differ by many decades.
//!
//! Let W^½P = QR with orthonormal Q, and Π = I − QQᵀ. The solution satisfies v = Πv and ΠSΠ v = Π
//! W^½y.
//! On the range of Π the matrix ΠSΠ is positive definite.
//! Adding σQQᵀ makes it definite everywhere without touching the solution.
//! With σ the mean eigenvalue on the range of Π the condition number stays what it is.

mod factorization;
mod iterative;
mod path;

use core::{mem::MaybeUninit, ops::ControlFlow};

use faer::{
    Accum, Mat, MatMut, MatRef, Par, Spec,
    diag::DiagMut,
    dyn_stack::{MemStack, StackReq},
    linalg::{cholesky::llt, evd, matmul::matmul, triangular_inverse},
};
use nalgebra::Point;

pub use path::LambdaPath;

use crate::{
    FitOptions, Kernel, Progress, R2LogR, Smoothing, TpsError,
    error::{finite, same_count},
    evaluate::Frame,
    lanes::{Job, Lane, UNIT_ROUNDOFF, dispatch, dot, squared_distance},
    smoothing::least_gcv,
};

/// Affine functions in three dimensions: 1, x, y and z.
const MAX: usize = 4;

/// Coefficients of an affine function.
type Coefficients = [f64; MAX];

/// A callback that receives a fit's progress and may stop it.
type Watch<'a> = dyn FnMut(&Progress) -> ControlFlow<()> + 'a;

/// Source points with their kernel matrix factored: splines to any targets follow in O(n²).
///
/// ```
/// use nalgebra::Point2;
/// use tactile_tps::{Factorization, FitOptions, ThinPlateSpline};
/// # fn main() -> Result<(), tactile_tps::TpsError> {
/// let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.4, 0.6]].map(Point2::from);
/// let factorization = Factorization::new(&sources, &FitOptions::default())?;
/// let targets = sources.map(|p| Point2::new(p.x + 0.1 * p.y * p.y, p.y));
/// let spline: ThinPlateSpline<2> = factorization.fit(&targets)?;
/// assert!((spline.apply(&sources[4]) - targets[4]).norm() < 1e-14);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct Factorization<const D: usize, K = R2LogR> {
    kernel: K,
    centres: Centres<D>,
    system: System<D>,
    weights: Option<Vec<f64>>,
    /// Weight of every centre, empty if all weights are one.
    centre_weights: Vec<f64>,
    smoothing: Smoothing,
    rank_tolerance: f64,
    /// The preconditioner, if the solver iterates. The system is then without a factor.
    iterative: Option<Iterative<D>>,
    /// Residual at which iteration stops.
    tolerance: f64,
}

/// Buffers that refits reuse.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_tps::{Factorization, FitOptions, Spline, SplineWorkspace};
/// # fn main() -> Result<(), tactile_tps::TpsError> {
/// let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.4, 0.6]].map(Point2::from);
/// let factorization = Factorization::new(&sources, &FitOptions::default())?;
/// let (mut workspace, mut spline) = (SplineWorkspace::default(), Spline::default());
/// for step in 1..=3 {
///     // No allocation from the second round on.
///     let targets = sources.map(|p| Point2::new(p.x, p.y * f64::from(step)));
///     factorization.refit_with(&mut workspace, &targets, None, None, &mut spline)?;
///     assert!((spline.apply(&sources[4]) - targets[4]).norm() < 1e-14);
/// }
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug, Default)]
pub struct SplineWorkspace<const D: usize> {
    buffers: Buffers,
    system: System<D>,
    iterative: Iterative<D>,
    centre_weights: Vec<f64>,
}

impl<const D: usize, K: Kernel> Factorization<D, K> {
    /// No points yet: memory for [`with_points`](Self::with_points).
    pub(crate) fn without_points(kernel: K) -> Self {
        const { assert!(D >= 1 && D < MAX, "splines have one to three dimensions") };
        Self {
            kernel,
            centres: Centres::default(),
            system: System::default(),
            weights: None,
            centre_weights: Vec::new(),
            smoothing: Smoothing::None,
            rank_tolerance: 0.0,
            iterative: None,
            tolerance: 0.0,
        }
    }

    /// The distinct centres and the options, without a factor for them.
    fn with_points(
        mut self,
        sources: &[Point<f64, D>],
        options: &FitOptions<K>,
    ) -> Result<Self, TpsError> {
        if let Some(weights) = &options.weights {
            same_count("weights", sources.len(), weights.len())?;
            self.weights.get_or_insert_default().clone_from(weights);
        } else {
            self.weights = None;
        }
        self.kernel.clone_from(&options.kernel);
        // A kernel with a length of its own would become another one under a change of scale.
        self.centres.take(sources, self.kernel.degree().is_some())?;
        self.centres
            .weigh(self.weights.as_deref(), &mut self.centre_weights);
        self.smoothing = options.smoothing;
        self.rank_tolerance = options.rank_tolerance;
        self.tolerance = options.tolerance;
        Ok(self)
    }

    fn setting(&self) -> Setting<'_, K, D> {
        Setting {
            kernel: &self.kernel,
            centres: &self.centres,
            rank_tolerance: self.rank_tolerance,
        }
    }

    /// λ in the frame's units: the kernel scales as length to its degree.
    fn inner_lambda(&self, smoothing: Smoothing) -> f64 {
        match smoothing {
            Smoothing::Lambda(lambda) => lambda / self.unit(),
            _ => 0.0,
        }
    }

    /// How much larger the kernel is outside than in the frame.
    fn unit(&self) -> f64 {
        let degree = self.kernel.degree().unwrap_or(0);
        self.centres.frame.scale.powi(degree)
    }

    /// One finite target for each source.
    fn check<const M: usize>(&self, targets: &[Point<f64, M>]) -> Result<(), TpsError> {
        same_count("target points", self.centres.inputs, targets.len())?;
        finite(targets, "target points")
    }
}

/// Memory of an iterative solve.
#[derive(Clone, Debug, Default)]
struct Vectors {
    residual: Vec<f64>,
    preconditioned: Vec<f64>,
    direction: Vec<f64>,
    product: Vec<f64>,
    solution: Vec<f64>,
    target: Vec<f64>,
    /// Values at the coarse points, and memory of their solve.
    coarse: [Vec<f64>; 2],
}

/// Points from coarse to fine with their preconditioner.
#[derive(Clone, Debug, Default)]
struct Iterative<const D: usize> {
    /// Coordinates of the active centres in order, axis by axis.
    axes: Vec<Vec<f64>>,
    /// λ/weight of each, empty without λ.
    diagonal: Vec<f64>,
    preconditioner: iterative::Preconditioner<D>,
}

/// One run: its system and its stopping rule.
struct Run<'a, K, const D: usize> {
    kernel: &'a K,
    system: &'a System<D>,
    iterative: &'a Iterative<D>,
    /// Largest residual at a point, relative to the largest target, to stop at.
    tolerance: f64,
}

/// Distinct points in their frame, and which input point went where.
#[derive(Clone, Debug)]
struct Centres<const D: usize> {
    frame: Frame<D>,
    /// Coordinates in the frame, axis by axis.
    axes: [Vec<f64>; D],
    /// First input point of every centre, ascending.
    first: Vec<usize>,
    /// Centre of every input point. Empty if they are the same.
    centre_of: Vec<usize>,
    /// Rounding of the coordinates, relative to the frame.
    grain: f64,
    inputs: usize,
    /// The input points in the order of their coordinates.
    order: Vec<usize>,
}

impl<const D: usize> Default for Centres<D> {
    fn default() -> Self {
        Self {
            frame: Frame::default(),
            axes: [const { Vec::new() }; D],
            first: Vec::new(),
            centre_of: Vec::new(),
            grain: 0.0,
            inputs: 0,
            order: Vec::new(),
        }
    }
}

impl<const D: usize> Centres<D> {
    /// Takes over points, reusing memory where it suffices.
    fn take(&mut self, points: &[Point<f64, D>], rescale: bool) -> Result<(), TpsError> {
        if points.is_empty() {
            return Err(TpsError::Empty("source points"));
        }
        finite(points, "source points")?;
        // The frame first: grain and coordinates are relative to it.
        self.frame = Frame::around(points, rescale);
        self.merge(points);
        for (k, axis) in self.axes.iter_mut().enumerate() {
            axis.clear();
            axis.extend(self.first.iter().map(|&i| self.frame.inside(&points[i])[k]));
        }
        let numbers = points.iter().flat_map(|p| p.iter());
        let largest = numbers.fold(0.0, |m, x| f64::max(m, x.abs()));
        self.grain = largest / self.frame.scale * UNIT_ROUNDOFF;
        self.inputs = points.len();
        Ok(())
    }

    /// Finds the first point of every group of equal ones, and the group of each point.
    fn merge(&mut self, points: &[Point<f64, D>]) {
        let Self {
            first,
            centre_of,
            order,
            ..
        } = self;
        for list in [&mut *first, &mut *order] {
            list.clear();
            list.extend(0..points.len());
        }
        centre_of.clear();
        let compare = |&i: &usize, &j: &usize| {
            let differ = (0..D).map(|k| points[i][k].partial_cmp(&points[j][k]));
            differ.flatten().find(|o| o.is_ne()).unwrap_or(i.cmp(&j))
        };
        // Sorted by coordinates, equal points stand next to each other, the first one first.
        order.sort_unstable_by(compare);
        if order.windows(2).all(|w| points[w[0]] != points[w[1]]) {
            return;
        }
        // The first point of every point's group, then the group's number.
        centre_of.extend(0..points.len());
        for pair in order.windows(2) {
            if points[pair[0]] == points[pair[1]] {
                centre_of[pair[1]] = centre_of[pair[0]];
            }
        }
        first.retain(|&i| centre_of[i] == i);
        for leader in centre_of {
            *leader = first.partition_point(|&i| i < *leader);
        }
    }

    /// Replaces `local` by these centres alone, in the same frame.
    fn select(&self, centres: impl Iterator<Item = usize> + Clone, local: &mut Self) {
        for (axis, all) in local.axes.iter_mut().zip(&self.axes) {
            axis.clear();
            axis.extend(centres.clone().map(|i| all[i]));
        }
        local.first.clear();
        local.first.extend(centres.map(|i| self.first[i]));
    }

    /// Number of distinct points.
    fn len(&self) -> usize {
        self.first.len()
    }

    /// Centre of input point `i`.
    fn centre(&self, i: usize) -> usize {
        self.centre_of.get(i).copied().unwrap_or(i)
    }

    /// Coinciding points must have equal targets where the spline interpolates.
    fn agree<const M: usize>(
        &self,
        targets: &[Point<f64, M>],
        weights: Option<&[f64]>,
    ) -> Result<(), TpsError> {
        let counts = |i: usize| weights.is_none_or(|w| w[i] > 0.0);
        for second in (0..self.centre_of.len()).filter(|&i| counts(i)) {
            let centre = self.centre_of[second];
            let same = |&i: &usize| self.centre_of[i] == centre && counts(i);
            // Points of weight 0 are passed over. They may disagree with the others.
            let first = (self.first[centre]..second).find(same).unwrap_or(second);
            if targets[first] != targets[second] {
                return Err(TpsError::Conflict { first, second });
            }
        }
        Ok(())
    }

    /// Targets at the centres less `origin`, output by output: the weighted mean where points
    /// coincide.
    fn gather<const M: usize>(
        &self,
        targets: &[Point<f64, M>],
        weights: Option<&[f64]>,
        origin: &[f64; M],
        buffers: &mut Buffers,
    ) {
        let n = self.len();
        buffers.targets.clear();
        buffers.targets.resize(n * M, 0.0);
        for (k, column) in buffers.targets.chunks_exact_mut(n).enumerate() {
            let totals = &mut buffers.work;
            totals.clear();
            totals.resize(n, 0.0);
            for (i, target) in targets.iter().enumerate() {
                let (centre, weight) = (self.centre(i), weights.map_or(1.0, |w| w[i]));
                let value = target[k] - origin[k];
                totals[centre] += weight;
                // Only points of weight 0 came before, whose targets do not count.
                if totals[centre] == weight {
                    column[centre] = value;
                } else if weight > 0.0 {
                    column[centre] += (value - column[centre]) * (weight / totals[centre]);
                }
            }
        }
    }

    /// Weight of every centre, none if all are one.
    fn weigh(&self, weights: Option<&[f64]>, sums: &mut Vec<f64>) {
        sums.clear();
        if weights.is_none() && self.centre_of.is_empty() {
            return;
        }
        sums.resize(self.len(), 0.0);
        for i in 0..self.inputs {
            sums[self.centre(i)] += weights.map_or(1.0, |w| w[i]);
        }
    }
}

/// The directions in which points extend, from the singular values of their centred coordinates.
#[derive(Clone, Debug)]
struct Span<const D: usize> {
    /// Number of spanned directions.
    directions: usize,
    /// Orthonormal directions, spanned ones first. The coordinate axes if all are spanned.
    basis: [[f64; D]; D],
    /// Root mean square extent along each direction relative to the largest, falling.
    extents: [f64; D],
}

impl<const D: usize> Default for Span<D> {
    fn default() -> Self {
        Self {
            directions: 0,
            basis: [[0.0; D]; D],
            extents: [0.0; D],
        }
    }
}

impl<const D: usize> Span<D> {
    /// The span of n points, whose coordinates stand in `columns`, axis by axis, and are
    /// overwritten.
    ///
    /// One-sided rotations (Hestenes 1958) keep small singular values to their own relative
    /// precision.
    /// A direction counts if its extent exceeds the rounding `grain` and the share `tolerance` of
    /// the largest.
    fn new(columns: &mut [f64], grain: f64, tolerance: f64) -> Self {
        let n = columns.len() / D;
        // Centred, so that an offset of all points is no extent.
        for column in columns.chunks_exact_mut(n) {
            let mean = column.iter().sum::<f64>() / n as f64;
            column.iter_mut().for_each(|x| *x -= mean);
        }
        let axes = core::array::from_fn(|j| core::array::from_fn(|i| f64::from(i == j)));
        let mut vectors: [[f64; D]; D] = axes;
        // Three columns need a handful of sweeps: convergence is quadratic.
        for _ in 0..20 {
            let mut turned = false;
            for q in 1..D {
                for p in 0..q {
                    turned |= orthogonalise(columns, n, p, q, &mut vectors);
                }
            }
            if !turned {
                break;
            }
        }
        let size = |k: usize| {
            let column = &columns[k * n..(k + 1) * n];
            dot(column, column).sqrt()
        };
        let mut order: [usize; D] = core::array::from_fn(|k| k);
        order.sort_unstable_by(|&i, &j| size(j).total_cmp(&size(i)));
        let sizes = order.map(size);
        // Rounding of n coordinates adds up to √n of that of one.
        let rounding = 8.0 * (grain + f64::EPSILON) * (n as f64).sqrt();
        let noise = f64::max(rounding, tolerance * sizes[0]);
        let directions = sizes.iter().filter(|size| **size > noise).count();
        Self {
            directions,
            // The coordinate axes where all directions are spanned: the coefficients then are the
            // gradient.
            basis: if directions < D {
                order.map(|k| vectors[k])
            } else {
                axes
            },
            extents: sizes.map(|size| if sizes[0] > 0.0 { size / sizes[0] } else { 0.0 }),
        }
    }

    /// Affine function `c` of [1, x·b₁, …] at a point.
    fn value(&self, c: usize, point: &[f64; D]) -> f64 {
        if c == 0 {
            return 1.0;
        }
        (0..D).map(|k| self.basis[c - 1][k] * point[k]).sum()
    }

    /// Derivative of affine function `c` along an axis.
    fn slope(&self, c: usize, axis: usize) -> f64 {
        if c == 0 { 0.0 } else { self.basis[c - 1][axis] }
    }

    /// The affine function with coefficients `a` at a point.
    fn polynomial(&self, a: &Coefficients, point: &[f64; D]) -> f64 {
        (0..=self.directions)
            .map(|c| a[c] * self.value(c, point))
            .sum()
    }

    /// The gradient in coordinates of an affine function.
    fn gradient(&self, a: &Coefficients) -> [f64; D] {
        core::array::from_fn(|k| (1..=self.directions).map(|c| a[c] * self.slope(c, k)).sum())
    }
}

/// Rotates columns `p` and `q` of length `n` until they are orthogonal, and `vectors` with them.
/// `false` if they are.
fn orthogonalise<const D: usize>(
    columns: &mut [f64],
    n: usize,
    p: usize,
    q: usize,
    vectors: &mut [[f64; D]; D],
) -> bool {
    let (left, right) = columns.split_at_mut(q * n);
    let (left, right) = (&mut left[p * n..(p + 1) * n], &mut right[..n]);
    let (a, b, c) = (dot(left, left), dot(right, right), dot(left, right));
    // Rounding of the sums: below it the columns are orthogonal.
    if c.abs() <= f64::EPSILON * (n as f64).sqrt() * (a * b).sqrt() {
        return false;
    }
    let zeta = (b - a) / (2.0 * c);
    // The smaller of the two angles, by the form that does not cancel.
    let tangent = zeta.signum() / (zeta.abs() + (1.0 + zeta * zeta).sqrt());
    let cosine = 1.0 / (1.0 + tangent * tangent).sqrt();
    let sine = cosine * tangent;
    let turn = |x: &mut f64, y: &mut f64| {
        (*x, *y) = (cosine * *x - sine * *y, sine * *x + cosine * *y);
    };
    left.iter_mut().zip(right).for_each(|(x, y)| turn(x, y));
    let (head, tail) = vectors.split_at_mut(q);
    head[p]
        .iter_mut()
        .zip(&mut tail[0])
        .for_each(|(x, y)| turn(x, y));
    true
}

/// The affine functions at n points: P = QR with orthonormal Q.
#[derive(Clone, Debug, Default)]
struct AffineBasis {
    n: usize,
    /// Number of affine functions.
    q: usize,
    /// Q, column by column, and columns of zeros: four in all, so that loops over them have a fixed
    /// length.
    columns: Vec<f64>,
    r: [[f64; MAX]; MAX],
}

impl AffineBasis {
    /// Factors the q columns of length n that `fill` writes, by Gram and Schmidt's rule.
    ///
    /// Twice is enough for orthogonality to rounding. Rows keep their own relative precision, which
    /// wild weights need.
    fn factor(&mut self, n: usize, q: usize, fill: impl Fn(usize, &mut [f64])) {
        (self.n, self.q) = (n, q);
        self.columns.clear();
        self.columns.resize(n * MAX, 0.0);
        self.r = [[0.0; MAX]; MAX];
        for k in 0..q {
            let (done, rest) = self.columns.split_at_mut(k * n);
            let column = &mut rest[..n];
            fill(k, column);
            for _ in 0..2 {
                for (i, earlier) in done.chunks_exact(n).enumerate() {
                    // Modified Gram–Schmidt: each share is taken from what is left, not from the
                    // original column.
                    let share = dot(earlier, column);
                    self.r[i][k] += share;
                    subtract(share, earlier, column);
                }
            }
            let norm = dot(column, column).sqrt();
            self.r[k][k] = norm;
            column.iter_mut().for_each(|x| *x /= norm);
        }
    }

    fn column(&self, k: usize) -> &[f64] {
        &self.columns[k * self.n..(k + 1) * self.n]
    }

    /// b ← Πb. Returns Qᵀb.
    fn remove(&self, b: &mut [f64]) -> Coefficients {
        let mut heads = [0.0; MAX];
        for k in 0..self.q {
            heads[k] = dot(self.column(k), b);
        }
        for k in 0..self.q {
            subtract(heads[k], self.column(k), b);
        }
        heads
    }

    /// Solves R a = c.
    fn coefficients(&self, c: &Coefficients) -> Coefficients {
        let mut a = [0.0; MAX];
        for i in (0..self.q).rev() {
            let rest: f64 = (i + 1..self.q).map(|j| self.r[i][j] * a[j]).sum();
            a[i] = (c[i] - rest) / self.r[i][i];
        }
        a
    }

    /// Solves Rᵀ h = p: the part Qh of a solution with Pᵀv = p.
    fn conditions(&self, p: &Coefficients) -> Coefficients {
        let mut h = [0.0; MAX];
        for i in 0..self.q {
            let rest: f64 = (0..i).map(|j| self.r[j][i] * h[j]).sum();
            h[i] = (p[i] - rest) / self.r[i][i];
        }
        h
    }
}

/// b ← b − factor · a.
fn subtract(factor: f64, a: &[f64], b: &mut [f64]) {
    b.iter_mut().zip(a).for_each(|(b, a)| *b -= factor * a);
}

/// The inputs of a system.
struct Setting<'a, K, const D: usize> {
    kernel: &'a K,
    centres: &'a Centres<D>,
    /// Share of the largest extent below which a direction counts as not spanned.
    rank_tolerance: f64,
}

/// ΠSΠ + σQQᵀ over the centres of positive weight, factored or decomposed.
#[derive(Clone, Debug, Default)]
struct System<const D: usize> {
    /// Centres of positive weight.
    active: Vec<usize>,
    /// √weight of each. Empty if all are one.
    scales: Vec<f64>,
    span: Span<D>,
    affine: AffineBasis,
    /// SQ without λ, column by column, and columns of zeros.
    coupling: Vec<f64>,
    /// σ.
    shift: f64,
    /// Lower triangle of the matrix, or its Cholesky factor.
    matrix: Triangle,
    spectrum: Option<Spectrum>,
    condition: f64,
    scratch: Vec<f64>,
}

impl<const D: usize> System<D> {
    /// Factors for centre weights (empty: all one) and λ ≥ 0: n³/3 multiplications and additions.
    fn factor<K: Kernel>(
        &mut self,
        setting: &Setting<'_, K, D>,
        weights: &[f64],
        lambda: f64,
    ) -> Result<(), TpsError> {
        self.spectrum = None;
        let size = self.assemble(setting, weights, lambda > 0.0);
        self.matrix.add_to_diagonal(lambda);
        if self.matrix.factor().is_err() {
            // Points nearly coincide, and rounding has left the matrix indefinite. A λ of the size
            // of that rounding moves values by no more than it. A kernel that is not definite fails
            // again.
            self.assemble(setting, weights, lambda > 0.0);
            let rounding = f64::EPSILON * self.active.len() as f64 * (size + lambda);
            self.matrix.add_to_diagonal(lambda + rounding);
            self.matrix.factor()?;
            self.condition = f64::INFINITY;
            return Ok(());
        }
        self.condition = 1.0;
        // With affine functions alone nothing but σ is left of the matrix.
        if self.active.len() > self.affine.q {
            let inverse = self.matrix.inverse_norm(&mut self.scratch);
            self.condition = f64::max(1.0, (size + lambda) * inverse);
        }
        Ok(())
    }

    /// Decomposes for centre weights and any λ > 0: some 10 n³ operations.
    fn decompose<K: Kernel>(&mut self, setting: &Setting<'_, K, D>, weights: &[f64]) {
        self.assemble(setting, weights, true);
        self.spectrum
            .get_or_insert_default()
            .decompose(&mut self.matrix);
    }

    /// Condition number of the matrix, with `lambda` added to a decomposed one.
    fn condition(&self, lambda: f64) -> f64 {
        self.spectrum
            .as_ref()
            .map_or(self.condition, |spectrum| spectrum.condition(lambda))
    }

    /// Writes the lower triangle of the matrix without λ. Returns the Frobenius norm of ΠSΠ.
    fn assemble<K: Kernel>(
        &mut self,
        setting: &Setting<'_, K, D>,
        weights: &[f64],
        scaled: bool,
    ) -> f64 {
        self.choose(setting.centres.len(), weights, scaled);
        self.outline(setting);
        let n = self.active.len();
        self.matrix.resize(n);
        self.coupling.clear();
        self.coupling.resize(n * MAX, 0.0);
        self.places(setting.centres);
        self.scratch.resize((D + 1) * n, 1.0);
        self.scratch[D * n..][..self.scales.len()].copy_from_slice(&self.scales);
        dispatch(Assemble::<_, D> {
            kernel: setting.kernel,
            places: &self.scratch,
            basis: &self.affine.columns,
            matrix: &mut self.matrix,
            product: &mut self.coupling,
        });
        self.project()
    }

    /// From S to ΠSΠ + σQQᵀ = S − QXᵀ − XQᵀ with X = SQ − ½Q(QᵀSQ + σI).
    fn project(&mut self) -> f64 {
        let (n, q) = (self.active.len(), self.affine.q);
        let head =
            |i: usize, k: usize| dot(self.affine.column(i), &self.coupling[k * n..(k + 1) * n]);
        let trace = self.matrix.trace() - (0..q).map(|k| head(k, k)).sum::<f64>();
        // No point is left where all of them are affine functions' own.
        // The trace on the range of Π is the whole trace less that on the affine functions.
        let mean = trace / (n - q).max(1) as f64;
        let shift = if mean > 0.0 && n > q { mean } else { 1.0 };
        let x = &mut self.scratch;
        x.clear();
        x.extend_from_slice(&self.coupling);
        for k in 0..q {
            for i in 0..q {
                let own = if i == k { shift } else { 0.0 };
                let half = 0.5 * (head(i, k) + own);
                subtract(half, self.affine.column(i), &mut x[k * n..(k + 1) * n]);
            }
        }
        self.shift = shift;
        let squares = dispatch(Update {
            basis: &self.affine.columns,
            x,
            matrix: &mut self.matrix,
        });
        // The update has added σ in q directions, which are no part of ΠSΠ.
        f64::max(squares - q as f64 * shift * shift, 0.0).sqrt()
    }

    /// Centres of positive weight, and their scales.
    fn choose(&mut self, n: usize, weights: &[f64], scaled: bool) {
        self.active.clear();
        self.scales.clear();
        let counts = |i: &usize| weights.get(*i).is_none_or(|&w| w > 0.0);
        self.active.extend((0..n).filter(counts));
        if scaled && !weights.is_empty() {
            let roots = self.active.iter().map(|&i| weights[i].sqrt());
            self.scales.extend(roots);
        }
    }

    /// The coordinates of the active centres, axis by axis, into `scratch`.
    fn places(&mut self, centres: &Centres<D>) {
        self.scratch.clear();
        for axis in &centres.axes {
            self.scratch.extend(self.active.iter().map(|&i| axis[i]));
        }
    }

    /// Finds what the active centres span and the affine functions at them.
    fn outline<K>(&mut self, setting: &Setting<'_, K, D>) {
        let centres = setting.centres;
        self.places(centres);
        self.span = Span::new(&mut self.scratch, centres.grain, setting.rank_tolerance);
        let n = self.active.len();
        let (span, active, scales) = (&self.span, &self.active, &self.scales);
        self.affine
            .factor(n, n.min(1 + span.directions), |c, column| {
                for (i, (value, &centre)) in column.iter_mut().zip(active).enumerate() {
                    let point = core::array::from_fn(|k| centres.axes[k][centre]);
                    *value = span.value(c, &point) * scales.get(i).copied().unwrap_or(1.0);
                }
            });
    }

    /// The λ of least generalised cross-validation for values at all centres. The system must be
    /// decomposed.
    fn cross_validate<const M: usize>(
        &self,
        y: &[f64],
        work: &mut Vec<f64>,
        spare: &mut Vec<f64>,
    ) -> f64 {
        let Some(spectrum) = &self.spectrum else {
            return 0.0;
        };
        self.reduce::<M>(y, work);
        let n = self.active.len();
        spare.clear();
        spare.resize(M * n, 0.0);
        spectrum.coefficients(work, spare);
        for k in 0..n {
            spare[k] = (0..M).map(|m| spare[m * n + k].powi(2)).sum();
        }
        least_gcv(&spectrum.values, &spare[..n], self.affine.q, self.shift)
    }

    /// Solves for `M` outputs: `y` holds the values at all centres and receives the weights w.
    /// Returns the affine parts.
    ///
    /// `lambda` is added to a decomposed system. A factored one has its own.
    fn solve<const M: usize>(
        &self,
        y: &mut [f64],
        lambda: f64,
        work: &mut Vec<f64>,
        spare: &mut Vec<f64>,
    ) -> [Coefficients; M] {
        self.solve_by(y, work, |columns| match &self.spectrum {
            Some(spectrum) => spectrum.solve(columns, lambda, spare),
            None => self.matrix.solve(columns),
        })
    }

    /// As [`solve`](Self::solve), with a solver for the columns of Π W^½y.
    fn solve_by<const M: usize>(
        &self,
        y: &mut [f64],
        work: &mut Vec<f64>,
        solver: impl FnOnce(&mut [f64]),
    ) -> [Coefficients; M] {
        let n = self.active.len();
        let mut heads = self.reduce::<M>(y, work);
        solver(work);
        for (head, column) in heads.iter_mut().zip(work.chunks_exact_mut(n)) {
            // The exact solution lies in the range of Π. Rounding is taken off.
            self.affine.remove(column);
            for (head, coupling) in head.iter_mut().zip(self.coupling.chunks_exact(n)) {
                // Qᵀ of the first equation: R a = Qᵀ(W^½y − S v).
                *head -= dot(coupling, column);
            }
            *head = self.affine.coefficients(head);
        }
        self.scatter(work, y);
        heads
    }

    /// Solves for the weights alone: (K + λW⁻¹)w + P a = y, Pᵀw = p for each column of `y`. The
    /// system must be factored.
    ///
    /// With W^-½w = Qh + z the conditions give h, which moves to the right-hand side of the
    /// equations for z.
    fn solve_adjoint<const R: usize>(
        &self,
        y: &mut [f64],
        p: [&Coefficients; R],
        work: &mut Vec<f64>,
    ) {
        let n = self.active.len();
        self.reduce::<R>(y, work);
        let heads = p.map(|p| self.affine.conditions(p));
        for (head, column) in heads.iter().zip(work.chunks_exact_mut(n)) {
            for (head, coupling) in head.iter().zip(self.coupling.chunks_exact(n)) {
                subtract(*head, coupling, column);
            }
            self.affine.remove(column);
        }
        self.matrix.solve(work);
        for (head, column) in heads.iter().zip(work.chunks_exact_mut(n)) {
            self.affine.remove(column);
            (0..self.affine.q).for_each(|k| subtract(-head[k], self.affine.column(k), column));
        }
        self.scatter(work, y);
    }

    /// Π W^½ y in `work`. Returns QᵀW^½ y, output by output.
    fn reduce<const M: usize>(&self, y: &[f64], work: &mut Vec<f64>) -> [Coefficients; M] {
        let n = self.active.len();
        work.clear();
        let mut heads = [[0.0; MAX]; M];
        for (m, values) in y.chunks_exact(y.len() / M).enumerate() {
            work.extend(self.active.iter().map(|&centre| values[centre]));
            let column = &mut work[m * n..];
            column
                .iter_mut()
                .zip(&self.scales)
                .for_each(|(value, scale)| *value *= scale);
            heads[m] = self.affine.remove(column);
        }
        heads
    }

    /// The derivative of one active centre's weight by another's value, from the inverse of the
    /// factor.
    fn entry(&self, inverse: &Mat<f64>, lambda: f64, i: usize, j: usize) -> f64 {
        let n = self.active.len();
        // The inverse of the factor is a lower triangle.
        let column = |k: usize| &inverse.col_as_slice(k)[i.max(j)..n];
        let (a, b) = (column(i), column(j));
        let affine = (0..self.affine.q).map(|c| {
            let column = self.affine.column(c);
            column[i] * column[j]
        });
        let scale = |i: usize| self.scales.get(i).copied().unwrap_or(1.0);
        // The inverse has 1/(σ + λ) on the affine functions, where the map from values to weights
        // has 0.
        scale(i) * scale(j) * (dot(a, b) - affine.sum::<f64>() / (self.shift + lambda))
    }

    /// Spreads the columns of `work`, each entry times its scale, over the centres.
    fn scatter(&self, work: &[f64], y: &mut [f64]) {
        let n = self.active.len();
        let columns = work.len() / n;
        let centres = y.len() / columns;
        y.fill(0.0);
        for (values, column) in y.chunks_exact_mut(centres).zip(work.chunks_exact(n)) {
            for (i, (&centre, v)) in self.active.iter().zip(column).enumerate() {
                values[centre] = v * self.scales.get(i).copied().unwrap_or(1.0);
            }
        }
    }
}

/// The lower triangle of a symmetric matrix, column by column, and its Cholesky factor in the same
/// place.
#[derive(Clone, Debug, Default)]
struct Triangle {
    n: usize,
    /// Places from one column to the next.
    stride: usize,
    data: Vec<f64>,
    stack: Vec<MaybeUninit<u8>>,
}

impl Triangle {
    /// Makes room for a matrix of order n.
    fn resize(&mut self, n: usize) {
        self.n = n;
        self.stride = n.next_multiple_of(8);
        // Columns a multiple of 512 bytes apart would crowd into the same few sets of the cache.
        if self.stride.is_multiple_of(64) {
            self.stride += 8;
        }
        let length = n * self.stride;
        if self.data.capacity() < length {
            // A new allocation comes zeroed from the system, page by page as it is touched.
            self.data = vec![0.0; length];
        } else {
            self.data.resize(length, 0.0);
        }
    }

    /// Takes over another matrix, without its memory.
    fn copy_from(&mut self, other: &Self) {
        (self.n, self.stride) = (other.n, other.stride);
        self.data.clone_from(&other.data);
    }

    fn trace(&self) -> f64 {
        (0..self.n).map(|j| self.data[j * self.stride + j]).sum()
    }

    fn add_to_diagonal(&mut self, lambda: f64) {
        (0..self.n).for_each(|j| self.data[j * self.stride + j] += lambda);
    }

    /// The entries of column `j` from the diagonal on.
    #[inline(always)]
    fn column(&mut self, j: usize) -> &mut [f64] {
        &mut self.data[j * self.stride + j..j * self.stride + self.n]
    }

    fn view(&self) -> MatRef<'_, f64> {
        MatRef::from_column_major_slice_with_stride(&self.data, self.n, self.n, self.stride)
    }

    /// Factors in place. Fails with the column whose pivot is not positive.
    fn factor(&mut self) -> Result<(), TpsError> {
        let Self {
            n,
            stride,
            data,
            stack,
        } = self;
        let scratch = llt::factor::cholesky_in_place_scratch::<f64>(*n, Par::Seq, Spec::default());
        let view = MatMut::from_column_major_slice_with_stride_mut(data, *n, *n, *stride);
        let factored = llt::factor::cholesky_in_place(
            view,
            Default::default(),
            Par::Seq,
            memory(stack, scratch),
            Spec::default(),
        );
        match factored {
            Err(llt::factor::LltError::NonPositivePivot { index }) => {
                Err(TpsError::NotDefinite { column: index })
            }
            Ok(_) => {
                // An infinite entry gives pivots that are not numbers.
                let bad = (0..self.n).find(|&j| !self.data[j * self.stride + j].is_finite());
                bad.map_or(Ok(()), |column| Err(TpsError::NotDefinite { column }))
            }
        }
    }

    /// b ← A⁻¹b for columns of n entries, by the factor.
    fn solve(&self, b: &mut [f64]) {
        let columns = b.len() / self.n;
        let b = MatMut::from_column_major_slice_mut(b, self.n, columns);
        llt::solve::solve_in_place(self.view(), b, Par::Seq, MemStack::new(&mut []));
    }

    /// The inverse of the Cholesky factor.
    fn inverse_factor(&self) -> Mat<f64> {
        let mut inverse = Mat::zeros(self.n, self.n);
        triangular_inverse::invert_lower_triangular(inverse.as_mut(), self.view(), Par::Seq);
        inverse
    }

    /// An estimate of the 2-norm of A⁻¹: two steps of inverse iteration from the column of the
    /// least pivot.
    fn inverse_norm(&self, x: &mut Vec<f64>) -> f64 {
        let pivot = |j: usize| self.data[j * self.stride + j];
        // The column of the least pivot tends to be close to the direction that the inverse
        // enlarges most.
        let start = (1..self.n).fold(
            0,
            |least, j| if pivot(j) < pivot(least) { j } else { least },
        );
        x.clear();
        x.resize(self.n, 0.0);
        x[start] = 1.0;
        let mut norm = 1.0;
        for _ in 0..2 {
            self.solve(x);
            norm = dot(x, x).sqrt();
            x.iter_mut().for_each(|x| *x /= norm);
        }
        norm
    }
}

/// A stack of at least the size asked for, in memory that is kept.
fn memory(kept: &mut Vec<MaybeUninit<u8>>, size: StackReq) -> &mut MemStack {
    kept.resize(size.unaligned_bytes_required(), MaybeUninit::uninit());
    MemStack::new(kept)
}

/// A = V diag(μ) Vᵀ.
#[derive(Clone, Debug)]
struct Spectrum {
    /// μ, ascending.
    values: Vec<f64>,
    vectors: Mat<f64>,
}

impl Default for Spectrum {
    fn default() -> Self {
        Self {
            values: Vec::new(),
            vectors: Mat::new(),
        }
    }
}

impl Spectrum {
    fn decompose(&mut self, matrix: &mut Triangle) {
        let n = matrix.n;
        let parameters = Spec::default();
        let scratch = evd::self_adjoint_evd_scratch::<f64>(
            n,
            evd::ComputeEigenvectors::Yes,
            Par::Seq,
            parameters,
        );
        let mut stack = core::mem::take(&mut matrix.stack);
        self.values.clear();
        self.values.resize(n, 0.0);
        self.vectors.resize_with(n, n, |_, _| 0.0);
        let done = evd::self_adjoint_evd(
            matrix.view(),
            DiagMut::from_slice_mut(&mut self.values),
            Some(self.vectors.as_mut()),
            Par::Seq,
            memory(&mut stack, scratch),
            parameters,
        );
        // Without convergence, which finite symmetric matrices do not fail, the spectrum counts as
        // singular.
        if done.is_err() {
            self.values.fill(0.0);
        }
        matrix.stack = stack;
    }

    /// c = Vᵀb, column by column.
    fn coefficients(&self, b: &[f64], c: &mut [f64]) {
        self.product(self.vectors.transpose(), b, c);
    }

    /// c = factor · b, column by column.
    fn product(&self, factor: MatRef<'_, f64>, b: &[f64], c: &mut [f64]) {
        let n = self.values.len();
        let columns = b.len() / n;
        let b = MatRef::from_column_major_slice(b, n, columns);
        let c = MatMut::from_column_major_slice_mut(c, n, columns);
        matmul(c, Accum::Replace, factor, b, 1.0, Par::Seq);
    }

    /// b ← (A + λI)⁻¹ b, column by column.
    fn solve(&self, b: &mut [f64], lambda: f64, spare: &mut Vec<f64>) {
        spare.clear();
        spare.resize(b.len(), 0.0);
        self.coefficients(b, spare);
        for column in spare.chunks_exact_mut(self.values.len()) {
            let pairs = column.iter_mut().zip(&self.values);
            // In the eigenvectors λ is a shift of the eigenvalues: any λ costs two products.
            pairs.for_each(|(c, mu)| *c /= mu + lambda);
        }
        self.product(self.vectors.as_ref(), spare, b);
    }

    /// 2-norm condition number of A + λI. Infinite where rounding leaves eigenvalues that are not
    /// positive.
    fn condition(&self, lambda: f64) -> f64 {
        let ends = self.values.first().zip(self.values.last());
        match ends {
            None => 1.0,
            Some((least, most)) if least + lambda > 0.0 => (most + lambda) / (least + lambda),
            Some(_) => f64::INFINITY,
        }
    }
}

/// Writes the lower triangle of W^½KW^½, and its product with Q while each column is at hand.
struct Assemble<'a, K, const D: usize> {
    kernel: &'a K,
    /// Coordinates axis by axis, then the scales.
    places: &'a [f64],
    basis: &'a [f64],
    matrix: &'a mut Triangle,
    product: &'a mut [f64],
}

impl<K: Kernel, const D: usize> Job for Assemble<'_, K, D> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lane>(self) {
        let n = self.matrix.n;
        for j in 0..n {
            let column = self.matrix.column(j);
            let axes: [&[f64]; D] =
                core::array::from_fn(|k| &self.places[k * n + j..(k + 1) * n][..column.len()]);
            let scales = &self.places[D * n + j..(D + 1) * n][..column.len()];
            let own: [L; D] = core::array::from_fn(|k| L::from_f64(axes[k][0]));
            let own_scale = L::from_f64(scales[0]);
            for (i, value) in column.iter_mut().enumerate() {
                let s = squared_distance(axes, i, own);
                let scale = L::from_f64(scales[i]) * own_scale;
                *value = (self.kernel.derivatives(s).value * scale).get();
            }
            add_column::<L>(column, j, self.basis, self.product);
        }
    }
}

/// What column `j` of a symmetric matrix, given from the diagonal on, adds to Y = SQ on both sides
/// of the diagonal.
#[inline(always)]
fn add_column<L: Lane>(column: &[f64], j: usize, basis: &[f64], product: &mut [f64]) {
    let n = basis.len() / MAX;
    let mut sums = [[0.0; 8]; MAX];
    let whole = column.len() / 8 * 8;
    for at in (0..whole).step_by(8) {
        let mut a = [0.0; 8];
        a.copy_from_slice(&column[at..at + 8]);
        for c in 0..MAX {
            let own = L::from_f64(basis[c * n + j]);
            let first = c * n + j + at;
            let (v, y) = (&basis[first..first + 8], &mut product[first..first + 8]);
            for l in 0..8 {
                let sum = L::from_f64(sums[c][l]);
                sums[c][l] = L::from_f64(a[l]).mul_add(L::from_f64(v[l]), sum).get();
                y[l] = own.mul_add(L::from_f64(a[l]), L::from_f64(y[l])).get();
            }
        }
    }
    for c in 0..MAX {
        let (v, y) = (&basis[c * n + j..], &mut product[c * n + j..]);
        let own = L::from_f64(v[0]);
        let mut tail = 0.0;
        for i in whole..column.len() {
            tail += column[i] * v[i];
            y[i] = own.mul_add(L::from_f64(column[i]), L::from_f64(y[i])).get();
        }
        // Both sums have counted the diagonal.
        y[0] += sums[c].iter().sum::<f64>() + tail - column[0] * v[0];
    }
}

/// A ← A − QXᵀ − XQᵀ in the lower triangle. Gives the squared Frobenius norm of the whole.
struct Update<'a> {
    basis: &'a [f64],
    x: &'a [f64],
    matrix: &'a mut Triangle,
}

impl Job for Update<'_> {
    type Output = f64;

    #[inline(always)]
    fn run<L: Lane>(self) -> f64 {
        let n = self.matrix.n;
        let mut squares = 0.0;
        for j in 0..n {
            let column = self.matrix.column(j);
            let whole = column.len() / 8 * 8;
            for at in (0..whole).step_by(8) {
                // A copy of eight stays in registers.
                let mut a = [0.0; 8];
                a.copy_from_slice(&column[at..at + 8]);
                for c in 0..MAX {
                    let (first, own) = (c * n + j + at, c * n + j);
                    let (by_q, by_x) = (L::from_f64(-self.basis[own]), L::from_f64(-self.x[own]));
                    let (q, x) = (&self.basis[first..first + 8], &self.x[first..first + 8]);
                    for l in 0..8 {
                        let sum = by_x.mul_add(L::from_f64(q[l]), L::from_f64(a[l]));
                        a[l] = by_q.mul_add(L::from_f64(x[l]), sum).get();
                    }
                }
                column[at..at + 8].copy_from_slice(&a);
            }
            for i in whole..column.len() {
                for c in 0..MAX {
                    let own = c * n + j;
                    let (by_q, by_x) = (L::from_f64(-self.basis[own]), L::from_f64(-self.x[own]));
                    let sum =
                        by_x.mul_add(L::from_f64(self.basis[own + i]), L::from_f64(column[i]));
                    column[i] = by_q.mul_add(L::from_f64(self.x[own + i]), sum).get();
                }
            }
            squares += 2.0 * dot(column, column) - column[0] * column[0];
        }
        squares
    }
}

/// Memory of a solve.
#[derive(Clone, Debug, Default)]
struct Buffers {
    /// Targets at the centres, output by output.
    targets: Vec<f64>,
    /// Weights at the centres, output by output: the answer.
    weights: Vec<f64>,
    residuals: Vec<f64>,
    work: Vec<f64>,
    spare: Vec<f64>,
    vectors: Vectors,
}

/// Largest magnitude.
fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |m, x| f64::max(m, x.abs()))
}

/// `size` relative to the largest target.
fn relative(size: f64, targets: &[f64]) -> f64 {
    let target = largest(targets);
    if target > 0.0 { size / target } else { size }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Columns of known lengths turned by a known rotation: sizes to rounding, a small one to its
    /// own precision.
    #[test]
    fn extents_come_to_their_own_precision() {
        let (c, s) = (0.8, 0.6);
        let columns = [
            3.0 * c,
            -2e-9 * s,
            0.0,
            3.0 * s,
            2e-9 * c,
            0.0,
            0.0,
            0.0,
            1.0,
        ];
        // Each point and its mirror image, so that the mean is zero.
        let mut both: Vec<f64> = columns
            .chunks_exact(3)
            .flat_map(|column| column.iter().copied().chain(column.iter().map(|x| -x)))
            .collect();
        let span = Span::<3>::new(&mut both, 0.0, 1e-8);
        for (found, expected) in span.extents.iter().zip([1.0, 1.0 / 3.0, 2e-9 / 3.0]) {
            assert!((found / expected - 1.0).abs() < 1e-13, "{found}");
        }
        assert_eq!(span.directions, 2);
        assert!((span.basis[0][0].abs() - c).abs() < 1e-15);
    }
}
