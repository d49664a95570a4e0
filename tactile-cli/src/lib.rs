//! The program `tactile`: every stage of an optical tactile sensor's measurement, and the whole, from the command line.
//!
//! ```text
//! cargo run --release -p tactile-cli -- measure
//! ```
#![forbid(unsafe_code)]

mod arguments;
mod calibrate;
mod console;
mod context;
mod depth;
mod failure;
mod force;
mod images;
mod inclusion;
mod indent;
mod integrate;
mod interrupt;
mod light;
mod match_points;
mod measure;
mod memory;
mod numbers;
mod outputs;
pub mod plot;
mod progress;
mod reconstruct;
mod simulated;
mod strain;
mod stream;
mod table;
mod warp;

use self::arguments::Program;
use self::context::Context;
use self::failure::Exit;
use clap::Parser;
use std::process::ExitCode;

/// Runs the program on the arguments of this process and returns its exit code, as `tactile --help` lists them.
///
/// Reads and writes files, the standard streams and, where it can, the interrupt's handler of the process: for a `main`.
///
/// ```no_run
/// fn main() -> std::process::ExitCode {
///     tactile_cli::run()
/// }
/// ```
pub fn run() -> ExitCode {
    let program = match Program::try_parse() {
        Ok(program) => program,
        Err(error) => return ExitCode::from(arguments::explain(&error).code()),
    };
    let mut context = Context::new(program.json, program.memory_gb);
    let exit = match program.command.run(&mut context) {
        Ok(exit) => exit,
        Err(failure) => {
            context.console.note(&failure);
            failure.exit
        }
    };
    let exit = if context.interrupt.requested() {
        Exit::Interrupted
    } else {
        exit
    };
    ExitCode::from(context.console.close(exit).code())
}
