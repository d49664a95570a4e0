//! Simplified Newton iterations: with the tangent of an earlier iterate.
//!
//! An iteration then evaluates forces alone, a third of an element's work, and factorises nothing: about a fifth
//! of a full one's time. It converges linearly, by a factor that is proportional to the distance from where the
//! tangent was taken (P. Deuflhard, *Newton Methods for Nonlinear Problems* (2004), §2.1.2), which for scenes near a
//! solved one is small.

use super::condensation::Elimination;
use super::element::OUTER;
use super::fields::{Equilibrium, Fields};
use super::model::Model;
use super::slot::Slot;
use super::sparse::Factors;
use super::tangent::Tangent;
use std::sync::Arc;

/// Unbalanced force over element forces at which an equilibrium counts as reached: four digits
/// below what the forces are wanted to, and well above rounding.
pub(super) const TOLERANCE: f64 = 1e-8;
/// Iterations that may be left at the rate of the last one: more take longer than a new tangent and the two that then do.
const MOST_LEFT: f64 = 6.0;

/// A factorised tangent of a model without contacts.
#[derive(Debug)]
pub(crate) struct Chord {
    slots: Arc<[Slot]>,
    eliminations: Vec<Elimination>,
    factors: Factors,
    /// Change of the equations' unknowns by a unit approach.
    by_approach: Vec<f64>,
}

/// How iterations with one tangent end.
pub(super) enum Ending {
    Balanced(Equilibrium),
    /// They converge no longer, or not fast: the iterate from which a new tangent is to be taken.
    Slow(Fields),
}

/// Forces out of balance at some displacements.
struct Unbalanced {
    /// Negative residual of the equations, the elements' centres eliminated.
    right: Vec<f64>,
    /// Residual of each element's centre.
    centres: Vec<[f64; 2]>,
    /// Pressures that would balance each element's volume.
    pressures: Vec<[f64; 3]>,
    /// Derivative of the energy by the approach.
    force: f64,
    /// Over the root of the sum of squared element forces.
    imbalance: f64,
}

impl Chord {
    /// `None` where the tangent is singular.
    pub(super) fn new(
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

    /// Iterates from `start` at an approach as long as that converges fast.
    pub(super) fn iterate(
        &self,
        model: &Model,
        start: Fields,
        approach: f64,
        is_new: bool,
        iterations: &mut usize,
    ) -> Ending {
        let mut fields = start;
        // A full step of Newton's method may raise the imbalance on its way to the solution.
        let mut may_rise = is_new;
        // The iterate before and its imbalance.
        let mut before: Option<(Fields, f64)> = None;
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
                // At this rate.
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
            // Forces at another approach say nothing of the iterates there.
            before = is_there.then_some((fields, imbalance));
            fields = next;
        }
    }

    /// `None` where an element is turned inside out.
    fn unbalanced(&self, model: &Model, fields: &Fields) -> Option<Unbalanced> {
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
        model: &Model,
        fields: &Fields,
        unbalanced: &Unbalanced,
        approach: f64,
    ) -> Option<Fields> {
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
