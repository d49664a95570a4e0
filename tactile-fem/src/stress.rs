//! Stresses at any point of a state.

use super::element::{ALL, map, pressure_functions, shape};
use super::material::{Deformation, Gradient, Kinematics};
use super::model::Model;
use super::state::State;

/// The Cauchy stress at a point, in pascals, tension positive; the components rθ and zθ are zero.
///
/// ```
/// use tactile_fem::{Interface, Load, Material, Scene};
///
/// // A cylinder free to slide between plates, squeezed by a thousandth: σzz = −E/1000 nearly.
/// let scene = Scene::cylinder_between_plates(2e-3, 2e-3, Material::new(1e5, 0.45)?, Interface::Frictionless)?;
/// let state = &scene.solve(&[Load::Approach(1e-6)]).states[0];
/// let stress = scene.stress(state, [0.7e-3, 0.4e-3]).expect("a point of the cylinder");
/// assert!((stress.zz_pa / -100.0 - 1.0).abs() < 5e-3 && stress.rr_pa.abs() < 0.5);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Stress {
    /// Radial component.
    pub rr_pa: f64,
    /// Axial component.
    pub zz_pa: f64,
    /// Hoop component.
    pub hoop_pa: f64,
    /// Shear component rz.
    pub rz_pa: f64,
}

impl Model {
    /// Cauchy stress at the material point with reference coordinates (r, z) in metres; Hooke's stress in
    /// linear kinematics. `None` outside the bodies, or for a state of another model.
    pub(crate) fn stress(&self, state: &State, point: [f64; 2]) -> Option<Stress> {
        let fields = &state.fields;
        if fields.displacement.len() != 2 * self.nodes.len() {
            return None;
        }
        let (index, [xi, eta]) = self.locate(point)?;
        // On the axis u_r / r is ∂u_r/∂r: taken from close by, where the quotient is still exact.
        let xi = if point[0] == 0.0 {
            xi * (1.0 - 1e-7)
        } else {
            xi
        };
        self.element_stress(state, index, [xi, eta])
    }

    /// Cauchy stress within an element, off the axis; `None` where it is turned inside out.
    pub(super) fn element_stress(
        &self,
        state: &State,
        index: usize,
        [xi, eta]: [f64; 2],
    ) -> Option<Stress> {
        let fields = &state.fields;
        let nodes = self.elements[index].map(|node| self.nodes[node]);
        let (position, gradients, _) = map(&nodes, xi, eta);
        let u: [f64; ALL] = fields.element(&self.elements[index]);
        let mut h: Gradient = [0.0; 5];
        for (a, [by_r, by_z, over_r]) in gradients.iter().enumerate() {
            h[0] += by_r * u[2 * a];
            h[1] += by_z * u[2 * a];
            h[2] += by_r * u[2 * a + 1];
            h[3] += by_z * u[2 * a + 1];
            h[4] += over_r * u[2 * a];
        }
        let material = &self.materials[self.regions[index]];
        let deformation = Deformation::new(self.kinematics, material.shear_modulus(), &h)?;
        let response = deformation.response();
        let functions = pressure_functions(&nodes, position);
        let pressures = functions.iter().zip(&fields.pressures[index]);
        let pressure: f64 = pressures.map(|(function, value)| function * value).sum();
        let first: Gradient =
            core::array::from_fn(|k| response.stress[k] + pressure * response.cofactor[k]);
        // σ = P Fᵀ / J.
        let (f, j) = match self.kinematics {
            Kinematics::Linear => ([1.0, 0.0, 0.0, 1.0, 1.0], 1.0),
            Kinematics::Finite => (
                [1.0 + h[0], h[1], h[2], 1.0 + h[3], 1.0 + h[4]],
                1.0 + response.volume,
            ),
        };
        Some(Stress {
            rr_pa: (first[0] * f[0] + first[1] * f[1]) / j,
            zz_pa: (first[2] * f[2] + first[3] * f[3]) / j,
            hoop_pa: first[4] * f[4] / j,
            rz_pa: (first[0] * f[2] + first[1] * f[3]) / j,
        })
    }

    /// The element that holds a point of the reference configuration, and the point's ξ and η.
    fn locate(&self, point: [f64; 2]) -> Option<(usize, [f64; 2])> {
        // Rounding alone takes points of a shared edge out of both elements.
        let limit = 1.0 + 1e-9;
        self.elements.iter().enumerate().find_map(|(index, nodes)| {
            let nodes = nodes.map(|node| self.nodes[node]);
            let within = |k: usize| {
                let values = nodes.iter().map(|node| node[k]);
                let low = values.clone().fold(f64::INFINITY, f64::min);
                let high = values.fold(f64::NEG_INFINITY, f64::max);
                // An edge bulges beyond its nodes by less than an eighth of the element.
                let margin = 0.125 * (high - low);
                (low - margin..=high + margin).contains(&point[k])
            };
            if !(within(0) && within(1)) {
                return None;
            }
            let at = inverse_map(&nodes, point)?;
            at.iter().all(|x| x.abs() <= limit).then_some((index, at))
        })
    }
}

/// ξ and η of a point by Newton's method; `None` where it leaves the element's surroundings.
fn inverse_map(nodes: &[[f64; 2]; 9], point: [f64; 2]) -> Option<[f64; 2]> {
    let size = (nodes[2][0] - nodes[0][0]).hypot(nodes[2][1] - nodes[0][1]);
    let mut at = [0.0; 2];
    for _ in 0..20 {
        let shapes = shape(at[0], at[1]);
        let mut position = [0.0; 2];
        let mut jacobian = [[0.0; 2]; 2];
        for (node, [n, by_xi, by_eta]) in nodes.iter().zip(&shapes) {
            for k in 0..2 {
                position[k] += n * node[k];
                jacobian[0][k] += by_xi * node[k];
                jacobian[1][k] += by_eta * node[k];
            }
        }
        let [dr, dz] = [point[0] - position[0], point[1] - position[1]];
        if dr.hypot(dz) <= 1e-13 * size {
            break;
        }
        let determinant = jacobian[0][0] * jacobian[1][1] - jacobian[0][1] * jacobian[1][0];
        at[0] += (jacobian[1][1] * dr - jacobian[1][0] * dz) / determinant;
        at[1] += (jacobian[0][0] * dz - jacobian[0][1] * dr) / determinant;
        if !at.iter().all(|x| x.abs() < 3.0) {
            return None;
        }
    }
    Some(at)
}
