//! New weights without a new factorisation, by the spectrum of the old one: a Woodbury update for a few weights
//! that differ from the rest, or conjugate gradients.
//!
//! Weights enter the equations as a diagonal, (K + λW⁻¹) w + P a = y, Pᵀw = 0. With w = Q₂z, B = Q₂ᵀKQ₂ and any λ̄,
//!
//! (B + λ̄I + Q₂ᵀEQ₂) z = Q₂ᵀy,  E = λW⁻¹ − λ̄I,
//!
//! and the spectrum of B gives C = (B + λ̄I)⁻¹ in one pass. A direction p = Cr + βp' has (B + λ̄I)p = r + β(B + λ̄I)p', so that
//! a step costs one pass over the eigenvectors and no product with B (Eisenstat's trick, 1981). What C leaves is of
//! condition at most (μ₁ + λ max W⁻¹)/(μ₁ + λ min W⁻¹) with μ₁ the least eigenvalue of B, and k weights that differ from the
//! rest are k directions: k + 1 steps. Up to sixteen of them take a [Woodbury update](Reweighting::woodbury) instead.

use nalgebra::SMatrix;

use crate::{
    layout::HEAD,
    null_space::{NullSpace, dot, ratio},
    spectrum::Spectrum,
};

/// Residual relative to the right-hand side at which the iteration stops: values at the centres are off by about as much.
const TOLERANCE: f64 = 1e-13;
/// Condition number up to which a plain solution needs no refinement, as for a factored system.
const CONDITION: f64 = 1e8;
/// A factorisation takes as long as one step for every so many points.
const POINTS_PER_STEP: usize = 18;
/// Weights that differ from the rest up to which the update is direct.
const MOST_UPDATED: usize = 16;

/// λW⁻¹ at the active centres, and how far to go with it.
pub(crate) struct Reweighting<'a> {
    spectrum: &'a Spectrum,
    null: &'a NullSpace,
    /// λ̄.
    level: f64,
    /// Bound of the matrix's condition number.
    pub(crate) condition: f64,
    /// Steps after which a factorisation is cheaper.
    steps: usize,
    /// How many weights differ from the rest.
    differing: usize,
}

impl<'a> Reweighting<'a> {
    /// For λ and positive weights; writes E into `excess`, in the order of the rows. `None` where a factorisation is cheaper or safer.
    pub(crate) fn new(
        spectrum: &'a Spectrum,
        null: &'a NullSpace,
        lambda: f64,
        weights: &[f64],
        excess: &mut Vec<f64>,
    ) -> Option<Self> {
        excess.clear();
        excess.extend(weights.iter().map(|w| lambda / w));
        let ends = |range: (f64, f64), &d: &f64| (range.0.min(d), range.1.max(d));
        let (low, high) = excess.iter().fold((f64::INFINITY, 0.0), ends);
        let (least, most) = spectrum.range();
        let condition = (most + high) / (least + low);
        let spread = (least.max(0.0) + high) / (least.max(0.0) + low);
        let rate = (spread.sqrt() - 1.0) / (spread.sqrt() + 1.0);
        let bound = if rate > 0.0 {
            (0.5 * TOLERANCE).ln() / rate.ln()
        } else {
            0.0
        };
        let level = median(excess);
        let differing = excess.iter().filter(|&&d| d != level).count();
        let steps = null.n / POINTS_PER_STEP;
        let good = least + low > 0.0 && condition < CONDITION;
        if !good
            || (differing > MOST_UPDATED && f64::min(bound, differing as f64) + 1.0 > steps as f64)
        {
            return None;
        }
        excess.clear();
        excess.extend(weights.iter().map(|w| lambda / w - level));
        Some(Self {
            spectrum,
            null,
            level,
            condition,
            steps,
            differing,
        })
    }

    /// By an update of low rank for the weights that differ (Woodbury 1950; Hager 1989).
    ///
    /// With U the rows of Q₂ that carry an excess e, (A + UᵀeU)⁻¹b = A⁻¹(b − Uᵀt), (I + eUA⁻¹Uᵀ) t = eUA⁻¹b. All of it
    /// happens among the coefficients of the eigenvectors, where A is diagonal.
    fn woodbury<const M: usize>(
        &self,
        b: &[f64],
        excess: &[f64],
        work: &mut Vec<f64>,
        spare: &mut Vec<f64>,
    ) -> Option<()> {
        let (stride, spectrum) = (self.null.stride, self.spectrum);
        self.units(excess, work, spare);
        spare.clear();
        spare.resize(M * stride, 0.0);
        spectrum.coefficients::<M>(b, spare);
        spectrum.divide(spare, self.level);
        let length = work.len();
        work.extend_from_within(..);
        let (units, solved) = work.split_at_mut(length);
        spectrum.divide(solved, self.level);
        let t = self.solve_capacitance::<M>(excess, units, solved, spare)?;
        for (found, t) in spare.chunks_exact_mut(stride).zip(t.column_iter()) {
            for (solved, t) in solved.chunks_exact(stride).zip(&t) {
                found.iter_mut().zip(solved).for_each(|(c, s)| *c -= t * s);
            }
        }
        work.clear();
        work.resize(2 * M * stride, 0.0);
        let [x, product] = split(work, M * stride);
        spectrum.combine::<M>(spare, x);
        self.complete(excess, x, product);
        Some(())
    }

    /// Solves the capacitance system of [`woodbury`](Self::woodbury) for t, from U, UA⁻¹ and A⁻¹b.
    fn solve_capacitance<const M: usize>(
        &self,
        excess: &[f64],
        units: &[f64],
        solved: &[f64],
        found: &[f64],
    ) -> Option<SMatrix<f64, MOST_UPDATED, M>> {
        let row = |data: &'_ [f64], i: usize, unit: usize| {
            dot(
                &units[unit * self.null.stride..][..self.null.stride],
                &data[i * self.null.stride..][..self.null.stride],
            )
        };
        let mut matrix = SMatrix::<f64, MOST_UPDATED, MOST_UPDATED>::identity();
        let mut sides = SMatrix::<f64, MOST_UPDATED, M>::zeros();
        for (i, e) in excess.iter().filter(|e| **e != 0.0).enumerate() {
            // A row of large excess is scaled down.
            let scale = 1.0 / f64::max(e.abs(), 1.0);
            matrix[(i, i)] = scale;
            (0..self.differing).for_each(|j| matrix[(i, j)] += scale * e * row(solved, j, i));
            (0..M).for_each(|m| sides[(i, m)] = scale * e * row(found, m, i));
        }
        matrix.lu().solve_mut(&mut sides).then_some(sides)
    }

    /// The rows of Q₂ with an excess, as coefficients of the eigenvectors, one after the other in `units`.
    fn units(&self, excess: &[f64], units: &mut Vec<f64>, group: &mut Vec<f64>) {
        const GROUP: usize = 4;
        let (stride, first) = (self.null.stride, self.null.rows().start);
        let mut differing = (0..excess.len()).filter(|&i| excess[i] != 0.0);
        units.clear();
        for start in (0..self.differing).step_by(GROUP) {
            group.clear();
            group.resize(GROUP * stride, 0.0);
            for (column, i) in group.chunks_exact_mut(stride).zip(&mut differing) {
                column[first + i] = 1.0;
                self.null.apply_transpose(column);
            }
            units.resize((start + GROUP) * stride, 0.0);
            self.spectrum
                .coefficients::<GROUP>(group, &mut units[start * stride..]);
        }
        units.truncate(self.differing * stride);
    }

    /// Solves for `M` columns b = Q₂ᵀy, which it overwrites; z comes at the front of `work`, followed by Q₁ᵀEQ₂z
    /// in the places before the complement's. Returns the steps taken, `None` if they do
    /// not suffice.
    pub(crate) fn solve<const M: usize>(
        &self,
        b: &mut [f64],
        excess: &[f64],
        work: &mut Vec<f64>,
        spare: &mut Vec<f64>,
    ) -> Option<usize> {
        if self.differing <= MOST_UPDATED {
            return self.woodbury::<M>(b, excess, work, spare).map(|()| 0);
        }
        self.iterate::<M>(b, excess, work, spare)
    }

    /// By conjugate gradients.
    fn iterate<const M: usize>(
        &self,
        b: &mut [f64],
        excess: &[f64],
        work: &mut Vec<f64>,
        spare: &mut Vec<f64>,
    ) -> Option<usize> {
        work.clear();
        work.resize(5 * b.len(), 0.0);
        let [x, p, s, product, c] = split(work, b.len());
        let (start, mut size) = (self.inner::<M>(b, b), [f64::INFINITY; M]);
        for step in 1..=self.steps {
            c.copy_from_slice(b);
            self.spectrum.solve::<M>(c, self.level, spare);
            let new = self.inner::<M>(b, c);
            let beta = core::array::from_fn(|m| ratio(new[m], size[m]));
            self.turn::<M>(&beta, c, p);
            self.turn::<M>(&beta, b, s);
            size = new;
            self.diagonal(excess, p, product);
            product
                .iter_mut()
                .zip(&*s)
                .for_each(|(product, s)| *product += s);
            let curvature = self.inner::<M>(p, product);
            let alpha: [f64; M] = core::array::from_fn(|m| ratio(size[m], curvature[m]));
            self.advance::<M>(&alpha, p, x);
            self.advance::<M>(&alpha.map(|a| -a), product, b);
            let left = self.inner::<M>(b, b);
            if (0..M).all(|m| ratio(left[m], start[m]).sqrt() <= TOLERANCE) {
                self.complete(excess, x, product);
                return Some(step);
            }
        }
        None
    }

    /// The places of the complement in column `m`.
    fn tail(&self, m: usize) -> core::ops::Range<usize> {
        let start = m * self.null.stride + HEAD;
        start..start + self.null.n - self.null.q
    }

    /// Inner products of the columns.
    fn inner<const M: usize>(&self, a: &[f64], b: &[f64]) -> [f64; M] {
        core::array::from_fn(|m| dot(&a[self.tail(m)], &b[self.tail(m)]))
    }

    /// p ← c + βp.
    fn turn<const M: usize>(&self, beta: &[f64; M], c: &[f64], p: &mut [f64]) {
        for (m, beta) in beta.iter().enumerate() {
            let pairs = p[self.tail(m)].iter_mut().zip(&c[self.tail(m)]);
            pairs.for_each(|(p, c)| *p = c + beta * *p);
        }
    }

    /// x ← x + αp.
    fn advance<const M: usize>(&self, alpha: &[f64; M], p: &[f64], x: &mut [f64]) {
        for (m, alpha) in alpha.iter().enumerate() {
            let pairs = x[self.tail(m)].iter_mut().zip(&p[self.tail(m)]);
            pairs.for_each(|(x, p)| *x += alpha * p);
        }
    }

    /// Writes Q₁ᵀEQ₂z into the places before the complement's, column by column; `product` is overwritten.
    fn complete(&self, excess: &[f64], z: &mut [f64], product: &mut [f64]) {
        self.diagonal(excess, z, product);
        let stride = self.null.stride;
        for (z, product) in z.chunks_exact_mut(stride).zip(product.chunks_exact(stride)) {
            z[..HEAD].copy_from_slice(&product[..HEAD]);
        }
    }

    /// QᵀEQ₂p, column by column.
    fn diagonal(&self, excess: &[f64], p: &[f64], product: &mut [f64]) {
        product.copy_from_slice(p);
        for column in product.chunks_exact_mut(self.null.stride) {
            column[..HEAD].fill(0.0);
            self.null.apply(column);
            let values = &mut column[self.null.rows()];
            values.iter_mut().zip(excess).for_each(|(v, e)| *v *= e);
            self.null.apply_transpose(column);
        }
    }
}

/// The first pieces of this length.
fn split<const N: usize>(mut rest: &mut [f64], length: usize) -> [&mut [f64]; N] {
    core::array::from_fn(|_| {
        let (piece, others) = core::mem::take(&mut rest).split_at_mut(length);
        rest = others;
        piece
    })
}

/// The middle of `values`, which it reorders.
fn median(values: &mut [f64]) -> f64 {
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}
