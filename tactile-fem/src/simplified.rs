//! Equilibria by simplified Newton iterations.

use super::chord::{Chord, Ending};
use super::fields::{Equilibrium, Fields};
use super::layout::Layout;
use super::material::Kinematics;
use super::model::Model;
use std::sync::Arc;

/// Tangents on the way to an equilibrium: those that are reached take one to three.
const MAX_TANGENTS: usize = 7;
/// Change of the approach, relative, up to which the last tangent is tried.
const NEAR: f64 = 0.02;

/// Equilibrium at an approach, of a model without contacts; `None` where iterations do not converge. A new tangent is taken
/// only where those with the last one of `layout` converge slowly.
pub(crate) fn equilibrium(
    model: &Model,
    layout: &mut Layout,
    start: &Fields,
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
