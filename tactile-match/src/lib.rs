#![doc = include_str!("../README.md")]
//!
//! # Methods
//! The default, [`AnnealedSoftassign`], alternates a soft assignment and a smooth warp while a
//! temperature falls. The warp has a Gaussian-process prior, and distances are computed from its
//! leave-one-out predictions. If the first start leaves the match undecided, further starts follow;
//! relaxation labelling is one of them. The paper's own method, relaxation labelling (13)–(20) with
//! a thin-plate spline (21)–(24), is [`RelaxationLabelling`]:
//! `RelaxationLabelling::default().match_points(&model, &target)`.
//!
//! # Equations
//! Match matrix $M$ of I model points $y_i$ and J target points $t_j$, with slack. Equation numbers
//! refer to the paper.
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
//! Lengths are in any unit. Errors are [`MatchError`]; a run that does not converge is reported in
//! [`MatchReport`].
#![forbid(unsafe_code)]
// Several arrays share one index, and zipping them all hides it.
#![allow(clippy::needless_range_loop)]

mod assignment;
#[cfg(test)]
#[allow(dead_code)] // shared with the tests of the public interface
#[path = "../tests/suite/common/mod.rs"]
mod common;
mod cpd;
mod error;
mod frame;
mod gaussian_process;
mod hard;
mod instances;
mod interpolation;
mod judgement;
mod kernels;
pub mod labelling;
mod matching;
mod shape_context;
mod softassign;
mod transformation;

// The shared tests refer to the crate by its external name.
#[cfg(test)]
extern crate self as tactile_match;

pub use assignment::linear_assignment;
pub use cpd::{CoherentPointDrift, Normalization};
pub use error::MatchError;
pub use hard::{LinearAssignment, NearestNeighbour};
pub use judgement::{Doubt, Judgement, LatticeStep};
pub use labelling::RelaxationLabelling;
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

/// Called many times a second by what takes long, which ends early if it returns `Break`.
type Watch<'w> = &'w mut dyn FnMut() -> std::ops::ControlFlow<()>;
