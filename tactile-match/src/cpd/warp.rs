//! The map a registration found, for any point of space.

use crate::frame::Frame;
use nalgebra::{Point, SMatrix, SVector};
use tactile_tps::Warp;

/// The map found by [`CoherentPointDrift`](super::CoherentPointDrift): in the frame of the registration
/// `y ↦ A y + b + Σ_k w_k exp(−|y − p_k|² / 2β²)`, with no Gaussians for rigid, similarity and affine motion, and `A = I`, `b = 0` for
/// non-rigid. It takes the model points to where the registration left them, and any other point along.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct DriftWarp<const D: usize> {
    pub(super) model: Frame<D>,
    pub(super) target: Frame<D>,
    pub(super) linear: SMatrix<f64, D, D>,
    pub(super) offset: SVector<f64, D>,
    pub(super) centres: Vec<SVector<f64, D>>,
    pub(super) weights: Vec<SVector<f64, D>>,
    pub(super) beta: f64,
}

impl<const D: usize> DriftWarp<D> {
    fn gaussian(&self, from_centre: &SVector<f64, D>) -> f64 {
        (-0.5 * from_centre.norm_squared() / (self.beta * self.beta)).exp()
    }
}

impl<const D: usize> Warp<f64, D> for DriftWarp<D> {
    fn apply(&self, point: &Point<f64, D>) -> Point<f64, D> {
        let y = self.model.inside(point);
        let mut image = self.linear * y + self.offset;
        for (centre, weight) in self.centres.iter().zip(&self.weights) {
            image += weight * self.gaussian(&(y - centre));
        }
        self.target.leave(image)
    }

    fn jacobian(&self, point: &Point<f64, D>) -> SMatrix<f64, D, D> {
        let y = self.model.inside(point);
        let mut jacobian = self.linear;
        for (centre, weight) in self.centres.iter().zip(&self.weights) {
            let step = y - centre;
            jacobian -=
                weight * step.transpose() * (self.gaussian(&step) / (self.beta * self.beta));
        }
        jacobian * (self.target.scale / self.model.scale)
    }
}
