#![doc = include_str!("../README.md")]
//!
//! # Method
//! The unknowns are the diameter D, the depth d of the top, the modulus E₁ of the inclusion and the
//! modulus E₀ of the block. The block's height, Poisson's ratio and the zero of the approaches have
//! priors. The model is [`FemScene::block_under_guide`](tactile_fem::FemScene::block_under_guide)
//! at finite strain: size and stiffness differ in the growth of the pressure with the approach,
//! which linear elasticity hardly shows.
//!
//! Let y be the measured ring means and forces, m(φ) those of the model, and C the covariance of
//! the errors of sensor and model. With a Gaussian prior of mean φ₀ and covariance P,
//!
//! $$ -2 \ln p(\varphi | y) = (y - m)^T C^{-1} (y - m) + (\varphi - \varphi_0)^T P^{-1} (\varphi -
//! \varphi_0) + c $$
//!
//! is minimised over φ = (ln E₀, zero, ln H, ν, ln D, ln d, ln E₁). Its second derivative at the
//! minimum gives errors and correlations, and the determinant gives the evidence (Laplace). The
//! ratio of the evidence with and without an inclusion gives the odds of an inclusion.
//!
//! The posterior is far from Gaussian: above some contrast, a stiffer inclusion no longer changes
//! the pressure. A small stiff inclusion is hardly different from a large one that is slightly
//! stiffer than the tissue. The intervals of D, d and E₁ therefore follow the posterior along ln
//! E₁. If bonded and frictionless faces fit the frames about equally well, the intervals cover
//! both.
//!
//! # References
//! V. Egorov & A. P. Sarvazyan, IEEE Trans. Med. Imaging 27 (2008) 1275. J.-H. Lee & C.-H. Won,
//! IEEE Sensors J. 13 (2013). A. Tarantola, *Inverse Problem Theory* (2005). R. E. Kass & A. E.
//! Raftery, J. Am. Stat. Assoc. 90 (1995) 773. H. Rue, S. Martino & N. Chopin, J. R. Stat. Soc. B
//! 71 (2009) 319.
#![forbid(unsafe_code)]

mod covariance;
mod design;
mod estimate;
mod first_fits;
mod fit;
mod forward;
mod hypothesis;
mod inclusion_search;
mod limits;
mod pair;
mod parameters;
mod picture;
mod progress;
mod ridge;
mod scan;
mod search;
mod starts;
mod tissue_block;

pub use design::{AssumedInclusion, ExpectedErrors};
pub use estimate::{
    Estimated, Identifiable, Inclusion, InclusionEstimate, InclusionWarning, SearchVerdict,
    asymmetry_warnings,
};
pub use inclusion_search::InclusionSearch;
pub use scan::{Scan, ScanPress};
pub use tactile_core::Progress;
pub use tissue_block::{PressureProfile, SensorErrors, TissueBlock};

#[cfg(test)]
mod tests;
