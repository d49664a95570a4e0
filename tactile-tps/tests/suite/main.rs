//! The tests of `tactile-tps`, in a single program, so that the generic code is compiled once.

mod allocation;
mod common;
mod degenerate;
mod evaluation;
mod input;
mod iterative;
mod local;
mod properties;
mod recorded;
mod reference;
mod stability_scale;
