//! The tests of `tactile-sfs`, in a single program, so that the generic code is compiled once.

mod behaviour;
mod common;
mod contacts;
mod depth_maps;
mod hard_input;
mod invariants;
mod large;
mod measured;
mod order;
mod recorded;
mod samplers;
mod stability_scale;
mod table_zero;
