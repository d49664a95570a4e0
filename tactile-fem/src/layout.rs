//! Numbers of the equations, and the pattern of the tangent.

use super::chord::Chord;
use super::element::OUTER;
use super::model::{Model, Motion};
use super::slot::{NO_PLACE, Places, Slot, slot};
use super::sparse::{Pattern, Singular};
use std::sync::Arc;

/// Equations of a model, and the tangent's pattern as far as contacts have needed it.
#[derive(Debug, Clone)]
pub struct Layout {
    slots: Arc<[Slot]>,
    pub(crate) equations: usize,
    /// Equations that are coupled with each other by an element or by a contact.
    groups: Vec<Vec<usize>>,
    pattern: Option<Arc<Pattern>>,
    /// Of each element, in the pattern.
    places: Arc<[Places]>,
    /// The tangent taken last, with which a scene nearby converges; elsewhere a new one is taken.
    pub(crate) chord: Option<Arc<Chord>>,
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
            places: Arc::new([]),
            chord: None,
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
        elements: &[[usize; 9]],
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
        let places = elements.iter().map(|nodes| self.places_of(nodes, &pattern));
        self.places = places.collect();
        self.pattern = Some(Arc::clone(&pattern));
        Ok(pattern)
    }
}

impl Layout {
    /// Places of every element's stiffness in the pattern asked for last.
    pub(crate) fn places(&self) -> Arc<[Places]> {
        Arc::clone(&self.places)
    }

    fn places_of(&self, nodes: &[usize; 9], pattern: &Pattern) -> Places {
        let equations: [Option<usize>; OUTER] =
            core::array::from_fn(|k| match self.slots[2 * nodes[k / 2] + k % 2] {
                Slot::Equation(equation) => Some(equation),
                _ => None,
            });
        let mut places = [NO_PLACE; OUTER * (OUTER + 1) / 2];
        let pairs = (0..OUTER).flat_map(|i| (0..=i).map(move |j| (i, j)));
        for (place, (i, j)) in places.iter_mut().zip(pairs) {
            if let (Some(row), Some(column)) = (equations[i], equations[j]) {
                let found = pattern.place(row, column);
                // A tangent of 2³² entries would take 32 GB.
                *place = found.map_or(NO_PLACE, |found| found as u32);
            }
        }
        places
    }
}
