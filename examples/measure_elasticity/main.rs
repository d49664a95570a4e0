//! Measures Young's modulus: of a simulated press (the default), or of your own frames.
//!
//! ```text
//! cargo run --release --example measure_elasticity
//! cargo run --release --example measure_elasticity -- SCENE.toml --json
//! ```
#![allow(clippy::print_stdout, clippy::print_stderr)]
mod arguments;
mod output;
mod source;

use arguments::Arguments;
use clap::Parser;
use std::process::ExitCode;

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    match output::run(&arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("measure_elasticity: {error}");
            ExitCode::from(2)
        }
    }
}
