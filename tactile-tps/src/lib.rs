#![doc = include_str!("../README.md")]
//!
//! ## Where to find what
//!
//! | to | use |
//! |---|---|
//! | fit once | [`ThinPlateSpline::fit`](Spline::fit), or [`Spline::fit`] for other than D outputs |
//! | fit again and again | [`Factorization`] with a [`Workspace`] |
//! | choose kernel, smoothing, weights | [`FitOptions`], [`Smoothing`], [`Kernel`] |
//! | carry the targets' uncertainty to values and Jacobians | [`Factorization::influence`], [`Factorization::jacobian_influence`] |
//! | know how it went | [`FitReport`] |
//! | take any warp | the object-safe trait [`Warp`]: splines, [`Affine`], [`Rigid`] |
//! | fit any kind of warp | the trait [`WarpModel`]: [`FitOptions`], [`AffineModel`], [`RigidModel`] |
#![forbid(unsafe_code)]
// Several arrays share one index in dense linear algebra; zipping them hides it.
#![allow(clippy::needless_range_loop)]

mod affine;
mod cholesky;
mod error;
mod evaluate;
mod factorization;
mod far;
mod influence;
mod iterative;
mod kernel;
mod logarithm;
mod null_space;
mod options;
mod packed;
#[cfg(feature = "rayon")]
mod parallel;
mod precise;
mod product;
mod progress;
mod real;
mod refine;
mod refit;
mod report;
mod reweight;
mod sample;
mod simd;
mod sites;
mod solve;
mod span;
mod spectrum;
mod spline;
mod symmetric;
mod system;
mod targets;
mod task;
mod tiles;
mod triangular;
mod twofold;
mod values;
mod warp;

pub use affine::{Affine, AffineModel, Rigid, RigidModel};
pub use error::{Input, TpsError};
pub use factorization::{Factorization, Workspace};
pub use kernel::{Jet, Kernel, NegR, R2LogR, R3};
pub use options::{FitOptions, Smoothing, Solver};
pub use progress::{Progress, Stage};
pub use real::{Real, Scalar};
pub use report::FitReport;
pub use spline::{Spline, ThinPlateSpline};
pub use warp::{Warp, WarpModel};
