//! Where the nodes are: reference coordinates and displacements.

use super::material::Kinematics;

/// Where contact is judged: reference coordinates and displacements.
#[derive(Clone, Copy)]
pub(crate) struct Placement<'a> {
    pub(crate) kinematics: Kinematics,
    pub(crate) nodes: &'a [[f64; 2]],
    pub(crate) displacement: &'a [f64],
    pub(crate) approach: f64,
}

impl Placement<'_> {
    /// Where a node is: in linear kinematics at its undeformed radius, as gaps are.
    pub(crate) fn current(&self, node: usize) -> [f64; 2] {
        let [r, z] = self.nodes[node];
        let [u, w] = self.moved(node);
        match self.kinematics {
            Kinematics::Finite => [r + u, z + w],
            Kinematics::Linear => [r, z + w],
        }
    }

    pub(crate) fn moved(&self, node: usize) -> [f64; 2] {
        [self.displacement[2 * node], self.displacement[2 * node + 1]]
    }
}

impl Placement<'_> {
    /// Deformed area over reference area at a point of an edge with these shape functions (one in linear
    /// kinematics).
    pub(crate) fn stretch(
        &self,
        shape: &[f64; 3],
        derivative: &[f64; 3],
        nodes: [usize; 3],
    ) -> f64 {
        if self.kinematics == Kinematics::Linear {
            return 1.0;
        }
        let area = |at: &dyn Fn(usize) -> [f64; 2]| {
            let [r, _] = combine(shape, nodes, at);
            let [dr, dz] = combine(derivative, nodes, at);
            r * dr.hypot(dz)
        };
        area(&|n| self.current(n)) / area(&|n| self.nodes[n])
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
