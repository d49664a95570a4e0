#![doc = include_str!("../README.md")]
//!
//! ## Where to find what
//!
//! | to | use |
//! |---|---|
//! | fit once | [`ThinPlateSpline::fit`](Spline::fit), or [`Spline::fit`] for other than D outputs |
//! | fit repeatedly | [`Factorization`] with a [`Workspace`] |
//! | choose kernel, smoothing, weights | [`FitOptions`], [`Smoothing`], [`Kernel`] |
//! | propagate the targets' uncertainty to values and Jacobians | [`Factorization::influence_into`], [`Factorization::jacobian_influence_into`] |
//! | see condition, residual and iterations | [`FitReport`] |
//! | strain from matches whose neighbours share errors | [`StrainSpline`] |
//! | warp by matches some of which are wrong | [`RobustSpline`], [`RobustFit`] |
//! | accept any warp | the object-safe trait [`Warp`]: splines, [`Affine`] |
//! | fit any kind of warp | the trait [`WarpModel`]: [`FitOptions`], [`AffineModel`] |
//!
//! # Equations
//! $$f(x) = a_0 + A x + \sum_i w_i U(|x - x_i|), \qquad \sum_i w_i = 0, \quad \sum_i w_i x_i^T = 0$$
//!
//! is the least of $\sum_i v_i |f(x_i) - y_i|^2 + \lambda w^T K w$, with weights $v_i$ and $K_{ij} = U(|x_i - x_j|)$. Kernels: $r^2 \ln r$ (plane), $-r$
//! (space), $r^3$. Bending energy: $8\pi w^T K w = \int |\partial^2 f|^2$ for the first two in their own dimension.
//!
//! Jacobian: $\nabla f = A + \sum_i w_i U^{\prime}(r_i) (x - x_i)^T/r_i$. Costs for n points: fit $n^3/3$, new targets $O(n^2)$, a query $O(n)$; beyond
//! 3000 points a fit takes O(steps × n²) time and O(n) memory. Lengths are in any unit; errors are [`TpsError`].
#![forbid(unsafe_code)]
// Several arrays share one index in dense linear algebra; zipping them hides it.
#![allow(clippy::needless_range_loop)]

mod affine;
mod centres;
mod cholesky;
mod column;
mod double_double;
mod equations;
mod error;
mod evaluate;
mod factorization;
mod far;
mod fit;
mod influence;
#[cfg(all(debug_assertions, not(test)))]
mod instances;
mod iterative;
mod kernel;
mod layout;
mod logarithm;
mod memory;
mod models;
mod null_space;
mod options;
mod packed;
#[cfg(feature = "rayon")]
mod parallel;
mod parts;
mod path;
mod precise;
mod product;
mod progress;
mod real;
mod refine;
mod refit;
mod report;
mod residual;
mod reweight;
mod sample;
mod simd;
mod smoothing;
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
mod tridiagonal;
mod values;
mod warp;

pub use affine::Affine;
pub use error::TpsError;
pub use factorization::{Factorization, Workspace};
pub use kernel::{Jet, Kernel, NegR, R2LogR, R3};
pub use memory::Memory;
pub use models::AffineModel;
pub use options::{FitOptions, Solver};
pub use path::LambdaPath;
pub use progress::Progress;
pub use real::{Real, Scalar};
pub use report::FitReport;
pub use smoothing::{RobustFit, RobustSpline, Smoothing, StrainSpline};
pub use spline::{Spline, ThinPlateSpline};
pub use warp::{Pairs, Warp, WarpModel};
