//! What is matched: both point sets in the units of the matcher, and what the caller knows of them.

use super::options::Slack;
use super::run::{Cooling, Run, Schedule};
use super::{AnnealedSoftassign, Transformation, squared_distance};
use crate::frame::{FARTHEST, centre_and_radius, typical_spacing};
use crate::{MatchError, error};
use nalgebra::{Point, SVector};

/// Two sets to be matched. A search only reads it.
#[derive(Clone, Debug)]
pub(super) struct Problem<const D: usize> {
    pub options: AnnealedSoftassign,
    pub frame: Frame<D>,
    pub model: Vec<[f64; D]>,
    pub target: Vec<[f64; D]>,
    /// Volume of the bounding box of the bulk of the targets.
    pub volume: f64,
    /// Distance between neighbours of targets that fill this volume.
    pub mean_spacing: f64,
    /// Typical distance of a target to its nearest neighbour.
    pub spacing: f64,
    pub limits: Limits,
    /// Largest motion allowed.
    pub farthest: f64,
    /// Working memory: rows of a set, sorted by their coordinates.
    rows: Vec<usize>,
    /// Working memory: nearest-neighbour distances.
    distances: Vec<f64>,
}

/// Lengths that separate noise from the truncation error of the prior's factor.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Limits {
    /// Residuals up to this value are the truncation error: the data are clean.
    pub clean: f64,
    /// The lowest temperature of a run.
    pub least: f64,
    /// Resolution at which runs are compared.
    pub resolution: f64,
}

/// [`Limits::clean`] in radii of the model and in spacings, the smaller of which counts.
const CLEAN: [f64; 2] = [3e-3, 0.05];
/// [`Limits::least`]: partners a twentieth of a spacing apart are distinguished.
const LEAST: [f64; 2] = [1e-3, 1.0 / 60.0];
/// [`Limits::resolution`]. If it depended on the radius alone, a set of 20,000 points would be
/// compared at its spacing, where no answer is likelier than chance.
const RESOLUTION: [f64; 2] = [0.01, 0.2];

/// A set of this many points is dense: an exact answer need not be complete, and the motions of
/// blocks are tried first.
const DENSE: usize = 500;
/// If both sets have at least this many points, they are matched coarse to fine.
pub(super) const LARGE: usize = 4000;

/// Minimum log-likelihood gain per point over a uniform target distribution. Wrong basins have a
/// negative gain.
pub(super) const MIN_TELLING_GAIN: f64 = 0.2;

/// Number of targets whose nearest-neighbour distances determine the typical one.
pub(super) const SAMPLE: usize = 101;

impl Limits {
    fn of(spacing: f64) -> Self {
        let least = |[radii, spacings]: [f64; 2]| radii.min(spacings * spacing);
        Self {
            clean: least(CLEAN),
            least: least(LEAST),
            resolution: least(RESOLUTION),
        }
    }
}

impl<const D: usize> Default for Problem<D> {
    fn default() -> Self {
        Self {
            options: AnnealedSoftassign::default(),
            frame: Frame::default(),
            model: Vec::new(),
            target: Vec::new(),
            volume: 1.0,
            mean_spacing: 1.0,
            spacing: 1.0,
            limits: Limits::default(),
            farthest: f64::INFINITY,
            rows: Vec::new(),
            distances: Vec::new(),
        }
    }
}

impl<const D: usize> Problem<D> {
    /// Stores two sets and the options. Allocates nothing once the memory has grown.
    pub(super) fn take(
        &mut self,
        options: AnnealedSoftassign,
        model: &[Point<f64, D>],
        target: &[Point<f64, D>],
    ) -> Result<(), MatchError> {
        error::point_sets(model, target)?;
        if model.len().min(target.len()) >= LARGE {
            error::spread_out("model", model, &mut self.rows)?;
            error::spread_out("target", target, &mut self.rows)?;
        }
        let frame = Frame::new(model, target);
        (self.options, self.frame) = (options, frame);
        self.model.clear();
        self.model.extend(model.iter().map(|p| frame.model(p)));
        self.target.clear();
        self.target.extend(target.iter().map(|p| frame.target(p)));
        self.volume = bounding_volume(&self.target, frame.target_radius);
        self.mean_spacing = mean_spacing::<D>(self.volume, target.len());
        self.limits = Limits::of(mean_spacing::<D>(self.volume, self.smaller()));
        self.spacing = typical_spacing(&self.target, SAMPLE, &mut self.distances);
        self.farthest = options.largest_motion / frame.scale;
        Ok(())
    }

    /// Number of points of the smaller set.
    pub(super) fn smaller(&self) -> usize {
        self.model.len().min(self.target.len())
    }

    pub(super) fn is_dense(&self) -> bool {
        self.smaller() >= DENSE
    }

    /// Whether sets of these sizes are matched coarse to fine.
    pub(super) fn is_large(&self) -> bool {
        self.smaller() >= LARGE
    }

    /// Whether the warp may bend.
    pub(super) fn bends(&self) -> bool {
        self.options.transformation == Transformation::Smooth
    }

    /// Distance between neighbours of a model that fills its bounding box.
    pub(super) fn model_spacing(&self) -> f64 {
        mean_spacing::<D>(bounding_volume(&self.model, 1.0), self.model.len())
    }

    /// Expectation for points without a partner.
    pub(super) fn slack(&self) -> Slack {
        self.options.slack(self.volume)
    }

    /// The schedule of a run that cools like this.
    pub(super) fn schedule(&self, mut cooling: Cooling) -> Schedule {
        if !self.bends() {
            // A motion without bending can stall while it rotates into place.
            cooling.stuck = cooling.patience;
        }
        Schedule {
            cooling,
            floor: self.limits.least,
            limit: self.options.max_iterations,
            collapse: 0.0,
            partners: f64::INFINITY,
            slack: self.slack(),
        }
    }

    /// Log-likelihood gain, per point of the smaller set, of a run over points distributed
    /// uniformly in their bounding box. The prior of the warp is included. `None` if an exact first
    /// run was compared with nothing.
    pub(super) fn gain(&self, run: &Run<D>) -> Option<f64> {
        let strewn = self.target.len() as f64 * self.volume.ln();
        let gain = (strewn - run.energy) / self.smaller() as f64;
        run.energy.is_finite().then_some(gain)
    }

    /// Whether more than a tenth of the points moves farther than allowed.
    pub(super) fn is_far(&self, warped: &[[f64; D]]) -> bool {
        if self.farthest.is_infinite() {
            return false;
        }
        let still = self.frame.still();
        let rows = self.model.iter().zip(warped);
        let square = |(p, w): &(&[f64; D], &[f64; D])| {
            squared_distance(w, &std::array::from_fn(|k| p[k] + still[k]))
        };
        let far = rows.filter(|row| square(row) > self.farthest * self.farthest);
        10 * far.count() > self.model.len()
    }
}

/// Whether parts of one set are occluded or randomly scattered.
pub(super) fn are_unequal(model: usize, target: usize) -> bool {
    // If the smaller set has less than this fraction of the larger set's points, parts are occluded
    // or scattered. The edge of the smaller set then attracts the points behind it, and the match
    // can shift by one point. An answer is accepted without doubt only if its likelihood gain is
    // high. A smaller limit misses more of these shifts; a larger one costs noisy scenes further
    // starts (`--example confidence`).
    (model.min(target) as f64) < 0.95 * model.max(target) as f64
}

/// Distance between neighbours of `points` points that fill a volume.
fn mean_spacing<const D: usize>(volume: f64, points: usize) -> f64 {
    (volume / points as f64).powf(1.0 / D as f64)
}

/// Volume of the bounding box of the bulk of points of this radius. Thin sides count as a tenth of
/// the radius of the model.
fn bounding_volume<const D: usize>(points: &[[f64; D]], radius: f64) -> f64 {
    let limit = (BULK * radius).max(f64::MIN_POSITIVE);
    let side = |k: usize| {
        let bulk = points.iter().filter(|p| p.iter().all(|c| c.abs() <= limit));
        let (low, high) = bulk.fold((f64::MAX, f64::MIN), |(l, h), p| (l.min(p[k]), h.max(p[k])));
        (high - low).max(0.1)
    };
    (0..D).map(side).product()
}

/// The centroids and the unit of length inside the matcher.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame<const D: usize> {
    model: SVector<f64, D>,
    target: SVector<f64, D>,
    pub scale: f64,
    /// Radius of the target, relative to the scale.
    target_radius: f64,
}

impl<const D: usize> Default for Frame<D> {
    fn default() -> Self {
        Self {
            model: SVector::zeros(),
            target: SVector::zeros(),
            scale: 1.0,
            target_radius: 1.0,
        }
    }
}

impl<const D: usize> Frame<D> {
    /// The frame of two sets. For a model without extent the radius of `target` is used, or 1 if
    /// the target has no extent either.
    pub(super) fn new(model: &[Point<f64, D>], target: &[Point<f64, D>]) -> Self {
        let sets = [model, target].map(bulk);
        // A radius below the rounding of the coordinates is noise: such a set counts as one point.
        let extended = |(centre, radius): &(SVector<f64, D>, f64)| {
            *radius > 8.0 * f64::EPSILON * centre.amax()
        };
        let scale = sets
            .iter()
            .find(|set| extended(set))
            .map_or(1.0, |set| set.1);
        Self {
            model: sets[0].0,
            target: sets[1].0,
            scale,
            target_radius: sets[1].1 / scale,
        }
    }

    /// Offset from a model point in the frame to its position among the targets without motion.
    pub(super) fn still(&self) -> [f64; D] {
        self.inward(self.model - self.target)
    }

    /// Converts a model point into the frame.
    pub(super) fn model(&self, point: &Point<f64, D>) -> [f64; D] {
        self.inward(point.coords - self.model)
    }

    /// Converts a target point into the frame.
    pub(super) fn target(&self, point: &Point<f64, D>) -> [f64; D] {
        self.inward(point.coords - self.target)
    }

    fn inward(&self, offset: SVector<f64, D>) -> [f64; D] {
        std::array::from_fn(|k| (offset[k] / self.scale).clamp(-FARTHEST, FARTHEST))
    }

    /// Converts a warped point, given among the targets, into the units of the caller.
    pub(super) fn outward(&self, point: &[f64; D]) -> Point<f64, D> {
        Point::from(std::array::from_fn(|k| {
            point[k] * self.scale + self.target[k]
        }))
    }
}

/// Points farther from the centre than this multiple of the median do not belong to the bulk of a
/// set. Points that fill a ball, a box or their surfaces have no such outliers.
const BULK: f64 = 6.0;

/// Centroid and root mean square radius of the bulk of a set, so that a point at a thousand times
/// the size of the others does not change them.
fn bulk<const D: usize>(points: &[Point<f64, D>]) -> (SVector<f64, D>, f64) {
    let (mut centre, mut radius) = centre_and_radius(points);
    let mut kept: Vec<Point<f64, D>> = Vec::new();
    // Several rounds, because the farthest outliers hide nearer ones.
    for _ in 0..4 {
        let within = |p: &&Point<f64, D>, limit: f64| (p.coords - centre).norm() <= limit;
        // Half of the points lie farther than the median.
        let limit = BULK * radius / 4.0;
        let near = points.iter().filter(|p| within(p, limit / BULK)).count();
        if !(radius.is_finite() && 2 * near > points.len()) {
            break; // the bulk reaches farther than a quarter of the radius
        }
        kept.clear();
        kept.extend(points.iter().filter(|p| within(p, limit)));
        (centre, radius) = centre_and_radius(&kept);
    }
    (centre, radius)
}
