//! Fuzzy graph matching of point sets by relaxation labelling, with a thin-plate-spline warp.
//!
//! # Equations
//! Match matrix $M$ of I model points $y_i$ and J target points $t_j$, with slack; numbers are the paper's.
//!
//! - Rows and columns sum to one with their slack (15): $\sum_j M_{ij} = 1$ and $\sum_i M_{ij} = 1$.
//! - Soft assignment at the temperature $\sigma$: $M_{ij} \propto \exp(-|y_i - t_j|^2/2\sigma^2)$, made doubly stochastic. At most O(IJ) a sweep.
//! - Relaxation labelling (19), (20): $M_{ij} \leftarrow M_{ij} S_{ij}/\sum_k M_{ik} S_{ik}$ with the support
//!   $S_{ij} = \sum_a \sum_b M_{ab} \alpha \beta \gamma$ of neighbours a of i and b of j. Densely O(IJAB), over few candidates one product a link.
//! - Warp: the posterior mean of an affine field plus a smooth one, $\tau^2 \exp(-|x - x^{\prime}|^2/2\ell^2)$; $O(I r^2)$ with r near 30. The last one
//!   is the thin-plate spline through the estimated positions.
//!
//! Lengths are in any unit; errors are [`MatchError`], not converging is a [`MatchReport`].
#![forbid(unsafe_code)]
// Several arrays share one index; zipping them all hides it.
#![allow(clippy::needless_range_loop)]

mod assignment;
mod assignment_matcher;
mod cpd;
pub mod dense;
mod error;
mod frame;
mod hard;
mod matching;
mod nearest;
mod relaxation;
mod shape_context;
mod soft;
mod validate;
mod warm_start;

pub use assignment::{AssignmentWorkspace, linear_assignment};
pub use assignment_matcher::LinearAssignment;
pub use cpd::{CoherentPointDrift, DriftOptions, DriftWarp, DriftWorkspace, Motion, Normalization};
pub use dense::{DenseOptions, DenseRelaxation, SparseRelaxation};
pub use error::{MatchError, PointSet};
pub use matching::{MatchReport, Matching, PointMatcher, StopReason, unmatched_rows};
pub use nearest::NearestNeighbour;
pub use relaxation::{
    Labelling, Outliers, PointSets, RelaxationMatch, RelaxationMatcher, RelaxationOptions,
    RelaxationWorkspace, Rotation, Search,
};
pub use shape_context::ShapeContexts;
pub use soft::SoftMatches;
pub use warm_start::WarmStart;
