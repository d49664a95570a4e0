//! The tests of `tactile-force`, in one program: the generic code is compiled once for all of them.

mod bad_input;
mod batch;
mod calibration;
mod frame_statistics;
mod health;
mod illumination;
mod lens;
mod no_allocation;
mod pressure;
mod profile_shape;
mod recorded;
mod reference;
mod sensor;
mod simulated;
mod stability;
mod stability_scale;
