//! The unknowns of a model.

use super::anchor::Anchor;
use super::element::ALL;
use super::model::Model;

/// The unknowns: displacements, element pressures and the approach.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Fields {
    /// Component 2 node + (0 for r, 1 for z).
    pub(crate) displacement: Vec<f64>,
    pub(crate) pressures: Vec<[f64; 3]>,
    pub(crate) approach: f64,
    /// Contact pressures per reference area kept by the augmented Lagrangian.
    pub(crate) multipliers: Vec<f64>,
    /// Contact pressures per reference area, unknowns of their own as element pressures are.
    pub(crate) contact: Vec<f64>,
    /// Where contact nodes stick; empty where surfaces slide.
    pub(crate) anchors: Vec<Option<Anchor>>,
}

impl Fields {
    pub(crate) fn zero(model: &Model) -> Self {
        Self {
            displacement: vec![0.0; 2 * model.nodes.len()],
            pressures: vec![[0.0; 3]; model.elements.len()],
            approach: 0.0,
            multipliers: vec![0.0; model.contact_nodes.len()],
            contact: vec![0.0; model.contact_nodes.len()],
            anchors: if model.sticks {
                vec![None; model.contact_nodes.len()]
            } else {
                Vec::new()
            },
        }
    }

    pub(crate) fn element(&self, nodes: &[usize; 9]) -> [f64; ALL] {
        core::array::from_fn(|k| self.displacement[2 * nodes[k / 2] + k % 2])
    }
}

/// An equilibrium.
pub(crate) struct Equilibrium {
    pub(crate) fields: Fields,
    pub(crate) force: f64,
}
