#![doc = include_str!("../README.md")]
//!
//! # Conventions
//! SI units are used. Tensors are `nalgebra::Matrix3`, with x = column, y = row and z towards the
//! object. Everything is computed in `f64`.
//!
//! # References
//! K. L. Johnson, *Contact Mechanics* (1985). I. N. Sneddon, Int. J. Eng. Sci. 3 (1965) 47.
//! N. N. Lebedev & Ia. S. Ufliand, J. Appl. Math. Mech. 22 (1958) 442. T. Ogita, S. M. Rump &
//! S. Oishi, SIAM J. Sci. Comput. 26 (2005) 1955.
//!
//! # Equations
//! $F = I + H$ is the deformation gradient, $H = \nabla u$.
//! $1/E^{\ast} = (1 - \nu_1^2)/E_1 + (1 - \nu_2^2)/E_2$. Equation numbers refer to the paper.
//!
//! - Green–Lagrange (25)–(30):
//!   $E = \frac{1}{2}(F^T F - I) = \frac{1}{2}(H + H^T + H^T H)$. O(1) a gradient.
//! - Euler–Almansi $\frac{1}{2}(I - F^{-T} F^{-1})$, Hencky $\ln U$, Biot $U - I$, infinitesimal
//!   $\frac{1}{2}(H + H^T)$.
//! - The paper's ratio (31): $E = S_{zz}/\bar e_{zz}$, correct under uniaxial loading.
//! - Hertz: $a^3 = 3FR/(4E^{\ast})$, $\delta = a^2/R$,
//!   $F = \frac{4}{3} E^{\ast} \sqrt{R} \delta^{3/2}$, $p = p_0 \sqrt{1 - r^2/a^2}$.
//! - Flat punch: $F = 2 E^{\ast} a \delta$. Cone:
//!   $F = \frac{2}{\pi} E^{\ast} \tan\alpha \delta^2$.
//! - Thin layer: $\varphi(s) - \frac{2}{\pi} \int_0^a K(s, t) \varphi(t) dt = \frac{E^{\ast}}{\pi}
//!   (\delta - s^2/R)$, $F = 2\pi \int_0^a \varphi$. O(n³) with some 24 + 6 a/h nodes, tabulated by
//!   the estimators.
//!
//! Errors are [`ElasticityError`]. A [`modulus::Warning`] weakens an estimate without preventing
//! it.
#![forbid(unsafe_code)]

pub mod contact;
mod error;
pub mod field;
pub mod kinematics;
pub mod laws;
pub mod modulus;
mod numerics;
pub mod relaxation;
pub mod strain;

pub use error::{ElasticityError, Quantity};
pub use nalgebra;
