//! Contacts by finite elements that come with the crate.

use super::contact_state::ContactState;
use super::material::{Elastic, Sphere, Waveguide};

/// A row a point: the ball's modulus and radius, its guide's layers, force, contact radius and approach of its state, then distance,
/// pressure and height. Made by `examples/contact_states.rs`.
const POINTS: &str = include_str!("finite_elements.csv");

/// R of the balls.
const RADIUS_M: f64 = 3e-3;

/// The states of a ball on a waveguide, of growing force; None for bodies that were not computed.
pub(super) fn states(sphere: &Sphere, waveguide: &Waveguide) -> Option<Vec<ContactState>> {
    let known = [Elastic::CL2000X, Elastic::CL2003X].contains(&sphere.material);
    let elastic = |w: &Waveguide| -> Vec<(f64, Elastic)> {
        w.layers
            .iter()
            .map(|l| (l.thickness_m, l.material))
            .collect()
    };
    let same_guide = elastic(waveguide) == elastic(&Waveguide::default());
    if !known || !same_guide || sphere.radius_m != RADIUS_M {
        return None;
    }
    let mut states: Vec<ContactState> = Vec::new();
    for row in POINTS.lines().skip(1) {
        // The layers, the third column, are the default waveguide's.
        let cells = row
            .split(',')
            .enumerate()
            .filter(|(column, _)| *column != 2);
        let numbers: Option<Vec<f64>> = cells.map(|(_, cell)| cell.parse().ok()).collect();
        let [
            modulus,
            _radius,
            force_n,
            contact_radius_m,
            indentation_m,
            r,
            pressure,
            height,
        ] = numbers?.try_into().ok()?;
        if modulus != sphere.material.youngs_modulus_pa {
            continue;
        }
        if states.last().is_none_or(|s| s.force_n != force_n) {
            states.push(ContactState {
                force_n,
                contact_radius_m,
                indentation_m,
                radius_m: Vec::new(),
                pressure_pa: Vec::new(),
                height_m: Vec::new(),
            });
        }
        if let Some(state) = states.last_mut() {
            state.radius_m.push(r);
            state.pressure_pa.push(pressure);
            state.height_m.push(height);
        }
    }
    Some(states)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_state_is_a_contact_that_carries_its_force() {
        for material in [Elastic::CL2000X, Elastic::CL2003X] {
            let ball = Sphere {
                radius_m: RADIUS_M,
                material,
            };
            let states = states(&ball, &Waveguide::default()).unwrap();
            assert_eq!(states.len(), 11);
            for pair in states.windows(2) {
                assert!(pair[0].force_n < pair[1].force_n);
                assert!(pair[0].contact_radius_m < pair[1].contact_radius_m);
            }
            for state in &states {
                state.validate().unwrap();
                // The recovered nodal pressures carry the force within the contact radius's own uncertainty.
                let carried = state.carried_force_n() / state.force_n;
                assert!(
                    (carried - 1.0).abs() < 5e-3,
                    "{} N: {carried}",
                    state.force_n
                );
            }
            let other = Sphere {
                radius_m: 4e-3,
                ..ball
            };
            assert!(super::states(&other, &Waveguide::default()).is_none());
        }
    }
}
