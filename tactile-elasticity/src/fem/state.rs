//! The solution at one load.

use super::model::Model;
use super::newton::Equilibrium;
use super::radius::contact_radius;
use super::system::Fields;

/// Pressure at a point of a contact or of a bonded interface.
///
/// ```
/// use tactile_elasticity::fem::{Load, Material, Scene};
///
/// let scene = Scene::ball_on_flat(3e-3, Material::new(1e5, 0.495).unwrap()).unwrap();
/// let state = &scene.solve(&[Load::Approach(0.3e-3)]).states[0];
/// assert!(state.pressure()[0].pressure_pa > state.pressure()[5].pressure_pa);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct PressurePoint {
    /// Deformed distance from the axis, in metres.
    pub r_m: f64,
    /// Deformed height, in metres.
    pub z_m: f64,
    /// Force per deformed area, in pascals.
    pub pressure_pa: f64,
}

/// A contact radius and how far the mesh leaves it open.
///
/// ```
/// use tactile_elasticity::fem::{Load, Material, Scene};
///
/// let scene = Scene::ball_on_flat(3e-3, Material::new(1e5, 0.495).unwrap()).unwrap();
/// let state = &scene.solve(&[Load::Approach(0.3e-3)]).states[0];
/// let radius = state.contact_radius().unwrap();
/// assert!(radius.uncertainty_m < 0.01 * radius.radius_m);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct ContactRadius {
    /// The radius, in metres.
    pub radius_m: f64,
    /// Numerical uncertainty: the difference between two extrapolations of the pressure to zero.
    pub uncertainty_m: f64,
}

/// The deformed bodies at one load.
///
/// ```
/// use tactile_elasticity::fem::{Load, Material, Scene};
///
/// let scene = Scene::ball_on_flat(3e-3, Material::new(1e5, 0.495).unwrap()).unwrap();
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
        let (mut pressure, forces) = model.contact_pressure(&equilibrium.fields);
        let radius = contact_radius(&pressure, &forces);
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
    pub fn displacements(&self) -> Vec<[f64; 2]> {
        let pairs = self.fields.displacement.chunks_exact(2);
        pairs.map(|pair| [pair[0], pair[1]]).collect()
    }

    /// Pressure at the nodes in contact or on the bonded interface, from the axis outwards.
    pub fn pressure(&self) -> &[PressurePoint] {
        &self.pressure
    }

    /// Radius at which the contact pressure falls to zero: near a smooth contact's edge p² is nearly
    /// linear in r², and the force it carries is known from equilibrium.
    ///
    /// `None` where fewer than some eight nodes are in contact.
    pub fn contact_radius(&self) -> Option<ContactRadius> {
        self.radius
    }
}

impl Model {
    /// Force per deformed area at the contact's nodes from the axis outwards, and their axial forces.
    pub(crate) fn contact_pressure(&self, fields: &Fields) -> (Vec<PressurePoint>, Vec<f64>) {
        let placement = self.placement(fields);
        let candidates = self.candidates(fields, 0.0);
        let mut deformed = vec![0.0; self.contact_nodes.len()];
        for point in self.contact_points(fields) {
            let stretch = placement.stretch(&point);
            for (node, weight) in point.shares {
                deformed[node] += weight * stretch;
            }
        }
        let mut points: Vec<(PressurePoint, f64)> = candidates
            .iter()
            .filter(|candidate| candidate.pressure > 0.0)
            .map(|candidate| {
                let node = &self.contact_nodes[candidate.index];
                let [r_m, z_m] = placement.current(node.node);
                let force = candidate.pressure * node.weight;
                let point = PressurePoint {
                    r_m,
                    z_m,
                    pressure_pa: force / deformed[candidate.index],
                };
                (point, force * candidate.gap.axial)
            })
            .collect();
        points.sort_by(|a, b| a.0.r_m.total_cmp(&b.0.r_m));
        points.into_iter().unzip()
    }
}
