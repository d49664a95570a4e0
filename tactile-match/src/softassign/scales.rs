//! The scales of the prior, averaged over by their evidence.
//!
//! With the soft matches fixed (weights `wᵢ`, targets `zᵢ`, noise σ²) the model is linear, `z = A c + noise`, with `A = [τ Lₛ, τₐ X]`: the factor
//! of the unit Gaussian kernel of length ℓ, and the affine functions. For one ℓ the factor and the Gram matrix `G = [Lₛ X]ᵀ W [Lₛ X]` are
//! computed once; every amplitude τ then costs one Cholesky factorisation of `D G D + σ² 1`, `D` the diagonal of amplitudes. Its evidence is
//!
//! `−ln p = (Σ wᵢ|zᵢ|² − cᵀ D b)/2σ² + (d/2) ln det(1 + D G D/σ²)`, `b = [Lₛ X]ᵀ W z`.

use super::anneal::Request;
use super::axes::Axes;
use super::columns;
use super::prior::{Prior, PriorScales};
use super::schedule::State;
use crate::simd::vectorised;

/// Lengths ℓ over which the warp may bend, in radii of the model, and amplitudes τ at the first of them: a factor √2 and 2 apart, about what
/// the evidence of a hundred points tells apart.
const LENGTHS: [f64; 4] = [1.2, 1.7, 2.4, 3.4];
const AMPLITUDES: [f64; 5] = [0.35, 0.2, 0.1, 0.05, 0.025];

/// Scales whose evidence is so many units of the logarithm below the best do not count: together less than a hundredth.
const UNLIKELY: f64 = 8.0;

/// Memory of the average.
#[derive(Clone, Debug, Default)]
pub(crate) struct ScaleAverage<const D: usize> {
    /// The smooth part of every length.
    smooth: [Prior; LENGTHS.len()],
    /// The energy of every scale in the last average.
    energies: Vec<f64>,
    /// The affine functions 1, x, y, …, column by column.
    affine: Vec<f64>,
    gram: Vec<f64>,
    factor: Vec<f64>,
    moments: Vec<[f64; D]>,
    solution: Vec<[f64; D]>,
    weighted: Vec<f64>,
    displacement: Axes<D>,
    mean: Axes<D>,
    /// Sum of the squared displacements under all scales, by their evidence.
    square: Vec<f64>,
    /// Variance of the displacements between the scales, along one axis.
    pub(crate) spread: Vec<f64>,
}

impl<const D: usize> ScaleAverage<D> {
    /// Replaces `state.warped` by the mean over all scales of the warps that the soft matches ask for, each weighted by its
    /// evidence; returns the scales of most evidence. `O(I r²)` for every length. Where `likely`, only scales that had some evidence in
    /// the last average.
    pub(crate) fn average(
        &mut self,
        request: Request<'_, D>,
        model: &[[f64; D]],
        state: &mut State<D>,
        variance: f64,
        affine: f64,
        likely: bool,
    ) -> PriorScales {
        if !likely {
            self.energies.clear();
            self.energies.resize(LENGTHS.len() * AMPLITUDES.len(), 0.0);
        }
        let limit = self.energies.iter().copied().fold(f64::INFINITY, f64::min) + UNLIKELY;
        let mut best = (f64::INFINITY, PriorScales::default());
        let mut total = 0.0;
        for axis in &mut self.mean.0 {
            axis.clear();
        }
        for (l, length) in LENGTHS.into_iter().enumerate() {
            let scales = l * AMPLITUDES.len();
            let of_length = &self.energies[scales..scales + AMPLITUDES.len()];
            if of_length.iter().all(|&energy| energy > limit) {
                continue;
            }
            self.prepare(request, model, l, variance);
            for (a, amplitude) in AMPLITUDES.into_iter().enumerate() {
                if self.energies[scales + a] > limit {
                    continue;
                }
                let bending = amplitude * length / LENGTHS[0];
                let energy = self.fit(request, bending, affine, variance);
                self.energies[scales + a] = energy;
                if energy < best.0 {
                    // What was summed so far is counted relative to the new best.
                    let fade = if best.0.is_finite() {
                        (energy - best.0).exp()
                    } else {
                        0.0
                    };
                    total *= fade;
                    self.fade(fade);
                    best = (
                        energy,
                        PriorScales {
                            length,
                            bending,
                            affine,
                        },
                    );
                }
                let weight = (best.0 - energy).exp();
                total += weight;
                // Below this the mean does not change by a thousandth of the noise.
                if weight > 1e-4 {
                    self.add(l, bending, affine, weight);
                }
            }
        }
        self.spread.clear();
        for (i, warped) in state.warped.iter_mut().enumerate() {
            let mut square = self.square[i] / total;
            for k in 0..D {
                let mean = self.mean.0[k][i] / total;
                warped[k] = state.base[i][k] + mean;
                square -= mean * mean;
            }
            self.spread.push((square / D as f64).max(0.0));
        }
        best.1
    }

    /// Factor and Gram matrix of one length.
    fn prepare(&mut self, request: Request<'_, D>, model: &[[f64; D]], l: usize, noise: f64) {
        let length = LENGTHS[l];
        let unit = PriorScales {
            length,
            bending: 1.0,
            affine: 0.0,
        };
        self.smooth[l].build(model, unit);
        let stride = self.smooth[l].stride;
        self.affine.clear();
        self.affine
            .extend((0..stride).map(|i| f64::from(i < model.len())));
        for k in 0..D {
            self.affine.extend(model.iter().map(|p| p[k]));
            self.affine.resize((k + 2) * stride, 0.0);
        }
        // Modes that the noise hides at the largest amplitude are hidden at all.
        let largest = AMPLITUDES[0] * length / LENGTHS[0];
        let count = self.smooth[l].rank_beside(noise / (largest * largest)) + D + 1;
        self.gram.resize(count * count, 0.0);
        self.weighted.resize(stride, 0.0);
        let Self {
            smooth: priors,
            affine,
            gram,
            moments,
            weighted,
            ..
        } = self;
        let smooth = &priors[l];
        let column = |p: usize| {
            let smooth_columns = count - D - 1;
            if p < smooth_columns {
                smooth.column(p)
            } else {
                &affine[(p - smooth_columns) * stride..][..stride]
            }
        };
        vectorised(
            #[inline(always)]
            || {
                columns::normal_equations(
                    column,
                    count,
                    request.weights,
                    &request.displacements.0,
                    weighted,
                    gram,
                    moments,
                );
            },
        );
        if self.mean.0[0].is_empty() {
            self.mean
                .0
                .iter_mut()
                .for_each(|axis| axis.resize(stride, 0.0));
            self.square.clear();
            self.square.resize(stride, 0.0);
        }
    }

    /// The energy of one amplitude; leaves the coefficients in `solution`.
    fn fit(&mut self, request: Request<'_, D>, bending: f64, affine: f64, noise: f64) -> f64 {
        let count = self.moments.len();
        let smooth = count - D - 1;
        let amplitude = |p: usize| if p < smooth { bending } else { affine };
        self.factor.clone_from(&self.gram);
        for p in 0..count {
            for q in 0..=p {
                self.factor[p * count + q] *= amplitude(p) * amplitude(q);
            }
            self.factor[p * count + p] += noise;
        }
        self.solution.clear();
        let scaled = self.moments.iter().enumerate();
        self.solution
            .extend(scaled.map(|(p, m)| m.map(|v| v * amplitude(p))));
        let Self {
            factor, solution, ..
        } = self;
        vectorised(
            #[inline(always)]
            || {
                columns::cholesky(factor, count);
                columns::solve(factor, count, solution);
            },
        );
        let explained: f64 = (0..count)
            .map(|p| {
                (0..D)
                    .map(|k| solution[p][k] * self.moments[p][k])
                    .sum::<f64>()
                    * amplitude(p)
            })
            .sum();
        let log_det: f64 = (0..count)
            .map(|p| 2.0 * factor[p * count + p].ln() - noise.ln())
            .sum();
        let squares: f64 = request
            .displacements
            .0
            .iter()
            .map(|z| {
                z.iter()
                    .zip(request.weights)
                    .map(|(z, w)| w * z * z)
                    .sum::<f64>()
            })
            .sum();
        0.5 * ((squares - explained) / noise + D as f64 * log_det)
    }

    fn fade(&mut self, factor: f64) {
        for axis in self.mean.0.iter_mut().chain([&mut self.square]) {
            axis.iter_mut().for_each(|v| *v *= factor);
        }
    }

    /// Adds the displacements of the present coefficients to the mean.
    fn add(&mut self, l: usize, bending: f64, affine: f64, weight: f64) {
        let stride = self.smooth[l].stride;
        let smooth = self.moments.len() - D - 1;
        let Self {
            smooth: priors,
            affine: functions,
            solution,
            displacement,
            mean,
            square,
            ..
        } = self;
        let prior = &priors[l];
        let column = |p: usize| {
            if p < smooth {
                prior.column(p)
            } else {
                &functions[(p - smooth) * stride..][..stride]
            }
        };
        for (p, c) in solution.iter_mut().enumerate() {
            let amplitude = if p < smooth { bending } else { affine };
            *c = c.map(|c| c * amplitude);
        }
        vectorised(
            #[inline(always)]
            || {
                columns::combine(column, solution, &mut displacement.0, stride);
                for (sum, axis) in mean.0.iter_mut().zip(&displacement.0) {
                    for ((sum, square), u) in sum.iter_mut().zip(square.iter_mut()).zip(axis) {
                        *sum += weight * u;
                        *square += weight * u * u;
                    }
                }
            },
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};

    /// The energy from the low-rank factors is that of the dense covariance: `½ zᵀ(K + σ²W⁻¹)⁻¹z + ½ ln det(1 + K W/σ²)` an axis.
    #[test]
    fn the_evidence_is_that_of_the_dense_covariance() {
        const N: usize = 24; // a multiple of the padding
        let points: Vec<[f64; 2]> = (0..N)
            .map(|i| [(i % 5) as f64 * 0.5 - 1.0, (i / 5) as f64 * 0.4 - 0.8])
            .collect();
        let weights: Vec<f64> = (0..N).map(|i| 0.3 + 0.02 * i as f64).collect();
        let wanted = Axes([
            (0..N).map(|i| 0.1 * (0.7 * i as f64).sin()).collect(),
            (0..N).map(|i| 0.02 * (i % 4) as f64).collect::<Vec<f64>>(),
        ]);
        let request = Request {
            weights: &weights,
            displacements: &wanted,
        };
        let (bending, affine, noise) = (0.1, 0.5, 4e-4);
        let length = LENGTHS[1];
        let mut scales = ScaleAverage::default();
        scales.prepare(request, &points, 1, noise);
        let found = scales.fit(request, bending, affine, noise);

        let kernel = DMatrix::from_fn(N, N, |a, b| {
            let (p, q) = (points[a], points[b]);
            let square = (p[0] - q[0]).powi(2) + (p[1] - q[1]).powi(2);
            bending * bending * (-0.5 * square / (length * length)).exp()
                + affine * affine * (1.0 + p[0] * q[0] + p[1] * q[1])
        });
        let noises = DMatrix::from_diagonal(&DVector::from_fn(N, |i, _| noise / weights[i]));
        let covariance = kernel + noises;
        let factor = covariance.cholesky().expect("positive definite");
        let log_det: f64 = (0..N)
            .map(|i| 2.0 * factor.l()[(i, i)].ln() - (noise / weights[i]).ln())
            .sum();
        let square = |z: &[f64]| {
            let z = DVector::from_column_slice(z);
            z.dot(&factor.solve(&z))
        };
        let expected = 0.5 * (square(&wanted.0[0]) + square(&wanted.0[1])) + log_det;
        // The modes left out are a hundredth of the noise each.
        assert!(
            (found - expected).abs() < 0.02 * expected.abs(),
            "{found} {expected}"
        );
    }
}
