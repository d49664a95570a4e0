//! Criterion benches of this stage.
fn main() {}
