//! Tests of the program `tactile`: the examples in the help run, and every error is one sentence.
#![cfg(unix)]

mod bad_calls;
mod bad_files;
mod colour;
mod depth;
mod frames;
mod harness;
mod help;
mod interrupt;
mod json;
mod outputs;
mod sensor;
mod streams;
