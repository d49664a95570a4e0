#![doc = include_str!("../README.md")]
//!
//! ## Where to find what
//!
//! | to | use |
//! |---|---|
//! | fit once | [`Spline::fit`], as `ThinPlateSpline::fit` for D outputs |
//! | fit repeatedly | [`Factorization`] with a [`SplineWorkspace`] |
//! | choose kernel, smoothing, weights | [`FitOptions`], [`Smoothing`], [`Kernel`] |
//! | see condition, residual and iterations | [`FitReport`] |
//! | displacement and gradient with errors, from pairs some of which are wrong | [`LocalField`] |
//! | accept any warp | the object-safe trait [`Warp`]: splines, [`LocalField`], [`Affine`] |
//! | fit any kind of warp | the trait [`WarpModel`]: [`FitOptions`], [`AffineModel`] |
//!
//! Jacobian: $\nabla f = A + \sum_i w_i U^{\prime}(r_i) (x - x_i)^T/r_i$. Costs for n points:
//! $n^3/3$ for a fit, $O(n^2)$ for new targets, $O(n)$ for a query. Beyond 3000 points a fit takes
//! O(steps × n²) time and O(n) memory. Lengths are in any unit, and errors are [`TpsError`].
#![forbid(unsafe_code)]
// Several arrays share one index in dense linear algebra, and zipping them hides it.
#![allow(clippy::needless_range_loop)]

mod affine;
mod error;
mod evaluate;
mod fit;
mod frame;
mod kernel;
mod kernel_sum;
mod lanes;
mod local;
mod options;
mod smoothing;
mod span;
mod warp;

pub use nalgebra;
pub use tactile_core::{CustomError, Progress, StopReason};

pub use affine::{Affine, AffineModel};
pub use error::TpsError;
pub use evaluate::{Spline, ThinPlateSpline};
pub use fit::{Factorization, SplineWorkspace};
pub use kernel::{Kernel, KernelDerivatives, KernelScalar, NegR, R2LogR, R3};
pub use local::{LocalField, LocalValue, nearest_rows};
pub use options::{FitOptions, FitReport, Solver};
pub use smoothing::Smoothing;
pub use warp::{Pairs, SeriesMemory, Warp, WarpModel};
