//! Loads, and what a solution reports.

use super::state::State;

/// One load: how far the driven boundaries have moved, or with what force.
///
/// ```
/// use tactile_fem::Load;
///
/// let loads = [0.2, 0.7, 1.2].map(Load::Force);
/// assert_eq!(loads[1], Load::Force(0.7));
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Load {
    /// The approach δ, in metres.
    Approach(f64),
    /// The force on the driven boundaries, in newtons; positive presses.
    Force(f64),
}

/// How a solution ended.
///
/// ```
/// use tactile_fem::Outcome;
///
/// assert_ne!(Outcome::Solved, Outcome::Stopped { load: 1, approach_m: 1e-3, force_n: 0.2 });
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub enum Outcome {
    /// Every load has its state.
    Solved,
    /// This load was not reached; the states of those before it are given.
    Stopped {
        /// Index of the load.
        load: usize,
        /// The last approach in equilibrium, in metres.
        approach_m: f64,
        /// The force there, in newtons.
        force_n: f64,
    },
}

/// What the solver did.
///
/// ```
/// use tactile_fem::{Load, Material, Object, Outcome, Press};
///
/// # fn main() -> Result<(), tactile_elasticity::ElasticityError> {
/// let press = Press::new(Object::Ball { radius_m: 3e-3 }, Material::new(1e5, 0.495)?)?;
/// let report = press.scene()?.solve(&[Load::Approach(0.3e-3)]).report;
/// assert_eq!(report.outcome, Outcome::Solved);
/// assert!(report.iterations > report.steps);
/// # Ok(())
/// # }
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Report {
    /// Whether all loads were reached.
    pub outcome: Outcome,
    /// Load steps that converged.
    pub steps: usize,
    /// Load steps given up and taken again in halves.
    pub rejected_steps: usize,
    /// Newton iterations, those with an earlier tangent and of rejected steps too.
    pub iterations: usize,
}

/// States at the loads that were reached, in order, and a report.
///
/// ```
/// use tactile_fem::{Load, Material, Object, Outcome, Press};
///
/// # fn main() -> Result<(), tactile_elasticity::ElasticityError> {
/// let press = Press::new(Object::Ball { radius_m: 3e-3 }, Material::new(1e5, 0.495)?)?;
/// let solution = press.scene()?.solve(&[Load::Approach(0.3e-3), Load::Approach(f64::NAN)]);
/// assert_eq!(solution.states.len(), 1);
/// assert!(matches!(solution.report.outcome, Outcome::Stopped { load: 1, .. }));
/// # Ok(())
/// # }
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Solution {
    /// One state a load.
    pub states: Vec<State>,
    /// What the solver did.
    pub report: Report,
}
