//! The symmetric linear system of one Newton iteration: numbering of the equations, sparsity
//! pattern of the tangent, and its solution.

use crate::contact::Candidate;
use crate::element::{Elimination, OUTER};
use crate::model::{DofMotion, ElementModel, ModelFields};
use crate::scene::AppliedLoad;
use crate::sparse::{Factors, Pattern, Singular, Symmetric};
use crate::surface::{DRIVER, Slip};
use std::sync::Arc;

/// Maximum number of active-set changes within a Newton iteration. More would be switching between
/// two sets because of rounding.
const MAX_CHANGES: usize = 15;

/// Destination of a displacement component in the system.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Slot {
    Nowhere,
    Driver(f64),
    Equation(usize),
}

/// Indices of the entries of an element's stiffness (lower half, row by row) in the values of the
/// tangent. [`NO_PLACE`] if one of the two components has no equation.
type Places = [u32; OUTER * (OUTER + 1) / 2];

/// Index of entries that are not in the tangent.
const NO_PLACE: u32 = u32::MAX;

/// The slot of a displacement component of a [`Gap`](super::gap::Gap).
pub(crate) fn slot(slots: &[Slot], dof: usize) -> Slot {
    if dof == DRIVER {
        Slot::Driver(1.0)
    } else {
        slots[dof]
    }
}

/// A factorised tangent of a model without contacts.
#[derive(Debug)]
pub(crate) struct Chord {
    pub slots: Arc<[Slot]>,
    pub eliminations: Vec<Elimination>,
    pub factors: Factors,
    /// Change of the unknowns per unit approach.
    pub by_approach: Vec<f64>,
}

impl Chord {
    /// `None` if the tangent is singular.
    pub(crate) fn new(
        tangent: Tangent,
        slots: Arc<[Slot]>,
        eliminations: Vec<Elimination>,
    ) -> Option<Self> {
        let factors = tangent.matrix.factorise().ok()?;
        let mut by_approach = tangent.driver_column;
        factors.solve(&mut by_approach).ok()?;
        Some(Self {
            slots,
            eliminations,
            factors,
            by_approach,
        })
    }
}

/// Equations of a model, and the pattern of the tangent with the contacts so far.
#[derive(Debug, Clone)]
pub(crate) struct Layout {
    slots: Arc<[Slot]>,
    pub(crate) equations: usize,
    /// Equations that are coupled by an element or by a contact.
    groups: Vec<Vec<usize>>,
    pattern: Option<Arc<Pattern>>,
    /// Indices of each element in the pattern.
    places: Arc<[Places]>,
    /// The last tangent, if a nearby scene converges with it. Otherwise a new one is computed.
    pub(crate) chord: Option<Arc<Chord>>,
}

impl Layout {
    pub(crate) fn new(model: &ElementModel) -> Self {
        // The centres are eliminated within their elements and have no equation.
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
                    DofMotion::Driven(factor) => Slot::Driver(factor),
                    DofMotion::Free if is_outer[dof / 2] && !shares => {
                        equations += 1;
                        Slot::Equation(equations - 1)
                    }
                    DofMotion::Free | DofMotion::Zero => Slot::Nowhere,
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

    /// Equations of the given displacement components.
    fn coupled(&self, dofs: impl Iterator<Item = usize>) -> Vec<usize> {
        dofs.filter_map(|dof| match slot(&self.slots, dof) {
            Slot::Equation(equation) => Some(equation),
            _ => None,
        })
        .collect()
    }

    /// The pattern of the tangent with couplings between the components of each contact. The
    /// previous pattern is reused if it contains them all.
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

    /// Indices of each element's stiffness in the last requested pattern.
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
                // A tangent with 2³² entries would take 32 GB.
                *place = found.map_or(NO_PLACE, |found| found as u32);
            }
        }
        places
    }
}

/// A symmetric linear system with the approach as an additional unknown.
#[derive(Debug, Clone)]
pub(crate) struct Tangent {
    pub matrix: Symmetric,
    /// Negative residual.
    pub right: Vec<f64>,
    pub driver_column: Vec<f64>,
    driver_stiffness: f64,
    /// Residual of the approach.
    pub force: f64,
}

impl Tangent {
    /// Adds an element.
    fn add_element(
        &mut self,
        slots: &[Slot; OUTER],
        places: &Places,
        residual: &[f64; OUTER],
        stiffness: &[[f64; OUTER]; OUTER],
    ) {
        if slots.iter().any(|slot| matches!(slot, Slot::Driver(_))) {
            self.scatter(slots, residual, |i, j| stiffness[i][j]);
            return;
        }
        for (slot, residual) in slots.iter().zip(residual) {
            if let Slot::Equation(row) = slot {
                self.right[*row] -= residual;
            }
        }
        let mut places = places.iter();
        for (i, row) in stiffness.iter().enumerate() {
            for (value, &place) in row[..=i].iter().zip(places.by_ref()) {
                if place != NO_PLACE {
                    self.matrix.add_at(place as usize, *value);
                }
            }
        }
    }

    /// Adds a spring of this stiffness that holds a contact node at its anchor.
    fn add_slip(&mut self, slots: &[Slot], slip: &Slip, stiffness: f64) {
        let slots: Vec<Slot> = slip.dofs.iter().map(|&dof| slot(slots, dof)).collect();
        let load = stiffness * slip.value;
        let residual: Vec<f64> = slip.first.iter().map(|by| load * by).collect();
        self.scatter(&slots, &residual, |i, j| {
            stiffness * slip.first[i] * slip.first[j]
        });
    }

    /// Adds a symmetric contribution, of which only the lower half is read.
    pub(crate) fn scatter(
        &mut self,
        slots: &[Slot],
        residual: &[f64],
        value: impl Fn(usize, usize) -> f64,
    ) {
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

    /// Solution for a goal: the unknowns and the step of the approach.
    pub(crate) fn solve(
        &self,
        factors: &Factors,
        goal: AppliedLoad,
        present: f64,
    ) -> Result<(Vec<f64>, f64), Singular> {
        // Two right-hand sides: the residual, and a unit approach.
        let size = self.right.len();
        let mut columns = [self.right.as_slice(), &self.driver_column].concat();
        factors.solve(&mut columns)?;
        let by_approach = columns.split_off(size);
        let mut solution = columns;
        let dot = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
        let approach = match goal {
            AppliedLoad::Approach(target) => target - present,
            AppliedLoad::Force(target) => {
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

/// Residual and tangent at one state.
///
/// Contact is a linear complementarity problem in each Newton iteration. Gaps are linear in the
/// step, and the set of contact nodes is found for the step (primal–dual active set) rather than
/// for the state before it.
pub(crate) struct System<'a> {
    model: &'a ElementModel,
    slots: Arc<[Slot]>,
    /// Contributions of the elements, and of the rotation of surfaces under their current pressure.
    base: Tangent,
    /// Unbalanced force at the state itself, with the contacts there.
    unbalanced: Vec<f64>,
    /// Derivative of the energy by the approach.
    pub force: f64,
    /// Root of the sum of squared element forces, the reference for residuals.
    pub scale: f64,
    eliminations: Vec<Elimination>,
    candidates: Vec<Candidate>,
}

/// Increments of a Newton step.
pub(crate) struct NewtonStep {
    displacement: Vec<f64>,
    pressures: Vec<[f64; 3]>,
    approach: f64,
    contact: Vec<f64>,
}

impl ElementModel {
    /// The system at a state from which the approach may change by `margin`. `None` if an element
    /// is inverted.
    pub(crate) fn assemble(
        &self,
        layout: &mut Layout,
        fields: &ModelFields,
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
        // Residual with the contacts at this state, before their rotation is added.
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

impl System<'_> {
    /// Unbalanced force relative to the scale of the forces.
    pub(crate) fn imbalance(&self, goal: AppliedLoad) -> f64 {
        let squares: f64 = self.unbalanced.iter().map(|f| f * f).sum();
        let driver = match goal {
            AppliedLoad::Approach(_) => 0.0,
            AppliedLoad::Force(force) => force - self.force,
        };
        if squares == 0.0 && driver == 0.0 {
            return 0.0;
        }
        (squares + driver * driver).sqrt() / self.scale.max(f64::MIN_POSITIVE)
    }

    /// The Newton step from `fields` towards the goal.
    pub(crate) fn step(
        &self,
        fields: &ModelFields,
        goal: AppliedLoad,
    ) -> Result<NewtonStep, Singular> {
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

    /// The tangent without contacts, and the eliminations of the elements.
    pub(crate) fn into_parts(self) -> (Tangent, Arc<[Slot]>, Vec<Elimination>) {
        (self.base, self.slots, self.eliminations)
    }

    /// Displacements and new pressures of all elements from the solution of the equations.
    fn expand(&self, solution: &[f64], approach: f64) -> NewtonStep {
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
        NewtonStep {
            displacement,
            pressures,
            approach,
            contact: vec![0.0; self.model.contact_nodes.len()],
        }
    }
}

impl NewtonStep {
    /// The fields after the fraction `length` of the step.
    pub(crate) fn apply(&self, fields: &ModelFields, length: f64) -> ModelFields {
        let along =
            |a: &[f64; 3], b: &[f64; 3]| core::array::from_fn(|k| a[k] + length * (b[k] - a[k]));
        let displacement = fields.displacement.iter().zip(&self.displacement);
        let pressures = fields.pressures.iter().zip(&self.pressures);
        ModelFields {
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
