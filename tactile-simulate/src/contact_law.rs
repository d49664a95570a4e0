//! Where the contact at a force comes from: a closed form or states computed elsewhere.

use std::borrow::Cow;
use std::f64::consts::PI;

use super::contact_state::{ContactState, EQUAL_FORCES};
use super::error::{SimulateError, at_least, within};
use super::finite_elements;
use super::material::{Sphere, Waveguide};

/// Where pressure, contact radius and indentation at a force come from.
///
/// ```
/// use tactile_simulate::{ContactLaw, PressOptions, PressScene};
/// let contact = |law| {
///     let scene = PressScene::new(PressOptions { law, ..PressOptions::default() })?;
///     Ok::<_, tactile_simulate::SimulateError>(scene.truth(0).contact)
/// };
/// let (hertz, tatara) = (contact(ContactLaw::Hertz)?, contact(ContactLaw::Tatara)?);
/// assert_eq!(hertz.indentation_m, hertz.contact_radius_m.powi(2) / hertz.sphere_radius_m);
/// assert_eq!(tatara.contact_radius_m, hertz.contact_radius_m);
/// assert!(tatara.indentation_m < hertz.indentation_m);
/// // 0.7 N: a/R is 0.92. Springs in series make the layers too soft.
/// let solved = contact(ContactLaw::FiniteElements)?;
/// assert!((solved.contact_radius_m / 2.75e-3 - 1.0).abs() < 0.01 && hertz.contact_radius_m > 1.15 * solved.contact_radius_m);
/// # Ok::<(), tactile_simulate::SimulateError>(())
/// ```
#[derive(Debug, Clone, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum ContactLaw {
    /// Hertz (1882): a³ = 3FR/(4E*), δ = a²/R. Small contact, a ≪ R; the simulator obeys it at any load.
    #[default]
    Hertz,
    /// Tatara (1991), first extension of Hertz to a sphere squeezed between two surfaces: Hertz's radius and
    /// pressure, but the approach is lessened by the displacement that the opposite contact's force causes,
    /// δ = a²/R − F/(πE₁)·[(1 − ν₁²)/√(a² + 4R²) + 2(1 + ν₁)R²/(a² + 4R²)^{3/2}].
    /// Only the sphere's own material (E₁, ν₁) enters the correction: the waveguide is loaded on one side.
    /// His stiffening of rubber and the lateral spread of the contact are not included.
    ///
    /// Y. Tatara, J. Eng. Mater. Technol. 113 (1991) 285–291.
    Tatara,
    /// Finite elements at finite strain: the contacts of a ball of 3 mm of [`CL2000X`](super::Elastic::CL2000X) or
    /// [`CL2003X`](super::Elastic::CL2003X) on the [default waveguide](super::Waveguide::default) up to 1.3 N, neo-Hookean and without friction, as
    /// `examples/contact_states.rs` computes them. Another ball or waveguide is refused: give its contacts as
    /// [`Tabulated`](Self::Tabulated). Between the states as there.
    FiniteElements,
    /// States computed elsewhere, with growing force. A load at a state's force is that state; between two states radius, pressure
    /// over its mean, and height over F^⅔ at equal r/a are linear in F^⅓; below the first, that one shrinks as Hertz's contact does. A
    /// load beyond the last state is refused. [`PressScene::calibrate`](super::PressScene::calibrate), which presses another
    /// object, takes Hertz's law.
    Tabulated(Vec<ContactState>),
}

impl ContactLaw {
    pub(super) fn validate(&self) -> Result<(), SimulateError> {
        let Self::Tabulated(states) = self else {
            return Ok(());
        };
        at_least("states", states.len(), 1)?;
        states.iter().try_for_each(ContactState::validate)?;
        for pair in states.windows(2) {
            within(
                "force_n",
                pair[1].force_n,
                pair[0].force_n * (1.0 + EQUAL_FORCES),
                f64::MAX,
            )?;
        }
        Ok(())
    }

    /// The largest force with a contact.
    ///
    /// # Errors
    /// [`SimulateError::NoFiniteElements`].
    pub(super) fn largest_force_n(
        &self,
        sphere: &Sphere,
        waveguide: &Waveguide,
    ) -> Result<f64, SimulateError> {
        let states = self.states(sphere, waveguide)?;
        let largest = |last: &ContactState| last.force_n * (1.0 + EQUAL_FORCES);
        Ok(states.map_or(f64::MAX, |s| s.last().map_or(0.0, largest)))
    }

    /// The states of a contact computed elsewhere; none for a closed form.
    ///
    /// # Errors
    /// [`SimulateError::NoFiniteElements`].
    pub(super) fn states(
        &self,
        sphere: &Sphere,
        waveguide: &Waveguide,
    ) -> Result<Option<Cow<'_, [ContactState]>>, SimulateError> {
        match self {
            Self::Hertz | Self::Tatara => Ok(None),
            Self::FiniteElements => {
                let states = finite_elements::states(sphere, waveguide);
                states
                    .map(|s| Some(Cow::Owned(s)))
                    .ok_or(SimulateError::NoFiniteElements)
            }
            Self::Tabulated(states) => Ok(Some(Cow::Borrowed(states))),
        }
    }
}

/// What the opposite contact takes off the approach by [`ContactLaw::Tatara`], in metres.
pub(super) fn far_side_m(sphere: &Sphere, force_n: f64, a: f64) -> f64 {
    let (nu, r) = (sphere.material.poisson_ratio, sphere.radius_m);
    let d = (a * a + 4.0 * r * r).sqrt();
    force_n / (PI * sphere.material.youngs_modulus_pa)
        * ((1.0 - nu) * (1.0 + nu) / d + 2.0 * (1.0 + nu) * r * r / (d * d * d))
}
