//! Contact nodes that touch, or may do so within a load step.

use super::anchor::Slip;
use super::contact::{ContactPoint, Opposite};
use super::fields::Fields;
use super::gap::{Gap, averaged};
use super::material::Kinematics;
use super::model::Model;
use super::placement::Placement;

/// Part of a node's area that has something opposite to it, below which the node is open.
const LEAST_SHARE: f64 = 0.25;

/// A node of a contact surface that is in contact or may come into it.
#[derive(Debug, Clone)]
pub(crate) struct Candidate {
    /// Index of the contact node.
    pub(crate) index: usize,
    pub(crate) gap: Gap,
    /// λ − ε g: the pressure per reference area if positive.
    pub(crate) pressure: f64,
    /// From where it sticks, if it does.
    pub(crate) slip: Option<Slip>,
}

impl Model {
    /// Where contact is judged at a state.
    pub(crate) fn placement<'a>(&'a self, fields: &'a Fields) -> Placement<'a> {
        Placement {
            kinematics: self.kinematics,
            nodes: &self.nodes,
            displacement: &fields.displacement,
            approach: fields.approach,
        }
    }

    /// Contact nodes that touch or are nearer than two spacings and `margin`.
    pub(crate) fn candidates(&self, fields: &Fields, margin: f64) -> Vec<Candidate> {
        let placement = self.placement(fields);
        let points = self.contact_points(fields);
        let mut around: Vec<Vec<(Gap, f64)>> = vec![Vec::new(); self.contact_nodes.len()];
        for point in &points {
            // Points with nothing opposite to them are open.
            if let Some(gap) = placement.gap(point, &self.opposites[point.pair]) {
                let [(first, weight), (second, other)] = point.shares;
                around[first].push((gap.clone(), weight));
                around[second].push((gap, other));
            }
        }
        let mut candidates = Vec::new();
        for (index, (node, around)) in self.contact_nodes.iter().zip(&around).enumerate() {
            let total: f64 = around.iter().map(|(_, weight)| weight).sum();
            // A node at a punch's rim has half of its surroundings under it.
            if total < LEAST_SHARE * node.weight {
                continue;
            }
            let weighted = around.iter().map(|(gap, weight)| gap.value * weight);
            let value = weighted.sum::<f64>() / total;
            if value < 2.0 * node.spacing + margin {
                candidates.push(Candidate {
                    index,
                    gap: averaged(around, total),
                    pressure: fields.multipliers[index] - node.penalty * value,
                    slip: (fields.anchors.get(index)).and_then(|anchor| {
                        anchor
                            .as_ref()
                            .map(|anchor| anchor.slip(&fields.displacement, fields.approach))
                    }),
                });
            }
        }
        candidates
    }

    /// The points at which gaps are measured at a state.
    pub(crate) fn contact_points(&self, fields: &Fields) -> Vec<ContactPoint> {
        let placement = self.placement(fields);
        let mut points = Vec::with_capacity(3 * self.segments.len());
        for segment in &self.segments {
            let cuts = match (&self.opposites[segment.pair], self.kinematics) {
                (Opposite::Surface(curve), Kinematics::Finite) => segment.cuts(curve, &placement),
                _ => Vec::new(),
            };
            points.extend(segment.points(&cuts, &self.nodes));
        }
        points
    }
}
