#![doc = include_str!("../README.md")]
//!
//! # Rooms
//!
//! | module | what it holds |
//! |---|---|
//! | [`angle`] | critical and acceptance angles, (1)–(4) |
//! | [`snell`] | propagation angles through a stack |
//! | [`mod@fresnel`] | reflectance and transmittance, s, p and unpolarised |
//! | [`stack`] | a stack of layers in its ambient: all of the above, normal incidence, the LED's cone |
//! | [`dispersion`] | refractive index against wavelength; PDMS and borosilicate glass |
//! | [`led`] | radiation pattern and the share of it that is trapped |
//! | [`surface`] | the slab's deformed top and what touches it |
//! | [`trace`] | rays through the slab: where the light goes |
//! | [`sensor`] | grid elements, temporal and force resolution |
//!
//! # Conventions
//! Angles in radians unless the name says degrees; angles of incidence are measured from the normal of the interface,
//! the LED's from its axis. Lengths in metres. Every function is generic over [`Real`], that is `f32` and `f64`,
//! allocates nothing, and needs no standard library.
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

pub mod angle;
pub mod dispersion;
mod error;
pub mod fresnel;
pub mod led;
mod real;
pub mod sensor;
pub mod snell;
pub mod stack;
pub mod surface;
pub mod trace;

pub use angle::{AcceptanceAngle, Angle, CriticalAngle, acceptance_angle, critical_angle};
pub use dispersion::Dispersion;
pub use error::OpticsError;
pub use fresnel::{Fresnel, fresnel};
pub use led::{Geometry, Led};
pub use real::Real;
pub use sensor::SensorSpecification;
pub use snell::{Propagation, propagation};
pub use stack::{LayerStack, LedCone, NormalIncidence};
