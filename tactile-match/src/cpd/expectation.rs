//! The E-step: which target point belongs to which model point, as sums over the posterior `P` without storing it.

use super::exp::exp_of_negative;
use crate::simd::{Loop, vectorised};

/// `D` coordinates, each contiguous over the points.
pub(super) type Columns<const D: usize> = [Vec<f64>; D];

/// The sums over the posterior that the M-steps need, for `M` model and `N` target points.
#[derive(Clone, Debug)]
pub(super) struct Posterior<const D: usize> {
    /// `P 1`: how much of the target every model point has.
    pub(super) model_mass: Vec<f64>,
    /// `Pᵀ 1`: how much of every target point is no outlier.
    pub(super) target_mass: Vec<f64>,
    /// `P X`.
    pub(super) weighted: Columns<D>,
    /// Negative log-likelihood, up to a constant that depends on the sizes alone.
    pub(super) energy: f64,
    /// One column of `P`.
    column: Vec<f64>,
}

impl<const D: usize> Default for Posterior<D> {
    fn default() -> Self {
        Self {
            model_mass: Vec::new(),
            target_mass: Vec::new(),
            weighted: std::array::from_fn(|_| Vec::new()),
            energy: 0.0,
            column: Vec::new(),
        }
    }
}

/// Weight of the uniform component relative to one Gaussian's peak, `(2πσ²)^{D/2} w M / ((1 − w) N)`.
pub(super) fn uniform_weight<const D: usize>(
    sigma2: f64,
    outlier_weight: f64,
    model: usize,
    target: usize,
) -> f64 {
    let volume = (std::f64::consts::TAU * sigma2).powf(0.5 * D as f64);
    volume * outlier_weight / (1.0 - outlier_weight) * model as f64 / target as f64
}

impl<const D: usize> Posterior<D> {
    /// All sums for model points that have moved to `moved`; `O(M N)`.
    pub(super) fn update(
        &mut self,
        moved: &Columns<D>,
        target: &Columns<D>,
        sigma2: f64,
        uniform: f64,
    ) {
        let (model_len, target_len) = (moved[0].len(), target[0].len());
        for sums in self
            .weighted
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
            for (weighted, x) in sums.weighted.iter_mut().zip(x) {
                for (sum, &p) in weighted.iter_mut().zip(&sums.column) {
                    *sum += p * x;
                }
            }
        }
    }
}

/// `exp(−|x − y_m|² / 2σ²)` for every model point; returns their sum.
#[inline(always)]
pub(super) fn gaussians<const D: usize>(
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
pub(super) fn lane_sum(values: &[f64]) -> f64 {
    let mut lanes = [0.0; 8];
    let (chunks, rest) = values.as_chunks::<8>();
    for chunk in chunks {
        for l in 0..8 {
            lanes[l] += chunk[l];
        }
    }
    lanes.iter().sum::<f64>() + rest.iter().sum::<f64>()
}
