//! Fuzzy graph matching of point sets by relaxation labelling, with a thin-plate-spline warp.
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

pub use assignment::{AssignmentWorkspace, linear_assignment};
pub use assignment_matcher::LinearAssignment;
pub use cpd::{CoherentPointDrift, DriftOptions, DriftWarp, DriftWorkspace, Motion, Normalization};
pub use dense::{DenseOptions, DenseRelaxation};
pub use error::{MatchError, PointSet};
pub use matching::{MatchReport, Matching, PointMatcher, StopReason, unmatched_rows};
pub use nearest::NearestNeighbour;
pub use relaxation::{
    Labelling, Outliers, RelaxationMatch, RelaxationMatcher, RelaxationOptions, RelaxationWorkspace,
    Rotation, Search,
};
pub use shape_context::ShapeContexts;
pub use soft::SoftMatches;
