//! The local light-to-pressure curve f of (5), fitted from frames: P = f(I), F_z = ∫ f(I) dS.
//!
//! A calibration of frame sums holds for contacts shaped like those it was made with. The local curve holds for any contact: the
//! force is linear in its coefficients, with the grey histogram of the contact as the row of the design,
//!
//! F_i = Σ_g A_i(g) f(g), A_i(g) the area in m² whose difference from the reference is g grey levels in frame i.
//!
//! f rises, passes through the origin and is as smooth as cross-validation finds best.

mod basis;
mod coefficients;
mod curve;
mod fit;
mod frame;
mod nonnegative;
mod options;
mod report;

pub use curve::PressureCurve;
pub use frame::CalibrationFrame;
pub use options::PressureCurveOptions;
pub use report::{CurveHysteresis, PressureCurveReport};
