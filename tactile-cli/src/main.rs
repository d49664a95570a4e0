//! The program `tactile`; it is in the library so that what both compute is compiled once.

fn main() -> std::process::ExitCode {
    tactile_cli::run()
}
