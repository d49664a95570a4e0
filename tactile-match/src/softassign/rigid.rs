//! Rigid motions and similarities in place of a warp that bends.
//!
//! The soft matches pull model point `xᵢ` with weight `wᵢ` to `zᵢ`; the motion of least `Σ wᵢ |s R xᵢ + b − zᵢ|²` is closed-form (Kabsch 1976;
//! Umeyama 1991). To first order in the noise σ² the image of the point at the offset `r` from the weighted centroid has the covariance
//! `σ² (1/W + [r]× Θ⁻¹ [r]×ᵀ)` with `W = Σ wᵢ` and the tensor of inertia `Θ = Σ wᵢ (|rᵢ|² 1 − rᵢ rᵢᵀ)`, and where the size is free
//! `σ² r rᵀ/Σ wᵢ|rᵢ|²` beside it.

use super::Transformation;
use super::axes::Axes;
use super::regression::Regression;
use nalgebra::{Matrix3, Point, SMatrix, SVector, Vector3};
use tactile_tps::Affine;

/// The fit, for a model that it keeps.
#[derive(Clone, Debug, Default)]
pub(crate) struct RigidFit<const D: usize> {
    transformation: Transformation,
    model: Vec<Point<f64, D>>,
    wanted: Vec<Point<f64, D>>,
}

impl<const D: usize> RigidFit<D> {
    /// Takes the model; idle where the warp may bend.
    pub(crate) fn set(&mut self, transformation: Transformation, model: &[[f64; D]]) {
        self.transformation = transformation;
        self.model.clear();
        if self.is_active() {
            self.model.extend(model.iter().map(|&p| Point::from(p)));
        }
    }

    pub(crate) fn is_active(&self) -> bool {
        self.transformation != Transformation::NonRigid
    }

    /// The displacements from `base` and their variances that the motion of least squares gives, into `regression`: `O(I)`.
    pub(crate) fn fit(
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
        let total: f64 = weights.iter().sum();
        let centre = |points: &[Point<f64, D>]| -> SVector<f64, D> {
            let rows = points.iter().zip(weights);
            rows.map(|(p, w)| p.coords * (w / total)).sum()
        };
        let fit = Affine::fit_rigid(&self.model, &self.wanted, Some(weights));
        // Nothing matched, or nothing finite: the model stays where it is.
        let Some(rotation) = fit.ok().filter(|_| total > 0.0).map(|fit| fit.linear) else {
            regression.set(displacements.0[0].len(), |_| ([0.0; D], 0.0));
            return;
        };
        let (from, to) = (centre(&self.model), centre(&self.wanted));
        let (mut along, mut extent) = (0.0, 0.0);
        let mut inertia = Matrix3::zeros();
        for ((p, z), w) in self.model.iter().zip(&self.wanted).zip(weights) {
            let r = p.coords - from;
            along += w * (z.coords - to).dot(&(rotation * r));
            extent += w * r.norm_squared();
            let r = in_space(&r);
            inertia += (Matrix3::identity() * r.norm_squared() - r * r.transpose()) * *w;
        }
        let scaled = self.transformation == Transformation::Similarity && extent > 0.0;
        let linear: SMatrix<f64, D, D> = rotation * if scaled { along / extent } else { 1.0 };
        let turning = rotations_covariance::<D>(&inertia);
        let model = &self.model;
        regression.set(displacements.0[0].len(), |i| {
            let Some(p) = model.get(i) else {
                return ([0.0; D], 0.0);
            };
            let r = p.coords - from;
            let image = linear * r + to;
            let arm = in_space(&r).cross_matrix();
            let turned = (arm * turning * arm.transpose()).trace();
            let grown = if scaled {
                r.norm_squared() / extent
            } else {
                0.0
            };
            let variance = noise * (1.0 / total + (turned + grown) / D as f64);
            (std::array::from_fn(|k| image[k] - base[i][k]), variance)
        });
    }
}

/// The vector with zeros for the dimensions that it lacks.
fn in_space<const D: usize>(v: &SVector<f64, D>) -> Vector3<f64> {
    Vector3::from_fn(|k, _| if k < D { v[k] } else { 0.0 })
}

/// Covariance of the rotation vector at unit noise: the inverse of the inertia, in the plane about its normal alone; zero where the points
/// lie on one line, about which no rotation is determined.
fn rotations_covariance<const D: usize>(inertia: &Matrix3<f64>) -> Matrix3<f64> {
    if D == 2 {
        let about = inertia[(2, 2)];
        let variance = if about > 0.0 { about.recip() } else { 0.0 };
        return Matrix3::from_diagonal(&Vector3::new(0.0, 0.0, variance));
    }
    inertia.try_inverse().unwrap_or_else(Matrix3::zeros)
}
