//! The warp of a match: the thin-plate spline through the estimated positions.

use super::blocks::Blocks;
use super::problem::{Frame, LARGE};
use crate::frame::centre_and_radius;
use crate::interpolation::{Interpolation, follows, through};
use nalgebra::{Point, SMatrix};
use std::sync::{Arc, OnceLock};
use tactile_tps::{Smoothing, TpsError, Warp};

/// Minimum distance of two points, in radii of the model, above which a spline is certain to
/// interpolate all positions: the condition number of its system grows at most with the square of
/// the inverse distance (Narcowich & Ward, J. Approx. Theory 69, 1992), to 10⁷ for several hundred
/// points.
const APART: f64 = 0.01;
/// Points closer than this need an interpolating spline of weights of about the difference of their
/// displacements over the kernel at their distance. Up to this weight, in radii, 4,000 points are
/// interpolated to half the digits.
const MAX_WEIGHT: f64 = 1e3;
/// Maximum number of such pairs per point: with more, a part of the model nearly coincides.
const MAX_CLOSE_PAIRS: usize = 8;

/// Radii for which nothing overflows or underflows, whatever the type of the points.
const ORDINARY: std::ops::Range<f64> = 1e-12..1e12;

/// A model's interpolating spline, through all points or through a well-spread sample of a large
/// set. Its system is factorised once for all targets, when a warp first needs it.
#[derive(Clone, Debug)]
pub(super) struct ModelSpline<const D: usize> {
    sources: Arc<Sources<D>>,
}

#[derive(Debug)]
struct Sources<const D: usize> {
    points: Vec<Point<f64, D>>,
    /// Rows of the sources in the model. Empty if all points are used.
    rows: Vec<usize>,
    /// Pairs of points closer than [`APART`], in radii, and their squared distance. `None` for too
    /// many, or sizes out of range.
    close: Option<Vec<(f64, usize, usize)>>,
    /// Radius of the points.
    radius: f64,
    system: OnceLock<Interpolation<D>>,
}

impl<const D: usize> Sources<D> {
    fn system(&self) -> &Interpolation<D> {
        self.system
            .get_or_init(|| Interpolation::new(&self.points, None, Smoothing::None))
    }

    /// Whether a spline is certain to interpolate these positions.
    fn interpolates(&self, images: &[Point<f64, D>]) -> bool {
        let radius = centre_and_radius(images).1;
        let Some(close) = self.close.as_ref().filter(|_| ORDINARY.contains(&radius)) else {
            return false;
        };
        close.iter().all(|&(square, i, k)| {
            let [before, after] = [
                (self.points[i] - self.points[k]) / self.radius,
                (images[i] - images[k]) / radius,
            ];
            let kernel = match D {
                2 => -0.5 * square * square.ln(),
                _ => square.sqrt(),
            };
            (after - before).norm() <= MAX_WEIGHT * kernel
        })
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
            // Number of points of a large set that the spline interpolates. The system of this size
            // is solved in a tenth of a second, and between the points the spline differs from a
            // field as smooth as the prior by less than the residuals.
            let step = model.len() / 1500;
            rows.extend(blocks.order.iter().step_by(step));
        }
        let points = if rows.is_empty() {
            model.to_vec()
        } else {
            rows.iter().map(|&i| model[i]).collect()
        };
        Self {
            sources: Arc::new(Sources {
                close: close_pairs(&points),
                radius: centre_and_radius(&points).1,
                points,
                rows,
                system: OnceLock::new(),
            }),
        }
    }

    /// The spline that maps the model, or its sample, to `warped`. If no spline interpolates these
    /// positions, a smoothed one takes its place; `warped` then becomes its values, unless it
    /// belongs to a sample.
    pub(super) fn through(&self, warped: &mut [Point<f64, D>]) -> Box<dyn Warp<D> + Send + Sync> {
        let rows = &self.sources.rows;
        let mut images = if rows.is_empty() {
            warped.to_vec()
        } else {
            rows.iter().map(|&i| warped[i]).collect()
        };
        if self.sources.interpolates(&images) {
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

/// A spline that is fitted on first use, so that callers who need only the pairs do not wait for
/// it.
struct Lazy<const D: usize> {
    sources: Arc<Sources<D>>,
    images: Vec<Point<f64, D>>,
    spline: OnceLock<Box<dyn Warp<D> + Send + Sync>>,
}

impl<const D: usize> Lazy<D> {
    fn spline(&self) -> &dyn Warp<D> {
        let fit = || warp_through(&self.sources, &mut self.images.clone());
        &**self.spline.get_or_init(fit)
    }
}

impl<const D: usize> Warp<D> for Lazy<D> {
    fn apply(&self, point: &Point<f64, D>) -> Point<f64, D> {
        self.spline().apply(point)
    }

    fn jacobian(&self, point: &Point<f64, D>) -> SMatrix<f64, D, D> {
        self.spline().jacobian(point)
    }

    fn rank(&self) -> usize {
        self.spline().rank()
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

/// The pairs of points closer than [`APART`] radii, with their squared distance in radii. `None` for
/// too many of them, or if the size of the set is out of range.
fn close_pairs<const D: usize>(points: &[Point<f64, D>]) -> Option<Vec<(f64, usize, usize)>> {
    let (centre, radius) = centre_and_radius(points);
    if !ORDINARY.contains(&radius) {
        return None;
    }
    let inside = |(i, p): (usize, &Point<f64, D>)| (i, (p.coords - centre) / radius);
    let mut sorted: Vec<_> = points.iter().enumerate().map(inside).collect();
    // Only neighbours along the first axis can be close.
    sorted.sort_unstable_by(|a, b| a.1[0].total_cmp(&b.1[0]));
    let mut close = Vec::new();
    for (at, (i, p)) in sorted.iter().enumerate() {
        let near = sorted[at + 1..].iter();
        let near = near.take_while(|(_, q)| q[0] - p[0] < APART);
        let squares = near.map(|(k, q)| ((q - p).norm_squared(), *i, *k));
        close.extend(squares.filter(|&(square, ..)| square < APART * APART));
        if close.len() > MAX_CLOSE_PAIRS * points.len() {
            return None;
        }
    }
    Some(close)
}

/// The interpolating spline through the estimated positions. If there is none (coincident model
/// points with different displacements), the result is a smoothed spline, and `warped` becomes its
/// values.
fn warp_through<const D: usize>(
    sources: &Sources<D>,
    warped: &mut [Point<f64, D>],
) -> Box<dyn Warp<D> + Send + Sync> {
    let model = &sources.points;
    let exact = sources.system().through(model, warped);
    // Accurate to half the digits.
    if follows(&*exact, model, warped, (0.5 * f64::EPSILON).sqrt()) {
        return exact;
    }
    // Smoothing of the spline if none interpolates all positions.
    let (warp, places) = through(model, model, warped, Smoothing::Lambda(1e-6));
    warped.copy_from_slice(&places);
    warp
}

#[cfg(test)]
mod tests;
