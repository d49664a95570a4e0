//! The warp of an answer: the thin-plate spline through the estimated positions.

use super::blocks::Blocks;
use super::frame::Frame;
use super::large::LARGE;
use crate::frame::{centre_and_radius, widened};
use crate::hard::{self, Interpolation};
use nalgebra::{Point, SMatrix};
use std::sync::{Arc, OnceLock};
use tactile_tps::{Scalar, Smoothing, TpsError, Warp};

/// Points that the spline of a large set goes through: a system of so many is solved in a tenth of a second, and between them a field as
/// smooth as the prior's differs from it by less than its residuals.
const SAMPLE: usize = 1500;

/// Least distance of two points, in radii of the model, from which on a spline surely goes through all positions: the condition of its
/// system grows with the square of the distance's inverse at most (Narcowich & Ward, J. Approx. Theory 69, 1992), to 10⁷ for some hundred points.
const APART: f64 = 0.01;

/// Radii in which nothing over- or underflows, whatever the type of the points.
const ORDINARY: std::ops::Range<f64> = 1e-12..1e12;

/// A model's interpolating spline: through all points, or through a well-spread sample of a large set. Its system is factorised when a warp first
/// needs it, and once for all targets.
#[derive(Clone, Debug)]
pub(super) struct ModelSpline<const D: usize> {
    sources: Arc<Sources<D>>,
}

#[derive(Debug)]
struct Sources<const D: usize> {
    points: Vec<Point<f64, D>>,
    /// Their rows in the model; empty for all.
    rows: Vec<usize>,
    /// Whether a spline goes through any positions.
    apart: bool,
    system: OnceLock<Interpolation<D>>,
}

impl<const D: usize> Sources<D> {
    fn system(&self) -> &Interpolation<D> {
        self.system
            .get_or_init(|| Interpolation::new(&self.points, None, Smoothing::None))
    }
}

impl<const D: usize> ModelSpline<D> {
    pub(super) fn new(model: &[Point<f64, D>]) -> Self {
        let mut rows = Vec::new();
        if model.len() >= LARGE {
            let frame = Frame::new(model, model);
            let inside: Vec<[f64; D]> = model.iter().map(|p| frame.model(p)).collect();
            let mut blocks = Blocks::default();
            blocks.build(&inside);
            let step = model.len() / SAMPLE;
            rows.extend(blocks.order.iter().step_by(step));
        }
        let points = if rows.is_empty() {
            model.to_vec()
        } else {
            rows.iter().map(|&i| model[i]).collect()
        };
        Self {
            sources: Arc::new(Sources {
                apart: are_apart(&points),
                points,
                rows,
                system: OnceLock::new(),
            }),
        }
    }

    /// The spline that takes the model, or its sample, to `warped`. Where none goes through these positions a smoothed one, and `warped`, unless
    /// that is of a sample, becomes what it gives.
    pub(super) fn through(
        &self,
        warped: &mut [Point<f64, D>],
    ) -> Box<dyn Warp<f64, D> + Send + Sync> {
        let Sources { rows, apart, .. } = &*self.sources;
        let mut images = if rows.is_empty() {
            warped.to_vec()
        } else {
            rows.iter().map(|&i| warped[i]).collect()
        };
        if *apart && ORDINARY.contains(&centre_and_radius(&images).1) {
            return Box::new(Lazy {
                sources: Arc::clone(&self.sources),
                images,
                spline: OnceLock::new(),
            });
        }
        let warp = warp_through(&self.sources, &mut images);
        if rows.is_empty() {
            warped.copy_from_slice(&images);
        }
        warp
    }
}

/// A spline that is fitted when it is first asked for: who wants the pairs alone does not wait for it.
#[derive(Debug)]
struct Lazy<const D: usize> {
    sources: Arc<Sources<D>>,
    images: Vec<Point<f64, D>>,
    spline: OnceLock<Fitted<D>>,
}

struct Fitted<const D: usize>(Box<dyn Warp<f64, D> + Send + Sync>);

impl<const D: usize> std::fmt::Debug for Fitted<D> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Fitted").finish_non_exhaustive()
    }
}

impl<const D: usize> Lazy<D> {
    fn spline(&self) -> &dyn Warp<f64, D> {
        let fit = || Fitted(warp_through(&self.sources, &mut self.images.clone()));
        &*self.spline.get_or_init(fit).0
    }
}

impl<const D: usize> Warp<f64, D> for Lazy<D> {
    fn apply(&self, point: &Point<f64, D>) -> Point<f64, D> {
        self.spline().apply(point)
    }

    fn jacobian(&self, point: &Point<f64, D>) -> SMatrix<f64, D, D> {
        self.spline().jacobian(point)
    }

    fn apply_into(
        &self,
        points: &[Point<f64, D>],
        images: &mut [Point<f64, D>],
    ) -> Result<(), TpsError> {
        self.spline().apply_into(points, images)
    }

    fn jacobian_into(
        &self,
        points: &[Point<f64, D>],
        jacobians: &mut [SMatrix<f64, D, D>],
    ) -> Result<(), TpsError> {
        self.spline().jacobian_into(points, jacobians)
    }
}

/// Whether all points are so far from each other, and their set of such a size, that a spline goes through any positions.
fn are_apart<const D: usize>(points: &[Point<f64, D>]) -> bool {
    let (centre, radius) = centre_and_radius(points);
    if !ORDINARY.contains(&radius) {
        return false;
    }
    let inside = |p: &Point<f64, D>| (widened(p) - centre) / radius;
    let mut sorted: Vec<_> = points.iter().map(inside).collect();
    // Only neighbours along the first axis can be near.
    sorted.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]));
    sorted.iter().enumerate().all(|(i, p)| {
        let near = sorted[i + 1..].iter();
        near.take_while(|q| q[0] - p[0] < APART)
            .all(|q| (q - p).norm() >= APART)
    })
}

/// Smoothing of the spline where none goes through all positions.
const SMOOTHING: f64 = 1e-6;

/// The interpolating spline through the estimated positions. Where there is none (model points that coincide and go different
/// ways) a smoothed one, and `warped` becomes what that gives.
fn warp_through<const D: usize>(
    sources: &Sources<D>,
    warped: &mut [Point<f64, D>],
) -> Box<dyn Warp<f64, D> + Send + Sync> {
    let model = &sources.points;
    let exact = sources.system().through(model, warped);
    if agrees(&*exact, model, warped) {
        return exact;
    }
    let warp = hard::spline(model, warped, None, Smoothing::Lambda(SMOOTHING));
    // As many points in as out.
    let _ = warp.apply_into(model, warped);
    warp
}

/// Whether a warp takes the model to these positions, to half the digits.
fn agrees<const D: usize>(
    warp: &(dyn Warp<f64, D> + Send + Sync),
    model: &[Point<f64, D>],
    warped: &[Point<f64, D>],
) -> bool {
    let size = warped
        .iter()
        .fold(0.0_f64, |size, p| size.max(p.coords.amax()));
    let tolerance = size * (f64::UNIT_ROUNDOFF.sqrt());
    // All at once: a spline samples points several at a time.
    let mut images = model.to_vec();
    warp.apply_into(model, &mut images).is_ok()
        && images
            .iter()
            .zip(warped)
            .all(|(image, w)| (image - w).amax() <= tolerance)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point2;

    fn lattice(step: f64) -> Vec<Point2<f64>> {
        let place = |i: usize| (i % 5) as f64 + 0.1 * ((i * i) as f64).sin();
        (0..25)
            .map(|i| Point2::new(place(i), (i / 5) as f64) * step)
            .collect()
    }

    #[test]
    fn nothing_is_factorised_before_the_warp_is_asked_and_then_once() {
        let model = lattice(1e-3);
        let spline = ModelSpline::new(&model);
        let mut warped: Vec<_> = model.iter().map(|p| p * 1.2).collect();
        let [one, other] = [0, 1].map(|_| spline.through(&mut warped));
        assert!(spline.sources.system.get().is_none());
        assert!((one.apply(&model[3]) - warped[3]).norm() < 1e-15);
        let system: *const _ = spline.sources.system();
        assert!((other.jacobian(&model[7])[(0, 0)] - 1.2).abs() < 1e-9);
        assert!(std::ptr::eq(system, spline.sources.system()));
    }

    #[test]
    fn points_that_nearly_coincide_or_sizes_out_of_all_range_are_fitted_at_once() {
        assert!(are_apart(&lattice(1.0)));
        let mut model = lattice(1.0);
        model.push(model[11] + nalgebra::Vector2::new(0.0, 0.01));
        assert!(!are_apart(&model));
        for step in [1e-200, 1e200] {
            assert!(!are_apart(&lattice(step)));
        }
        // The twins go different ways: the positions become those of a smoothed spline.
        let mut warped = model.clone();
        model[25] = model[11];
        warped[25].x += 0.5;
        let wanted = warped.clone();
        let warp = ModelSpline::new(&model).through(&mut warped);
        assert!((warped[25] - wanted[25]).norm() > 0.1);
        assert!((warp.apply(&model[25]) - warped[25]).norm() < 1e-9);
    }
}
