//! Anchors: where contact nodes that stick are held, and how far they have slipped.

use super::gap::DRIVER;

/// Where a contact node is held.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Anchor {
    /// The node and those of the opposite edge, with their weights in the relative displacement.
    pub(crate) weights: Vec<(usize, f64)>,
    /// Whether what is opposite moves by the approach.
    pub(crate) driven: bool,
    /// Relative displacement at which it was anchored.
    pub(crate) start: [f64; 2],
    /// Along the surface, a unit vector.
    pub(crate) direction: [f64; 2],
}

/// A distance along the surface and its derivatives by the displacement components `dofs`.
#[derive(Debug, Clone)]
pub(crate) struct Slip {
    pub(crate) value: f64,
    pub(crate) dofs: Vec<usize>,
    pub(crate) first: Vec<f64>,
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
