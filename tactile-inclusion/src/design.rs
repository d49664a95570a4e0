//! Expected errors of a scan before it is made.

use crate::covariance::{Observed, Resolution};
use crate::fit::Problem;
use crate::inclusion_search::InclusionSearch;
use crate::parameters::{BLOCK, LumpParameters};
use crate::tissue_block::check_approaches;
use tactile_elasticity::{ElasticityError, Quantity};

/// Elements along an eighth of the inclusion's circumference. The expected errors are within 2 % of
/// those of a mesh twice as fine. With three elements, the errors of a small shallow inclusion were
/// half as large as they should be.
const FINENESS: usize = 5;

/// An inclusion that is assumed for planning a scan.
///
/// ```
/// use tactile_inclusion::AssumedInclusion;
///
/// let lump = AssumedInclusion {
///     diameter_m: 10e-3,
///     depth_m: 4e-3,
///     youngs_modulus_pa: 40e3,
///     block_modulus_pa: 5e3,
/// };
/// assert_eq!(lump.youngs_modulus_pa / lump.block_modulus_pa, 8.0);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AssumedInclusion {
    /// Diameter D, in metres.
    pub diameter_m: f64,
    /// Depth of its top d, in metres.
    pub depth_m: f64,
    /// Young's modulus E₁, in pascals.
    pub youngs_modulus_pa: f64,
    /// Young's modulus of the tissue E₀, in pascals.
    pub block_modulus_pa: f64,
}

/// Relative standard errors expected from a scan.
///
/// ```
/// use tactile_inclusion::ExpectedErrors;
///
/// let errors = ExpectedErrors { diameter: 0.02, depth: 0.04, youngs_modulus: 0.4 };
/// assert!(errors.youngs_modulus > 0.3, "the modulus cannot be determined");
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct ExpectedErrors {
    /// Error of the diameter.
    pub diameter: f64,
    /// Error of the depth.
    pub depth: f64,
    /// Error of the inclusion's modulus.
    pub youngs_modulus: f64,
}

impl InclusionSearch {
    /// Standard errors of ln D, ln d and ln E₁ from frames at `approaches_m`, if the assumed
    /// inclusion is present. They are the Cramér–Rao bound
    ///
    /// $$ (J^T C^{-1} J + P^{-1})^{-1} $$
    ///
    /// with the prior knowledge of block, sensor and shape. `white_pa` is the white error of each
    /// ring's mean: the error of a pixel over the root of the ring's pixel count, larger near the
    /// axis. The face is assumed bonded unless the specimen specifies its interface. The cost is
    /// one solution with derivatives.
    ///
    /// # Errors
    /// An error if a length, modulus or error is not positive, if approaches do not increase, if
    /// the number of errors differs from that of the rings, or if fewer than eight rings are in
    /// reach. Also [`ElasticityError::NoSolution`].
    pub fn expected_errors(
        &self,
        assumed: &AssumedInclusion,
        approaches_m: &[f64],
        radii_m: &[f64],
        white_pa: &[f64],
    ) -> Result<ExpectedErrors, ElasticityError> {
        Quantity::Radius.positive(assumed.diameter_m)?;
        Quantity::Distance.positive(assumed.depth_m)?;
        Quantity::YoungsModulus.positive(assumed.youngs_modulus_pa)?;
        Quantity::YoungsModulus.positive(assumed.block_modulus_pa)?;
        Quantity::StandardError.entries(white_pa.len(), radii_m.len())?;
        for &white in white_pa {
            Quantity::StandardError.positive(white)?;
        }
        check_approaches(approaches_m.iter().copied())?;
        let used = self.rings_within_reach(radii_m)?;
        let mut observed = Observed {
            radii_m: used.iter().map(|&k| radii_m[k]).collect(),
            values: Vec::new(),
            white: Vec::new(),
            frames: approaches_m.len(),
            cells: None,
        };
        let interface = self.specimen().interfaces()[0];
        let mut parameters = self.known_block(assumed.block_modulus_pa);
        parameters.lump = Some(LumpParameters::ball(
            assumed.diameter_m,
            assumed.depth_m,
            assumed.youngs_modulus_pa,
        ));
        let forward = self.forward(&observed, approaches_m, interface, FINENESS);
        forward.scene(&parameters)?;
        let predicted = (forward.predict(&parameters)).ok_or(ElasticityError::NoSolution)?;
        observed.white = (0..observed.frames)
            .flat_map(|_| used.iter().map(|&ring| white_pa[ring]))
            .collect();
        // The pixel noise does not affect forces.
        observed.white.resize(predicted.len(), 0.0);
        observed.values = predicted;
        let covariance = observed.covariance(self.sensor(), interface, Resolution::Answer);
        let mut priors = self.block_priors(assumed.block_modulus_pa);
        priors.extend(self.lump_priors(assumed.block_modulus_pa));
        priors.extend(self.approach_priors(1, approaches_m));
        let problem = Problem {
            forward,
            measured: observed.values,
            factor: covariance.cholesky().ok_or(ElasticityError::NoSolution)?,
            priors,
        };
        let errors = (problem.errors(&parameters)).ok_or(ElasticityError::NoSolution)?;
        let [diameter, depth, youngs_modulus] = [0, 1, 2].map(|k| errors[BLOCK.len() + k]);
        Ok(ExpectedErrors {
            diameter,
            depth,
            youngs_modulus,
        })
    }
}
