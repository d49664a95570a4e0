//! Numbers of the equations, and the pattern of the tangent.

use super::element::OUTER;
use super::gap::DRIVER;
use super::model::{Model, Motion};
use super::sparse::{Pattern, Singular};
use std::sync::Arc;

/// Where a displacement component's share of the system goes.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Slot {
    Nowhere,
    Driver(f64),
    Equation(usize),
}

/// Equations of a model, and the tangent's pattern as far as contacts have needed it.
#[derive(Debug)]
pub(crate) struct Layout {
    slots: Arc<[Slot]>,
    pub(crate) equations: usize,
    /// Equations that are coupled with each other by an element or by a contact.
    groups: Vec<Vec<usize>>,
    pattern: Option<Arc<Pattern>>,
}

impl Layout {
    pub(crate) fn new(model: &Model) -> Self {
        // The centres, eliminated within their elements, have no equation.
        let mut is_outer = vec![false; model.nodes.len()];
        for nodes in &model.elements {
            for &node in &nodes[..OUTER / 2] {
                is_outer[node] = true;
            }
        }
        let mut equations = 0;
        let mut slots: Vec<Slot> = (model.motion.iter().enumerate())
            .map(|(dof, motion)| {
                let shares = dof % 2 == 1 && model.partners[dof / 2].is_some();
                match *motion {
                    Motion::Driven(factor) => Slot::Driver(factor),
                    Motion::Free if is_outer[dof / 2] && !shares => {
                        equations += 1;
                        Slot::Equation(equations - 1)
                    }
                    Motion::Free | Motion::Zero => Slot::Nowhere,
                }
            })
            .collect();
        for (node, partner) in model.partners.iter().enumerate() {
            if let Some(partner) = partner {
                slots[2 * node + 1] = slots[2 * partner + 1];
            }
        }
        let mut layout = Self {
            slots: slots.into(),
            equations,
            groups: Vec::new(),
            pattern: None,
        };
        let elements = model.elements.iter();
        layout.groups = elements
            .map(|nodes| {
                let outer = &nodes[..OUTER / 2];
                layout.coupled(outer.iter().flat_map(|node| [2 * node, 2 * node + 1]))
            })
            .collect();
        layout
    }

    /// Slots of all displacement components.
    pub(crate) fn slots(&self) -> Arc<[Slot]> {
        Arc::clone(&self.slots)
    }

    /// Equations among displacement components.
    fn coupled(&self, dofs: impl Iterator<Item = usize>) -> Vec<usize> {
        dofs.filter_map(|dof| match slot(&self.slots, dof) {
            Slot::Equation(equation) => Some(equation),
            _ => None,
        })
        .collect()
    }

    /// The tangent's pattern with couplings between the components of each contact; the one made
    /// before where it has them all.
    pub(crate) fn pattern<'a>(
        &mut self,
        contacts: impl Iterator<Item = &'a [usize]>,
    ) -> Result<Arc<Pattern>, Singular> {
        let mut is_new = false;
        for dofs in contacts {
            let group = self.coupled(dofs.iter().copied());
            let known = self.pattern.as_ref();
            if known.is_none_or(|pattern| !pattern.couples(&group)) {
                self.groups.push(group);
                is_new = true;
            }
        }
        if let (Some(pattern), false) = (&self.pattern, is_new) {
            return Ok(Arc::clone(pattern));
        }
        let groups = self.groups.iter().map(Vec::as_slice);
        let pattern = Arc::new(Pattern::new(self.equations, groups)?);
        self.pattern = Some(Arc::clone(&pattern));
        Ok(pattern)
    }
}

/// The slot of a displacement component of a [`Gap`](super::gap::Gap).
pub(crate) fn slot(slots: &[Slot], dof: usize) -> Slot {
    if dof == DRIVER {
        Slot::Driver(1.0)
    } else {
        slots[dof]
    }
}
