//! Surfaces that may touch: their segments and nodes, what lies opposite, where nodes are held.
use crate::element::{GAUSS3, quadratic};

/// Penalty of contact over the softer body's modulus and the edge's length: a pressure of a third
/// of the modulus then leaves a thousandth of an element's penetration before the multipliers'
/// update. Ten times less needs more updates, ten times more iterations; the Hertz test shows it.
const PENALTY_LIMIT: f64 = 300.0;

/// Stands for the approach among the displacement components of a [`Gap`].
pub(crate) const DRIVER: usize = usize::MAX;

/// The shape of a rigid body of revolution, with its lowest point at height zero.
#[derive(Debug, Clone, Copy, PartialEq)]
// A flat alone is pressed on objects; the others have the closed forms that tests compare with.
#[cfg_attr(not(test), allow(dead_code))]
pub(crate) enum RigidShape {
    /// A plane at right angles to the axis.
    Flat,
    /// The paraboloid r² / 2R, of which Hertz's theory speaks.
    Paraboloid {
        /// Its radius of curvature at the pole, in metres.
        radius_m: f64,
    },
    /// The flat end of a cylinder.
    Punch {
        /// Its radius, in metres.
        radius_m: f64,
    },
    /// A cone.
    Cone {
        /// Between its axis and its surface, in radians.
        half_angle_rad: f64,
    },
}

impl RigidShape {
    /// Height at radius r, its slope and second derivative. `None` beyond the shape.
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

/// What a surface may touch.
#[derive(Debug, Clone)]
pub(crate) enum Opposite {
    /// Another body's surface.
    Surface(SurfaceCurve),
    /// A rigid shape above (+1) or below (−1) the surface, whose pole is at z = 0 in the reference
    /// configuration. One below moves by the approach.
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
    /// Contact nodes whose hat functions reach here, with the functions times the point's reference
    /// area.
    pub shares: [(usize, f64); 2],
}

/// A node of a contact surface, which carries a pressure.
#[derive(Debug, Clone)]
pub(crate) struct ContactNode {
    pub pair: usize,
    pub node: usize,
    /// Reference area of the hat function.
    pub weight: f64,
    /// Penalty ε: pressure per penetration, Pa/m.
    pub penalty: f64,
    /// Distance to its neighbours.
    pub spacing: f64,
}

impl ContactSegment {
    /// Gauss points between the cuts, which are parameters on the edge in ascending order.
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
    /// +1 where the body is on the left of the way outwards: its outward normal is (z', −r').
    pub side: f64,
}

/// Weights of an edge's nodes.
pub(crate) type Weights = [f64; 3];

/// An edge's nodes, and their weights in position, first and second derivative at one parameter.
#[derive(Debug, Clone, Copy)]
pub(crate) struct CurvePoint {
    pub nodes: [usize; 3],
    pub position: Weights,
    pub first: Weights,
}

/// Weights of the second derivative, the same everywhere on an edge.
pub(crate) const BEND: Weights = [1.0, -2.0, 1.0];

impl CurvePoint {
    /// Weighted sum over the nodes.
    pub(crate) fn sum(&self, weights: &Weights, at: impl Fn(usize) -> [f64; 2]) -> [f64; 2] {
        combine(weights, self.nodes, at)
    }
}

impl SurfaceCurve {
    /// From edges ordered along a surface whose radius grows along it.
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

/// Where a contact node is held.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Anchor {
    /// The node and those of the opposite edge, with their weights in the relative displacement.
    pub weights: Vec<(usize, f64)>,
    /// Whether what is opposite moves by the approach.
    pub driven: bool,
    /// Relative displacement at which it was anchored.
    pub start: [f64; 2],
    /// Along the surface, a unit vector.
    pub direction: [f64; 2],
}

/// A distance along the surface and its derivatives by the displacement components `dofs`.
#[derive(Debug, Clone)]
pub(crate) struct Slip {
    pub value: f64,
    pub dofs: Vec<usize>,
    pub first: Vec<f64>,
}

impl Anchor {
    /// Its relative displacement, from the displacements of all nodes and the approach.
    pub(crate) fn displacement(&self, displacement: &[f64], approach: f64) -> [f64; 2] {
        let mut sum = [0.0, if self.driven { -approach } else { 0.0 }];
        for &(node, weight) in &self.weights {
            sum[0] += weight * displacement[2 * node];
            sum[1] += weight * displacement[2 * node + 1];
        }
        sum
    }

    /// The same place on a surface that has turned.
    pub(crate) fn turned(&self, direction: [f64; 2]) -> Self {
        Self {
            direction,
            ..self.clone()
        }
    }

    /// How far the node has slipped from its anchor.
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
