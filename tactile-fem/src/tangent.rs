//! The symmetric linear system of a Newton step.

use super::anchor::Slip;
use super::element::OUTER;
use super::slot::{NO_PLACE, Places, Slot, slot};
use super::sparse::{Factors, Singular, Symmetric};

/// What a step is to reach.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Goal {
    Approach(f64),
    Force(f64),
}

/// A symmetric linear system with one more unknown, the approach.
#[derive(Debug, Clone)]
pub(crate) struct Tangent {
    pub(crate) matrix: Symmetric,
    /// Negative residual.
    pub(crate) right: Vec<f64>,
    pub(crate) driver_column: Vec<f64>,
    pub(crate) driver_stiffness: f64,
    /// Residual of the approach.
    pub(crate) force: f64,
}

impl Tangent {
    /// Adds an element.
    pub(crate) fn add_element(
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
    pub(crate) fn add_slip(&mut self, slots: &[Slot], slip: &Slip, stiffness: f64) {
        let slots: Vec<Slot> = slip.dofs.iter().map(|&dof| slot(slots, dof)).collect();
        let load = stiffness * slip.value;
        let residual: Vec<f64> = slip.first.iter().map(|by| load * by).collect();
        self.scatter(&slots, &residual, |i, j| {
            stiffness * slip.first[i] * slip.first[j]
        });
    }

    /// Adds a symmetric contribution of which the lower half is asked.
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

    /// Solution for a goal: the equations' unknowns and the approach's step.
    pub(crate) fn solve(
        &self,
        factors: &Factors,
        goal: Goal,
        present: f64,
    ) -> Result<(Vec<f64>, f64), Singular> {
        // Two right-hand sides: the residual's, and that of a unit approach.
        let size = self.right.len();
        let mut columns = [self.right.as_slice(), &self.driver_column].concat();
        factors.solve(&mut columns)?;
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
