//! Thin-plate splines: fit, refit, evaluate, differentiate, with the error beside the time.
fn main() {}
