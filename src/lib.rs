#![doc = include_str!("../README.md")]
//!
//! # Equations
//! What the stages compute. Each crate's page has its own.
//!
//! - Light stays inside below $\theta_i = \arcsin\sqrt{n_i^2 - 1}$ (1)–(4) until a press lets it
//!   out: [`optics`].
//! - Force $F_z = \int P dS$, centroid $\sum x I/\sum I$, shear $F_x = K_x u_x$ (5)–(12):
//!   [`force`].
//! - Surface from shading, $|\nabla z| = \sqrt{1/R^2 - 1}$ under frontal light: [`sfs`].
//! - Matches: annealed softassign with a Gaussian-process prior by default, the paper's relaxation
//!   labelling (13)–(20) by name, [`matching`]; warp $f(x) = a_0 + A x + \sum_i w_i U(|x - x_i|)$
//!   (21)–(24): [`tps`].
//! - Strain $E = \frac{1}{2}(F^T F - I)$ (25)–(30) and modulus $E = S_{zz}/\bar e_{zz}$ (31), or
//!   Hertz's $a^3 = 3FR/(4E^{\ast})$: [`elasticity`].
#![forbid(unsafe_code)]
pub use tactile_core as core;
pub use tactile_elasticity as elasticity;
pub use tactile_force as force;
pub use tactile_match as matching;
pub use tactile_optics as optics;
pub use tactile_sfs as sfs;
pub use tactile_tps as tps;

#[cfg(feature = "fem")]
pub use tactile_fem as fem;

#[cfg(feature = "inclusion")]
pub mod inclusion;
#[cfg(feature = "scene")]
pub mod io;
pub mod markers;
pub mod pipeline;
#[cfg(feature = "scene")]
pub mod scene;
#[cfg(feature = "scene")]
pub mod sensor;
mod strain_between;
mod strain_series;

pub use pipeline::{Measurement, Object, Pipeline, Press};
pub use strain_between::{
    PairsDoubt, StrainAt, StrainBetween, StrainBetweenError, StrainBetweenOptions, strain_between,
};
pub use strain_series::{SeriesStrain, StrainSeries};

/// The types and traits of a program that measures with stages of its own: `use
/// tactile_imaging::prelude::*`.
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
