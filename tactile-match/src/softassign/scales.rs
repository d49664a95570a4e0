//! The average over the scales of the prior, weighted by their evidence.

use super::run::Run;
use crate::Watch;
use crate::gaussian_process::{Axes, Prior, PriorScales, Request};
use crate::kernels::{cholesky, combine, normal_equations, solve};
use std::ops::ControlFlow;
use tactile_core::vectorised;

// The average over the scales of the prior, weighted by their evidence.
//
// With the soft matches fixed (weights `wᵢ`, targets `zᵢ`, noise σ²) the model is linear,
// `z = A c + noise`, with `A = [τ Lₛ, τₐ X]`: the factor of the unit Gaussian kernel of length ℓ,
// and the affine functions. For each ℓ the factor and the Gram matrix `G = [Lₛ X]ᵀ W [Lₛ X]` are
// computed once; each amplitude τ then costs one Cholesky factorisation of `D G D + σ² 1`, where
// `D` is the diagonal of amplitudes. The evidence is
//
// `−ln p = (Σ wᵢ|zᵢ|² − cᵀ D b)/2σ² + (d/2) ln det(1 + D G D/σ²)`, `b = [Lₛ X]ᵀ W z`.

/// Correlation lengths ℓ of the warp, in radii of the model, and amplitudes τ at the first of them.
/// The ratios are √2 and 2, which the evidence of a hundred points just resolves.
const LENGTHS: [f64; 4] = [1.2, 1.7, 2.4, 3.4];
const AMPLITUDES: [f64; 5] = [0.35, 0.2, 0.1, 0.05, 0.025];

/// Working memory of the average.
#[derive(Clone, Debug, Default)]
pub(super) struct ScaleAverage<const D: usize> {
    /// The smooth part of the prior for each length.
    smooth: [Prior; LENGTHS.len()],
    /// The energy of each scale in the last average.
    energies: Vec<f64>,
    /// The affine functions 1, x, y, …, column by column.
    affine: Vec<f64>,
    gram: Vec<f64>,
    factor: Vec<f64>,
    moments: Vec<[f64; D]>,
    solution: Vec<[f64; D]>,
    weighted: Vec<f64>,
    displacement: Axes<D>,
    /// Sums over all scales, weighted by evidence relative to the lowest energy: of the
    /// displacements, of their squares and of the weights.
    mean: Axes<D>,
    square: Vec<f64>,
    total: f64,
    least: f64,
    /// Variance of the displacements between the scales, along one axis.
    pub spread: Vec<f64>,
}

impl<const D: usize> ScaleAverage<D> {
    /// Replaces `state.warped` by the mean over all scales of the warps fitted to the soft matches,
    /// each weighted by its evidence. Returns the scales of highest evidence. `O(I r²)` for each
    /// length. If `likely`, only scales with some evidence in the last average are used.
    pub(super) fn average(
        &mut self,
        request: Request<'_, D>,
        model: &[[f64; D]],
        state: &mut Run<D>,
        (variance, affine): (f64, f64),
        likely: bool,
        watch: Watch<'_>,
    ) -> ControlFlow<(), PriorScales> {
        if !likely {
            self.energies.clear();
            self.energies.resize(LENGTHS.len() * AMPLITUDES.len(), 0.0);
        }
        // Scales whose log-evidence is this far below the best are skipped: together they weigh
        // less than a hundredth.
        let limit = self.energies.iter().copied().fold(f64::INFINITY, f64::min) + 8.0;
        let mut best = PriorScales::default();
        self.clear(model.len());
        for (l, length) in LENGTHS.into_iter().enumerate() {
            let scales = l * AMPLITUDES.len();
            let of_length = &self.energies[scales..scales + AMPLITUDES.len()];
            if of_length.iter().all(|&energy| energy > limit) {
                continue;
            }
            watch()?;
            self.prepare(request, model, l, variance);
            for (a, amplitude) in AMPLITUDES.into_iter().enumerate() {
                if self.energies[scales + a] > limit {
                    continue;
                }
                watch()?;
                let bending = amplitude * length / LENGTHS[0];
                let energy = self.fit(request, bending, affine, variance);
                self.energies[scales + a] = energy;
                if energy < self.least {
                    best = PriorScales {
                        length,
                        bending,
                        affine,
                    };
                }
                let weight = self.weigh(energy);
                // Smaller weights change the mean by less than a thousandth of the noise.
                if weight > 1e-4 {
                    self.add(l, bending, affine, weight);
                }
            }
        }
        self.place(state);
        ControlFlow::Continue(best)
    }

    /// Resets all sums.
    fn clear(&mut self, points: usize) {
        (self.total, self.least) = (0.0, f64::INFINITY);
        for axis in self.mean.0.iter_mut().chain([&mut self.square]) {
            axis.clear();
            axis.resize(points, 0.0);
        }
    }

    /// The weight of a scale by its energy. Earlier sums are rescaled to the lowest energy.
    fn weigh(&mut self, energy: f64) -> f64 {
        if energy < self.least {
            let fade = if self.least.is_finite() {
                (energy - self.least).exp()
            } else {
                0.0
            };
            self.total *= fade;
            for axis in self.mean.0.iter_mut().chain([&mut self.square]) {
                axis.iter_mut().for_each(|v| *v *= fade);
            }
            self.least = energy;
        }
        let weight = (self.least - energy).exp();
        self.total += weight;
        weight
    }

    /// Moves the points to the accumulated mean, and sets `spread`.
    fn place(&mut self, state: &mut Run<D>) {
        self.spread.clear();
        for (i, warped) in state.warped.iter_mut().enumerate() {
            let mut square = self.square[i] / self.total;
            for k in 0..D {
                let mean = self.mean.0[k][i] / self.total;
                warped[k] = state.base[i][k] + mean;
                square -= mean * mean;
            }
            self.spread.push((square / D as f64).max(0.0));
        }
    }

    /// Computes factor and Gram matrix of one length.
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
        // Modes hidden by the noise at the largest amplitude are hidden at all amplitudes.
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
        let column = |p: usize| column_of(&priors[l], affine, count - D - 1, p);
        vectorised(
            #[inline(always)]
            || {
                normal_equations(
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
    }

    /// The energy of one amplitude. The coefficients are stored in `solution`.
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
                cholesky(factor, count);
                solve(factor, count, solution);
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

    /// Adds the displacements of the current coefficients to the mean.
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
        let column = |p: usize| column_of(&priors[l], functions, smooth, p);
        for (p, c) in solution.iter_mut().enumerate() {
            let amplitude = if p < smooth { bending } else { affine };
            *c = c.map(|c| c * amplitude);
        }
        vectorised(
            #[inline(always)]
            || {
                combine(column, solution, &mut displacement.0, stride);
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

/// Column `p` of `[Lₛ X]`. The first `smooth` columns belong to the prior.
fn column_of<'a>(prior: &'a Prior, affine: &'a [f64], smooth: usize, p: usize) -> &'a [f64] {
    if p < smooth {
        prior.column(p)
    } else {
        &affine[(p - smooth) * prior.stride..][..prior.stride]
    }
}

#[cfg(test)]
mod tests;
