//! The warp of an answer: the thin-plate spline through the estimated positions.

use super::blocks::Blocks;
use super::frame::Frame;
use super::large::LARGE;
use crate::hard::{self, Interpolation};
use nalgebra::Point;
use tactile_tps::{Scalar, Smoothing, Warp};

/// Points that the spline of a large set goes through: a system of so many is solved in a tenth of a second, and between them a field as
/// smooth as the prior's differs from it by less than its residuals.
const SAMPLE: usize = 1500;

/// The factorised system of a model's interpolating spline: through all points, or through a well-spread sample of a large set.
#[derive(Clone, Debug)]
pub(super) struct ModelSpline<T: Scalar, const D: usize> {
    /// The rows of the sample; empty for all.
    rows: Vec<usize>,
    interpolation: Interpolation<T, D>,
}

impl<T: Scalar, const D: usize> ModelSpline<T, D> {
    pub(super) fn new(model: &[Point<T, D>]) -> Self {
        if model.len() < LARGE {
            return Self {
                rows: Vec::new(),
                interpolation: Interpolation::new(model, None, Smoothing::None),
            };
        }
        let frame = Frame::new(model, model);
        let inside: Vec<[f64; D]> = model.iter().map(|p| frame.model(p)).collect();
        let mut blocks = Blocks::default();
        blocks.build(&inside);
        let step = model.len() / SAMPLE;
        let rows: Vec<usize> = blocks.order.iter().step_by(step).copied().collect();
        let sources: Vec<_> = rows.iter().map(|&i| model[i]).collect();
        Self {
            rows,
            interpolation: Interpolation::new(&sources, None, Smoothing::None),
        }
    }

    /// The spline that takes the model, or its sample, to `warped`; see [`warp_through`].
    pub(super) fn through(
        &self,
        model: &[Point<T, D>],
        warped: &mut [Point<T, D>],
    ) -> Box<dyn Warp<T, D> + Send + Sync> {
        if self.rows.is_empty() {
            return warp_through(&self.interpolation, model, warped);
        }
        let sources: Vec<_> = self.rows.iter().map(|&i| model[i]).collect();
        let mut images: Vec<_> = self.rows.iter().map(|&i| warped[i]).collect();
        warp_through(&self.interpolation, &sources, &mut images)
    }
}

/// Smoothing of the spline where none goes through all positions.
const SMOOTHING: f64 = 1e-6;

/// The interpolating spline through the estimated positions. Where there is none (model points that coincide and go different
/// ways) a smoothed one, and `warped` becomes what that gives.
fn warp_through<T: Scalar, const D: usize>(
    interpolation: &Interpolation<T, D>,
    model: &[Point<T, D>],
    warped: &mut [Point<T, D>],
) -> Box<dyn Warp<T, D> + Send + Sync> {
    let exact = interpolation.through(model, warped);
    if agrees(&*exact, model, warped) {
        return exact;
    }
    let warp = hard::spline(
        model,
        warped,
        None,
        Smoothing::Lambda(nalgebra::convert(SMOOTHING)),
    );
    // As many points in as out.
    let _ = warp.apply_into(model, warped);
    warp
}

/// Whether a warp takes the model to these positions, to half the digits.
fn agrees<T: Scalar, const D: usize>(
    warp: &(dyn Warp<T, D> + Send + Sync),
    model: &[Point<T, D>],
    warped: &[Point<T, D>],
) -> bool {
    let size = warped
        .iter()
        .fold(T::zero(), |size, p| size.max(p.coords.amax()));
    let tolerance = size * nalgebra::convert(T::UNIT_ROUNDOFF.sqrt());
    // All at once: a spline samples points several at a time.
    let mut images = model.to_vec();
    warp.apply_into(model, &mut images).is_ok()
        && images
            .iter()
            .zip(warped)
            .all(|(image, w)| (image - w).amax() <= tolerance)
}
