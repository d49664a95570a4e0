//! The map a registration found, for any point of space.

use crate::frame::Frame;
use nalgebra::{Point, SMatrix, SVector};
use tactile_tps::{Scalar, Warp};

/// The map found by [`CoherentPointDrift`](super::CoherentPointDrift): in the frame of the registration
/// `y ↦ A y + b + Σ_k w_k exp(−|y − p_k|² / 2β²)`, with no Gaussians for rigid, similarity and affine motion, and `A = I`, `b = 0` for
/// non-rigid. It takes the model points to where the registration left them, and any other point along.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_match::{CoherentPointDrift, DriftOptions, DriftWorkspace, Motion};
/// use tactile_tps::Warp;
/// let model: Vec<_> = (0..12).map(f64::from).map(|k| Point2::new(k % 4.0 + 0.2 * k.sin(), (k / 4.0).floor())).collect();
/// let stretch = |p: &Point2<f64>| Point2::new(1.1 * p.x + 0.5, p.y);
/// let target: Vec<_> = model.iter().map(stretch).collect();
/// let mut workspace = DriftWorkspace::new();
/// let options = DriftOptions::default().with_motion(Motion::Affine)?;
/// CoherentPointDrift::new(options).register_with(&mut workspace, &model, &target)?;
/// let (warp, elsewhere) = (workspace.warp(), Point2::new(7.0, -1.0)); // no point of the model
/// assert!((warp.apply(&elsewhere) - stretch(&elsewhere)).norm() < 1e-3);
/// assert!((warp.jacobian(&elsewhere).determinant() - 1.1_f64).abs() < 1e-3); // areas grow by a tenth
/// # Ok::<(), tactile_match::MatchError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct DriftWarp<const D: usize> {
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

impl<T: Scalar, const D: usize> Warp<T, D> for DriftWarp<D> {
    fn apply(&self, point: &Point<T, D>) -> Point<T, D> {
        let y = self.model.inside(point);
        let mut image = self.linear * y + self.offset;
        for (centre, weight) in self.centres.iter().zip(&self.weights) {
            image += weight * self.gaussian(&(y - centre));
        }
        self.target.leave(image)
    }

    fn jacobian(&self, point: &Point<T, D>) -> SMatrix<T, D, D> {
        let y = self.model.inside(point);
        let mut jacobian = self.linear;
        for (centre, weight) in self.centres.iter().zip(&self.weights) {
            let step = y - centre;
            jacobian -=
                weight * step.transpose() * (self.gaussian(&step) / (self.beta * self.beta));
        }
        (jacobian * (self.target.scale / self.model.scale)).map(nalgebra::convert)
    }
}
