//! The tests of `tactile-optics`, in one program: the generic code is compiled once for all of
//! them.

mod paper;
mod recorded;
mod reference;
mod stability;
mod stability_scale;
mod trace;
