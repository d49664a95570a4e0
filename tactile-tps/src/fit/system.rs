//! The projected matrix of a spline's equations: assembled, factored or decomposed, and solved.

use core::ops::ControlFlow;

use super::{
    affine_basis::{AffineBasis, subtract},
    centres::Centres,
    spectrum::Spectrum,
    triangle::Triangle,
};
use crate::{
    Kernel, Progress, TpsError,
    lanes::{Job, Lane, dispatch, dot, squared_distance},
    smoothing::least_gcv,
    span::{Coefficients, MAX, Span},
};

/// A callback that receives the progress of a fit and may stop it.
pub(super) type Watch<'a> = dyn FnMut(&Progress) -> ControlFlow<()> + 'a;

/// The inputs of a system.
pub(super) struct Setting<'a, K, const D: usize> {
    pub(super) kernel: &'a K,
    pub(super) centres: &'a Centres<D>,
    /// Fraction of the largest extent below which a direction counts as not spanned.
    pub(super) rank_tolerance: f64,
}

/// ΠSΠ + σQQᵀ over the centres of positive weight, factored or decomposed.
#[derive(Clone, Debug, Default)]
pub(super) struct System<const D: usize> {
    /// Centres of positive weight.
    pub(super) active: Vec<usize>,
    /// √weight of each. Empty if all are one.
    pub(super) scales: Vec<f64>,
    pub(super) span: Span<D>,
    pub(super) affine: AffineBasis,
    /// SQ without λ, by columns, padded with zero columns.
    pub(super) coupling: Vec<f64>,
    /// σ.
    pub(super) shift: f64,
    /// Lower triangle of the matrix, or its Cholesky factor.
    pub(super) matrix: Triangle,
    pub(super) spectrum: Option<Spectrum>,
    pub(super) condition: f64,
    pub(super) scratch: Vec<f64>,
}

impl<const D: usize> System<D> {
    /// Factors for centre weights (empty: all one) and λ ≥ 0, in n³/3 multiplications and
    /// additions.
    pub(super) fn factor<K: Kernel>(
        &mut self,
        setting: &Setting<'_, K, D>,
        weights: &[f64],
        lambda: f64,
        watch: &mut Watch<'_>,
    ) -> Result<(), TpsError> {
        self.spectrum = None;
        let size = self.assemble(setting, weights, lambda > 0.0);
        self.matrix.add_to_diagonal(lambda);
        let total = self.matrix.n;
        let mut watch = |done| watch(&Progress::new(done, total));
        if let Err(error) = self.matrix.factor(&mut watch) {
            if error == TpsError::Stopped {
                return Err(error);
            }
            // If points nearly coincide, rounding has made the matrix indefinite. A λ of the size
            // of this rounding changes values by no more than it. A kernel that is not positive
            // definite fails again.
            self.assemble(setting, weights, lambda > 0.0);
            let rounding = f64::EPSILON * self.active.len() as f64 * (size + lambda);
            self.matrix.add_to_diagonal(lambda + rounding);
            self.matrix.factor(&mut watch)?;
            self.condition = f64::INFINITY;
            return Ok(());
        }
        self.condition = 1.0;
        // If there are only affine functions, the matrix consists of σ alone.
        if self.active.len() > self.affine.q {
            let inverse = self.matrix.inverse_norm(&mut self.scratch);
            self.condition = f64::max(1.0, (size + lambda) * inverse);
        }
        Ok(())
    }

    /// Decomposes for centre weights and any λ > 0, in about 10 n³ operations.
    pub(super) fn decompose<K: Kernel>(&mut self, setting: &Setting<'_, K, D>, weights: &[f64]) {
        self.assemble(setting, weights, true);
        self.spectrum
            .get_or_insert_default()
            .decompose(&mut self.matrix);
    }

    /// Condition number of the matrix, with `lambda` added if it is decomposed.
    pub(super) fn condition(&self, lambda: f64) -> f64 {
        self.spectrum
            .as_ref()
            .map_or(self.condition, |spectrum| spectrum.condition(lambda))
    }

    /// Writes the lower triangle of the matrix without λ. Returns the Frobenius norm of ΠSΠ.
    pub(super) fn assemble<K: Kernel>(
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
    pub(super) fn project(&mut self) -> f64 {
        let (n, q) = (self.active.len(), self.affine.q);
        let head =
            |i: usize, k: usize| dot(self.affine.column(i), &self.coupling[k * n..(k + 1) * n]);
        let trace = self.matrix.trace() - (0..q).map(|k| head(k, k)).sum::<f64>();
        // If all points are used by the affine functions, no point is left. The trace on the range
        // of Π is the total trace minus that on the affine functions.
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
        // The update has added σ in q directions, which do not belong to ΠSΠ.
        f64::max(squares - q as f64 * shift * shift, 0.0).sqrt()
    }

    /// Selects centres of positive weight, with their scales.
    pub(super) fn choose(&mut self, n: usize, weights: &[f64], scaled: bool) {
        self.active.clear();
        self.scales.clear();
        let counts = |i: &usize| weights.get(*i).is_none_or(|&w| w > 0.0);
        self.active.extend((0..n).filter(counts));
        if scaled && !weights.is_empty() {
            let roots = self.active.iter().map(|&i| weights[i].sqrt());
            self.scales.extend(roots);
        }
    }

    /// Writes the coordinates of the active centres, by axes, into `scratch`.
    pub(super) fn places(&mut self, centres: &Centres<D>) {
        self.scratch.clear();
        for axis in &centres.axes {
            self.scratch.extend(self.active.iter().map(|&i| axis[i]));
        }
    }

    /// Computes the directions that the active centres span, and the affine functions there.
    pub(super) fn outline<K>(&mut self, setting: &Setting<'_, K, D>) {
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

    /// The λ that minimises the generalised cross-validation score for values at all centres. The
    /// system must be decomposed.
    pub(super) fn cross_validate<const M: usize>(
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
    /// `lambda` is added to a decomposed system. A factored system has its own λ.
    pub(super) fn solve<const M: usize>(
        &self,
        y: &mut [f64],
        lambda: f64,
        work: &mut Vec<f64>,
        spare: &mut Vec<f64>,
    ) -> [Coefficients; M] {
        let n = self.active.len();
        let mut heads = self.reduce::<M>(y, work);
        match &self.spectrum {
            Some(spectrum) => spectrum.solve(work, lambda, spare),
            None => self.matrix.solve(work),
        }
        for (head, column) in heads.iter_mut().zip(work.chunks_exact_mut(n)) {
            // The exact solution is in the range of Π; this removes rounding errors.
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

    /// Computes Π W^½ y in `work`. Returns QᵀW^½ y, by outputs.
    pub(super) fn reduce<const M: usize>(
        &self,
        y: &[f64],
        work: &mut Vec<f64>,
    ) -> [Coefficients; M] {
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

    /// Distributes the columns of `work`, each entry times its scale, to the centres.
    pub(super) fn scatter(&self, work: &[f64], y: &mut [f64]) {
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

/// Writes the lower triangle of W^½KW^½ and, while a column is in cache, its product with Q.
struct Assemble<'a, K, const D: usize> {
    kernel: &'a K,
    /// Coordinates by axes, then the scales.
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

/// Adds to Y = SQ the contribution of column `j` of a symmetric matrix, given from the diagonal on,
/// on both sides of the diagonal.
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
        // Both sums contain the diagonal.
        y[0] += sums[c].iter().sum::<f64>() + tail - column[0] * v[0];
    }
}

/// A ← A − QXᵀ − XQᵀ in the lower triangle. Returns the squared Frobenius norm of the whole matrix.
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
                // A copy of eight entries stays in registers.
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
