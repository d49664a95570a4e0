//! Surfaces that may touch: their segments and nodes, the opposite bodies, and the anchors of
//! nodes.
use crate::element::{GAUSS3, quadratic};

/// Contact penalty relative to the softer body's modulus and the edge length. A pressure of a third
/// of the modulus then leaves a penetration of a thousandth of an element before the update of the
/// multipliers. A value ten times smaller needs more updates, ten times larger more iterations, as
/// the Hertz test shows.
const PENALTY_LIMIT: f64 = 300.0;

/// Represents the approach among the displacement components of a [`Gap`].
pub(crate) const DRIVER: usize = usize::MAX;

/// The shape of a rigid body of revolution, with its lowest point at height zero.
#[derive(Debug, Clone, Copy, PartialEq)]
// Only a flat is pressed on objects. The others have closed-form solutions for the tests.
#[cfg_attr(not(test), allow(dead_code))]
pub(crate) enum RigidShape {
    /// A plane perpendicular to the axis.
    Flat,
    /// The paraboloid r² / 2R of Hertz's theory.
    Paraboloid {
        /// Radius of curvature at the pole, in metres.
        radius_m: f64,
    },
    /// The flat end of a cylinder.
    Punch {
        /// Radius in metres.
        radius_m: f64,
    },
    /// A cone.
    Cone {
        /// Angle between its axis and its surface, in radians.
        half_angle_rad: f64,
    },
}

impl RigidShape {
    /// Height, slope and second derivative at radius r. `None` outside the shape.
    pub(crate) fn profile(self, r: f64) -> Option<[f64; 3]> {
        match self {
            Self::Flat => Some([0.0; 3]),
            Self::Punch { radius_m } => (r <= radius_m).then_some([0.0; 3]),
            Self::Paraboloid { radius_m } => {
                Some([r * r / (2.0 * radius_m), r / radius_m, 1.0 / radius_m])
            }
            Self::Cone { half_angle_rad } => {
                let slope = 1.0 / half_angle_rad.tan();
                Some([r * slope, slope, 0.0])
            }
        }
    }
}

/// The body that a surface may touch.
#[derive(Debug, Clone)]
pub(crate) enum Opposite {
    /// Another body's surface.
    Surface(SurfaceCurve),
    /// A rigid shape above (+1) or below (−1) the surface, with its pole at z = 0 in the reference
    /// configuration. A shape below moves by the approach.
    Rigid { shape: RigidShape, side: f64 },
}

/// Half of an edge of a contact surface, between two of its nodes.
#[derive(Debug, Clone)]
pub(crate) struct ContactSegment {
    pub pair: usize,
    pub nodes: [usize; 3],
    /// Parameters of its ends on the edge.
    pub ends: [f64; 2],
    /// Indices of the contact nodes at its ends.
    pub contact_nodes: [usize; 2],
}

/// A Gauss point of a surface at which a gap is measured.
#[derive(Debug, Clone)]
pub(crate) struct GapPoint {
    pub pair: usize,
    pub nodes: [usize; 3],
    pub shape: [f64; 3],
    pub derivative: [f64; 3],
    /// Contact nodes whose hat functions are non-zero here, with the functions times the reference
    /// area of the point.
    pub shares: [(usize, f64); 2],
}

/// A node of a contact surface, with a pressure.
#[derive(Debug, Clone)]
pub(crate) struct ContactNode {
    pub pair: usize,
    pub node: usize,
    /// Integral of the hat function over the reference area.
    pub weight: f64,
    /// Penalty ε: pressure per penetration, Pa/m.
    pub penalty: f64,
    /// Distance to its neighbours.
    pub spacing: f64,
}

impl ContactSegment {
    /// Gauss points between the cuts, which are ascending parameters on the edge.
    pub(crate) fn points(&self, cuts: &[f64], nodes: &[[f64; 2]]) -> Vec<GapPoint> {
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
                points.push(GapPoint {
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
                corner.penalty = corner.penalty.min(0.5 * PENALTY_LIMIT * modulus / length);
            }
            segments.push(segment);
        }
    }
    (segments, corners)
}

/// Edges of a surface from the axis outwards.
#[derive(Debug, Clone)]
pub(crate) struct SurfaceCurve {
    /// Nodes (inner end, middle, outer end).
    edges: Vec<[usize; 3]>,
    /// +1 if the body is on the left of the outward direction: its outward normal is then (z',
    /// −r').
    pub side: f64,
}

/// Weights of an edge's nodes.
pub(crate) type Weights = [f64; 3];

/// The nodes of an edge, and their weights for position, first and second derivative at one
/// parameter.
#[derive(Debug, Clone, Copy)]
pub(crate) struct CurvePoint {
    pub nodes: [usize; 3],
    pub position: Weights,
    pub first: Weights,
}

/// Weights of the second derivative, constant along an edge.
pub(crate) const BEND: Weights = [1.0, -2.0, 1.0];

impl CurvePoint {
    /// Weighted sum over the nodes.
    pub(crate) fn sum(&self, weights: &Weights, at: impl Fn(usize) -> [f64; 2]) -> [f64; 2] {
        combine(weights, self.nodes, at)
    }
}

impl SurfaceCurve {
    /// Creates the curve from edges ordered along a surface with increasing radius.
    pub(crate) fn new(edges: &[[usize; 3]], coordinates: &[[f64; 2]]) -> Self {
        let outwards = |edge: &[usize; 3]| coordinates[edge[2]][0] > coordinates[edge[0]][0];
        Self {
            side: if edges.first().is_some_and(outwards) {
                1.0
            } else {
                -1.0
            },
            edges: edges
                .iter()
                .map(|edge| {
                    if outwards(edge) {
                        *edge
                    } else {
                        [edge[2], edge[1], edge[0]]
                    }
                })
                .collect(),
        }
    }

    pub(crate) fn edges(&self) -> &[[usize; 3]] {
        &self.edges
    }

    /// The point of an edge at ξ in [−1, 1].
    pub(crate) fn at(&self, edge: usize, xi: f64) -> CurvePoint {
        let (position, first) = quadratic(xi);
        CurvePoint {
            nodes: self.edges[edge],
            position,
            first,
        }
    }
}

/// Weighted sum over an edge's nodes.
pub(crate) fn combine(
    shape: &[f64; 3],
    nodes: [usize; 3],
    at: impl Fn(usize) -> [f64; 2],
) -> [f64; 2] {
    let mut sum = [0.0; 2];
    for (n, node) in shape.iter().zip(nodes) {
        let point = at(node);
        sum[0] += n * point[0];
        sum[1] += n * point[1];
    }
    sum
}

/// Anchor of a contact node.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Anchor {
    /// The node and those of the opposite edge, with their weights in the relative displacement.
    pub weights: Vec<(usize, f64)>,
    /// Whether the opposite body moves by the approach.
    pub driven: bool,
    /// Relative displacement at the time of anchoring.
    pub start: [f64; 2],
    /// Unit vector along the surface.
    pub direction: [f64; 2],
}

/// A distance along the surface, with its derivatives by the displacement components `dofs`.
#[derive(Debug, Clone)]
pub(crate) struct Slip {
    pub value: f64,
    pub dofs: Vec<usize>,
    pub first: Vec<f64>,
}

impl Anchor {
    /// The relative displacement, from the displacements of all nodes and the approach.
    pub(crate) fn displacement(&self, displacement: &[f64], approach: f64) -> [f64; 2] {
        let mut sum = [0.0, if self.driven { -approach } else { 0.0 }];
        for &(node, weight) in &self.weights {
            sum[0] += weight * displacement[2 * node];
            sum[1] += weight * displacement[2 * node + 1];
        }
        sum
    }

    /// The same anchor on a surface that has rotated.
    pub(crate) fn turned(&self, direction: [f64; 2]) -> Self {
        Self {
            direction,
            ..self.clone()
        }
    }

    /// Slip of the node from its anchor.
    pub(crate) fn slip(&self, displacement: &[f64], approach: f64) -> Slip {
        let [r, z] = self.displacement(displacement, approach);
        let [along_r, along_z] = self.direction;
        let mut slip = Slip {
            value: (r - self.start[0]) * along_r + (z - self.start[1]) * along_z,
            dofs: Vec::with_capacity(2 * self.weights.len() + 1),
            first: Vec::with_capacity(2 * self.weights.len() + 1),
        };
        for &(node, weight) in &self.weights {
            slip.dofs.extend([2 * node, 2 * node + 1]);
            slip.first.extend([weight * along_r, weight * along_z]);
        }
        if self.driven {
            slip.dofs.push(DRIVER);
            slip.first.push(-along_z);
        }
        slip
    }
}
