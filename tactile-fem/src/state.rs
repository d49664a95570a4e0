//! The solution at one load.

use super::fields::{Equilibrium, Fields};
use super::model::Model;
use super::pressure::{ContactRadius, PressurePoint, pressure_at};
use super::radius::ContactProfile;

/// The deformed bodies at one load.
///
/// ```
/// use tactile_fem::{Load, Material, Object, Press};
///
/// let scene = Press::new(Object::Ball { radius_m: 3e-3 }, Material::new(1e5, 0.495).unwrap()).and_then(|press| press.scene()).unwrap();
/// let state = &scene.solve(&[Load::Approach(0.3e-3)]).states[0];
/// assert_eq!(state.approach_m(), 0.3e-3);
/// assert!(state.force_n() > 0.0);
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct State {
    pub(crate) fields: Fields,
    force: f64,
    pressure: Vec<PressurePoint>,
    radius: Option<ContactRadius>,
}

impl State {
    pub(crate) fn new(model: &Model, equilibrium: &Equilibrium) -> Self {
        let (nodes, forces) = model.contact_pressure(&equilibrium.fields);
        let ContactProfile {
            points: mut pressure,
            radius,
        } = ContactProfile::new(nodes, forces.iter().sum());
        if let Some(interface) = &model.interface {
            pressure = model.interface_pressure(interface, &equilibrium.fields);
        }
        Self {
            force: equilibrium.force,
            radius,
            pressure,
            fields: equilibrium.fields.clone(),
        }
    }

    /// Force on the driven boundaries, in newtons; positive presses.
    pub fn force_n(&self) -> f64 {
        self.force
    }

    /// How far the driven boundaries have moved, in metres.
    pub fn approach_m(&self) -> f64 {
        self.fields.approach
    }

    /// Displacement (r, z) of every node, in metres.
    pub(crate) fn displacements(&self) -> Vec<[f64; 2]> {
        let pairs = self.fields.displacement.chunks_exact(2);
        pairs.map(|pair| [pair[0], pair[1]]).collect()
    }

    /// Pressure at the elements' ends in contact, or at the nodes of a bonded interface, from the axis outwards; of
    /// [`PressurePoint`]'s example. Within a contact's outermost two elements it is that of a smooth edge which carries the elements' force.
    pub fn pressure(&self) -> &[PressurePoint] {
        &self.pressure
    }

    /// Pressure at a radius of the deformed interface in metres, by the cubic through the four nearest
    /// points of [`Self::pressure`]; constant beyond the last, zero without contact.
    ///
    /// ```
    /// # use tactile_fem::{Load, Material, Object, Press};
    /// let scene = Press::new(Object::Ball { radius_m: 3e-3 }, Material::new(1e5, 0.495).unwrap()).and_then(|press| press.scene()).unwrap();
    /// let state = &scene.solve(&[Load::Approach(0.3e-3)]).states[0];
    /// assert!(state.pressure_at(0.1e-3) > state.pressure_at(0.5e-3));
    /// ```
    pub fn pressure_at(&self, radius_m: f64) -> f64 {
        pressure_at(&self.pressure, radius_m)
    }

    /// Radius at which the contact pressure falls to zero: near a smooth contact's edge p² is nearly
    /// linear in r², and the force it carries is known from equilibrium.
    ///
    /// `None` where fewer than some eight nodes are in contact.
    pub fn contact_radius(&self) -> Option<ContactRadius> {
        self.radius
    }
}
