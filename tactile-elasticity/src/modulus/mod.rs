//! Young's modulus from measurements at one or more loads.

mod bodies;
mod contact;
mod contact_fit;
mod estimate;
mod kind;
mod load;
mod ratio;
mod regression;
mod statistics;
mod tabulated;
mod uniaxial;
mod warning;

pub use bodies::{Bodies, Object};
pub use contact::{BondedLayer, Cone, ContactEstimator, FlatPunch, HertzSphere, SphereOnWaveguide};
pub use estimate::{FitStatistics, LoadDiagnostics, ModulusEstimate, ModulusEstimator};
pub use kind::EstimatorKind;
pub use load::{LoadSeries, LoadState};
pub use ratio::{PaperRatio, StrainReference};
pub use regression::StressStrainRegression;
pub use tabulated::TabulatedContact;
pub use tactile_core::{Estimate, Source, Uncertain};
pub use uniaxial::UniaxialLoads;
pub use warning::Warning;
