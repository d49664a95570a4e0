//! The program `tactile`.

fn main() -> std::process::ExitCode {
    tactile_cli::run()
}
