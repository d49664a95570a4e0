//! The linear system of one Newton iteration.

use super::candidates::Candidate;
use super::condensation::Elimination;
use super::element::OUTER;
use super::fields::Fields;
use super::gap::DRIVER;
use super::layout::Layout;
use super::model::Model;
use super::slot::{Slot, slot};
use super::sparse::{Singular, Symmetric};
use super::tangent::{Goal, Tangent};
use std::sync::Arc;

/// Residual and tangent at one state.
///
/// Contact enters each Newton iteration as a linear complementarity problem: gaps are linear in the
/// step, and which nodes are in contact is found for the step (primal–dual active set) rather than for
/// the state before it.
pub(crate) struct System<'a> {
    model: &'a Model,
    slots: Arc<[Slot]>,
    /// Elements' share and the turning of surfaces under their present pressure.
    base: Tangent,
    /// Force out of balance at the state itself, with the contacts there.
    unbalanced: Vec<f64>,
    /// Derivative of the energy by the approach.
    pub(crate) force: f64,
    /// Root of the sum of squared element forces: what residuals are compared with.
    pub(crate) scale: f64,
    eliminations: Vec<Elimination>,
    candidates: Vec<Candidate>,
}

/// Increments of a Newton step.
pub(crate) struct Step {
    displacement: Vec<f64>,
    pressures: Vec<[f64; 3]>,
    approach: f64,
    contact: Vec<f64>,
}

impl Model {
    /// The system at a state from which the approach may change by `margin`; `None` where an element
    /// is turned inside out.
    pub(crate) fn assemble(
        &self,
        layout: &mut Layout,
        fields: &Fields,
        margin: f64,
    ) -> Option<System<'_>> {
        let candidates = self.candidates(fields, 2.0 * margin.abs());
        let coupled = candidates.iter().flat_map(|candidate| {
            let slip = candidate.slip.as_ref().map(|slip| slip.dofs.as_slice());
            core::iter::once(candidate.gap.dofs.as_slice()).chain(slip)
        });
        let matrix = Symmetric::zero(layout.pattern(&self.elements, coupled).ok()?);
        let (slots, places, equations) = (layout.slots(), layout.places(), layout.equations);
        let mut base = Tangent {
            matrix,
            right: vec![0.0; equations],
            driver_column: vec![0.0; equations],
            driver_stiffness: 0.0,
            force: 0.0,
        };
        let mut squares = 0.0;
        let mut eliminations = Vec::with_capacity(self.elements.len());
        for (index, nodes) in self.elements.iter().enumerate() {
            let element = self.geometry[index].condensed(
                self.kinematics,
                &self.materials[self.regions[index]],
                &fields.element(nodes),
                &fields.pressures[index],
                [self.external[2 * nodes[8]], self.external[2 * nodes[8] + 1]],
            )?;
            let slots = core::array::from_fn(|k| slots[2 * nodes[k / 2] + k % 2]);
            base.add_element(
                &slots,
                &places[index],
                &element.residual,
                &element.stiffness,
            );
            squares += element.residual.iter().map(|f| f * f).sum::<f64>();
            eliminations.push(element.elimination);
        }
        for (slot, force) in slots.iter().zip(&self.external) {
            if let Slot::Equation(equation) = slot {
                base.right[*equation] += force;
            }
        }
        for candidate in &candidates {
            if let Some(slip) = &candidate.slip {
                let node = &self.contact_nodes[candidate.index];
                base.add_slip(&slots, slip, node.weight * node.penalty);
            }
        }
        // Residual with the contacts at this state, before their turning is added.
        let (mut unbalanced, mut force) = (base.right.clone(), base.force);
        for candidate in &candidates {
            let gap = &candidate.gap;
            let node = &self.contact_nodes[candidate.index];
            let touching: Vec<Slot> = gap.dofs.iter().map(|&dof| slot(&slots, dof)).collect();
            let load = node.weight * candidate.pressure.max(0.0);
            for (slot, by) in touching.iter().zip(&gap.first) {
                match *slot {
                    Slot::Nowhere => {}
                    Slot::Equation(row) => unbalanced[row] += load * by,
                    Slot::Driver(factor) => force -= factor * load * by,
                }
            }
            let turning = node.weight * fields.contact[candidate.index];
            if turning > 0.0 {
                let (count, none) = (touching.len(), vec![0.0; touching.len()]);
                base.scatter(&touching, &none, |i, j| {
                    -turning * gap.second[count * i + j]
                });
            }
        }
        Some(System {
            model: self,
            slots,
            base,
            unbalanced,
            force,
            scale: squares.sqrt(),
            eliminations,
            candidates,
        })
    }
}

/// Changes of the active set within a Newton iteration; more are rounding's toss between two sets.
const MAX_CHANGES: usize = 15;

impl System<'_> {
    /// Unbalanced force over the scale of the forces.
    pub(crate) fn imbalance(&self, goal: Goal) -> f64 {
        let squares: f64 = self.unbalanced.iter().map(|f| f * f).sum();
        let driver = match goal {
            Goal::Approach(_) => 0.0,
            Goal::Force(force) => force - self.force,
        };
        if squares == 0.0 && driver == 0.0 {
            return 0.0;
        }
        (squares + driver * driver).sqrt() / self.scale.max(f64::MIN_POSITIVE)
    }

    /// The Newton step from `fields` towards the goal.
    pub(crate) fn step(&self, fields: &Fields, goal: Goal) -> Result<Step, Singular> {
        let mut active: Vec<bool> = self.candidates.iter().map(|c| c.pressure > 0.0).collect();
        let mut changes = 0;
        loop {
            if self.candidates.is_empty() {
                let factors = self.base.matrix.factorise()?;
                let (solution, approach) = self.base.solve(&factors, goal, fields.approach)?;
                return Ok(self.expand(&solution, approach));
            }
            let mut tangent = self.base.clone();
            for (candidate, _) in self
                .candidates
                .iter()
                .zip(&active)
                .filter(|(_, active)| **active)
            {
                let gap = &candidate.gap;
                let node = &self.model.contact_nodes[candidate.index];
                let slots: Vec<Slot> = gap.dofs.iter().map(|&dof| slot(&self.slots, dof)).collect();
                let load = node.weight * candidate.pressure;
                let stiffness = node.weight * node.penalty;
                let residual: Vec<f64> = gap.first.iter().map(|by| -load * by).collect();
                tangent.scatter(&slots, &residual, |i, j| {
                    stiffness * gap.first[i] * gap.first[j]
                });
            }
            let factors = tangent.matrix.factorise()?;
            let (solution, approach) = tangent.solve(&factors, goal, fields.approach)?;
            let mut step = self.expand(&solution, approach);
            let mut settled = true;
            for (candidate, active) in self.candidates.iter().zip(&mut active) {
                let node = &self.model.contact_nodes[candidate.index];
                let gap = &candidate.gap;
                let change: f64 = (gap.dofs.iter().zip(&gap.first))
                    .map(|(&dof, by)| {
                        by * if dof == DRIVER {
                            approach
                        } else {
                            step.displacement[dof]
                        }
                    })
                    .sum();
                let pressure = candidate.pressure - node.penalty * change;
                settled &= *active == (pressure > 0.0);
                *active = pressure > 0.0;
                step.contact[candidate.index] = pressure.max(0.0);
            }
            changes += 1;
            if settled || changes > MAX_CHANGES {
                return Ok(step);
            }
        }
    }

    /// The tangent without contacts, and what the elements eliminated.
    pub(crate) fn into_parts(self) -> (Tangent, Arc<[Slot]>, Vec<Elimination>) {
        (self.base, self.slots, self.eliminations)
    }

    /// Displacements and new pressures of all elements from the equations' solution.
    fn expand(&self, solution: &[f64], approach: f64) -> Step {
        let mut displacement: Vec<f64> = self
            .slots
            .iter()
            .map(|slot| match *slot {
                Slot::Nowhere => 0.0,
                Slot::Driver(factor) => factor * approach,
                Slot::Equation(equation) => solution[equation],
            })
            .collect();
        let mut pressures = Vec::with_capacity(self.eliminations.len());
        for (nodes, elimination) in self.model.elements.iter().zip(&self.eliminations) {
            let outer: [f64; OUTER] =
                core::array::from_fn(|k| displacement[2 * nodes[k / 2] + k % 2]);
            let (centre, new) = elimination.recover(&outer);
            displacement[2 * nodes[8]] = centre[0];
            displacement[2 * nodes[8] + 1] = centre[1];
            pressures.push(new);
        }
        Step {
            displacement,
            pressures,
            approach,
            contact: vec![0.0; self.model.contact_nodes.len()],
        }
    }
}

impl Step {
    /// The fields after the fraction `length` of the step.
    pub(crate) fn apply(&self, fields: &Fields, length: f64) -> Fields {
        let along =
            |a: &[f64; 3], b: &[f64; 3]| core::array::from_fn(|k| a[k] + length * (b[k] - a[k]));
        let displacement = fields.displacement.iter().zip(&self.displacement);
        let pressures = fields.pressures.iter().zip(&self.pressures);
        Fields {
            displacement: displacement.map(|(u, du)| u + length * du).collect(),
            pressures: pressures.map(|(old, new)| along(old, new)).collect(),
            approach: fields.approach + length * self.approach,
            multipliers: fields.multipliers.clone(),
            anchors: fields.anchors.clone(),
            contact: fields
                .contact
                .iter()
                .zip(&self.contact)
                .map(|(old, new)| old + length * (new - old))
                .collect(),
        }
    }
}
