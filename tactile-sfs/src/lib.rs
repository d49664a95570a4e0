//! Surfaces from a single image, on a [`Domain`] (mask, pixel size, known heights).
//!
//! Images are indexed `[row, column]`. The axis x runs along columns, y along rows, and z points to
//! the viewer. Coordinates of a pixel refer to its centre. Slopes are p = ∂z/∂x and q = ∂z/∂y. See
//! [`Lighting`] for the sign of the direction of the light.
//!
#![doc = include_str!("../README.md")]
//!
//! # Equations
//! Heights $z$, slopes $p = \partial z/\partial x$ and $q = \partial z/\partial y$, light $s$,
//! reflectance $R$. N is the number of pixels.
//!
//! - Lambert: $R = n \cdot s$ with $n = (-p, -q, 1)/\sqrt{1 + p^2 + q^2}$.
//! - Eikonal, frontal light: $|\nabla z| = \sqrt{1/R^2 - 1}$. A few sweeps, O(N).
//! - Slopes to heights, Poisson: $\Delta z = \partial p/\partial x + \partial q/\partial y$. By
//!   cosine transform O(N log N), error $O(h^4)$.
//! - Tsai–Shah: a damped Newton step $z - K f(z)$ on $f = R - n \cdot s$, pixel by pixel. O(N) per
//!   iteration.
//!
//! Errors are [`SfsError`]. A lack of convergence is not an error: see [`SurfaceReport`].
#![forbid(unsafe_code)]

mod ball;
mod binning;
mod domain;
mod error;
mod image;
mod integrate;
mod lighting;
mod reconstruct;
mod sample;
mod scalar;
mod slopes;
mod surface;
mod workspace;

pub use ball::BallFit;
pub use binning::{BinnedContact, Binning};
pub use domain::Domain;
pub use error::SfsError;
pub use image::{Frame, Image};
pub use integrate::{CosinePoisson, MaskedLeastSquares, SlopeIntegrator};
pub use lighting::Lighting;
pub use reconstruct::{
    BoundaryCondition, DepthTable, Eikonal, EikonalBranch, SurfaceReconstruction, TsaiShah,
};
pub use sample::{ContactSampler, ControlPointSampler, EquallySpaced};
pub use scalar::PixelScalar;
pub use slopes::slopes;
pub use surface::{Component, PixelFlags, Surface, SurfaceReport};
pub use tactile_core::{BoundingBox, CustomError, InvalidOption, Progress, StopReason};
pub use workspace::SurfaceWorkspace;
pub use {nalgebra, ndarray};
