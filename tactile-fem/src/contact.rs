//! Contact: the points of a surface at which gaps are measured, and the forces that keep them from
//! closing.
//!
//! Gaps g are averaged over the hat functions φ of the first surface's nodes (linear on each half of an
//! edge): $g_v = \int \varphi_v g / \int \varphi_v$. The pressure per reference area is
//! $t = \sum_v \varphi_v t_v$ with $t_v = \langle \lambda_v - \varepsilon g_v \rangle$: one pressure for
//! each node's displacement, a stable pair (pressures linear on each edge, but not continuous,
//! oscillate). It derives from a potential, so that the tangent is symmetric; λ is updated to t between
//! equilibria (augmented Lagrangian, Uzawa).
//!
//! Opposite a deformable surface the integrals are taken piece by piece between the ends of the other
//! surface's edges (segment-to-segment). Its normal jumps there: points fixed on the first surface would
//! carry their whole force from one side of the kink to the other at once, and Newton's method would
//! cycle; pieces that grow and shrink carry it over continuously.

use super::curve::SurfaceCurve;
use super::element::{GAUSS3, quadratic};
use super::placement::{Placement, combine};
use super::rigid::RigidShape;

/// What a surface may touch.
#[derive(Debug, Clone)]
pub(crate) enum Opposite {
    /// Another body's surface.
    Surface(SurfaceCurve),
    /// A rigid shape above (+1) or below (−1) the surface.
    Rigid {
        shape: RigidShape,
        side: f64,
        /// Height of the shape's pole in the reference configuration.
        height: f64,
        /// Whether the approach moves it.
        driven: bool,
    },
}

/// Half of an edge of a contact surface, between two of its nodes.
#[derive(Debug, Clone)]
pub(crate) struct ContactSegment {
    pub(crate) pair: usize,
    pub(crate) nodes: [usize; 3],
    /// Parameters of its ends on the edge.
    ends: [f64; 2],
    /// Indices of the contact nodes at its ends.
    contact_nodes: [usize; 2],
}

/// A Gauss point of a surface at which a gap is measured.
#[derive(Debug, Clone)]
pub(crate) struct ContactPoint {
    pub(crate) pair: usize,
    pub(crate) nodes: [usize; 3],
    pub(crate) shape: [f64; 3],
    pub(crate) derivative: [f64; 3],
    /// Contact nodes whose hat functions reach here, with the functions times the point's reference area.
    pub(crate) shares: [(usize, f64); 2],
}

/// A node of a contact surface, which carries a pressure.
#[derive(Debug, Clone)]
pub(crate) struct ContactNode {
    pub(crate) pair: usize,
    pub(crate) node: usize,
    /// Reference area of the hat function.
    pub(crate) weight: f64,
    /// Penalty ε: pressure per penetration, Pa/m.
    pub(crate) penalty: f64,
    /// Distance to its neighbours.
    pub(crate) spacing: f64,
}

/// Penalty of contact over the softer body's modulus and the edge's length: a pressure of a third of
/// the modulus then leaves a thousandth of an element's penetration before the multipliers' update.
/// Ten times less needs more updates, ten times more iterations; the Hertz test shows it.
const PENALTY: f64 = 300.0;

/// Two ends of edges nearer than this part of a segment leave nothing to integrate between them.
const SLIVER: f64 = 1e-6;

impl ContactSegment {
    /// Gauss points between the cuts, which are parameters on the edge in ascending order.
    pub(crate) fn points(&self, cuts: &[f64], nodes: &[[f64; 2]]) -> Vec<ContactPoint> {
        let [start, end] = self.ends;
        let mut bounds = vec![start];
        bounds.extend(cuts);
        bounds.push(end);
        let mut points = Vec::with_capacity(3 * (bounds.len() - 1));
        for piece in bounds.windows(2) {
            let (middle, half) = (0.5 * (piece[0] + piece[1]), 0.5 * (piece[1] - piece[0]));
            for (x, gauss) in GAUSS3 {
                let parameter = middle + half * x;
                let (shape, derivative) = quadratic(parameter);
                let [r, _] = combine(&shape, self.nodes, |n| nodes[n]);
                let [dr, dz] = combine(&derivative, self.nodes, |n| nodes[n]);
                let area = core::f64::consts::TAU * r * half * gauss * dr.hypot(dz);
                let hat = (parameter - start) / (end - start);
                points.push(ContactPoint {
                    pair: self.pair,
                    nodes: self.nodes,
                    shape,
                    derivative,
                    shares: [
                        (self.contact_nodes[0], (1.0 - hat) * area),
                        (self.contact_nodes[1], hat * area),
                    ],
                });
            }
        }
        points
    }

    /// Parameters at which the ends of the opposite edges lie closest.
    pub(crate) fn cuts(&self, curve: &SurfaceCurve, placement: &Placement<'_>) -> Vec<f64> {
        let at = |parameter: f64| {
            let (shape, derivative) = quadratic(parameter);
            let position = combine(&shape, self.nodes, |n| placement.current(n));
            (
                position,
                combine(&derivative, self.nodes, |n| placement.current(n)),
            )
        };
        let [start, end] = self.ends;
        let (a, b) = (at(start).0, at(end).0);
        let chord = [b[0] - a[0], b[1] - a[1]];
        let square = chord[0] * chord[0] + chord[1] * chord[1];
        let margin = SLIVER * (end - start);
        let mut cuts = Vec::new();
        for edge in &curve.edges()[1..] {
            let corner = placement.current(edge[0]);
            let offset = [corner[0] - a[0], corner[1] - a[1]];
            let along = (offset[0] * chord[0] + offset[1] * chord[1]) / square;
            let across = (offset[1] * chord[0] - offset[0] * chord[1]) / square;
            // What is farther than the segment is long presses on nothing here.
            if !(-0.5..1.5).contains(&along) || across.abs() > 1.0 {
                continue;
            }
            let mut parameter = start + along * (end - start);
            // Newton's method without the curve's bend: the segment is nearly straight.
            for _ in 0..8 {
                let (position, slope) = at(parameter);
                let metric = slope[0] * slope[0] + slope[1] * slope[1];
                parameter += ((corner[0] - position[0]) * slope[0]
                    + (corner[1] - position[1]) * slope[1])
                    / metric;
            }
            if parameter > start + margin && parameter < end - margin {
                cuts.push(parameter);
            }
        }
        cuts.sort_by(f64::total_cmp);
        cuts.dedup_by(|next, kept| *next - *kept < margin);
        cuts
    }
}

/// The segments of a surface's edges and their nodes, numbered from `first_node`.
pub(crate) fn contact_segments(
    pair: usize,
    first_node: usize,
    edges: &[[usize; 3]],
    nodes: &[[f64; 2]],
    modulus: f64,
) -> (Vec<ContactSegment>, Vec<ContactNode>) {
    let mut segments = Vec::new();
    let mut corners: Vec<ContactNode> = Vec::new();
    for &edge in edges {
        for half in [0, 1] {
            let contact_nodes = [edge[half], edge[half + 1]].map(|node| {
                let known = corners.iter().position(|corner| corner.node == node);
                let index = known.unwrap_or_else(|| {
                    corners.push(ContactNode {
                        pair,
                        node,
                        weight: 0.0,
                        penalty: f64::INFINITY,
                        spacing: 0.0,
                    });
                    corners.len() - 1
                });
                first_node + index
            });
            let start = half as f64 - 1.0;
            let segment = ContactSegment {
                pair,
                nodes: edge,
                ends: [start, start + 1.0],
                contact_nodes,
            };
            let [a, b] = [edge[half], edge[half + 1]].map(|node| nodes[node]);
            let length = (b[0] - a[0]).hypot(b[1] - a[1]);
            for point in segment.points(&[], nodes) {
                for (index, weight) in point.shares {
                    corners[index - first_node].weight += weight;
                }
            }
            for index in contact_nodes {
                let corner = &mut corners[index - first_node];
                corner.spacing = length.max(corner.spacing);
                corner.penalty = corner.penalty.min(0.5 * PENALTY * modulus / length);
            }
            segments.push(segment);
        }
    }
    (segments, corners)
}
