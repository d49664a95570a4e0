//! Newton's method with load steps that adapt to the convergence, and simplified Newton iterations.
//!
//! Simplified Newton iterations use the tangent of an earlier iterate. Such an iteration only
//! evaluates forces, a third of an element's work, and factorises nothing: it takes about a fifth
//! of a full iteration's time. It converges linearly, by a factor proportional to the distance from
//! the tangent's state (P. Deuflhard, *Newton Methods for Nonlinear Problems* (2004), §2.1.2),
//! which is small for scenes close to a solved one.

use crate::element::OUTER;
use crate::material::Kinematics;
use crate::model::{ElementModel, Equilibrium, ModelFields};
use crate::scene::{AppliedLoad, Outcome, Solution, SolverReport};
use crate::state::State;
use crate::surface::Opposite;
use crate::system::{Chord, Layout, Slot};
use std::sync::Arc;

/// First step for sticking surfaces, relative to the approach of the load: contacts that form
/// within this step slide. With 0.02, a thirtieth of the effect of friction is lost.
const STICK_FIRST_STEP: f64 = 0.002;

/// Growth of the approach per step for sticking surfaces: the time of touching within a step is
/// unknown. With 1.2, earlier loads change the force of a ball by a thousandth and its contact
/// radius by four thousandths. With this value the changes are less than half as large (test
/// `more_loads_on_the_way_change_little`).
const STICK_GROWTH: f64 = 1.1;

/// Largest step of the approach for sticking surfaces, relative to the height of the bodies.
const LARGEST_STEP: f64 = 0.08;

/// Maximum number of halvings of a load step.
const MAX_HALVINGS: usize = 10;

/// Imbalance at a guessed approach below which the force becomes the goal.
const SWITCH_TO_FORCE: f64 = 1e-2;

/// Minimum fraction of a Newton step. Below it the step is abandoned, because elements are
/// inverted.
const SHORTEST_STEP: f64 = 0.02;

/// Maximum number of iterations of a load step before it is halved. Convergent steps take three to
/// ten.
const MAX_ITERATIONS: usize = 25;

/// Relative change of the approach up to which the last tangent is tried.
const NEAR: f64 = 0.02;

/// Maximum number of tangents on the way to an equilibrium. Successful ones take one to three.
const MAX_TANGENTS: usize = 7;

/// Maximum number of remaining iterations at the current rate. More would take longer than a new
/// tangent with its two iterations.
const MOST_LEFT: f64 = 6.0;

/// First step of a contact, relative to the height of the bodies.
const FIRST_STEP: f64 = 1e-3;
/// Growth of the approach per step if two deformable surfaces slide on each other.
const LARGEST_GROWTH: f64 = 3.0;

struct Solver<'a> {
    model: &'a ElementModel,
    layout: &'a mut Layout,
    report: SolverReport,
    /// The previous equilibrium, for extrapolation.
    before: Option<Equilibrium>,
    last: Equilibrium,
}

impl ElementModel {
    /// Solves for the loads in order, each starting from the previous one.
    ///
    /// If a load is not reached, the solution ends there, as its [`SolverReport`] states. O(n b²)
    /// per Newton iteration, with n unknowns in a system of half-width b.
    pub(crate) fn solve(&self, loads: &[AppliedLoad]) -> Solution {
        self.solve_near(&mut Layout::new(self), loads, &[])
    }

    /// Like [`Self::solve`], but first tries to reach each load from a guess: the state of a model
    /// with the same elements at a similar load. `layout` belongs to this model or to one with the
    /// same elements and supports, and its analysis is reused.
    pub(crate) fn solve_near(
        &self,
        layout: &mut Layout,
        loads: &[AppliedLoad],
        guesses: &[State],
    ) -> Solution {
        let mut unloaded = ModelFields::zero(self);
        if self.sticks {
            unloaded.anchors = self.first_anchors(&unloaded);
        }
        let mut solver = Solver {
            model: self,
            layout,
            report: SolverReport {
                outcome: Outcome::Solved,
                steps: 0,
                rejected_steps: 0,
                iterations: 0,
            },
            before: None,
            last: Equilibrium {
                fields: unloaded,
                force: 0.0,
            },
        };
        let mut states = Vec::with_capacity(loads.len());
        for (index, &load) in loads.iter().enumerate() {
            let guess = guesses.get(index);
            if !guess.is_some_and(|guess| solver.jump(guess, load)) && !solver.reach(load) {
                solver.report.outcome = Outcome::Stopped {
                    load: index,
                    approach_m: solver.last.fields.approach,
                    force_n: solver.last.force,
                };
                break;
            }
            states.push(State::new(self, &solver.last));
        }
        Solution {
            states,
            report: solver.report,
        }
    }

    /// The state of a model without contacts at an approach, by simplified Newton iterations from a
    /// nearby state of a model with the same elements. `None` if they do not converge.
    pub(crate) fn solve_from(
        &self,
        layout: &mut Layout,
        near: &State,
        approach: f64,
    ) -> Option<State> {
        let found = simplified(self, layout, &near.fields, approach, &mut 0)?;
        Some(State::new(self, &found))
    }

    /// Total height of all bodies.
    fn height(&self) -> f64 {
        let heights = || self.nodes.iter().map(|node| node[1]);
        heights().fold(f64::NEG_INFINITY, f64::max) - heights().fold(f64::INFINITY, f64::min)
    }
}

impl Solver<'_> {
    /// Goes to an approach from a guess. Returns whether it succeeded.
    fn jump(&mut self, guess: &State, load: AppliedLoad) -> bool {
        let AppliedLoad::Approach(approach) = load else {
            return false;
        };
        let found = self.newton(guess.fields.clone(), AppliedLoad::Approach(approach));
        let is_found = found.is_some();
        if let Some(found) = found {
            self.before = Some(core::mem::replace(&mut self.last, found));
            self.report.steps += 1;
        }
        is_found
    }

    fn reach(&mut self, load: AppliedLoad) -> bool {
        let reached = match load {
            AppliedLoad::Approach(approach) => approach.is_finite() && self.walk(|_| approach),
            AppliedLoad::Force(force) => {
                force.is_finite()
                    && self.touch(force)
                    && self.walk(|solver| solver.approach_for(force))
            }
        };
        reached && self.advance(load) && self.augment(load)
    }

    /// Moves to an approach, which may change on the way, in steps suitable for two deformable
    /// surfaces or for sticking surfaces. If a contact grows manyfold in one step, it does not
    /// converge, or slides although it should stick.
    fn walk(&mut self, target: impl Fn(&Self) -> f64) -> bool {
        let (growth, first_part) = match (self.model.sticks, self.slides()) {
            (true, _) => (STICK_GROWTH, STICK_FIRST_STEP),
            (false, true) => (LARGEST_GROWTH, 1.0),
            (false, false) => return true,
        };
        let height = self.model.height();
        let mut first = (FIRST_STEP * height).min(first_part * target(self).abs());
        loop {
            let here = self.last.fields.approach;
            let next = (growth * here).min(here + LARGEST_STEP * height).max(first);
            if target(self) <= next {
                return true;
            }
            if !self.advance(AppliedLoad::Approach(next)) {
                // Rounding may hide such a small first approach from the penalty.
                if here != 0.0 || first >= FIRST_STEP * height {
                    return false;
                }
                first *= 4.0;
            }
        }
    }

    /// Whether deformed surfaces slide on each other.
    fn slides(&self) -> bool {
        let surface = |opposite: &Opposite| matches!(opposite, Opposite::Surface(_));
        self.model.kinematics == Kinematics::Finite && self.model.opposites.iter().any(surface)
    }

    /// Increases the approach until bodies with a gap press on each other.
    fn touch(&mut self, force: f64) -> bool {
        // A small fraction of the height of the bodies. The first contact is found in several
        // steps, each twice the previous one.
        let mut step = FIRST_STEP * self.model.height();
        for _ in 0..12 {
            if self.last.force.abs() > 1e-6 * force.abs() || force == 0.0 {
                return true;
            }
            if !self.advance(AppliedLoad::Approach(self.last.fields.approach + step)) {
                return false;
            }
            step *= 2.0;
        }
        false
    }

    fn advance(&mut self, goal: AppliedLoad) -> bool {
        let mut fraction = 1.0;
        let mut halvings = 0;
        loop {
            let now = self.position(goal, &self.last);
            let done = fraction == 1.0;
            let part = |target: f64| now + fraction * (target - now);
            let next = match goal {
                _ if done => goal,
                AppliedLoad::Approach(target) => AppliedLoad::Approach(part(target)),
                AppliedLoad::Force(target) => AppliedLoad::Force(part(target)),
            };
            match self.equilibrium(next) {
                Some(mut found) => {
                    if self.model.sticks {
                        let before = &self.last.fields;
                        found.fields.anchors = self.model.next_anchors(before, &found.fields);
                    }
                    self.before = Some(core::mem::replace(&mut self.last, found));
                    self.report.steps += 1;
                    if done {
                        return true;
                    }
                    // `fraction` refers to the remainder: this doubles the step.
                    fraction = (2.0 * fraction / (1.0 - fraction)).min(1.0);
                }
                None => {
                    self.report.rejected_steps += 1;
                    halvings += 1;
                    if halvings > MAX_HALVINGS {
                        return false;
                    }
                    fraction *= 0.5;
                }
            }
        }
    }

    fn position(&self, goal: AppliedLoad, equilibrium: &Equilibrium) -> f64 {
        match goal {
            AppliedLoad::Approach(_) => equilibrium.fields.approach,
            AppliedLoad::Force(_) => equilibrium.force,
        }
    }

    /// Equilibrium at the goal, starting from an extrapolation of the last two equilibria or from
    /// the last one.
    fn equilibrium(&mut self, goal: AppliedLoad) -> Option<Equilibrium> {
        if let Some(guess) = self.extrapolated(goal)
            && let Some(found) = self.newton(guess, goal)
        {
            return Some(found);
        }
        self.newton(self.last.fields.clone(), goal)
    }

    fn extrapolated(&self, goal: AppliedLoad) -> Option<ModelFields> {
        if self.slides() {
            // Nodes that came into contact since then behave differently.
            return None;
        }
        let before = self.before.as_ref()?;
        let (from, to) = (self.position(goal, before), self.position(goal, &self.last));
        let target = match goal {
            AppliedLoad::Approach(target) | AppliedLoad::Force(target) => target,
        };
        let ratio = (target - to) / (to - from);
        // Beyond three times the last step, a linear extrapolation is worse than none.
        if ratio.is_nan() || ratio.abs() > 3.0 || before.fields.approach == 0.0 {
            return None;
        }
        let (a, b) = (&before.fields, &self.last.fields);
        let displacement = a.displacement.iter().zip(&b.displacement);
        let pressures = a.pressures.iter().zip(&b.pressures);
        Some(ModelFields {
            displacement: displacement.map(|(a, b)| b + ratio * (b - a)).collect(),
            pressures: pressures
                .map(|(a, b)| core::array::from_fn(|k| b[k] + ratio * (b[k] - a[k])))
                .collect(),
            approach: b.approach + ratio * (b.approach - a.approach),
            multipliers: b.multipliers.clone(),
            anchors: b.anchors.clone(),
            contact: b.contact.clone(),
        })
    }

    /// Equilibrium at the goal. Models without contacts use simplified Newton iterations if they
    /// converge.
    fn newton(&mut self, start: ModelFields, goal: AppliedLoad) -> Option<Equilibrium> {
        if let (AppliedLoad::Approach(to), true) = (goal, self.model.contact_nodes.is_empty()) {
            let iterations = &mut self.report.iterations;
            let found = simplified(self.model, self.layout, &start, to, iterations);
            return found.or_else(|| self.full(start, goal));
        }
        self.full(start, goal)
    }

    fn full(&mut self, start: ModelFields, goal: AppliedLoad) -> Option<Equilibrium> {
        let model = self.model;
        let wanted = goal;
        let mut fields = start;
        // A force is first approached at a guessed approach, because the tangent of a contact that
        // has only started is a poor guide.
        let mut goal = match goal {
            AppliedLoad::Force(force) => AppliedLoad::Approach(self.approach_for(force)),
            AppliedLoad::Approach(_) => goal,
        };
        let margin = |goal: AppliedLoad, fields: &ModelFields| match goal {
            AppliedLoad::Approach(target) => target - fields.approach,
            AppliedLoad::Force(_) => 0.0,
        };
        let mut system = model.assemble(self.layout, &fields, margin(goal, &fields))?;
        let mut worst = f64::INFINITY;
        for iteration in 0..MAX_ITERATIONS {
            let there = match goal {
                AppliedLoad::Approach(target) => fields.approach == target,
                AppliedLoad::Force(_) => true,
            };
            let imbalance = system.imbalance(goal);
            if there && goal != wanted && imbalance < SWITCH_TO_FORCE {
                goal = wanted;
            }
            if goal == wanted && there && (iteration > 0 || system.scale > 0.0) {
                let imbalance = system.imbalance(goal);
                if imbalance <= TOLERANCE {
                    return Some(Equilibrium {
                        force: system.force,
                        fields,
                    });
                }
            }
            // After six iterations without gain, a shorter load step is better.
            if iteration % 6 == 5 {
                if imbalance > worst {
                    return None;
                }
                worst = imbalance;
            }
            self.report.iterations += 1;
            let step = system.step(&fields, goal).ok()?;
            let mut length = 1.0;
            (fields, system) = loop {
                let mut trial = step.apply(&fields, length);
                if let (AppliedLoad::Approach(target), true) = (goal, length == 1.0) {
                    // Avoids the rounding of the sum.
                    trial.approach = target;
                }
                if let Some(next) = model.assemble(self.layout, &trial, margin(goal, &trial)) {
                    break (trial, next);
                }
                length *= 0.5;
                if length < SHORTEST_STEP {
                    return None;
                }
            };
        }
        None
    }

    /// The approach at which a force is expected: F ∝ δⁿ, with n from the last two equilibria.
    fn approach_for(&self, force: f64) -> f64 {
        let (last, here) = (self.last.force, self.last.fields.approach);
        if !(force / last > 0.0 && here != 0.0) {
            return here;
        }
        // Hertz's exponent if only one equilibrium is known, one if there is no contact.
        let guess = if self.model.contact_nodes.is_empty() {
            1.0
        } else {
            1.5
        };
        let exponent = self.before.as_ref().map_or(guess, |before| {
            let exponent = (last / before.force).ln() / (here / before.fields.approach).ln();
            if exponent.is_finite() {
                exponent.clamp(1.0, 3.0)
            } else {
                guess
            }
        });
        here * (force / last).powf(1.0 / exponent)
    }

    /// Updates the contact multipliers at the last equilibrium and restores equilibrium.
    fn augment(&mut self, load: AppliedLoad) -> bool {
        if self.model.contact_nodes.is_empty() {
            return true;
        }
        let mut fields = self.last.fields.clone();
        fields.multipliers.clone_from(&fields.contact);
        match self.newton(fields, load) {
            Some(found) => {
                self.last = found;
                true
            }
            None => false,
        }
    }
}

/// Equilibrium at an approach for a model without contacts. `None` if the iterations do not
/// converge. A new tangent is computed only if those with the last one of `layout` converge slowly.
fn simplified(
    model: &ElementModel,
    layout: &mut Layout,
    start: &ModelFields,
    approach: f64,
    iterations: &mut usize,
) -> Option<Equilibrium> {
    let mut fields = start.clone();
    let is_near = (approach - fields.approach).abs() <= NEAR * approach.abs();
    let mut chord = layout.chord.take();
    if model.kinematics == Kinematics::Finite && !is_near {
        chord = None;
    }
    for _ in 0..MAX_TANGENTS {
        let is_new = chord.is_none();
        let tried = match chord.take() {
            Some(chord) => chord,
            None => {
                let system = model.assemble(layout, &fields, 0.0)?;
                let (tangent, slots, eliminations) = system.into_parts();
                Arc::new(Chord::new(tangent, slots, eliminations)?)
            }
        };
        match tried.iterate(model, fields, approach, is_new, iterations) {
            Ending::Balanced(found) => {
                layout.chord = Some(tried);
                return Some(found);
            }
            Ending::Slow(last) => fields = last,
        }
    }
    None
}

/// Unbalanced force relative to the element forces at which an equilibrium is accepted: four digits
/// below the required accuracy of forces, and well above rounding.
const TOLERANCE: f64 = 1e-8;

/// Result of iterations with one tangent.
enum Ending {
    Balanced(Equilibrium),
    /// They diverge or converge slowly: the iterate at which a new tangent is computed.
    Slow(ModelFields),
}

/// Unbalanced forces at given displacements.
struct Unbalanced {
    /// Negative residual of the equations, with the elements' centres eliminated.
    right: Vec<f64>,
    /// Residual of each element's centre.
    centres: Vec<[f64; 2]>,
    /// Equilibrium pressures of each element.
    pressures: Vec<[f64; 3]>,
    /// Derivative of the energy by the approach.
    force: f64,
    /// Relative to the root of the sum of squared element forces.
    imbalance: f64,
}

impl Chord {
    /// Iterates from `start` at an approach as long as the iterations converge fast.
    fn iterate(
        &self,
        model: &ElementModel,
        start: ModelFields,
        approach: f64,
        is_new: bool,
        iterations: &mut usize,
    ) -> Ending {
        let mut fields = start;
        // A full Newton step may raise the imbalance on its way to the solution.
        let mut may_rise = is_new;
        // The previous iterate and its imbalance.
        let mut before: Option<(ModelFields, f64)> = None;
        loop {
            let unbalanced = self.unbalanced(model, &fields);
            let imbalance = (unbalanced.as_ref()).map_or(f64::INFINITY, |found| found.imbalance);
            if let Some((before, last)) = before
                && imbalance > TOLERANCE
            {
                let rate = imbalance / last;
                if rate >= 1.0 && !may_rise {
                    return Ending::Slow(before);
                }
                may_rise = false;
                // Number of remaining iterations at this rate.
                let left = (TOLERANCE / imbalance).ln() / rate.ln();
                if !(rate < 1.0 && left < MOST_LEFT) {
                    return Ending::Slow(fields);
                }
            }
            let Some(unbalanced) = unbalanced else {
                return Ending::Slow(fields);
            };
            let is_there = fields.approach == approach;
            if is_there && imbalance <= TOLERANCE {
                return Ending::Balanced(Equilibrium {
                    force: unbalanced.force,
                    fields,
                });
            }
            *iterations += 1;
            let Some(next) = self.step(model, &fields, &unbalanced, approach) else {
                return Ending::Slow(fields);
            };
            // Forces at another approach give no rate for the iterates there.
            before = is_there.then_some((fields, imbalance));
            fields = next;
        }
    }

    /// `None` if an element is inverted.
    fn unbalanced(&self, model: &ElementModel, fields: &ModelFields) -> Option<Unbalanced> {
        let mut found = Unbalanced {
            right: vec![0.0; self.by_approach.len()],
            centres: Vec::with_capacity(model.elements.len()),
            pressures: Vec::with_capacity(model.elements.len()),
            force: 0.0,
            imbalance: 0.0,
        };
        for (slot, force) in self.slots.iter().zip(&model.external) {
            if let Slot::Equation(equation) = slot {
                found.right[*equation] += force;
            }
        }
        let (mut element_squares, mut centre_squares) = (0.0, 0.0);
        for (index, (nodes, elimination)) in
            model.elements.iter().zip(&self.eliminations).enumerate()
        {
            let material = &model.materials[model.regions[index]];
            let u = fields.element(nodes);
            let (mut residual, pressures) = model.geometry[index].balance(
                model.kinematics,
                material,
                &u,
                &fields.pressures[index],
                elimination,
            )?;
            for (k, residual) in residual[OUTER..].iter_mut().enumerate() {
                *residual -= model.external[2 * nodes[8] + k];
                centre_squares += *residual * *residual;
            }
            let outer = elimination.outer_residual(&residual);
            for (k, force) in outer.iter().enumerate() {
                match self.slots[2 * nodes[k / 2] + k % 2] {
                    Slot::Nowhere => {}
                    Slot::Equation(row) => found.right[row] -= force,
                    Slot::Driver(factor) => found.force += factor * force,
                }
                element_squares += force * force;
            }
            found.centres.push([residual[OUTER], residual[OUTER + 1]]);
            found.pressures.push(pressures);
        }
        let squares: f64 = found.right.iter().map(|force| force * force).sum();
        if squares + centre_squares > 0.0 {
            found.imbalance =
                ((squares + centre_squares) / element_squares.max(f64::MIN_POSITIVE)).sqrt();
        }
        Some(found)
    }

    fn step(
        &self,
        model: &ElementModel,
        fields: &ModelFields,
        unbalanced: &Unbalanced,
        approach: f64,
    ) -> Option<ModelFields> {
        let mut solution = unbalanced.right.clone();
        self.factors.solve(&mut solution).ok()?;
        let step = approach - fields.approach;
        for (x, by) in solution.iter_mut().zip(&self.by_approach) {
            *x -= step * by;
        }
        let mut next = fields.clone();
        next.approach = approach;
        let change = |dof: usize| match self.slots[dof] {
            Slot::Nowhere => 0.0,
            Slot::Driver(factor) => factor * step,
            Slot::Equation(equation) => solution[equation],
        };
        for (dof, u) in next.displacement.iter_mut().enumerate() {
            *u += change(dof);
        }
        let eliminations = model.elements.iter().zip(&self.eliminations);
        for (index, (nodes, elimination)) in eliminations.enumerate() {
            let outer = core::array::from_fn(|k| change(2 * nodes[k / 2] + k % 2));
            let centre = elimination.centre(unbalanced.centres[index], &outer);
            for (k, step) in centre.into_iter().enumerate() {
                next.displacement[2 * nodes[8] + k] += step;
            }
            let changes = elimination.pressure_change(&outer, centre);
            next.pressures[index] =
                core::array::from_fn(|k| unbalanced.pressures[index][k] + changes[k]);
        }
        Some(next)
    }
}
