//! The program `tactile` as a user meets it: what the help shows runs, and what is wrong is said in
//! one sentence.
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
