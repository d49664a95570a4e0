//! The pipeline: from frames to force, contact, surface, match, strain and modulus, each computed
//! on request.
//!
//! ```text
//! frame ─ contact ─┬─ force, radius, centroid ──────────────────────────┐
//!                  └─ surface ─ control points ─ match ─ warp ─ strain ─┴─ modulus
//! ```
//!
//! A [`Pipeline`] holds the stages. Each is any implementation of its trait, given as a value or by
//! its name in a configuration ([`StagesConfig`]). A pipeline is `Send + Sync` and cheap to clone.
//! A [`Press`] holds frames and computes only the requested results and their inputs:
//! [`Press::contact`] and, for a ball, [`Press::modulus`] reconstruct no surface, whereas
//! [`Press::measure`] computes everything. The [`Report`] lists which stages ran, their times, and
//! what was skipped for which reason.
//!
//! A [`Session`] follows a stream from a [`FrameSource`] with constant memory. It computes force,
//! modulus and, on request, strain. [`contacts`] reads a batch of frames.
//!
//! # Which modulus
//! For a ball, Hertz's pressure p₀√(1 − r²/a²) interpreted as frontal Lambertian shading is a
//! hemisphere of radius a, and a grows as (F R/E*)^⅓. Between two loads this surface scales by
//! (F₂/F₁)^⅓ for any modulus. The ratio of stress to strain, equation (31), is therefore reported
//! (first in [`Measurement::estimators`]) but not used. The modulus comes from a³ = 3FR/(4E*),
//! where both bodies are elastic and the layers of the waveguide act in series. Every report
//! contains a/R, and above 0.3 the result has a flag. Equation (31) is exact for specimens with a
//! flat face: stress over strain, regressed over all loads, with the strain from the growth of the
//! face's area. An object of unknown shape is treated in this way if its contacts are those of a
//! flat face. Otherwise it is rejected, and the error explains what to specify
//! ([`PipelineError::NotUniaxial`]).
mod assumptions;
mod batch;
mod budget;
mod contact;
mod dark;
mod depression;
mod error;
mod estimators;
mod flag;
mod known_presses;
mod light;
mod loads;
mod measure;
#[expect(clippy::module_inception, reason = "the type that the module is about")]
mod pipeline;
mod press;
mod reference_light;
mod report;
mod result;
mod session;
mod settings;
mod source;
mod specimen;
mod stage_names;
mod stages;
mod strain;
mod surface;
mod text;
mod time;

pub use self::pipeline::Pipeline;
pub use crate::force::{FaceReading, ShapeProblem};
pub use crate::sfs::{BallFit, Binning};
pub use assumptions::{Assumption, Assumptions, CheckedGain, CheckedGuide};
pub use batch::contacts;
pub use budget::ErrorShare;
pub use contact::{ContactReading, ContactStage, FrameContact};
pub use dark::DarkContact;
pub use error::{PipelineError, PipelineErrorKind};
pub use flag::Flag;
pub use known_presses::{CheckPress, CheckedObject, KnownBall};
pub use light::LightContact;
pub use press::{PerPercent, Press};
pub use reference_light::ReferenceLight;
pub use report::{Report, Skip, SkipReason, Stage, Work};
pub use result::{FrameResult, MatchResult, Measurement, ModulusResult, StrainResult};
pub use session::{DriftWatch, Session, SessionStrain, Update};
pub use settings::{Settings, SurfaceInput};
pub use source::FrameSource;
pub use specimen::Object;
pub use stage_names::{
    EstimatorChoice, MatcherChoice, ReconstructionChoice, SamplerChoice, StagesConfig,
    StrainChoice, UnknownStage, WarpChoice,
};
pub use strain::PairStrain;
pub use surface::ContactSurface;
pub use text::{interval_text, with_error};
pub use time::TimeResult;
