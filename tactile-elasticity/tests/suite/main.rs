//! The tests of `tactile-elasticity`, in a single program, so that the generic code is compiled
//! once.

mod common;
mod hertz_reference;
mod kinematics;
mod modulus;
mod recorded;
mod relaxation;
mod stability;
mod stability_scale;
mod strain_reference;
