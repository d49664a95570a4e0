#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

pub mod io;
pub mod scene;
pub mod sensor;
