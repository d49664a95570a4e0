//! The solution at one load, with its pressures, contact radius and stresses.

use crate::element::{ALL, map, position, pressure_functions, shape};
use crate::material::{Gradient, Kinematics, PointDeformation};
use crate::model::{ElementModel, Equilibrium, ModelFields};
use crate::recovery::{ContactRadius, PressurePoint, contact_profile};

/// The deformed bodies at one load.
///
/// ```
/// use tactile_fem::{AppliedLoad, Material, ObjectShape, ObjectPress};
///
/// let scene = ObjectPress::new(
///     ObjectShape::Ball { radius_m: 3e-3 },
///     Material::new(1e5, 0.495).unwrap(),
/// )
/// .and_then(|press| press.scene())
/// .unwrap();
/// let state = &scene.solve(&[AppliedLoad::Approach(0.3e-3)]).states[0];
/// assert_eq!(state.approach_m(), 0.3e-3);
/// assert!(state.force_n() > 0.0);
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct State {
    pub(crate) fields: ModelFields,
    force: f64,
    pressure: Vec<PressurePoint>,
    radius: Option<ContactRadius>,
}

impl State {
    pub(crate) fn new(model: &ElementModel, equilibrium: &Equilibrium) -> Self {
        let (nodes, forces) = model.contact_pressure(&equilibrium.fields);
        let (mut pressure, radius) = contact_profile(nodes, forces.iter().sum());
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

    /// Force on the driven boundaries, in newtons, positive in compression.
    pub fn force_n(&self) -> f64 {
        self.force
    }

    /// Displacement of the driven boundaries, in metres.
    pub fn approach_m(&self) -> f64 {
        self.fields.approach
    }

    /// Pressure at the ends of the elements in contact, or at the nodes of a bonded interface, from
    /// the axis outwards, as in the example of [`PressurePoint`]. In the two outermost elements of
    /// a contact it is the pressure of a smooth edge that carries the force of the elements.
    pub fn pressure(&self) -> &[PressurePoint] {
        &self.pressure
    }

    /// Pressure at a radius of the deformed interface in metres, by a cubic through the nearest
    /// points of [`Self::pressure`]. It is constant outside the last point, and zero without
    /// contact.
    ///
    /// ```
    /// use tactile_fem::{AppliedLoad, Material, ObjectShape, ObjectPress};
    /// let scene = ObjectPress::new(
    ///     ObjectShape::Ball { radius_m: 3e-3 },
    ///     Material::new(1e5, 0.495).unwrap(),
    /// )
    /// .and_then(|press| press.scene())
    /// .unwrap();
    /// let state = &scene.solve(&[AppliedLoad::Approach(0.3e-3)]).states[0];
    /// assert!(state.pressure_at(0.1e-3) > state.pressure_at(0.5e-3));
    /// ```
    pub fn pressure_at(&self, radius_m: f64) -> f64 {
        pressure_at(&self.pressure, radius_m)
    }

    /// Radius at which the contact pressure falls to zero. Near the edge of a smooth contact p² is
    /// nearly linear in r², and its force is known from equilibrium.
    ///
    /// `None` if fewer than about eight nodes are in contact.
    pub fn contact_radius(&self) -> Option<ContactRadius> {
        self.radius
    }
}

/// Pressure at a radius, by the cubic between the two nearest points with the [slopes](slope_at)
/// there. It is constant outside the last point.
///
/// The slope is continuous, so a fit that moves an inclusion sees no kinks.
pub(crate) fn pressure_at(points: &[PressurePoint], radius: f64) -> f64 {
    let after = points.partition_point(|point| point.r_m < radius);
    let Some(last) = points.last() else {
        return 0.0;
    };
    if after == points.len() || points.len() < 2 {
        return last.pressure_pa;
    }
    // Before the first point, the first cubic is extrapolated.
    let right = after.max(1);
    let [from, to] = [right - 1, right].map(|k| &points[k]);
    let (length, rise) = (to.r_m - from.r_m, to.pressure_pa - from.pressure_pa);
    let t = (radius - from.r_m) / length;
    let [first, second] = [right - 1, right].map(|k| length * slope_at(points, k));
    let bent = (1.0 - t) * (first - rise) + t * (rise - second);
    from.pressure_pa + t * (rise + (1.0 - t) * bent)
}

/// Slope of the pressure at a point, by the polynomial through the five nearest points.
fn slope_at(points: &[PressurePoint], at: usize) -> f64 {
    let first = at.saturating_sub(2).min(points.len().saturating_sub(5));
    let near = &points[first..points.len().min(first + 5)];
    let here = &points[at];
    // The barycentric weights of Lagrange's polynomial.
    let weight = |j: usize| {
        let others = near.iter().enumerate().filter(|(k, _)| *k != j);
        let product: f64 = others.map(|(_, other)| near[j].r_m - other.r_m).product();
        product.recip()
    };
    let own = weight(at - first);
    let others = near.iter().enumerate().filter(|(j, _)| first + j != at);
    let parts = others.map(|(j, other)| {
        weight(j) / own * (other.pressure_pa - here.pressure_pa) / (here.r_m - other.r_m)
    });
    parts.sum()
}

/// The Cauchy stress at a point, in pascals, positive in tension. The components rθ and zθ are
/// zero.
///
/// ```
/// use tactile_fem::{Interface, AppliedLoad, Material, FemScene};
///
/// // A cylinder that slides freely between plates, compressed by a thousandth: σzz ≈ −E/1000.
/// let scene = FemScene::cylinder_between_plates(
///     2e-3,
///     2e-3,
///     Material::new(1e5, 0.45)?,
///     Interface::Frictionless,
/// )?;
/// let state = &scene.solve(&[AppliedLoad::Approach(1e-6)]).states[0];
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

impl ElementModel {
    /// Cauchy stress at the material point with reference coordinates (r, z) in metres, or Hooke's
    /// stress in linear kinematics. `None` outside the bodies, or for a state of another model.
    pub(crate) fn stress(&self, state: &State, point: [f64; 2]) -> Option<Stress> {
        let fields = &state.fields;
        if fields.displacement.len() != 2 * self.nodes.len() {
            return None;
        }
        let (index, [xi, eta]) = self.locate(point)?;
        // On the axis u_r / r is ∂u_r/∂r. It is evaluated nearby, where the quotient is still
        // accurate.
        let xi = if point[0] == 0.0 {
            xi * (1.0 - 1e-7)
        } else {
            xi
        };
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
        let deformation = PointDeformation::new(self.kinematics, material.shear_modulus(), &h)?;
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

    /// The element that contains a point of the reference configuration, and ξ and η of the point.
    fn locate(&self, point: [f64; 2]) -> Option<(usize, [f64; 2])> {
        // Rounding may place points of a shared edge outside both elements.
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

/// ξ and η of a point by Newton's method. `None` if it leaves the neighbourhood of the element.
fn inverse_map(nodes: &[[f64; 2]; 9], point: [f64; 2]) -> Option<[f64; 2]> {
    let size = (nodes[2][0] - nodes[0][0]).hypot(nodes[2][1] - nodes[0][1]);
    let mut at = [0.0; 2];
    for _ in 0..20 {
        let (here, jacobian, determinant) = position(nodes, &shape(at[0], at[1]));
        let [dr, dz] = [point[0] - here[0], point[1] - here[1]];
        if dr.hypot(dz) <= 1e-13 * size {
            break;
        }
        at[0] += (jacobian[1][1] * dr - jacobian[1][0] * dz) / determinant;
        at[1] += (jacobian[0][0] * dz - jacobian[0][1] * dr) / determinant;
        if !at.iter().all(|x| x.abs() < 3.0) {
            return None;
        }
    }
    Some(at)
}
