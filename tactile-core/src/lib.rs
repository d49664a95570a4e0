#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

mod bounding_box;
mod error;
mod estimate;
mod option;
mod readable;
mod regions;
mod report;
pub mod statistics;
mod uncertain;
#[cfg(feature = "simd")]
mod vectorised;

pub use bounding_box::BoundingBox;
pub use error::CustomError;
pub use estimate::{Estimate, Interval};
pub use option::{InvalidOption, Requirement};
pub use readable::Readable;
pub use regions::{otsu, regions};
pub use report::{Polarity, Progress, StopReason};
pub use uncertain::{Source, Uncertain};
#[cfg(feature = "simd")]
pub use vectorised::{Loop, vectorised};
