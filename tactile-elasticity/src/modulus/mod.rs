//! Young's modulus from what was measured at one or more loads.

mod contact;
mod estimate;
mod law;
mod load;
mod ratio;
mod regression;
mod statistics;
mod tabulated;
mod waveguide_law;

pub use contact::{BondedLayer, Cone, ContactEstimator, FlatPunch, HertzSphere, SphereOnWaveguide};
pub use estimate::{
    EstimatorKind, FitStatistics, LoadDiagnostics, ModulusEstimate, ModulusEstimator, Warning,
};
pub use law::{ConeLaw, ContactLaw, HertzLaw, LayerLaw, LogForce, PunchLaw};
pub use load::{LoadSeries, LoadState, SharedErrors};
pub use ratio::{PaperRatio, StrainReference};
pub use regression::{StressStrainRegression, UniaxialLoads};
pub use tabulated::TabulatedContact;
pub use tactile_core::{Estimate, Interval};
pub use waveguide_law::WaveguideLaw;
