//! Fuzzy graph matching of point sets by relaxation labelling, with a thin-plate-spline warp.
#![forbid(unsafe_code)]

mod assignment;
pub mod dense;
mod error;
mod matching;
mod relaxation;
mod soft;
mod validate;

pub use assignment::{AssignmentWorkspace, linear_assignment};
pub use error::{MatchError, PointSet};
pub use matching::{MatchReport, Matching, PointMatcher, StopReason, unmatched_rows};
pub use relaxation::{Outliers, RelaxationMatcher, RelaxationOptions, RelaxationWorkspace, Rotation};
pub use soft::SoftMatches;
