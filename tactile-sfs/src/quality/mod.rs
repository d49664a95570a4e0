//! Errors of a surface: against the truth, or against the image where there is none.

mod compare;
mod shading;

pub use compare::{Alignment, ErrorSummary, HeightError, height_error};
pub(crate) use shading::slopes_at;
pub use shading::{render, reprojection, slopes};
