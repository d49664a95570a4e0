//! The one pass over a frame, the reference it is compared with, and the noise of both.

mod extent;
mod flat_field;
mod noise;
mod pass;
mod reference;
mod statistics;
mod strip;
mod tighten;
mod tiles;

pub use flat_field::FlatField;
pub use noise::{DifferenceNoise, NoiseModel};
pub use reference::ReferenceFrame;
pub use statistics::FrameStatistics;

pub(crate) use flat_field::FlatLine;
pub(crate) use noise::trimmed_variance;
pub(crate) use reference::{Levels, PassWorkspace};
pub(crate) use tiles::{TILE_COLUMNS, TILE_ROWS, TileSum, Tiles};
