//! The tests of `tactile-optics`, in a single program, so that the generic code is compiled once.

mod paper;
mod recorded;
mod reference;
mod stability;
mod stability_scale;
mod trace;
