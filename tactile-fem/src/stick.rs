//! Contact without slip: points that touch stay where they first touched. Contact nodes that stick
//! have anchors, from which their slip is measured.
//!
//! A contact node that carries a pressure after a load step is anchored to the point opposite to
//! it. Let d be its displacement relative to that point since then, and t the direction of the
//! surface. The traction τ = ε t·d per reference area holds it back, with the penalty ε of the
//! normal pressure. It derives from the potential ½ ε (t·d)². The direction t is taken from the
//! last load step, so the potential is quadratic and its tangent symmetric. A node whose pressure
//! has ended becomes free only after the load step: otherwise Newton's method would switch it
//! between the two states.
//!
//! A node that comes into contact within a load step does so on average in its middle. It is
//! anchored to the mean of its relative displacements before and after the step. Nodes that touch
//! in the unloaded state are anchored there.

use crate::contact::Placement;
use crate::material::Kinematics;
use crate::model::{ElementModel, ModelFields};
use crate::surface::{Anchor, ContactNode, Opposite};

/// Fraction of the nodes' spacing within which two unloaded surfaces count as touching. Rounding of
/// coordinates is 1e-16 of it.
const TOUCHING: f64 = 1e-9;

impl ElementModel {
    /// Anchors of the nodes that touch without load.
    pub(crate) fn first_anchors(&self, unloaded: &ModelFields) -> Vec<Option<Anchor>> {
        let mut anchors = vec![None; self.contact_nodes.len()];
        for candidate in self.candidates(unloaded, 0.0) {
            let contact = &self.contact_nodes[candidate.index];
            if candidate.gap.value <= TOUCHING * contact.spacing {
                anchors[candidate.index] = self.anchor(contact, unloaded);
            }
        }
        anchors
    }

    /// Anchors after a load step: those of nodes that still press, rotated with the surface, and
    /// new ones for nodes that came into contact.
    pub(crate) fn next_anchors(
        &self,
        before: &ModelFields,
        after: &ModelFields,
    ) -> Vec<Option<Anchor>> {
        let anchors = after.contact.iter().zip(&after.anchors);
        let contacts = self.contact_nodes.iter().zip(anchors);
        contacts
            .map(|(contact, (&pressure, known))| {
                let found = (pressure > 0.0).then(|| self.anchor(contact, after))??;
                let start = match known {
                    Some(known) => return Some(known.turned(found.direction)),
                    None => [before, after]
                        .map(|fields| found.displacement(&fields.displacement, fields.approach)),
                };
                let start = [0, 1].map(|k| 0.5 * (start[0][k] + start[1][k]));
                Some(Anchor { start, ..found })
            })
            .collect()
    }

    fn anchor(&self, contact: &ContactNode, fields: &ModelFields) -> Option<Anchor> {
        let opposite = &self.opposites[contact.pair];
        self.placement(fields).anchor(contact.node, opposite)
    }
}

impl Placement<'_> {
    /// The anchor of a node at the point opposite to it.
    fn anchor(&self, node: usize, opposite: &Opposite) -> Option<Anchor> {
        let mut weights = vec![(node, 1.0)];
        let (direction, driven) = match opposite {
            Opposite::Rigid { shape, side } => {
                let [r, _] = self.current(node);
                let [_, slope, _] = shape.profile(r)?;
                ([1.0, side * slope], *side < 0.0)
            }
            Opposite::Surface(curve) => {
                let at = match self.kinematics {
                    Kinematics::Finite => self.nearest(curve, self.current(node))?.at,
                    Kinematics::Linear => {
                        let (edge, xi) = self.opposite(curve, self.nodes[node][0])?;
                        curve.at(edge, xi)
                    }
                };
                let opposite = at.nodes.iter().zip(at.position);
                weights.extend(opposite.map(|(node, weight)| (*node, -weight)));
                (at.sum(&at.first, |n| self.current(n)), false)
            }
        };
        let direction = match self.kinematics {
            Kinematics::Finite => direction.map(|x| x / direction[0].hypot(direction[1])),
            Kinematics::Linear => [1.0, 0.0],
        };
        Some(Anchor {
            weights,
            driven,
            start: [0.0; 2],
            direction,
        })
    }
}
