//! The tests of `tactile-elasticity`, in one program: the generic code is compiled once for all of
//! them.

mod common;
mod hertz_reference;
mod kinematics;
mod modulus;
mod recorded;
mod relaxation;
mod stability;
mod stability_scale;
mod strain_reference;
