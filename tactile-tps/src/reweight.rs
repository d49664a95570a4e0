//! New weights without a new factorisation: conjugate gradients preconditioned by the spectrum at hand.
//!
//! Weights enter the equations as a diagonal, (K + λW⁻¹) w + P a = y, Pᵀw = 0. With w = Q₂z, B = Q₂ᵀKQ₂ and any λ̄,
//!
//! (B + λ̄I + Q₂ᵀEQ₂) z = Q₂ᵀy,  E = λW⁻¹ − λ̄I,
//!
//! and the spectrum of B gives C = (B + λ̄I)⁻¹ in one pass. A direction p = Cr + βp' has (B + λ̄I)p = r + β(B + λ̄I)p', so that
//! a step costs one pass over the eigenvectors and no product with B (Eisenstat's trick, 1981). What C leaves is of
//! condition at most (μ₁ + λ max W⁻¹)/(μ₁ + λ min W⁻¹) with μ₁ the least eigenvalue of B, and k weights apart from the rest
//! are k directions: k + 1 steps.

use crate::{
    cholesky::HEAD,
    null_space::{NullSpace, dot},
    spectrum::Spectrum,
};

/// Residual relative to the right-hand side at which the iteration stops: values at the sites are off by about as much.
const TOLERANCE: f64 = 1e-13;
/// Condition number up to which a plain solution needs no refinement, as for a factored system.
const CONDITION: f64 = 1e8;
/// A factorisation takes as long as one step for every so many points.
const POINTS_PER_STEP: usize = 18;

/// λW⁻¹ at the active sites, and how far to go with it.
pub(crate) struct Reweighting<'a> {
    spectrum: &'a Spectrum,
    null: &'a NullSpace,
    /// λ̄.
    level: f64,
    /// Bound of the matrix's condition number.
    pub(crate) condition: f64,
    /// Steps after which a factorisation is cheaper.
    steps: usize,
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
        let bound = if rate > 0.0 { (0.5 * TOLERANCE).ln() / rate.ln() } else { 0.0 };
        let level = median(excess);
        let apart = excess.iter().filter(|&&d| d != level).count();
        let steps = null.n / POINTS_PER_STEP;
        let good = least + low > 0.0 && condition < CONDITION;
        if !good || f64::min(bound, apart as f64) + 1.0 > steps as f64 {
            return None;
        }
        excess.clear();
        excess.extend(weights.iter().map(|w| lambda / w - level));
        Some(Self { spectrum, null, level, condition, steps })
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
        let (stride, length) = (self.null.stride, b.len());
        let tail = HEAD..HEAD + self.null.n - self.null.q;
        work.clear();
        work.resize(5 * length, 0.0);
        let (x, rest) = work.split_at_mut(length);
        let (p, rest) = rest.split_at_mut(length);
        let (s, rest) = rest.split_at_mut(length);
        let (product, c) = rest.split_at_mut(length);
        let column = |m: usize| m * stride + tail.start..m * stride + tail.end;
        let inner = |a: &[f64], b: &[f64]| -> [f64; M] {
            core::array::from_fn(|m| dot(&a[column(m)], &b[column(m)]))
        };
        let start = inner(b, b);
        let mut size = [f64::INFINITY; M];
        for step in 1..=self.steps {
            c.copy_from_slice(b);
            self.spectrum.solve::<M>(c, self.level, spare);
            let new = inner(b, c);
            for m in 0..M {
                let beta = ratio(new[m], size[m]);
                for i in column(m) {
                    p[i] = c[i] + beta * p[i];
                    s[i] = b[i] + beta * s[i];
                }
            }
            size = new;
            self.diagonal(excess, p, product);
            for m in 0..M {
                let curvature = dot(&p[column(m)], &s[column(m)]) + dot(&p[column(m)], &product[column(m)]);
                let alpha = ratio(size[m], curvature);
                for i in column(m) {
                    x[i] += alpha * p[i];
                    b[i] -= alpha * (s[i] + product[i]);
                }
            }
            let left = inner(b, b);
            let residual = (0..M).map(|m| ratio(left[m], start[m]).sqrt()).fold(0.0, f64::max);
            if residual <= TOLERANCE {
                self.diagonal(excess, x, product);
                for (x, product) in x.chunks_exact_mut(stride).zip(product.chunks_exact(stride)) {
                    x[..HEAD].copy_from_slice(&product[..HEAD]);
                }
                return Some(step);
            }
        }
        None
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

/// a / b, zero where b is zero or not finite: that output has converged or not begun.
fn ratio(a: f64, b: f64) -> f64 {
    if b > 0.0 && b.is_finite() { a / b } else { 0.0 }
}

/// The middle of `values`, which it reorders.
fn median(values: &mut [f64]) -> f64 {
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}
