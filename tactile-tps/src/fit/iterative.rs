//! Matrix-free solution for thousands of points: preconditioned conjugate gradients.
//!
//! The dense factor takes n³/3 operations and 8n² bytes. Here a step takes one sum over all pairs,
//! with n² kernel evaluations and no memory. The preconditioner makes the number of steps nearly
//! independent of n. On the complement of the affine functions the matrix is positive definite, and
//! conjugate gradients stay there: each direction satisfies the side conditions.

use core::ops::ControlFlow;

use super::{
    affine_basis::AffineBasis,
    buffers::{Buffers, Vectors},
    centres::Centres,
    system::{Setting, System, Watch},
};
use crate::{
    FitReport, Kernel, Progress, StopReason,
    kernel_sum::{BLOCK, KernelSum},
    lanes::{Job, Lane, dispatch, dot, largest, relative, squared_distance},
    span::{Coefficients, MAX},
};

/// Number of earlier points from which a point is predicted. More make the set-up slower, fewer
/// increase the number of steps (`cargo bench -p tactile-benches --bench tps`).
const NEIGHBOURS: usize = 64;

/// Number of points of the coarsest level, which is solved exactly.
const COARSE_POINTS: usize = 512;

/// Maximum number of steps.
const STEPS: usize = 200;

/// Points from coarse to fine, with their preconditioner.
#[derive(Clone, Debug, Default)]
pub(super) struct Iterative<const D: usize> {
    /// Coordinates of the active centres in order, by axes.
    pub(super) axes: Vec<Vec<f64>>,
    /// λ/weight of each centre. Empty without λ.
    pub(super) diagonal: Vec<f64>,
    pub(super) preconditioner: Preconditioner<D>,
}

/// One run with its system and stopping rule.
pub(super) struct Run<'a, K, const D: usize> {
    pub(super) kernel: &'a K,
    pub(super) system: &'a System<D>,
    pub(super) iterative: &'a Iterative<D>,
    /// Residual at which to stop: the largest at a point, relative to the largest target.
    pub(super) tolerance: f64,
}

impl<const D: usize> Iterative<D> {
    /// Orders the points of positive weight in `system` and builds the preconditioner: O(n²) time,
    /// O(n) memory.
    pub(super) fn build<K: Kernel>(
        &mut self,
        setting: &Setting<'_, K, D>,
        weights: &[f64],
        lambda: f64,
        system: &mut System<D>,
        watch: &mut Watch<'_>,
    ) -> ControlFlow<()> {
        system.spectrum = None;
        // Not scaled by the roots of the weights: here the weights are on the diagonal as λ/weight.
        system.choose(setting.centres.len(), weights, false);
        // All points are ordered first and then given their weights.
        let n = system.active.len();
        let mut tell = |done| watch(&Progress::new(done, 2 * n));
        let spacing = self.arrange(setting.centres, system, &mut tell)?;
        system.outline(setting);
        let active = system.active.iter();
        let weights: Vec<f64> = active.filter_map(|&i| weights.get(i).copied()).collect();
        self.diagonal.clear();
        if lambda > 0.0 {
            let inverse = |i: usize| lambda / weights.get(i).copied().unwrap_or(1.0);
            self.diagonal.extend((0..n).map(inverse));
        }
        let ordered = Ordered {
            kernel: setting.kernel,
            centres: setting.centres,
            order: &system.active,
            axes: core::array::from_fn(|k| &self.axes[k][..]),
            spacing: &spacing,
            weights: if lambda > 0.0 { &weights } else { &[] },
            lambda,
        };
        (self.preconditioner).build(&ordered, &mut |weighted| tell(n + weighted))
    }

    /// Orders the active points from coarse to fine. Returns the squared distance of each point to
    /// the nearest one before it.
    fn arrange(
        &mut self,
        centres: &Centres<D>,
        system: &mut System<D>,
        watch: &mut dyn FnMut(usize) -> ControlFlow<()>,
    ) -> ControlFlow<(), Vec<f64>> {
        let gathered = |order: &[usize]| -> Vec<Vec<f64>> {
            centres
                .axes
                .iter()
                .map(|axis| order.iter().map(|&i| axis[i]).collect())
                .collect()
        };
        self.axes = gathered(&system.active);
        let (mut order, spacing) = coarse_to_fine(self.axes(), watch)?;
        order.iter_mut().for_each(|i| *i = system.active[*i]);
        self.axes = gathered(&order);
        system.active = order;
        ControlFlow::Continue(spacing)
    }

    fn axes(&self) -> [&[f64]; D] {
        core::array::from_fn(|k| &self.axes[k][..])
    }
}

impl<K: Kernel, const D: usize> Run<'_, K, D> {
    /// Solves for the targets in `buffers`, where the weights are stored. Stops early if `watch`
    /// returns `Break`.
    pub(super) fn solve<const M: usize>(
        &self,
        buffers: &mut Buffers,
        report: &mut FitReport,
        watch: &mut Watch<'_>,
    ) -> [Coefficients; M] {
        let (active, n) = (&self.system.active, self.system.active.len());
        let Buffers {
            targets,
            weights,
            vectors,
            ..
        } = buffers;
        let centres = targets.len() / M;
        let Vectors {
            target, solution, ..
        } = vectors;
        target.clear();
        (0..M).for_each(|m| {
            target.extend(active.iter().map(|&centre| targets[m * centres + centre]))
        });
        solution.clear();
        solution.resize(M * n, 0.0);
        (report.condition, report.iterations, report.refinements) = (1.0, 0, 0);
        let (mut affine, mut broken) = ([[0.0; MAX]; M], false);
        // At most three runs of steps. The fourth pass only measures the last residual.
        for start in 0..=3 {
            let residual;
            (affine, residual) = self.residual::<M>(vectors);
            report.residual = Some(residual);
            report.stop = match residual <= self.tolerance {
                true => StopReason::Converged,
                false if broken => StopReason::Cancelled,
                false if report.iterations >= STEPS => StopReason::IterationLimit,
                false => StopReason::Stagnated,
            };
            // Restarts with a recomputed residual, because rounding makes the iterated one drift.
            if report.stop != StopReason::Stagnated || start == 3 {
                break;
            }
            broken = self.steps::<M>(vectors, report, watch).is_break();
        }
        weights.clear();
        weights.resize(M * centres, 0.0);
        for (m, column) in vectors.solution.chunks_exact(n).enumerate() {
            active
                .iter()
                .zip(column)
                .for_each(|(&centre, w)| weights[m * centres + centre] = *w);
        }
        affine
    }

    /// Iterates until the iterated residual is small enough.
    fn steps<const M: usize>(
        &self,
        vectors: &mut Vectors,
        report: &mut FitReport,
        watch: &mut Watch<'_>,
    ) -> ControlFlow<()> {
        vectors.direction.clear();
        vectors.direction.resize(vectors.residual.len(), 0.0);
        let (mut size, mut best) = ([0.0; M], (f64::INFINITY, report.iterations));
        while report.iterations < STEPS {
            // The residual of the recurrence, which costs no matrix product.
            let left = relative(largest(&vectors.residual), &vectors.target);
            let done = report.iterations;
            let progress = Progress::new(done, STEPS).with_residual(left);
            watch(&progress)?;
            if left < 0.5 * best.0 {
                best = (left, done);
            }
            // If 25 steps do not halve the residual, rounding prevents further progress. Half the
            // tolerance leaves room for the drift of the recurrence.
            if left <= 0.5 * self.tolerance || done >= best.1 + 25 {
                break;
            }
            self.turn::<M>(vectors, &mut size);
            self.advance::<M>(vectors, &size, &mut || watch(&progress))?;
            report.iterations += 1;
        }
        ControlFlow::Continue(())
    }

    /// The next direction p ← M⁻¹r + βp. `size` is rᵀM⁻¹r for each output.
    fn turn<const M: usize>(&self, vectors: &mut Vectors, size: &mut [f64; M]) {
        let n = self.system.active.len();
        let Vectors {
            residual,
            preconditioned,
            direction,
            coarse,
            ..
        } = vectors;
        preconditioned.resize(M * n, 0.0);
        self.iterative
            .preconditioner
            .apply::<M>(residual, preconditioned, n, coarse);
        // Rounding leaves the complement, outside which the matrix may be indefinite.
        self.complement(preconditioned);
        let new = inner::<M>(residual, preconditioned);
        for m in 0..M {
            let (beta, part) = (ratio(new[m], size[m]), m * n..(m + 1) * n);
            let terms = direction[part.clone()]
                .iter_mut()
                .zip(&preconditioned[part]);
            terms.for_each(|(p, z)| *p = z + beta * *p);
        }
        *size = new;
    }

    /// Makes the step along the direction that minimises the energy. Makes no step if
    /// `still_wanted` returns `Break` before it is computed.
    fn advance<const M: usize>(
        &self,
        vectors: &mut Vectors,
        size: &[f64; M],
        still_wanted: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        let n = self.system.active.len();
        let Vectors {
            residual,
            direction,
            product,
            solution,
            ..
        } = vectors;
        product.clear();
        product.resize(direction.len(), 0.0);
        self.subtract::<M>(direction, product, still_wanted)?;
        let curvature = inner::<M>(direction, product);
        for m in 0..M {
            // The product has the opposite sign.
            let alpha = ratio(size[m], -curvature[m]);
            for i in m * n..(m + 1) * n {
                solution[i] += alpha * direction[i];
                residual[i] += alpha * product[i];
            }
        }
        self.complement(residual);
        ControlFlow::Continue(())
    }

    /// r ← r − (K + λW⁻¹) w. Incomplete if `still_wanted` returns `Break`.
    fn subtract<const M: usize>(
        &self,
        w: &[f64],
        r: &mut [f64],
        still_wanted: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        let (n, places) = (self.system.active.len(), self.iterative.axes());
        let weights: [&[f64]; M] = core::array::from_fn(|m| &w[m * n..(m + 1) * n]);
        // Whole blocks, so that the sums do not depend on how often `still_wanted` is called.
        // Several seconds pass between two calls: 2³⁰ kernel evaluations.
        let run = ((1 << 30) / BLOCK / n.max(1)).max(1) * BLOCK;
        for start in (0..n).step_by(run) {
            if start > 0 {
                still_wanted()?;
            }
            let sum = KernelSum {
                kernel: self.kernel,
                centres: places,
                weights,
            };
            sum.subtract(places, start..n.min(start + run), r);
        }
        if !self.iterative.diagonal.is_empty() {
            for (r, w) in r.chunks_exact_mut(n).zip(w.chunks_exact(n)) {
                r.iter_mut()
                    .zip(w)
                    .zip(&self.iterative.diagonal)
                    .for_each(|((r, w), d)| *r -= d * w);
            }
        }
        ControlFlow::Continue(())
    }

    /// Recomputes the residual: y − (K + λW⁻¹)w − P a with the a that minimises it. Returns its
    /// largest entry relative to the largest target.
    fn residual<const M: usize>(&self, vectors: &mut Vectors) -> ([Coefficients; M], f64) {
        let Vectors {
            residual,
            solution,
            target,
            ..
        } = vectors;
        self.complement(solution);
        residual.clone_from(target);
        // Without interruption, because the affine part of the result depends on it.
        let _ = self.subtract::<M>(solution, residual, &mut || ControlFlow::Continue(()));
        let basis = &self.system.affine;
        let mut affine = [[0.0; MAX]; M];
        for (affine, values) in affine.iter_mut().zip(residual.chunks_exact_mut(basis.n)) {
            *affine = basis.coefficients(&basis.remove(values));
        }
        (affine, relative(largest(residual), target))
    }

    /// Removes the affine functions from each column.
    fn complement(&self, values: &mut [f64]) {
        let basis: &AffineBasis = &self.system.affine;
        for values in values.chunks_exact_mut(basis.n) {
            basis.remove(values);
        }
    }
}

/// Inner products of the columns.
fn inner<const M: usize>(a: &[f64], b: &[f64]) -> [f64; M] {
    let n = a.len() / M;
    core::array::from_fn(|m| dot(&a[m * n..(m + 1) * n], &b[m * n..(m + 1) * n]))
}

/// a / b, or zero if b is zero or not finite: for an output that has converged or not started.
fn ratio(a: f64, b: f64) -> f64 {
    if b > 0.0 && b.is_finite() { a / b } else { 0.0 }
}

/// Orders points by farthest-point sampling, starting from the one nearest to the origin. O(n²)
/// time.
///
/// Returns the order, and the squared distance of each point to the nearest one before it (infinite
/// for the first). Stops if `watch`, which receives the number of ordered points, returns `Break`.
fn coarse_to_fine<const D: usize>(
    axes: [&[f64]; D],
    watch: &mut dyn FnMut(usize) -> ControlFlow<()>,
) -> ControlFlow<(), (Vec<usize>, Vec<f64>)> {
    let n = axes[0].len();
    let mut near = vec![f64::INFINITY; n];
    let (mut order, mut distances) = (Vec::with_capacity(n), Vec::with_capacity(n));
    let norm = |i: usize| axes.iter().map(|axis| axis[i] * axis[i]).sum::<f64>();
    let mut next = (0..n).min_by(|&i, &j| norm(i).total_cmp(&norm(j)));
    while let Some(i) = next.filter(|_| order.len() < n) {
        if order.len().is_multiple_of(64) {
            watch(order.len())?;
        }
        order.push(i);
        distances.push(near[i]);
        let farthest = dispatch(Approach {
            axes,
            from: axes.map(|axis| axis[i]),
            near: &mut near,
        });
        // A selected point is never the farthest again.
        near[i] = -1.0;
        next = near
            .iter()
            .position(|&d| d == farthest)
            .or_else(|| near.iter().position(|&d| d >= 0.0));
    }
    ControlFlow::Continue((order, distances))
}

/// Updates all distances with one more point. Returns the largest.
struct Approach<'a, const D: usize> {
    axes: [&'a [f64]; D],
    from: [f64; D],
    near: &'a mut [f64],
}

impl<const D: usize> Job for Approach<'_, D> {
    type Output = f64;

    #[inline(always)]
    fn run<L: Lane>(self) -> f64 {
        let n = self.near.len();
        let (axes, place) = (self.axes.map(|axis| &axis[..n]), self.from.map(L::from_f64));
        for i in 0..n {
            let s = squared_distance(axes, i, place).get();
            self.near[i] = if s < self.near[i] { s } else { self.near[i] };
        }
        // Eight running maxima, which the compiler combines into one vector.
        let mut largest = [-1.0; 8];
        let chunks = self.near.chunks_exact(8);
        let rest = chunks.remainder();
        for chunk in chunks {
            (0..8).for_each(|l| {
                largest[l] = if chunk[l] > largest[l] {
                    chunk[l]
                } else {
                    largest[l]
                }
            });
        }
        rest.iter()
            .chain(&largest)
            .fold(-1.0, |m, &d| f64::max(m, d))
    }
}

/// Squared distances of the first points from a position.
struct Distances<'a, const D: usize> {
    axes: [&'a [f64]; D],
    from: [f64; D],
    distances: &'a mut [f64],
}

impl<const D: usize> Job for Distances<'_, D> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lane>(self) {
        let n = self.distances.len();
        let (axes, place) = (self.axes.map(|axis| &axis[..n]), self.from.map(L::from_f64));
        for (i, distance) in self.distances.iter_mut().enumerate() {
            *distance = squared_distance(axes, i, place).get();
        }
    }
}

/// Finds the nearest earlier points of each point, in the order from coarse to fine.
#[derive(Default)]
struct Nearest {
    distances: Vec<f64>,
    candidates: Vec<(f64, usize)>,
    /// Squared radius searched first, relative to the point's own squared distance to the earlier
    /// ones.
    reach: f64,
}

impl Nearest {
    /// The `count` nearest to point `i` among the points before it, in ascending order of index.
    ///
    /// `spacing` is the squared distance of point `i` to the nearest of them.
    fn find<const D: usize>(
        &mut self,
        axes: [&[f64]; D],
        i: usize,
        spacing: f64,
        count: usize,
        found: &mut Vec<usize>,
    ) {
        self.distances.resize(i, 0.0);
        dispatch(Distances {
            axes,
            from: axes.map(|axis| axis[i]),
            distances: &mut self.distances,
        });
        self.gather(spacing, count.min(i));
        if self.candidates.len() > count {
            self.candidates
                .select_nth_unstable_by(count, |a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            self.candidates.truncate(count);
        }
        found.clear();
        found.extend(self.candidates.iter().map(|c| c.1));
        found.sort_unstable();
    }

    /// Collects the points within a distance that includes at least `count` of them as candidates.
    fn gather(&mut self, spacing: f64, count: usize) {
        let mut reach = f64::max(self.reach, 1.0);
        loop {
            let within = self
                .distances
                .iter()
                .copied()
                .enumerate()
                // Scanning the distances avoids a search tree and stays within the O(n²) of the
                // set-up.
                .filter(|&(_, d)| d <= reach * spacing);
            self.candidates.clear();
            self.candidates.extend(within.map(|(j, d)| (d, j)));
            if self.candidates.len() >= count || reach > 1e300 {
                break;
            }
            reach *= 1.5;
        }
        // The reach decreases slowly again, so that one point in a corner does not slow down all
        // others.
        self.reach = 0.98 * reach;
    }
}

/// A sparse inverse Cholesky factor of the kernel matrix on the complement: Σ wᵢ wᵢᵀ over the
/// points.
///
/// Points are ordered from coarse to fine. Point i contributes its prediction error from the points
/// before it, cᵢ(y) = yᵢ − f(xᵢ), with f the spline through the earlier points. These errors are
/// uncorrelated in the inner product of the kernel: wᵢᵀA wⱼ = δᵢⱼ after scaling, so A⁻¹ = Σ wᵢ wᵢᵀ.
/// Here f uses only the nearest earlier points (Vecchia 1988; Schäfer, Katzfuss & Owhadi 2021). The
/// weights of the spline with value one at xᵢ and zero at its neighbours are wᵢ √wᵢᵢ. All of them
/// satisfy the side conditions, as conditionally positive definite kernels require.
#[derive(Clone, Debug, Default)]
pub(super) struct Preconditioner<const D: usize> {
    /// The factored system of the first points.
    coarse: System<D>,
    coarse_points: usize,
    /// For each later point, its own index and those of its neighbours,
    places: Vec<u32>,
    /// and their weights.
    weights: Vec<f64>,
    row: usize,
}

/// The points in order, with the diagonal.
struct Ordered<'a, K, const D: usize> {
    kernel: &'a K,
    centres: &'a Centres<D>,
    /// Centre of each point.
    order: &'a [usize],
    axes: [&'a [f64]; D],
    /// Squared distance to the nearest point before it.
    spacing: &'a [f64],
    /// Weights of the points. Empty if all are one.
    weights: &'a [f64],
    lambda: f64,
}

impl<K: Kernel, const D: usize> Ordered<'_, K, D> {
    /// Factors the system of the points with these indices. Returns `false` if rounding leaves it
    /// indefinite.
    fn factor(
        &self,
        places: &[usize],
        local: &mut Centres<D>,
        weights: &mut Vec<f64>,
        system: &mut System<D>,
    ) -> bool {
        self.centres
            .select(places.iter().map(|&i| self.order[i]), local);
        weights.clear();
        if !self.weights.is_empty() {
            weights.extend(places.iter().map(|&i| self.weights[i]));
        }
        let setting = Setting {
            kernel: self.kernel,
            centres: local,
            rank_tolerance: 0.0,
        };
        let watch = &mut |_: &Progress| ControlFlow::Continue(());
        system.factor(&setting, weights, self.lambda, watch).is_ok()
    }
}

/// Splines with value one at the last of a few points and zero at the others, computed one by one.
struct Cardinal<'a, K, const D: usize> {
    points: &'a Ordered<'a, K, D>,
    local: Centres<D>,
    local_weights: Vec<f64>,
    system: System<D>,
    unit: Vec<f64>,
    work: Vec<f64>,
}

impl<'a, K: Kernel, const D: usize> Cardinal<'a, K, D> {
    fn new(points: &'a Ordered<'a, K, D>) -> Self {
        let (local, system) = (points.centres.clone(), System::default());
        Self {
            points,
            local,
            local_weights: Vec::new(),
            system,
            unit: Vec::new(),
            work: Vec::new(),
        }
    }

    /// The weights of the spline of the points with these indices. If there is no spline, the unit
    /// vector.
    fn weights(&mut self, places: &[usize]) -> &[f64] {
        let Self {
            points,
            local,
            local_weights,
            system,
            unit,
            work,
        } = self;
        unit.clear();
        unit.resize(places.len(), 0.0);
        unit[places.len() - 1] = 1.0;
        if points.factor(places, local, local_weights, system) {
            system.solve::<1>(unit, 0.0, work, &mut Vec::new());
        }
        unit
    }
}

impl<const D: usize> Preconditioner<D> {
    /// Builds the factor: O(n m³ + n²) for m neighbours.
    ///
    /// Stops if `watch`, which receives the number of completed points, returns `Break`.
    fn build<K: Kernel>(
        &mut self,
        points: &Ordered<'_, K, D>,
        watch: &mut dyn FnMut(usize) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        let n = points.order.len();
        self.coarse_points = n.min(COARSE_POINTS);
        let first: Vec<usize> = (0..self.coarse_points).collect();
        // Without a coarse factor, all points from D + 2 on have their own row.
        if !points.factor(
            &first,
            &mut points.centres.clone(),
            &mut Vec::new(),
            &mut self.coarse,
        ) {
            self.coarse_points = 0;
        }
        self.row = NEIGHBOURS + 1;
        self.places.clear();
        self.weights.clear();
        let (mut cardinal, mut nearest, mut places) =
            (Cardinal::new(points), Nearest::default(), Vec::new());
        // A spline of fewer than D + 2 points is affine and has no weights.
        for i in self.coarse_points.max(D + 2)..n {
            if i % 64 == 0 {
                watch(i)?;
            }
            nearest.find(points.axes, i, points.spacing[i], NEIGHBOURS, &mut places);
            places.push(i);
            self.push(&places, cardinal.weights(&places));
        }
        ControlFlow::Continue(())
    }

    /// Stores the weights of a cardinal spline, scaled to unit energy.
    fn push(&mut self, places: &[usize], unit: &[f64]) {
        let own = unit[unit.len() - 1];
        // If the factorisation failed, or because of rounding, the energy may not be positive. The
        // point then contributes nothing.
        let scale = if own > 0.0 && own.is_finite() {
            1.0 / own.sqrt()
        } else {
            0.0
        };
        self.places.extend(places.iter().map(|&i| i as u32));
        self.weights.extend(unit.iter().map(|w| w * scale));
        let padding = self.row - places.len();
        self.places
            // Rows of equal length need no table of starts. Padding has weight 0.
            .extend(core::iter::repeat_n(places[0] as u32, padding));
        self.weights.extend(core::iter::repeat_n(0.0, padding));
    }

    /// z = Σ wᵢ wᵢᵀ r for `M` columns of `n` entries.
    fn apply<const M: usize>(&self, r: &[f64], z: &mut [f64], n: usize, spare: &mut [Vec<f64>; 2]) {
        z.fill(0.0);
        for (places, weights) in self
            .places
            .chunks_exact(self.row)
            .zip(self.weights.chunks_exact(self.row))
        {
            for m in 0..M {
                let (r, z) = (&r[m * n..(m + 1) * n], &mut z[m * n..(m + 1) * n]);
                let product: f64 = places
                    .iter()
                    .zip(weights)
                    .map(|(&i, w)| w * r[i as usize])
                    .sum();
                places
                    .iter()
                    .zip(weights)
                    .for_each(|(&i, w)| z[i as usize] += product * w);
            }
        }
        let (count, [values, work]) = (self.coarse_points, spare);
        values.clear();
        (0..M).for_each(|m| values.extend_from_slice(&r[m * n..m * n + count]));
        if count > 0 {
            self.coarse.solve::<M>(values, 0.0, work, &mut Vec::new());
        }
        for (m, values) in values.chunks_exact(count.max(1)).enumerate() {
            z[m * n..m * n + count]
                .iter_mut()
                .zip(values)
                .for_each(|(z, v)| *z += v);
        }
    }
}
