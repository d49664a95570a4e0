//! Surfaces from one image: shape from shading, slope integration, control points.
//!
//! Three traits, each with several implementations: [`SurfaceReconstruction`] (image → heights),
//! [`SlopeIntegrator`] (slopes → heights) and [`ControlPointSampler`] (surface → points). All work on a [`Domain`]
//! (mask, pixel size, known heights), for `f32` and `f64`.
//!
//! Images are indexed `[row, column]`; x is the column, y the row, z points to the viewer; a pixel's coordinate is its
//! centre. Slopes are p = ∂z/∂x and q = ∂z/∂y. See [`Lighting`] for the sign of the light's direction.
//!
#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

mod domain;
mod error;
mod estimate;
mod frame;
mod integrate;
mod lighting;
mod quality;
mod reconstruct;
mod sample;
mod scalar;
mod surface;
mod workspace;

pub use domain::{BoundingBox, Domain};
pub use error::{Input, SfsError};
pub use estimate::{estimate_lighting, estimate_normal_intensity};
pub use frame::Frame;
pub use integrate::{CosinePoisson, FrankotChellappa, MaskedLeastSquares, SlopeIntegrator};
pub use lighting::Lighting;
pub use quality::{
    Alignment, ErrorSummary, HeightError, Reprojection, SlopeError, height_error, render, reprojection,
    slope_error, slopes,
};
pub use reconstruct::{
    BallCalibration, Branch, BrooksHorn, DepthTable, Eikonal, Pentland, Rim, Signal, SurfaceReconstruction,
    TsaiShah,
};
pub use sample::{ControlPointSampler, CurvatureAdaptive, EquallySpaced, Random};
pub use scalar::Scalar;
pub use surface::{Component, PixelFlags, Report, StopReason, Surface};
pub use workspace::{Progress, Workspace};
