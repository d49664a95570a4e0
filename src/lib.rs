//! Force, shape, strain and Young's modulus, each with its error, from the frames of an optical
//! tactile sensor.
//!
//! A [`Pipeline`] holds the stages from a frame to the modulus, and a [`Press`] holds the frames at
//! one or more loads. Each result is computed when it is requested:
//!
//! ```
//! use tactile_imaging::force::CalibrationPair;
//! use tactile_imaging::{Object, Pipeline};
//!
//! // Integrated pixel value (grey minus reference, summed) and force, as read from a gauge.
//! let pairs = [0.0, 0.1, 0.2, 0.3, 0.4].map(|n| CalibrationPair::loading(2e5 * n, n));
//! let pipeline = Pipeline::from_pairs(&pairs, [86.2e-6; 2], Object::sphere(3e-3))?;
//!
//! let ball = |peak: f64, radius_px: f64| {
//!     ndarray::Array2::from_shape_fn((120, 160), |(y, x)| {
//!         let r = (x as f64 - 80.0).hypot(y as f64 - 60.0) / radius_px;
//!         12 + (peak * (1.0 - r * r).max(0.0).sqrt()).round() as u8
//!     })
//! };
//! let reference = ball(0.0, 1.0);
//! let mut press = pipeline.press(reference.view())?;
//! let frames = [ball(60.0, 12.0), ball(90.0, 18.0)];
//! for frame in &frames {
//!     press.add_frame(frame.view());
//! }
//! let contact = press.contact(0)?.expect("something touches");
//! assert!((contact.contact_radius_m.value / (12.0 * 86.2e-6) - 1.0).abs() < 0.01);
//! let modulus = press.modulus()?;
//! println!("{:.0} Pa, 95 %: {:?}", modulus.youngs_modulus_pa, modulus.interval_95);
//! # Ok::<(), tactile_imaging::pipeline::PipelineError>(())
//! ```
//!
//! # Where to look
//!
//! - From a sensor's frames to all results: [`pipeline`]. The crate `tactile-files` reads and
//!   writes images, tables, streams, scene files and calibrated sensors.
//! - From two point sets to displacement and strain with an error: [`strain_between()`].
//! - Gels lit in colours, gels that darken, printed markers: [`gel`]. A lump under a surface:
//!   [`inclusion`] (feature `inclusion`).
//! - Single stages: the crates below. A user-defined stage implements one trait of the [`prelude`].
//!
//! Equation numbers in brackets refer to "the paper", *The Novel Artificial Intelligence Based
//! Sub-Surface Inclusion Detection Device and Algorithm*.
//!
//! # Equations
//! The stages compute the following. The page of each crate has its own equations.
//!
//! - Light stays inside below $\theta_i = \arcsin\sqrt{n_i^2 - 1}$ (1)–(4) until pressure lets it
//!   leak: [`optics`].
//! - Force $F_z = \int P dS$, centroid $\sum x I/\sum I$, shear $F_x = K_x u_x$ (5)–(12):
//!   [`force`].
//! - Surface from shading, $|\nabla z| = \sqrt{1/R^2 - 1}$ under frontal light: [`sfs`].
//! - Matches: annealed softassign with a Gaussian-process prior by default, or the paper's
//!   relaxation labelling (13)–(20), [`matching`]; warp
//!   $f(x) = a_0 + A x + \sum_i w_i U(|x - x_i|)$ (21)–(24): [`tps`].
//! - Strain $E = \frac{1}{2}(F^T F - I)$ (25)–(30) and modulus $E = S_{zz}/\bar e_{zz}$ (31), or by
//!   Hertz's law $a^3 = 3FR/(4E^{\ast})$: [`elasticity`].
#![forbid(unsafe_code)]

// The examples of README and guide run as documentation tests. Links are relative to the
// repository.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
#[doc = include_str!("../docs/own_stage.md")]
struct Readme;

pub use tactile_core as core;
pub use tactile_elasticity as elasticity;
pub use tactile_force as force;
pub use tactile_gel as gel;
pub use tactile_match as matching;
pub use tactile_optics as optics;
pub use tactile_sfs as sfs;
pub use tactile_tps as tps;

#[cfg(feature = "fem")]
pub use tactile_fem as fem;

#[cfg(feature = "inclusion")]
pub mod inclusion;
pub mod pipeline;
mod point_grid;
mod strain_between;
mod strain_kinematics;
mod strain_series;

pub use pipeline::{Measurement, Object, Pipeline, Press};
pub use point_grid::PointGrid;
pub use strain_between::{
    PairsDoubt, StrainAt, StrainBetween, StrainBetweenError, StrainBetweenOptions, strain_between,
};
pub use strain_series::{SeriesStrain, StrainSeries};

/// The types and traits that a program with user-defined stages needs:
/// `use tactile_imaging::prelude::*`.
pub mod prelude {
    pub use crate::elasticity::ElasticityError;
    pub use crate::elasticity::modulus::{LoadSeries, ModulusEstimate, ModulusEstimator};
    pub use crate::elasticity::strain::{Deformation, StrainMeasure};
    pub use crate::force::{Estimate, ForceError, ReferenceFrame, StressCalibration};
    pub use crate::matching::{MatchError, Matching, PointMatcher};
    pub use crate::pipeline::{
        ContactReading, ContactStage, FrameContact, Measurement, Object, Pipeline, PipelineError,
        Press, Session,
    };
    pub use crate::sfs::{ControlPointSampler, SfsError, SlopeIntegrator, SurfaceReconstruction};
    pub use crate::tps::{TpsError, Warp, WarpModel};
    pub use crate::{StrainBetween, StrainBetweenOptions, strain_between};
}
