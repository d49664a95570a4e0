//! The strain between two frames.
use crate::elasticity::field::{StrainField, StrainSummary};
use crate::elasticity::modulus::Estimate;

/// The strain between two frames.
///
/// ```
/// use tactile_simulate::Trial;
/// let trial = Trial::coarser(8)?;
/// use tactile_imaging::pipeline::PairStrain;
/// let pipeline = trial.pipeline()?.with_control_points(60);
/// let press = trial.press(&pipeline)?;
/// let strain: &PairStrain = press.strain(1)?;
/// assert_eq!(strain.field.strains.len(), 60, "one at every control point of the first frame");
/// let found = strain.summary.mean[(0, 0)];
/// let [first, last] = [&trial.simulation.truth[0], &trial.simulation.truth[1]];
/// assert!((found - first.scaling_to(last).green_lagrange_strain()[(0, 0)]).abs() < 0.03);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct PairStrain {
    /// Name of the measure.
    pub measure: &'static str,
    /// Strain at each control point of the first frame.
    pub field: StrainField,
    /// Mean, spread and standard error.
    pub summary: StrainSummary,
}

impl Default for PairStrain {
    /// An empty value to be filled.
    fn default() -> Self {
        let field = StrainField::default();
        Self {
            measure: "",
            summary: field.summary(),
            field,
        }
    }
}

impl PairStrain {
    /// The apparent strain of a ball's load for equation (31). The surface interpreted from its
    /// pressure grows in all directions with the load. Equation (31) therefore gets the size of the
    /// mean e_zz, with the sign of `force_step_n`, the change of load from the first frame to the
    /// second. (Specimens with a flat face have signed strains.)
    pub(super) fn of_load(&self, force_step_n: f64) -> Estimate {
        let size = self.summary.mean[(2, 2)].abs();
        let error = self.summary.standard_error[(2, 2)];
        Estimate::new(size.copysign(force_step_n), error)
    }
}
