#![doc = include_str!("../README.md")]
//!
//! # Methods
//! The default, [`AnnealedSoftassign`], alternates a soft assignment and a smooth warp while a
//! temperature falls. The warp has a Gaussian-process prior, and distances are taken from its
//! leave-one-out predictions. Relaxation labelling is one of the starts it tries where the first
//! does not settle the matter. The paper's own method, relaxation labelling (13)–(20) with a
//! thin-plate spline (21)–(24), is [`RelaxationLabelling`]:
//! `RelaxationLabelling::default().match_points(&model, &target)`.
//!
//! # Equations
//! Match matrix $M$ of I model points $y_i$ and J target points $t_j$, with slack. Numbers are the
//! paper's.
//!
//! - Rows and columns sum to one with their slack: $\sum_j M_{ij} = 1$ and $\sum_i M_{ij} = 1$.
//! - Soft assignment at the temperature $\sigma$: $M_{ij} \propto \exp(-|y_i - t_j|^2/2\sigma^2)$,
//!   made doubly stochastic. At most O(IJ) a sweep.
//! - Warp: the posterior mean of an affine field plus a smooth one,
//!   $\tau^2 \exp(-|x - x^{\prime}|^2/2\ell^2)$. $O(I r^2)$ with r near 30. The last one is the
//!   thin-plate spline through the estimated positions.
//! - Relaxation labelling (19), (20): $M_{ij} \leftarrow M_{ij} S_{ij}/\sum_k M_{ik} S_{ik}$ with
//!   the support $S_{ij} = \sum_a \sum_b M_{ab} \alpha \beta \gamma$ of neighbours a of i and b of
//!   j. Densely O(IJAB), over few candidates one product a link.
//!
//! Lengths are in any unit. Errors are [`MatchError`], not converging is a [`MatchReport`].
#![forbid(unsafe_code)]
// Several arrays share one index; zipping them all hides it.
#![allow(clippy::needless_range_loop)]

mod assignment;
#[cfg(test)]
#[allow(dead_code)] // shared with the tests of the public interface
#[path = "../tests/suite/common/mod.rs"]
mod common;
mod cpd;
mod error;
mod hard;
mod instances;
mod judgement;
pub mod labelling;
mod matching;
mod shape_context;
mod softassign;
mod transformation;

// The shared tests name the crate from outside.
#[cfg(test)]
extern crate self as tactile_match;

pub use assignment::{AssignmentWorkspace, linear_assignment};
pub use cpd::{CoherentPointDrift, DriftWorkspace, Normalization};
pub use error::MatchError;
pub use hard::{LinearAssignment, NearestNeighbour};
pub use judgement::{Doubt, Judgement};
pub use labelling::RelaxationLabelling;
use matching::unmatched_rows;
pub use matching::{MatchReport, MatchedPairs, Matching, PointMatcher, SoftMatches, WarmStart};
pub use nalgebra;
pub use shape_context::ShapeContexts;
#[cfg(feature = "ablation")]
pub use softassign::Mechanism;
pub use softassign::{
    AnnealedSoftassign, Outliers, Rotation, Search, SoftassignMatch, SoftassignWorkspace,
    Transformation,
};
pub use tactile_core::{CustomError, StopReason};
pub use transformation::FittedTransformation;

use ::nalgebra::{Point, SMatrix, SVector};
use tactile_tps::Affine;

// A frame to work in: centre and size taken out, so that no parameter depends on the units of the
// points and no square under- or overflows.

/// `x ↦ (x − centre) / scale`.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Frame<const D: usize> {
    centre: SVector<f64, D>,
    scale: f64,
}

impl<const D: usize> Default for Frame<D> {
    fn default() -> Self {
        Self {
            centre: SVector::zeros(),
            scale: 1.0,
        }
    }
}

impl<const D: usize> Frame<D> {
    /// Centre and root mean square radius of a set. Scale one where all points coincide.
    fn of(points: &[Point<f64, D>]) -> Self {
        let (centre, radius) = centre_and_radius(points);
        Self {
            centre,
            scale: if radius > 0.0 { radius } else { 1.0 },
        }
    }

    /// The model's centre and the largest distance from it along an axis in either set: for sets
    /// compared as they lie.
    fn of_both(model: &[Point<f64, D>], target: &[Point<f64, D>]) -> Self {
        let centre = Self::of(model).centre;
        let largest = model
            .iter()
            .chain(target)
            .map(|p| (p.coords - centre).amax())
            .fold(0.0, f64::max);
        Self {
            centre,
            scale: if largest > 0.0 { largest } else { 1.0 },
        }
    }

    /// A point in this frame.
    fn inside(&self, point: &Point<f64, D>) -> SVector<f64, D> {
        (point.coords - self.centre) / self.scale
    }

    /// All points in this frame.
    fn enter(&self, points: &[Point<f64, D>], axes: &mut Axes<D>) {
        axes.0.iter_mut().for_each(Vec::clear);
        for point in points {
            let inside = self.inside(point);
            for (axis, &c) in axes.0.iter_mut().zip(inside.iter()) {
                axis.push(c);
            }
        }
    }

    /// A point of this frame in the units of the caller.
    fn leave(&self, inside: SVector<f64, D>) -> Point<f64, D> {
        Point::from(inside * self.scale + self.centre)
    }
}

/// Centroid of a set and its root mean square radius, zero where all points coincide.
fn centre_and_radius<const D: usize>(points: &[Point<f64, D>]) -> (SVector<f64, D>, f64) {
    let n = points.len() as f64;
    // Sums of differences keep the digits of sets far from the origin.
    let origin = points[0].coords;
    let centre = origin
        + points
            .iter()
            .map(|p| p.coords - origin)
            .sum::<SVector<f64, D>>()
            / n;
    // The largest radius taken out first: no square under- or overflows.
    let largest = points
        .iter()
        .map(|p| (p.coords - centre).amax())
        .fold(0.0, f64::max);
    if !(largest > 0.0 && largest.is_finite()) {
        return (centre, 0.0);
    }
    let squares: f64 = points
        .iter()
        .map(|p| ((p.coords - centre) / largest).norm_squared())
        .sum();
    (centre, largest * (squares / n).sqrt())
}

/// Covariance of a place drawn from these with their weights. Zero where there is no weight.
fn spread<const D: usize>(
    places: impl Iterator<Item = (SVector<f64, D>, f64)> + Clone,
) -> SMatrix<f64, D, D> {
    let mass: f64 = places.clone().map(|(_, weight)| weight).sum();
    if mass <= 0.0 {
        return SMatrix::zeros();
    }
    let shares = places.map(|(place, weight)| (place, weight / mass));
    let mean: SVector<f64, D> = shares.clone().map(|(place, share)| place * share).sum();
    shares.fold(SMatrix::zeros(), |sum, (place, share)| {
        let step = place - mean;
        sum + step * step.transpose() * share
    })
}

/// The rigid motion or similarity `x ↦ A (x − from) + to` of least weighted squares (Kabsch 1976;
/// Umeyama 1991).
struct BestMotion<const D: usize> {
    linear: SMatrix<f64, D, D>,
    from: SVector<f64, D>,
    to: SVector<f64, D>,
    /// `Σ wᵢ |xᵢ − from|²`.
    extent: f64,
}

impl<const D: usize> BestMotion<D> {
    /// `O(I)`. None without any weight, or of numbers that are not finite.
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

/// One array an axis.
#[derive(Clone, Debug)]
struct Axes<const D: usize>([Vec<f64>; D]);

impl<const D: usize> Default for Axes<D> {
    fn default() -> Self {
        Self(std::array::from_fn(|_| Vec::new()))
    }
}
