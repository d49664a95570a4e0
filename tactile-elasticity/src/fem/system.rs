//! The linear system of one Newton iteration.

use super::element::{ALL, Elimination, OUTER};
use super::gap::{DRIVER, Gap, Placement, averaged};
use super::layout::{Layout, Slot, slot};
use super::model::Model;
use super::sparse::{Singular, Symmetric};
use std::sync::Arc;

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
}

impl Fields {
    pub(crate) fn zero(model: &Model) -> Self {
        Self {
            displacement: vec![0.0; 2 * model.nodes.len()],
            pressures: vec![[0.0; 3]; model.elements.len()],
            approach: 0.0,
            multipliers: vec![0.0; model.contact_nodes.len()],
            contact: vec![0.0; model.contact_nodes.len()],
        }
    }

    pub(crate) fn element(&self, nodes: &[usize; 9]) -> [f64; ALL] {
        core::array::from_fn(|k| self.displacement[2 * nodes[k / 2] + k % 2])
    }
}

/// A node of a contact surface that is in contact or may come into it.
#[derive(Debug, Clone)]
pub(crate) struct Candidate {
    /// Index of the contact node.
    pub(crate) index: usize,
    pub(crate) gap: Gap,
    /// λ − ε g: the pressure per reference area if positive.
    pub(crate) pressure: f64,
}

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

/// A symmetric linear system with one more unknown, the approach.
#[derive(Debug, Clone)]
struct Tangent {
    matrix: Symmetric,
    /// Negative residual.
    right: Vec<f64>,
    driver_column: Vec<f64>,
    driver_stiffness: f64,
    /// Residual of the approach.
    force: f64,
}

/// Increments of a Newton step.
pub(crate) struct Step {
    displacement: Vec<f64>,
    pressures: Vec<[f64; 3]>,
    approach: f64,
    contact: Vec<f64>,
}

/// What a step is to reach.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Goal {
    Approach(f64),
    Force(f64),
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
            if total < 0.5 * node.weight {
                continue;
            }
            let weighted = around.iter().map(|(gap, weight)| gap.value * weight);
            let value = weighted.sum::<f64>() / total;
            if value < 2.0 * node.spacing + margin {
                candidates.push(Candidate {
                    index,
                    gap: averaged(around, total),
                    pressure: fields.multipliers[index] - node.penalty * value,
                });
            }
        }
        candidates
    }

    /// The system at a state from which the approach may change by `margin`; `None` where an element
    /// is turned inside out.
    pub(crate) fn assemble(
        &self,
        layout: &mut Layout,
        fields: &Fields,
        margin: f64,
    ) -> Option<System<'_>> {
        let mut condensed = Vec::with_capacity(self.elements.len());
        for (index, nodes) in self.elements.iter().enumerate() {
            let material = &self.materials[self.regions[index]];
            condensed.push(self.geometry[index].condensed(
                self.kinematics,
                material,
                &fields.element(nodes),
                &fields.pressures[index],
                [self.external[2 * nodes[8]], self.external[2 * nodes[8] + 1]],
            )?);
        }
        let candidates = self.candidates(fields, 2.0 * margin.abs());
        let gaps = candidates
            .iter()
            .map(|candidate| candidate.gap.dofs.as_slice());
        let matrix = Symmetric::zero(layout.pattern(gaps).ok()?);
        let (slots, equations) = (layout.slots(), layout.equations);
        let mut base = Tangent {
            matrix,
            right: vec![0.0; equations],
            driver_column: vec![0.0; equations],
            driver_stiffness: 0.0,
            force: 0.0,
        };
        let mut squares = 0.0;
        let mut eliminations = Vec::with_capacity(condensed.len());
        for (nodes, element) in self.elements.iter().zip(condensed) {
            let slots: [Slot; OUTER] = core::array::from_fn(|k| slots[2 * nodes[k / 2] + k % 2]);
            base.scatter(&slots, &element.residual, |i, j| element.stiffness[i][j]);
            squares += element.residual.iter().map(|f| f * f).sum::<f64>();
            eliminations.push(element.elimination);
        }
        for (slot, force) in slots.iter().zip(&self.external) {
            if let Slot::Equation(equation) = slot {
                base.right[*equation] += force;
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

impl Tangent {
    /// Adds a symmetric contribution of which the lower half is asked.
    fn scatter(&mut self, slots: &[Slot], residual: &[f64], value: impl Fn(usize, usize) -> f64) {
        for (i, &slot) in slots.iter().enumerate() {
            match slot {
                Slot::Nowhere => continue,
                Slot::Equation(row) => self.right[row] -= residual[i],
                Slot::Driver(factor) => self.force += factor * residual[i],
            }
            for (j, &other) in slots[..=i].iter().enumerate() {
                let value = value(i, j);
                match (slot, other) {
                    (Slot::Equation(row), Slot::Equation(column)) => {
                        self.matrix.add(row, column, value);
                    }
                    (Slot::Equation(row), Slot::Driver(factor))
                    | (Slot::Driver(factor), Slot::Equation(row)) => {
                        self.driver_column[row] += factor * value;
                    }
                    (Slot::Driver(a), Slot::Driver(b)) => {
                        let times = if i == j { 1.0 } else { 2.0 };
                        self.driver_stiffness += times * a * b * value;
                    }
                    _ => {}
                }
            }
        }
    }

    /// Solution for a goal: the equations' unknowns and the approach's step.
    fn solve(&self, goal: Goal, present: f64) -> Result<(Vec<f64>, f64), Singular> {
        // Two right-hand sides: the residual's, and that of a unit approach.
        let size = self.right.len();
        let mut columns = [self.right.as_slice(), &self.driver_column].concat();
        self.matrix.factorise()?.solve(&mut columns)?;
        let by_approach = columns.split_off(size);
        let mut solution = columns;
        let dot = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
        let approach = match goal {
            Goal::Approach(target) => target - present,
            Goal::Force(target) => {
                let stiffness = self.driver_stiffness - dot(&self.driver_column, &by_approach);
                (target - self.force - dot(&self.driver_column, &solution)) / stiffness
            }
        };
        for (x, by) in solution.iter_mut().zip(&by_approach) {
            *x -= approach * by;
        }
        Ok((solution, approach))
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
            let (solution, approach) = tangent.solve(goal, fields.approach)?;
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
            contact: fields
                .contact
                .iter()
                .zip(&self.contact)
                .map(|(old, new)| old + length * (new - old))
                .collect(),
        }
    }
}
