//! Balls pressed with another program: its contacts compared with those of this project's elements,
//! and the moduli measured in rendered frames of them.
#![allow(clippy::print_stdout)]
use super::{balls_of, error, solved};
use tactile_imaging::fem::AppliedLoad;

const FILE: &str = "calculix_presses.csv";

/// Poisson's ratio of the bodies.
const POISSON_RATIO: f64 = 0.499;

/// At the same approach both programs give the same force and contact radius. `ALL_LOADS=1` solves
/// every ball instead of every third.
#[test]
fn contacts_are_those_of_another_program() {
    let step = if std::env::var_os("ALL_LOADS").is_some() {
        1
    } else {
        3
    };
    for ball in balls_of(FILE).into_iter().step_by(step) {
        let approaches = ball.states.iter().map(|state| state.indentation_m);
        let loads = approaches.map(AppliedLoad::Approach);
        let modulus = ball.youngs_modulus_pa;
        let scene = solved::press(ball.radius_m, &ball.layers, modulus, POISSON_RATIO, 10);
        let solved = scene.solve(&loads.collect::<Vec<_>>()).states;
        assert_eq!(solved.len(), ball.states.len(), "{}", ball.name);
        for (own, other) in solved.iter().zip(&ball.states) {
            let force = own.force_n() / other.force_n - 1.0;
            let radius = own.contact_radius().unwrap().radius_m / other.contact_radius_m - 1.0;
            println!(
                "{}: a/R {:.2}, force {:+.3} %, radius {:+.3} %",
                ball.name,
                other.contact_radius_m / ball.radius_m,
                100.0 * force,
                100.0 * radius
            );
            assert!(force.abs() < 3e-3 && radius.abs() < 1e-3, "{}", ball.name);
        }
    }
}

/// Rendered with the noise of the camera and measured without knowledge of the truth, two loads at
/// a time.
#[test]
fn moduli_of_balls_of_another_program_are_right() {
    for (k, ball) in balls_of(FILE).iter().enumerate() {
        for first in (0..ball.states.len()).step_by(2) {
            let reading = ball.read(first, 500 + (10 * k + first) as u64, &[]);
            let off = error(&reading.layered, ball.youngs_modulus_pa);
            let interval = reading.layered.interval_95;
            println!(
                "{}: a/R {:.2}, {:+.2} % ± {:.2} %, radii {:+.3?} %",
                ball.name,
                reading.largest_ratio,
                100.0 * off,
                100.0 * reading.layered.standard_error_pa / reading.layered.youngs_modulus_pa,
                reading.radius_errors.map(|e| 100.0 * e)
            );
            let holds = interval.contains(ball.youngs_modulus_pa);
            assert!(holds && off.abs() < 0.015, "{}: {interval:?}", ball.name);
        }
    }
}
