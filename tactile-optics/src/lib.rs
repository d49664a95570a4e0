#![doc = include_str!("../README.md")]
//!
//! # Contents
//!
//! | functions and types | contents |
//! |---|---|
//! | [`critical_angle`], [`acceptance_angle`], [`propagation`] | angles in a layer, (1)–(4) |
//! | [`fresnel`] | reflectance and transmittance, s, p and unpolarised |
//! | [`normal_incidence`], [`led_cone`] | a stack of layers in its ambient |
//! | [`Dispersion`] | refractive index of PDMS and borosilicate glass by wavelength |
//! | [`Led`] | radiation pattern and its trapped fraction |
//! | [`surface`] | the deformed top of the slab and the touching object |
//! | [`trace`](mod@trace) | ray tracing through the slab: the light budget of a press |
//! | [`SensorSpecification`] | Table 1: grid elements, temporal and force resolution |
//!
//! # Conventions
//! Angles are in radians unless the name contains degrees. Angles of incidence are measured from
//! the normal of the interface, and those of the LED from its axis. Lengths are in metres. Layers
//! are counted from the object to the glass, and their indices increase in this order, as in §3.3:
//! 1.38, 1.39, 1.40, glass 1.41. The crate neither allocates nor needs the standard library.
//!
//! # Equations
//! Equation numbers refer to the paper. $n_i$ is the index of a layer, $n_0$ that of the ambient,
//! and $\theta$ an angle of incidence.
//!
//! - Critical angle, and acceptance angle of light that enters through the edge (1)–(4):
//!   $\theta_c = \arcsin(n_0/n_i)$, $\theta_i = \arcsin(\sqrt{n_i^2 - n_0^2}/n_0)$. O(1) per layer.
//! - Snell: $n \sin\theta$ is the same in every layer. If it exceeds $n$, the field decays.
//! - Fresnel, amplitudes:
//!   $r_s = \frac{n_1\cos\theta_1 - n_2\cos\theta_2}{n_1\cos\theta_1 + n_2\cos\theta_2}$ and
//!   $r_p = \frac{n_2\cos\theta_1 - n_1\cos\theta_2}{n_2\cos\theta_1 + n_1\cos\theta_2}$.
//!   Reflectances are their squares.
//! - Stack at normal incidence, with reflections added by intensity:
//!   $T = 1/(1 + \sum_j R_j/(1 - R_j))$. O(layers).
//! - Dispersion: Cauchy $n = a + b/\lambda^2 + c/\lambda^4$. Sellmeier
//!   $n^2 = 1 + a + \sum_k B_k\lambda^2/(\lambda^2 - C_k)$.
//! - LED: intensity $\propto \cos^m\theta$. Trace: O(rays × reflections), with fractions of the
//!   light that add up to 1.
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

mod angle;
mod dispersion;
mod error;
mod fresnel;
mod led;
mod sensor;
mod spread_points;
mod stack;
pub mod surface;
pub mod trace;

pub use angle::{Angle, acceptance_angle, critical_angle, propagation};
pub use dispersion::Dispersion;
pub use error::OpticsError;
pub use fresnel::{Fresnel, fresnel};
pub use led::{Geometry, Led};
pub use sensor::{SensorParameters, SensorSpecification};
pub use stack::{LedCone, NormalIncidence, led_cone, normal_incidence};
