//! The tests of `tactile-tps`, in one program: the generic code is compiled once for all of them.

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
