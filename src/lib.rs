#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]
pub use tactile_elasticity as elasticity;
pub use tactile_force as force;
pub use tactile_match as matching;
pub use tactile_optics as optics;
pub use tactile_sfs as sfs;
pub use tactile_tps as tps;

#[cfg(feature = "scene")]
pub mod io;
pub mod pipeline;
#[cfg(feature = "plot")]
pub mod plot;
#[cfg(feature = "scene")]
pub mod scene;
#[cfg(feature = "simulate")]
pub mod simulate;

pub use pipeline::{Measurement, Object, Pipeline, Press};
