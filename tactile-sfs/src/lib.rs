//! Surfaces from one image: shape from shading, slope integration, control points.
#![forbid(unsafe_code)]
