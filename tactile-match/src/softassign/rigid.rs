//! Rigid motions, similarities and affine maps in place of a smooth warp.

use super::{Transformation, in_space};
use crate::frame::FARTHEST;
use crate::gaussian_process::{Axes, Regression};
use nalgebra::{Matrix3, Point, SMatrix, SVector, SymmetricEigen, Vector3};
use tactile_tps::{Affine, Warp};

// Rigid motions and similarities in place of a smooth warp.
//
// The soft matches pull model point `xᵢ` with weight `wᵢ` to `zᵢ`. The motion that minimises `Σ wᵢ
// |s R xᵢ + b − zᵢ|²` has a closed form ([`BestMotion`]). To first order in the noise σ², the image
// of the point at the offset `r` from the weighted centroid has the covariance `σ² (1/W + [r]× Θ⁻¹
// [r]×ᵀ)`, with `W = Σ wᵢ` and the tensor of inertia `Θ = Σ wᵢ (|rᵢ|² 1 − rᵢ
// rᵢᵀ)`. If the size is free, `σ² r rᵀ/Σ wᵢ|rᵢ|²` is added.

/// The fit of one model.
#[derive(Clone, Debug, Default)]
pub(super) struct RigidFit<const D: usize> {
    transformation: Transformation,
    model: Vec<Point<f64, D>>,
    wanted: Vec<Point<f64, D>>,
}

impl<const D: usize> RigidFit<D> {
    /// Stores the model. Does nothing if the warp may bend.
    pub(super) fn set(&mut self, transformation: Transformation, model: &[[f64; D]]) {
        self.transformation = transformation;
        self.model.clear();
        if self.is_active() {
            self.model.extend(model.iter().map(|&p| Point::from(p)));
        }
    }

    pub(super) fn is_active(&self) -> bool {
        self.transformation != Transformation::Smooth
    }

    /// Writes the displacements from `base` under the least-squares motion, and their variances,
    /// into `regression`: `O(I)`.
    pub(super) fn fit(
        &mut self,
        weights: &[f64],
        base: &[[f64; D]],
        displacements: &Axes<D>,
        noise: f64,
        regression: &mut Regression<D>,
    ) {
        self.wanted.clear();
        self.wanted.extend(
            base.iter()
                .enumerate()
                .map(|(i, b)| Point::from(SVector::from_fn(|k, _| b[k] + displacements.0[k][i]))),
        );
        let weights = &weights[..base.len()];
        if self.transformation == Transformation::Affine {
            return self.fit_affine(weights, base, noise, displacements.0[0].len(), regression);
        }
        let scaled = self.transformation == Transformation::Similarity;
        // If nothing is matched, or nothing finite, the model does not move.
        let Some(fit) = BestMotion::of(&self.model, &self.wanted, weights, scaled) else {
            regression.set(displacements.0[0].len(), |_| ([0.0; D], 0.0));
            return;
        };
        let total: f64 = weights.iter().sum();
        let mut inertia = Matrix3::zeros();
        for (p, w) in self.model.iter().zip(weights) {
            let r = in_space(&(p.coords - fit.from));
            inertia += (Matrix3::identity() * r.norm_squared() - r * r.transpose()) * *w;
        }
        let turning = rotations_covariance::<D>(&inertia);
        let model = &self.model;
        regression.set(displacements.0[0].len(), |i| {
            let Some(p) = model.get(i) else {
                return ([0.0; D], 0.0);
            };
            let r = p.coords - fit.from;
            let image = fit.linear * r + fit.to;
            let arm = in_space(&r).cross_matrix();
            let turned = (arm * turning * arm.transpose()).trace().max(0.0);
            let grown = if scaled && fit.extent > 0.0 {
                r.norm_squared() / fit.extent
            } else {
                0.0
            };
            let variance = noise * (1.0 / total + (turned + grown) / D as f64);
            let variance = variance.min(FARTHEST); // hardly any point is matched
            (displacement(&image.into(), &base[i]), variance)
        });
    }
}

impl<const D: usize> RigidFit<D> {
    /// The least-squares affine map. An image at the offset `r` from the weighted centroid has the
    /// variance `σ² (1/W + rᵀ S⁻¹ r)` along each axis, with `S = Σ wᵢ rᵢ rᵢᵀ`.
    fn fit_affine(
        &self,
        weights: &[f64],
        base: &[[f64; D]],
        noise: f64,
        padded: usize,
        regression: &mut Regression<D>,
    ) {
        let total: f64 = weights.iter().sum();
        let fit = Affine::fit(&self.model, &self.wanted, Some(weights)).ok();
        let Some(fit) = fit.filter(|_| total > 0.0) else {
            regression.set(padded, |_| ([0.0; D], 0.0));
            return;
        };
        let rows = self.model.iter().zip(weights);
        let centre: SVector<f64, D> = rows.clone().map(|(p, w)| p.coords * (w / total)).sum();
        let mut scatter = SMatrix::<f64, D, D>::zeros();
        for (p, w) in rows {
            let r = p.coords - centre;
            scatter += r * r.transpose() * *w;
        }
        let inverse = scatter.try_inverse().unwrap_or_else(SMatrix::zeros);
        regression.set(padded, |i| {
            let Some(p) = self.model.get(i) else {
                return ([0.0; D], 0.0);
            };
            let image = fit.apply(p);
            let r = p.coords - centre;
            let variance = noise * (1.0 / total + r.dot(&(inverse * r)).max(0.0));
            (displacement(&image, &base[i]), variance.min(FARTHEST))
        });
    }
}

/// The weighted least-squares rigid motion or similarity `x ↦ A (x − from) + to` (Kabsch 1976;
/// Umeyama 1991).
struct BestMotion<const D: usize> {
    linear: SMatrix<f64, D, D>,
    from: SVector<f64, D>,
    to: SVector<f64, D>,
    /// `Σ wᵢ |xᵢ − from|²`.
    extent: f64,
}

impl<const D: usize> BestMotion<D> {
    /// Fits in `O(I)`. Returns `None` if all weights are zero or a number is not finite.
    fn of(
        sources: &[Point<f64, D>],
        images: &[Point<f64, D>],
        weights: &[f64],
        scaled: bool,
    ) -> Option<Self> {
        let total: f64 = weights.iter().sum();
        let fit = Affine::fit_rigid(sources, images, Some(weights)).ok();
        let rotation = fit.filter(|_| total > 0.0)?.linear;
        let mean = |points: &[Point<f64, D>]| -> SVector<f64, D> {
            let rows = points.iter().zip(weights);
            rows.map(|(p, w)| p.coords * (w / total)).sum()
        };
        let (from, to) = (mean(sources), mean(images));
        let (mut along, mut extent) = (0.0, 0.0);
        for ((x, y), w) in sources.iter().zip(images).zip(weights) {
            let arm = x.coords - from;
            along += w * (y.coords - to).dot(&(rotation * arm));
            extent += w * arm.norm_squared();
        }
        let grows = scaled && extent > 0.0;
        Some(Self {
            linear: rotation * if grows { along / extent } else { 1.0 },
            from,
            to,
            extent,
        })
    }
}

/// Displacement of a point to its image, limited because the image may be anywhere if hardly any
/// point is matched.
fn displacement<const D: usize>(image: &Point<f64, D>, base: &[f64; D]) -> [f64; D] {
    std::array::from_fn(|k| (image[k] - base[k]).clamp(-FARTHEST, FARTHEST))
}

/// Covariance of the rotation vector at unit noise: the inverse of the inertia (in the plane about
/// its normal only). Zero if the points lie on one line, because the rotation about it is
/// undetermined.
fn rotations_covariance<const D: usize>(inertia: &Matrix3<f64>) -> Matrix3<f64> {
    if D == 2 {
        let about = inertia[(2, 2)];
        let variance = if about > 0.0 { about.recip() } else { 0.0 };
        return Matrix3::from_diagonal(&Vector3::new(0.0, 0.0, variance));
    }
    let axes = SymmetricEigen::new(*inertia);
    // Moments below this fraction of the largest are rounding: the points lie on one line.
    let least = 1e-9 * axes.eigenvalues.max();
    let inverse = |moment: f64| if moment > least { moment.recip() } else { 0.0 };
    let turn = &axes.eigenvectors;
    turn * Matrix3::from_diagonal(&axes.eigenvalues.map(inverse)) * turn.transpose()
}
