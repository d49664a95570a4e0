//! Smooth pressures and the contact radius from the nodal forces of a contact.
//!
//! Pressures of neighbouring nodes, the ends and midpoints of quadratic edges, alternate about the
//! true pressure, by several per cent near the edge of the contact. Weighted by the hat functions
//! of the edges' ends, which are possible displacements of the elements, the forces are in
//! equilibrium with the bodies and do not alternate. They are means of the true pressure, whose
//! square is nearly linear in r².
//!
//! The pressures of a state come from the multipliers of a contact, or from the element forces at a
//! bonded interface.

use crate::element::{GAUSS3, quadratic};
use crate::model::{BondedInterface, ElementModel, ModelFields};
use core::f64::consts::{PI, TAU};
use nalgebra::DVector;
use std::collections::BTreeMap;

/// Intervals of Simpson's rule, which is then accurate nearly to rounding.
const SIMPSON_INTERVALS: i32 = 16;

/// Number of outermost edge ends excluded from the fit: the edge of the contact is within the last
/// element, which distorts its pressures and half of its neighbour's.
const LEFT_OUT_LIMIT: usize = 2;

/// Minimum number of means for a fit of two constants.
const FEWEST_MEANS: usize = 4;

/// Start of the fit, relative to the radius of the outermost node: further inside, p² deviates from
/// a parabola.
const FIT_FROM: f64 = 0.35;

/// Pressure at a point of a contact or of a bonded interface.
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

/// A contact radius with its numerical uncertainty.
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

/// Smooth pressures of a contact and its radius, from the pressures at all nodes in contact, in
/// order from the axis outwards, and the axial forces there.
pub(crate) fn contact_profile(
    points: Vec<PressurePoint>,
    force: f64,
) -> (Vec<PressurePoint>, Option<ContactRadius>) {
    // A contact with few nodes, or one that does not reach the axis, keeps its pressures.
    if points.len() < 5 || points[0].r_m != 0.0 {
        return (points, None);
    }
    let means = means(&points);
    let fit = |left_out| Fit::new(&points, force, &means, left_out);
    let fine = fit(LEFT_OUT_LIMIT);
    let radius = fine.as_ref().map(|fine| ContactRadius {
        radius_m: fine.square.sqrt(),
        uncertainty_m: match fit(LEFT_OUT_LIMIT + 1) {
            Some(coarse) => (fine.square.sqrt() - coarse.square.sqrt()).abs(),
            // Without a second fit, the uncertainty is half the distance between the outermost
            // nodes.
            None => 0.5 * (points[points.len() - 1].r_m - points[points.len() - 2].r_m),
        },
    });
    (smooth(&points, &means, fine.as_ref()), radius)
}

/// Mean pressure over the hat function of an edge's end, with mean and variance of r².
struct Mean {
    square: f64,
    variance: f64,
    pressure: f64,
}

impl Mean {
    /// p² at the mean of r². If p² falls linearly to zero at a², the mean of p is smaller than p
    /// there by the fraction var(r²)/8(a² − r²)².
    fn pressure_squared(&self, edge: Option<f64>) -> f64 {
        let to_edge = edge.map_or(f64::INFINITY, |square| square - self.square);
        self.pressure * self.pressure * (1.0 + 0.25 * self.variance / (to_edge * to_edge))
    }
}

/// Integrals over 2πr dr with a weight N that is linear between nodes: of N, N r², N r⁴ and N p.
#[derive(Default)]
struct Moments {
    area: f64,
    first: f64,
    second: f64,
    force: f64,
}

impl Moments {
    /// Adds the interval between two nodes, over which N and the pressure are linear.
    fn add(&mut self, nodes: [&PressurePoint; 2], weights: [f64; 2]) {
        let between = |values: [f64; 2], t: f64| values[0] + t * (values[1] - values[0]);
        let radii = nodes.map(|node| node.r_m);
        let pressures = nodes.map(|node| node.pressure_pa);
        for (x, gauss) in GAUSS3 {
            let t = 0.5 * (1.0 + x);
            let r = between(radii, t);
            let part = 0.5 * gauss * between(weights, t) * TAU * r * (radii[1] - radii[0]);
            self.area += part;
            self.first += part * r * r;
            self.second += part * r.powi(4);
            self.force += part * between(pressures, t);
        }
    }
}

/// Means of the edge ends, every second node, whose neighbours on both sides are in contact.
fn means(points: &[PressurePoint]) -> Vec<Mean> {
    (0..points.len() - 2)
        .step_by(2)
        .map(|k| {
            let mut hat = Moments::default();
            if k > 0 {
                hat.add([&points[k - 2], &points[k - 1]], [0.0, 0.5]);
                hat.add([&points[k - 1], &points[k]], [0.5, 1.0]);
            }
            hat.add([&points[k], &points[k + 1]], [1.0, 0.5]);
            hat.add([&points[k + 1], &points[k + 2]], [0.5, 0.0]);
            let square = hat.first / hat.area;
            Mean {
                square,
                variance: hat.second / hat.area - square * square,
                pressure: hat.force / hat.area,
            }
        })
        .collect()
}

/// p² = c₀ t + c₁ t² with t = 1 − r²/a², near the contact's edge.
struct Fit {
    /// a².
    square: f64,
    constants: [f64; 2],
    /// The outermost mean of the fit, which represents the pressure from there on.
    from: usize,
}

impl Fit {
    /// The constants are fitted to the means inside the outermost elements of the contact. The
    /// radius a is that for which the fit carries the same force outside as the elements. By
    /// equilibrium this force is accurate, although the pressures of the elements are not. `None`
    /// if too few nodes are in contact.
    fn new(points: &[PressurePoint], force: f64, means: &[Mean], left_out: usize) -> Option<Self> {
        let last_end = (points.len() - 1) / 2;
        let from = last_end.checked_sub(left_out)?.min(means.len() - 1);
        let outermost = points[points.len() - 1].r_m;
        let fitted: Vec<&Mean> = (means[..=from].iter())
            .filter(|mean| mean.square >= (FIT_FROM * outermost).powi(2))
            .collect();
        if fitted.len() < FEWEST_MEANS {
            return None;
        }
        // Force under the function that grows from zero at the previous end to one at this end and
        // outside.
        let (inner, start) = (points[2 * from - 2].r_m, points[2 * from].r_m);
        let mut within = Moments::default();
        for k in 0..2 * from {
            let weight = |node: usize| (0.5 * (2 * from - node) as f64).min(1.0);
            within.add([&points[k], &points[k + 1]], [weight(k), weight(k + 1)]);
        }
        let outside = force - within.force;
        let at = |square: f64| {
            let constants = constants(&fitted, square)?;
            let fit = Self {
                square,
                constants,
                from,
            };
            let excess = fit.ramp_force(inner, start) + fit.outer_force(start) - outside;
            Some((fit, excess))
        };
        let (mut low, mut high) = (start * start * 1.0001, (1.5 * outermost).powi(2));
        if !(at(low)?.1 < 0.0 && at(high)?.1 > 0.0) {
            return None;
        }
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if at(middle)?.1 < 0.0 {
                low = middle;
            } else {
                high = middle;
            }
        }
        Some(at(0.5 * (low + high))?.0)
    }

    /// p² at r².
    fn pressure_squared(&self, square: f64) -> f64 {
        let t = 1.0 - square / self.square;
        t * (self.constants[0] + self.constants[1] * t)
    }

    /// ∫ N p 2πr dr, with N growing from zero at one radius to one at the other.
    fn ramp_force(&self, inner: f64, outer: f64) -> f64 {
        let mut force = 0.0;
        for (x, weight) in GAUSS3 {
            let t = 0.5 * (1.0 + x);
            let r = inner + t * (outer - inner);
            let pressure = self.pressure_squared(r * r).max(0.0).sqrt();
            force += 0.5 * weight * t * pressure * TAU * r * (outer - inner);
        }
        force
    }

    /// π ∫ p ds from the square of `start` to a².
    fn outer_force(&self, start: f64) -> f64 {
        // With t = t₀ x², √(c₀ t + c₁ t²) dt = 2 t₀^{3/2} x² √(c₀ + c₁ t₀ x²) dx is smooth in x, so
        // Simpson's rule is used.
        let t0 = 1.0 - start * start / self.square;
        let [c0, c1] = self.constants;
        let value = |x: f64| x * x * (c0 + c1 * t0 * x * x).max(0.0).sqrt();
        let sum: f64 = (0..=SIMPSON_INTERVALS)
            .map(|k| {
                let weight = match k {
                    0 => 1.0,
                    SIMPSON_INTERVALS => 1.0,
                    k if k % 2 == 1 => 4.0,
                    _ => 2.0,
                };
                weight * value(f64::from(k) / f64::from(SIMPSON_INTERVALS))
            })
            .sum();
        PI * self.square * 2.0 * t0.powf(1.5) * sum / (3.0 * f64::from(SIMPSON_INTERVALS))
    }
}

/// c₀ and c₁ by least squares for a given a².
fn constants(fitted: &[&Mean], square: f64) -> Option<[f64; 2]> {
    let mut normal = nalgebra::Matrix2::<f64>::zeros();
    let mut right = nalgebra::Vector2::<f64>::zeros();
    for mean in fitted {
        let t = 1.0 - mean.square / square;
        let row = nalgebra::Vector2::new(t, t * t);
        normal += row * row.transpose();
        right += row * mean.pressure_squared(Some(square));
    }
    Some((normal.try_inverse()? * right).into())
}

/// Pressures at the edge ends: p² is linear in r² between the means, and from the fit outside.
fn smooth(points: &[PressurePoint], means: &[Mean], fit: Option<&Fit>) -> Vec<PressurePoint> {
    let edge = fit.map(|fit| fit.square);
    let between_means = |end: usize, square: f64| {
        let next = end.clamp(1, means.len() - 1);
        let [a, b] = [&means[next - 1], &means[next]];
        let t = (square - a.square) / (b.square - a.square);
        let [p, q] = [a, b].map(|mean| mean.pressure_squared(edge));
        p + t * (q - p)
    };
    let mut smooth = Vec::with_capacity(points.len() / 2 + 1);
    for (end, point) in points.iter().step_by(2).enumerate() {
        let square = point.r_m * point.r_m;
        let pressure_squared = match fit {
            Some(fit) if end > fit.from => fit.pressure_squared(square),
            _ if end < means.len() && means.len() > 1 => between_means(end, square),
            _ => point.pressure_pa * point.pressure_pa,
        };
        if pressure_squared > 0.0 {
            smooth.push(PressurePoint {
                pressure_pa: pressure_squared.sqrt(),
                ..*point
            });
        }
    }
    smooth
}

impl ElementModel {
    /// Force per deformed area at the contact's nodes, from the axis outwards, and their axial
    /// forces.
    pub(crate) fn contact_pressure(&self, fields: &ModelFields) -> (Vec<PressurePoint>, Vec<f64>) {
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

    /// Axial forces at the interface's nodes that press the bodies together.
    pub(crate) fn interface_forces(
        &self,
        interface: &BondedInterface,
        fields: &ModelFields,
    ) -> DVector<f64> {
        let mut forces = DVector::zeros(interface.nodes.len());
        for &index in &interface.elements {
            let nodes = &self.elements[index];
            let shear = self.materials[self.regions[index]].shear_modulus();
            let u = fields.element(nodes);
            // In equilibrium no element is inverted.
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
    /// The nodal forces balanced by the elements of one side are the moments of the pressure with
    /// the shape functions. Forces of single nodes alternate, but their sums with the hat function
    /// φ of each corner do not:
    ///
    /// $$ P_a = \frac{f_a}{\int \phi_a 2\pi r dr} = p(\bar r_a) + \tfrac12 \sigma_a^2 p'' + \dots
    /// $$
    ///
    /// with the mean and the variance of r under φ. The second term is subtracted, using the second
    /// difference of neighbouring means.
    pub(crate) fn interface_pressure(
        &self,
        interface: &BondedInterface,
        fields: &ModelFields,
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

    fn interface_means(&self, interface: &BondedInterface, fields: &ModelFields) -> Vec<HatMean> {
        let forces = self.interface_forces(interface, fields);
        let force = |node: usize| {
            let place = interface.nodes.iter().position(|n| *n == node);
            place.map_or(0.0, |place| forces[place])
        };
        let placement = self.placement(fields);
        let position = |node: usize| match self.kinematics {
            crate::Kinematics::Linear => self.nodes[node],
            crate::Kinematics::Finite => placement.current(node),
        };
        let mut corners: BTreeMap<usize, InterfaceMoments> = BTreeMap::new();
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
struct InterfaceMoments {
    area: f64,
    radius: f64,
    square: f64,
    height: f64,
    /// Axial force at the midpoints of the edges.
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

impl InterfaceMoments {
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

/// Second derivative of the mean pressure by the radius, from three neighbours. At the axis the
/// mirrored neighbour is used.
fn second_difference(means: &[HatMean], at: usize) -> Option<f64> {
    let here = means.get(at)?;
    let after = means.get(at + 1)?;
    let before = match at {
        // p is even in r, so its second derivative there follows from the two nearest means.
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
