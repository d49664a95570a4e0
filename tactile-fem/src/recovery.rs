//! Pressures of a state: on a contact from its multipliers, on a bonded interface from the elements'
//! forces.

use super::element::{GAUSS3, quadratic};
use super::fields::Fields;
use super::interface::BondedInterface;
use super::model::Model;
use super::pressure::PressurePoint;
use nalgebra::DVector;
use std::collections::BTreeMap;

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
            let Some(element) = self.geometry[index].forces(self.kinematics, shear, &u) else {
                continue;
            };
            let internal = element.internal(&fields.pressures[index]);
            for (local, node) in nodes.iter().enumerate() {
                if let Some(place) = interface.nodes.iter().position(|n| n == node) {
                    forces[place] += interface.sign * internal[2 * local + 1];
                }
            }
        }
        forces
    }

    /// Axial force per projected deformed area on the interface, from the axis outwards.
    ///
    /// The nodal forces that the elements of one side put in balance are the pressure's moments with
    /// the shape functions. Forces of single nodes alternate; their sums with the hat function φ of
    /// each corner do not:
    ///
    /// $$ P_a = \frac{f_a}{\int \phi_a 2\pi r dr} = p(\bar r_a) + \tfrac12 \sigma_a^2 p'' + \dots $$
    ///
    /// with the mean and the variance of r under φ. The second term is taken off by the second
    /// difference of neighbouring means.
    pub(crate) fn interface_pressure(
        &self,
        interface: &BondedInterface,
        fields: &Fields,
    ) -> Vec<PressurePoint> {
        let means = self.interface_means(interface, fields);
        let mut points = Vec::with_capacity(means.len());
        for (at, mean) in means.iter().enumerate() {
            let mut pressure_pa = mean.pressure;
            if let Some(bend) = second_difference(&means, at) {
                pressure_pa -= 0.5 * mean.variance * bend;
            }
            points.push(PressurePoint {
                r_m: mean.radius,
                z_m: mean.height,
                pressure_pa,
            });
        }
        points
    }

    fn interface_means(&self, interface: &BondedInterface, fields: &Fields) -> Vec<HatMean> {
        let forces = self.interface_forces(interface, fields);
        let force = |node: usize| {
            let place = interface.nodes.iter().position(|n| *n == node);
            place.map_or(0.0, |place| forces[place])
        };
        let placement = self.placement(fields);
        let position = |node: usize| match self.kinematics {
            super::Kinematics::Linear => self.nodes[node],
            super::Kinematics::Finite => placement.current(node),
        };
        let mut corners: BTreeMap<usize, Moments> = BTreeMap::new();
        for edge in &interface.edges {
            let nodes = edge.map(position);
            for (xi, gauss) in GAUSS3 {
                let (shape, derivative) = quadratic(xi);
                let [mut r, mut z, mut dr] = [0.0; 3];
                for k in 0..3 {
                    r += shape[k] * nodes[k][0];
                    z += shape[k] * nodes[k][1];
                    dr += derivative[k] * nodes[k][0];
                }
                let area = core::f64::consts::TAU * r * dr.abs() * gauss;
                for (corner, hat) in [(edge[0], 0.5 * (1.0 - xi)), (edge[2], 0.5 * (1.0 + xi))] {
                    let moments = corners.entry(corner).or_default();
                    moments.area += hat * area;
                    moments.radius += hat * area * r;
                    moments.square += hat * area * r * r;
                    moments.height += hat * area * z;
                }
            }
            for corner in [edge[0], edge[2]] {
                corners.entry(corner).or_default().force += 0.5 * force(edge[1]);
            }
        }
        let mut means: Vec<HatMean> = corners
            .into_iter()
            .map(|(corner, moments)| moments.mean(force(corner)))
            .collect();
        means.sort_by(|a, b| a.radius.total_cmp(&b.radius));
        means
    }
}

/// Integrals over the deformed interface with a corner's hat function.
#[derive(Debug, Clone, Copy, Default)]
struct Moments {
    area: f64,
    radius: f64,
    square: f64,
    height: f64,
    /// Axial force of the edges' middles.
    force: f64,
}

/// Mean pressure under a hat function.
#[derive(Debug, Clone, Copy)]
struct HatMean {
    radius: f64,
    height: f64,
    variance: f64,
    pressure: f64,
}

impl Moments {
    fn mean(self, corner_force: f64) -> HatMean {
        let radius = self.radius / self.area;
        HatMean {
            radius,
            height: self.height / self.area,
            variance: self.square / self.area - radius * radius,
            pressure: (self.force + corner_force) / self.area,
        }
    }
}

/// Second derivative of the mean pressure by the radius, from three neighbours; at the axis from the
/// mirrored one.
fn second_difference(means: &[HatMean], at: usize) -> Option<f64> {
    let here = means.get(at)?;
    let after = means.get(at + 1)?;
    let before = match at {
        // p is even in r: its second derivative there is that of the two nearest means.
        0 => {
            let squares =
                after.radius.powi(2) + after.variance - here.radius.powi(2) - here.variance;
            return Some(2.0 * (after.pressure - here.pressure) / squares);
        }
        _ => means.get(at - 1)?,
    };
    let (left, right) = (here.radius - before.radius, after.radius - here.radius);
    let slopes =
        (after.pressure - here.pressure) / right - (here.pressure - before.pressure) / left;
    Some(2.0 * slopes / (left + right))
}
