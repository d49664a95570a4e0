//! The warp that the soft matches ask for: weighted regression under the prior.
//!
//! With targets `zᵢ`, weights `wᵢ` and noise variance σ², the displacement is `u = L c`,
//! `(Lᵀ W L + σ² 1) c = Lᵀ W z`; its variance at point i is `vᵢ = σ² Lᵢ (Lᵀ W L + σ² 1)⁻¹ Lᵢᵀ`. What the other points say
//! about point i follows without another fit: with the leverage `hᵢ = wᵢ vᵢ/σ²`, the prediction that leaves i out is
//! `(uᵢ − hᵢ zᵢ)/(1 − hᵢ)`.

use super::axes::Axes;
use super::columns;
use super::prior::Prior;
use crate::simd::vectorised;

/// Memory and answer of a regression.
#[derive(Clone, Debug, Default)]
pub(crate) struct Regression<const D: usize> {
    gram: Vec<f64>,
    solution: Vec<[f64; D]>,
    weighted: Vec<f64>,
    whitened: Vec<f64>,
    /// `ln det(1 + LᵀWL/σ²)`.
    pub(crate) log_det: f64,
    /// Displacements, one array an axis, padded like the prior's columns.
    pub(crate) displacement: Axes<D>,
    /// Their variances along one axis, once [`variances`](Self::variances) has been called.
    pub(crate) variance: Vec<f64>,
    noise: f64,
    rank: usize,
}

impl<const D: usize> Regression<D> {
    /// Fits `targets` (displacements, one array an axis) with `weights`, both padded with zeros, at noise variance
    /// `noise`, in the modes that are not lost in it: `O(I r² + r³)`.
    pub(crate) fn fit(&mut self, prior: &Prior, weights: &[f64], targets: &Axes<D>, noise: f64) {
        let r = prior.rank_beside(noise);
        (self.rank, self.noise) = (r, noise);
        self.gram.resize(r * r, 0.0);
        self.weighted.resize(prior.stride, 0.0);
        let column = |p: usize| prior.column(p);
        vectorised(
            #[inline(always)]
            || {
                columns::normal_equations(
                    column,
                    r,
                    weights,
                    &targets.0,
                    &mut self.weighted,
                    &mut self.gram,
                    &mut self.solution,
                );
                for p in 0..r {
                    self.gram[p * r + p] += noise;
                }
                columns::cholesky(&mut self.gram, r);
                columns::solve(&self.gram, r, &mut self.solution);
                columns::combine(
                    column,
                    &self.solution,
                    &mut self.displacement.0,
                    prior.stride,
                );
            },
        );
        self.log_det = (0..r)
            .map(|p| 2.0 * self.gram[p * r + p].ln() - noise.ln())
            .sum();
    }

    /// Sets displacement and variance of every padded row; no penalty, no determinant.
    pub(crate) fn set(&mut self, padded: usize, row: impl Fn(usize) -> ([f64; D], f64)) {
        self.solution.clear();
        self.whitened.clear();
        self.log_det = 0.0;
        self.variance.clear();
        self.displacement.0.iter_mut().for_each(Vec::clear);
        for i in 0..padded {
            let (displacement, variance) = row(i);
            self.variance.push(variance);
            for (axis, value) in self.displacement.0.iter_mut().zip(displacement) {
                axis.push(value);
            }
        }
    }

    /// Computes the variances of the last fit: `O(I r²)`.
    pub(crate) fn variances(&mut self, prior: &Prior) {
        let (r, stride) = (self.rank, prior.stride);
        self.variance.clear();
        self.variance.resize(stride, 0.0);
        vectorised(
            #[inline(always)]
            || {
                columns::whiten(&prior.columns, stride, &self.gram, r, &mut self.whitened);
                for column in self.whitened.chunks_exact(stride) {
                    for (v, sum) in column.iter().zip(&mut self.variance) {
                        *sum += v * v * self.noise;
                    }
                }
            },
        );
    }

    /// Covariance of the displacements of two points, along one axis, after [`variances`](Self::variances): `O(r)`. None of rigid fits.
    pub(crate) fn covariance(&self, a: usize, b: usize) -> f64 {
        let columns = self.whitened.chunks_exact(self.variance.len().max(1));
        self.noise * columns.map(|column| column[a] * column[b]).sum::<f64>()
    }

    /// `Σ |c|²`, twice the prior's energy of the warp.
    pub(crate) fn penalty(&self) -> f64 {
        self.solution.iter().flatten().map(|c| c * c).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::super::prior::PriorScales;
    use super::*;

    fn scene() -> (Prior, Vec<f64>, Axes<2>) {
        let points: Vec<[f64; 2]> = (0..19)
            .map(|i| [f64::from(i % 5) * 0.4, f64::from(i / 5) * 0.3])
            .collect();
        let mut prior = Prior::default();
        prior.build(
            &points,
            PriorScales {
                length: 1.2,
                bending: 0.35,
                affine: 0.5,
            },
        );
        let pad = |f: &dyn Fn(usize) -> f64| {
            (0..prior.stride)
                .map(|i| if i < 19 { f(i) } else { 0.0 })
                .collect()
        };
        let weights: Vec<f64> = pad(&|i| 0.2 + 0.04 * i as f64);
        let targets = Axes([
            pad(&|i| (i as f64).sin() * 0.2),
            pad(&|i| 0.1 * (i % 3) as f64),
        ]);
        (prior, weights, targets)
    }

    /// Leaving a point out by formula is leaving it out in fact.
    #[test]
    fn leverage_gives_the_prediction_without_the_point() {
        let (prior, mut weights, targets) = scene();
        let mut regression = Regression::default();
        regression.fit(&prior, &weights, &targets, 0.01);
        regression.variances(&prior);
        let leverage = weights[7] * regression.variance[7] / 0.01;
        let predicted: [f64; 2] = std::array::from_fn(|k| {
            (regression.displacement.0[k][7] - leverage * targets.0[k][7]) / (1.0 - leverage)
        });
        weights[7] = 0.0;
        regression.fit(&prior, &weights, &targets, 0.01);
        for k in 0..2 {
            // Conditioning of the Gram matrix is below 1e4 here: rounding stays under 1e-11.
            assert!((predicted[k] - regression.displacement.0[k][7]).abs() < 1e-11);
        }
    }

    /// Modes that the noise hides are left out of a fit. Against the fit with the whole covariance, `u = K (K + σ² W⁻¹)⁻¹ z`, a displacement
    /// moves by less than the deviation of what is left out at its point, √0.01 σ.
    #[test]
    fn modes_left_out_move_the_warp_by_less_than_a_tenth_of_the_noise() {
        let n = 160;
        let points: Vec<[f64; 2]> = (0..n)
            .map(|i| {
                let (r, angle) = (((i as f64 + 0.5) / n as f64).sqrt(), 2.4 * i as f64);
                [r * angle.cos(), r * angle.sin()]
            })
            .collect();
        let scales = PriorScales {
            length: 0.5,
            bending: 0.35,
            affine: 0.5,
        };
        let covariance = nalgebra::DMatrix::from_fn(n, n, |i, j| {
            let (a, b) = (points[i], points[j]);
            let square = (a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2);
            let bending = scales.bending.powi(2) * (-0.5 * square / scales.length.powi(2)).exp();
            bending + scales.affine.powi(2) * (1.0 + a[0] * b[0] + a[1] * b[1])
        });
        let mut prior = Prior::default();
        prior.build(&points, scales);
        let pad = |f: &dyn Fn(usize) -> f64| -> Vec<f64> {
            (0..prior.stride)
                .map(|i| if i < n { f(i) } else { 0.0 })
                .collect()
        };
        let weights = pad(&|i| 0.3 + 0.7 * (i % 4) as f64 / 3.0);
        let smooth = |i: usize| 0.2 * (2.0 * points[i][0] - points[i][1]).sin();
        let mut ranks = Vec::new();
        for sigma in [0.3, 0.1, 0.03] {
            let off = |i: usize| sigma * (((i * i) as f64 * 0.618_033_988_75).fract() - 0.5);
            let targets = Axes([pad(&|i| smooth(i) + off(i)), pad(&|i| off(3 * i + 1))]);
            let mut regression = Regression::default();
            regression.fit(&prior, &weights, &targets, sigma * sigma);
            ranks.push(regression.rank);
            let mut noisy = covariance.clone();
            for i in 0..n {
                noisy[(i, i)] += sigma * sigma / weights[i];
            }
            let solver = noisy.cholesky().expect("positive definite");
            for axis in 0..2 {
                let z = nalgebra::DVector::from_fn(n, |i, _| targets.0[axis][i]);
                let whole = &covariance * solver.solve(&z);
                for i in 0..n {
                    let apart = regression.displacement.0[axis][i] - whole[i];
                    assert!(apart.abs() < 0.1 * sigma, "σ {sigma}, point {i}: {apart}");
                }
            }
        }
        // All are cut, the noisier the more.
        assert!(
            ranks[0] < ranks[1] && ranks[1] < ranks[2] && ranks[2] < 64,
            "{ranks:?}"
        );
    }
}
