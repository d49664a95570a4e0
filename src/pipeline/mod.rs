//! The pipeline: frames in. Force, contact, surface, match, strain and modulus out, each when asked
//! for.
//!
//! ```text
//! frame ─ contact ─┬─ force, radius, centroid ──────────────────────────┐
//!                  └─ surface ─ control points ─ match ─ warp ─ strain ─┴─ modulus
//! ```
//!
//! A [`Pipeline`] holds the stages, each any implementation of its trait, given as a value or by
//! its name in a configuration ([`StagesConfig`]). It is `Send + Sync` and cheap to clone. A
//! [`Press`] holds frames and computes what it is asked for, with what that needs and nothing else:
//! [`Press::contact`] touches no surface, [`Press::modulus`] of a ball none either,
//! [`Press::measure`] everything. The [`Report`] says what ran, for how long, and what was skipped
//! for which reason.
//!
//! A [`Session`] follows a stream from a [`FrameSource`] with constant memory, force and modulus
//! and, for who asks, strain;
//! [`contacts`] reads a batch of frames.
//!
//! # Which modulus
//! For a ball, Hertz's pressure p₀√(1 − r²/a²) read as frontal Lambertian shading is a hemisphere
//! of radius a, and a grows as (F R/E*)^⅓. Between two loads that surface scales by (F₂/F₁)^⅓
//! whatever the modulus is. The ratio of stress to strain, equation (31), is therefore reported
//! (first among [`Measurement::estimators`]) but not believed: the modulus comes from a³ =
//! 3FR/(4E*), both bodies yielding, the waveguide's layers in series. a/R is in every report, and
//! beyond 0.3 the result carries a flag. Specimens with a flat face are what (31) is exact for:
//! stress over strain, regressed over all loads, the strain from the growth of the face's area. An
//! object of unknown shape is read so if its contacts are those of a flat face, and refused with
//! what to tell the program if not ([`PipelineError::NotUniaxial`]).
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
pub use press::Press;
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
