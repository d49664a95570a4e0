#![doc = include_str!("../README.md")]
//!
//! # Conventions
//! Images are indexed `[row, column]`: x is the column, y the row, and (0, 0) is the centre of the
//! first pixel. Physical quantities are in SI units, with the unit in their names. Names that end
//! in `_px` are in pixels. Equation numbers refer to the paper on waveguide tactile imaging that
//! the workspace follows.
//!
//! # Modules
//! | module | contents |
//! |---|---|
//! | `frame` | the pass over a frame, the reference, the noise of both, vignetting |
//! | `face` | area and shape of flat faces |
//! | `drift` | drift of illumination and stray light since the reference was taken |
//! | `contact` | detection, mask, aperture, sums over the aperture |
//! | `profile` | the contact radius from the pressure profile |
//! | `calibration` | pixel value to force and stress, (5) and (6): a line, a local curve f |
//! | `measure` | the force of one frame |
//! | `shear` | (9) to (12) |
//! | `lens` | pixels to metres: sizes along x and y, radial distortion, fit to a dot target |
//!
//! # Equations
//! $d$ is the grey-level difference frame − reference, $V = \sum d$ the integrated pixel value.
//! Equation numbers refer to the paper.
//!
//! - Stress and force (5), (6): $P = f(I)$ and $F_z = \int P dS$, that is $F_z = F(V)$ by
//!   calibration.
//! - Centroid (7), (8): $\bar x = \sum x d / \sum d$ and $\bar y = \sum y d / \sum d$. One pass
//!   over the frame, O(pixels), exact in integers.
//! - Shear (9)–(12): $F_x = K_x u_x$ and $F_y = K_y u_y$, $u$ the step of the centroid.
//! - Hertz's profile: $I(r) = I_0 \sqrt{1 - r^2/a^2}$, averaged over pixels and blurred; $V =
//!   \frac{2}{3} \pi a^2 I_0$.
//! - Noise of a difference: $\sigma^2 = \sigma_0^2 + g d$; of the force: $\sigma_F^2 = (dF/dV)^2
//!   \sigma_V^2 + \sigma_{cal}^2$.
#![forbid(unsafe_code)]

mod calibration;
mod contact;
mod drift;
mod error;
mod face;
mod flat_field;
mod frame;
mod lens;
mod measure;
mod noise;
mod outline_box;
mod profile;
mod region;
mod runs;
mod shear;
mod tiles;

pub use calibration::{
    Branch, CalibrationFrame, CalibrationPair, CurveHysteresis, ForceReading, GreyHistogram,
    Hysteresis, LineDoubt, LineReport, LinearCalibration, LocalCalibration, PressureCurve,
    PressureCurveOptions, PressureCurveReport, StressCalibration,
};
pub use contact::{Contact, ContactOptions};
pub use drift::{DriftCorrection, DriftOutcome, IlluminationDrift};
pub use error::ForceError;
pub use face::{FaceReading, ShapeProblem};
pub use frame::ReferenceFrame;
pub use lens::{DotPair, LensFit, LensGeometry};
pub use measure::{ForceMeasurement, ForceMeter, ForceOptions, ForceWorkspace, measure_force};
pub use noise::{DifferenceNoise, NoiseModel};
pub use profile::{HertzFit, ProfileShape};
pub use shear::{ShearCalibration, ShearMeasurement, ShearPair, ShearTracker};
pub use tactile_core::{BoundingBox, Estimate, Polarity, Source, Uncertain};
pub use {nalgebra, ndarray, tactile_core};
