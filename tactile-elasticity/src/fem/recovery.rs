//! Pressures of a state: on a contact from its multipliers, on a bonded interface from the elements'
//! forces.

use super::element::{GAUSS3, quadratic};
use super::fields::Fields;
use super::interface::BondedInterface;
use super::model::Model;
use super::pressure::PressurePoint;
use nalgebra::{DMatrix, DVector};

impl Model {
    /// Force per deformed area at the contact's nodes from the axis outwards, and their axial forces.
    pub(crate) fn contact_pressure(&self, fields: &Fields) -> (Vec<PressurePoint>, Vec<f64>) {
        let placement = self.placement(fields);
        let candidates = self.candidates(fields, 0.0);
        let mut deformed = vec![0.0; self.contact_nodes.len()];
        for point in self.contact_points(fields) {
            let stretch = placement.stretch(&point.shape, &point.derivative, point.nodes);
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

impl Model {
    /// Axial forces that press the bodies together at the interface's nodes.
    pub(crate) fn interface_forces(
        &self,
        interface: &BondedInterface,
        fields: &Fields,
    ) -> DVector<f64> {
        let mut forces = DVector::zeros(interface.nodes.len());
        for &index in &interface.elements {
            let nodes = &self.elements[index];
            let shear = self.materials[self.regions[index]].shear_modulus();
            let u = fields.element(nodes);
            // A state in equilibrium has no inverted element.
            let Some(element) =
                self.geometry[index].forces(self.kinematics, shear, &u, &fields.pressures[index])
            else {
                continue;
            };
            for (local, node) in nodes.iter().enumerate() {
                if let Some(place) = interface.nodes.iter().position(|n| n == node) {
                    forces[place] += interface.sign * element.internal[2 * local + 1];
                }
            }
        }
        forces
    }

    /// ∫ N_a N_b 2π r dr over the deformed interface (the undeformed one in linear kinematics).
    pub(crate) fn interface_mass(
        &self,
        interface: &BondedInterface,
        fields: &Fields,
    ) -> DMatrix<f64> {
        let radius = |node: usize| match self.kinematics {
            super::Kinematics::Linear => self.nodes[node][0],
            super::Kinematics::Finite => self.nodes[node][0] + fields.displacement[2 * node],
        };
        let count = interface.nodes.len();
        let mut mass = DMatrix::zeros(count, count);
        for edge in &interface.edges {
            let places = edge.map(|node| interface.nodes.iter().position(|n| *n == node));
            for (xi, gauss) in GAUSS3 {
                let (shape, derivative) = quadratic(xi);
                let (mut r, mut dr) = (0.0, 0.0);
                for (k, &node) in edge.iter().enumerate() {
                    r += shape[k] * radius(node);
                    dr += derivative[k] * radius(node);
                }
                let weight = core::f64::consts::TAU * r * dr.abs() * gauss;
                for (a, place_a) in places.iter().enumerate() {
                    for (b, place_b) in places.iter().enumerate() {
                        if let (Some(i), Some(j)) = (place_a, place_b) {
                            mass[(*i, *j)] += weight * shape[a] * shape[b];
                        }
                    }
                }
            }
        }
        mass
    }

    /// Axial force per projected deformed area at the interface's nodes: the nodal forces that the
    /// elements of one side put in balance, spread over the interface by its quadratic shape functions.
    pub(crate) fn interface_pressure(
        &self,
        interface: &BondedInterface,
        fields: &Fields,
    ) -> Vec<PressurePoint> {
        let forces = self.interface_forces(interface, fields);
        let Some(pressures) = self.interface_mass(interface, fields).lu().solve(&forces) else {
            return Vec::new();
        };
        let placement = self.placement(fields);
        let nodes = interface.nodes.iter().zip(pressures.iter());
        let mut points: Vec<PressurePoint> = nodes
            .map(|(&node, &pressure_pa)| {
                let [r_m, z_m] = placement.current(node);
                PressurePoint {
                    r_m,
                    z_m,
                    pressure_pa,
                }
            })
            .collect();
        points.sort_by(|a, b| a.r_m.total_cmp(&b.r_m));
        points
    }
}
