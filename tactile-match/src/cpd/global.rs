//! The M-step of rigid, similarity and affine motion.
//!
//! The posterior pulls model point `y_m` with weight `(P1)_m` to the mean `(P X)_m / (P1)_m`, so that the step is the weighted
//! fit to these means: Myronenko & Song (2010), figures 2 and 3.

use super::Motion;
use super::expectation::{Columns, Posterior};
use nalgebra::{Point, SMatrix, SVector};
use tactile_tps::Affine;

/// `y ↦ A y + b`, and the memory to find it.
#[derive(Clone, Debug)]
pub(super) struct GlobalStep<const D: usize> {
    pub(super) linear: SMatrix<f64, D, D>,
    pub(super) offset: SVector<f64, D>,
    sources: Vec<Point<f64, D>>,
    means: Vec<Point<f64, D>>,
    weights: Vec<f64>,
}

impl<const D: usize> Default for GlobalStep<D> {
    fn default() -> Self {
        let (sources, means, weights) = Default::default();
        Self {
            linear: SMatrix::identity(),
            offset: SVector::zeros(),
            sources,
            means,
            weights,
        }
    }
}

impl<const D: usize> GlobalStep<D> {
    /// Back to the identity.
    pub(super) fn reset(&mut self) {
        (self.linear, self.offset) = (SMatrix::identity(), SVector::zeros());
    }

    /// Fits `motion` and moves `model` into `moved`; `O(M)`. A posterior without mass leaves the last motion.
    pub(super) fn solve(
        &mut self,
        motion: Motion,
        posterior: &Posterior<D>,
        model: &Columns<D>,
        moved: &mut Columns<D>,
    ) {
        self.collect(posterior, model);
        match motion {
            Motion::Rigid => self.fit_rigid(false),
            Motion::Similarity => self.fit_rigid(true),
            _ => {
                if let Ok(fit) = Affine::fit(&self.sources, &self.means, Some(&self.weights)) {
                    (self.linear, self.offset) = (fit.linear, fit.offset);
                }
            }
        }
        for m in 0..model[0].len() {
            let image = self.linear * SVector::from_fn(|d, _| model[d][m]) + self.offset;
            (0..D).for_each(|d| moved[d][m] = image[d]);
        }
    }

    fn collect(&mut self, posterior: &Posterior<D>, model: &Columns<D>) {
        self.sources.clear();
        self.means.clear();
        self.weights.clear();
        for (m, &mass) in posterior
            .model_mass
            .iter()
            .enumerate()
            .filter(|(_, mass)| **mass > f64::MIN_POSITIVE)
        {
            self.sources
                .push(Point::from(SVector::from_fn(|d, _| model[d][m])));
            self.means.push(Point::from(SVector::from_fn(|d, _| {
                posterior.weighted[d][m] / mass
            })));
            self.weights.push(mass);
        }
    }

    fn fit_rigid(&mut self, scaled: bool) {
        let Ok(fit) = Affine::fit_rigid(&self.sources, &self.means, Some(&self.weights)) else {
            return;
        };
        let scale = if scaled { self.scale(&fit.linear) } else { 1.0 };
        let (source, mean) = (
            self.weighted_mean(&self.sources),
            self.weighted_mean(&self.means),
        );
        self.linear = fit.linear * scale;
        self.offset = mean - self.linear * source;
    }

    /// `tr(Aᵀ R) / tr(Yᵀ diag(P1) Y)` about the weighted means; one where the model has no extent.
    fn scale(&self, rotation: &SMatrix<f64, D, D>) -> f64 {
        let (source, mean) = (
            self.weighted_mean(&self.sources),
            self.weighted_mean(&self.means),
        );
        let (mut along, mut extent) = (0.0, 0.0);
        for ((y, x), w) in self.sources.iter().zip(&self.means).zip(&self.weights) {
            let y = y.coords - source;
            along += w * (x.coords - mean).dot(&(rotation * y));
            extent += w * y.norm_squared();
        }
        if extent > 0.0 { along / extent } else { 1.0 }
    }

    fn weighted_mean(&self, points: &[Point<f64, D>]) -> SVector<f64, D> {
        let total: f64 = self.weights.iter().sum();
        points
            .iter()
            .zip(&self.weights)
            .map(|(p, w)| p.coords * (w / total))
            .sum()
    }
}
