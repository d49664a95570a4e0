//! The warp that the soft matches ask for: weighted regression under the prior.
//!
//! With targets `zᵢ`, weights `wᵢ` and noise variance σ², the displacement is `u = L c`,
//! `(Lᵀ W L + σ² 1) c = Lᵀ W z`; its variance at point i is `σ² Lᵢ (Lᵀ W L + σ² 1)⁻¹ Lᵢᵀ`.

use super::prior::Prior;
use pulp::Arch;

/// Memory and answer of a regression.
#[derive(Clone, Debug, Default)]
pub(crate) struct Regression<const D: usize> {
    gram: Vec<f64>,
    solution: Vec<[f64; D]>,
    scratch: Vec<f64>,
    noise: f64,
    rank: usize,
    /// `ln det(1 + LᵀWL/σ²)`.
    pub(crate) log_det: f64,
}

impl<const D: usize> Regression<D> {
    /// Fits `targets` (displacements) with `weights` at noise variance `noise`: `O(I r² + r³)`.
    pub(crate) fn fit(&mut self, prior: &Prior, weights: &[f64], targets: &[[f64; D]], noise: f64) {
        let r = prior.rank;
        (self.rank, self.noise) = (r, noise);
        self.gram.clear();
        self.gram.resize(r * r, 0.0);
        self.solution.clear();
        self.solution.resize(r, [0.0; D]);
        Arch::new().dispatch(|| {
            accumulate(&mut self.gram, &mut self.solution, prior, weights, targets);
            (0..r).for_each(|p| self.gram[p * r + p] += noise);
            cholesky(&mut self.gram, r);
        });
        self.log_det = (0..r).map(|p| 2.0 * self.gram[p * r + p].ln() - noise.ln()).sum();
        solve(&self.gram, r, &mut self.solution);
    }

    /// Displacement at model point `i`.
    pub(crate) fn displacement(&self, prior: &Prior, i: usize) -> [f64; D] {
        let mut u = [0.0; D];
        for (l, c) in prior.row(i).iter().zip(&self.solution) {
            (0..D).for_each(|k| u[k] += l * c[k]);
        }
        u
    }

    /// Variance of the displacement at model point `i` along one axis.
    pub(crate) fn variance(&mut self, prior: &Prior, i: usize) -> f64 {
        let r = self.rank;
        self.scratch.clear();
        self.scratch.extend_from_slice(prior.row(i));
        let mut sum = 0.0;
        for p in 0..r {
            let (head, tail) = self.scratch.split_at_mut(p);
            let dot: f64 = self.gram[p * r..p * r + p].iter().zip(&*head).map(|(a, b)| a * b).sum();
            tail[0] = (tail[0] - dot) / self.gram[p * r + p];
            sum += tail[0] * tail[0];
        }
        self.noise * sum
    }

    /// `Σ |c|²`, twice the prior's energy of the warp.
    pub(crate) fn penalty(&self) -> f64 {
        self.solution.iter().flatten().map(|c| c * c).sum()
    }
}

/// Lower triangle of `LᵀWL` and `LᵀWz`.
#[inline(always)]
fn accumulate<const D: usize>(
    gram: &mut [f64],
    rhs: &mut [[f64; D]],
    prior: &Prior,
    weights: &[f64],
    targets: &[[f64; D]],
) {
    let r = prior.rank;
    for ((row, &weight), target) in prior.factor.chunks_exact(r.max(1)).zip(weights).zip(targets) {
        if weight <= 0.0 {
            continue;
        }
        for p in 0..r {
            let f = weight * row[p];
            gram[p * r..=p * r + p].iter_mut().zip(row).for_each(|(g, l)| *g += f * l);
            (0..D).for_each(|k| rhs[p][k] += f * target[k]);
        }
    }
}

/// Cholesky factor in place of the lower triangle. The diagonal carries σ², so that pivots stay positive; rounding is
/// caught by a floor.
#[inline(always)]
fn cholesky(a: &mut [f64], n: usize) {
    for i in 0..n {
        let (above, current) = a.split_at_mut(i * n);
        for j in 0..=i {
            let mut sum = current[j];
            if j < i {
                let other = &above[j * n..j * n + j];
                sum -= other.iter().zip(&current[..j]).map(|(x, y)| x * y).sum::<f64>();
                current[j] = sum / above[j * n + j];
            } else {
                sum -= current[..j].iter().map(|x| x * x).sum::<f64>();
                current[j] = sum.max(f64::MIN_POSITIVE).sqrt();
            }
        }
    }
}

fn solve<const D: usize>(factor: &[f64], n: usize, b: &mut [[f64; D]]) {
    for i in 0..n {
        for k in 0..i {
            let (f, earlier) = (factor[i * n + k], b[k]);
            (0..D).for_each(|d| b[i][d] -= f * earlier[d]);
        }
        (0..D).for_each(|d| b[i][d] /= factor[i * n + i]);
    }
    for i in (0..n).rev() {
        (0..D).for_each(|d| b[i][d] /= factor[i * n + i]);
        let done = b[i];
        for k in 0..i {
            let f = factor[i * n + k];
            (0..D).for_each(|d| b[k][d] -= f * done[d]);
        }
    }
}
