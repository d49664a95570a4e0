//! The tests of `tactile-force`, in one program: the generic code is compiled once for all of them.

mod bad_input;
mod batch;
mod calibration;
mod frame_statistics;
mod lens;
mod no_allocation;
mod pressure;
mod recorded;
mod reference;
mod stability;
mod stability_scale;
