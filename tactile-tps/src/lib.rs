//! Thin-plate splines in two and three dimensions: fit, evaluate, differentiate, smooth.
#![forbid(unsafe_code)]
