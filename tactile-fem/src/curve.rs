//! A surface's edges in order, for the search of closest points.

use super::element::quadratic;

/// Edges of a surface from the axis outwards.
#[derive(Debug, Clone)]
pub(crate) struct SurfaceCurve {
    /// Nodes (inner end, middle, outer end).
    edges: Vec<[usize; 3]>,
    /// +1 where the body is on the left of the way outwards: its outward normal is (z', −r').
    pub(crate) side: f64,
}

/// Weights of an edge's nodes.
pub(crate) type Weights = [f64; 3];

/// An edge's nodes, and their weights in position, first and second derivative at one parameter.
#[derive(Debug, Clone, Copy)]
pub(crate) struct CurvePoint {
    pub(crate) nodes: [usize; 3],
    pub(crate) position: Weights,
    pub(crate) first: Weights,
}

/// Weights of the second derivative, the same everywhere on an edge.
pub(crate) const BEND: Weights = [1.0, -2.0, 1.0];

impl CurvePoint {
    /// Weighted sum over the nodes.
    pub(crate) fn sum(&self, weights: &Weights, at: impl Fn(usize) -> [f64; 2]) -> [f64; 2] {
        let mut sum = [0.0; 2];
        for (&node, weight) in self.nodes.iter().zip(weights) {
            let point = at(node);
            sum[0] += weight * point[0];
            sum[1] += weight * point[1];
        }
        sum
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
