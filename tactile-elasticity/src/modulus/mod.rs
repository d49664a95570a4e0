//! Young's modulus from what was measured at one or more loads.

mod contact;
mod covariance;
mod estimate;
mod law;
mod load;
mod ratio;
mod regression;
mod select;
mod series;
mod source;
mod statistics;
mod tabulated;
mod uniaxial;
mod warning;

pub use contact::{
    BondedLayer, Cone, ContactEstimator, Evidence, FlatPunch, HertzSphere, SphereBetweenPlates,
    SphereOnWaveguide, TataraSphere,
};
pub use estimate::{
    EstimatorKind, FitStatistics, LoadDiagnostics, ModulusEstimate, ModulusEstimator,
};
pub(crate) use law::{ConeLaw, LayerLaw, Punch, Sphere, TataraLaw, TipOnBallLaw};
pub use law::{ContactLaw, LayerTheory, LogForce, NoSlipLaw, WaveguideLaw};
pub use load::LoadState;
pub use ratio::{PaperRatio, StrainReference};
pub use regression::StressStrainRegression;
pub use select::{BestOf, ModulusSelection};
pub use series::{LoadSeries, SharedErrors};
pub use tabulated::TabulatedContact;
pub use tactile_core::{Estimate, Interval};
pub use uniaxial::UniaxialLoads;
pub use warning::Warning;
