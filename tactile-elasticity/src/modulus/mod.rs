//! Young's modulus from what was measured at one or more loads.

mod contact;
mod estimate;
mod law;
mod load;
mod ratio;
mod regression;
mod statistics;
mod warning;

pub use contact::{Cone, ContactEstimator, Evidence, FlatPunch, HertzSphere};
pub use estimate::{
    EstimatorKind, FitStatistics, Interval, LoadDiagnostics, ModulusEstimate, ModulusEstimator,
};
pub use law::{ConeLaw, ContactLaw, Punch, Sphere};
pub use load::{Estimate, LoadState};
pub use ratio::{PaperRatio, StrainReference};
pub use regression::{Intercept, StressStrainRegression};
pub use warning::Warning;
