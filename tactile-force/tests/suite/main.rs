//! The tests of `tactile-force`, in a single program.

mod bad_input;
mod batch;
mod blob;
mod calibration;
mod illumination;
mod lens;
mod no_allocation;
mod pressure;
mod profile_shape;
mod recorded;
mod sensor;
mod simulated;
mod stability;
