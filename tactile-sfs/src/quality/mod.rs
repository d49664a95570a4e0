//! How good a surface is: against truth where there is one, against the image where there is none.

mod compare;
mod shading;

pub use compare::{Alignment, ErrorSummary, HeightError, SlopeError, height_error, slope_error};
pub(crate) use shading::slopes_at;
pub use shading::{Reprojection, render, reprojection, slopes};
