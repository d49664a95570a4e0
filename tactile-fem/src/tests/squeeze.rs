//! Compares cylinders between plates with homogeneous strain and with the stiffness of thin bonded
//! discs.

use crate::{AppliedLoad, FemScene, Interface, Material, State};
use approx::assert_relative_eq;
use core::f64::consts::PI;

const RADIUS_M: f64 = 6e-3;

fn squeezed(aspect: f64, material: Material, faces: Interface, squeeze: f64) -> State {
    let height_m = 2.0 * RADIUS_M * aspect;
    let scene = FemScene::cylinder_between_plates(RADIUS_M, height_m, material, faces).unwrap();
    let solution = scene.solve(&[AppliedLoad::Approach(0.5 * squeeze * height_m)]);
    solution.states.into_iter().next().unwrap()
}

/// Lateral stretch and pressure of the material at an axial stretch with free sides: σ_t = 0 is
/// solved by bisection, with σ = μ J^{−5/3} dev B + κ (J − 1).
fn homogeneous(material: Material, axial: f64) -> (f64, f64) {
    let (mu, nu) = (material.shear_modulus(), material.poisson_ratio());
    let kappa = material.youngs_modulus_pa() / (3.0 * (1.0 - 2.0 * nu));
    let stresses = |lateral: f64| {
        let volume = lateral * lateral * axial;
        let mean = (2.0 * lateral * lateral + axial * axial) / 3.0;
        let of = |stretch: f64| {
            mu * volume.powf(-5.0 / 3.0) * (stretch * stretch - mean) + kappa * (volume - 1.0)
        };
        (of(lateral), of(axial))
    };
    let (mut low, mut high) = (1.0, 2.0);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        match stresses(middle).0 > 0.0 {
            true => high = middle,
            false => low = middle,
        }
    }
    (low, -stresses(low).1)
}

#[test]
fn faces_that_slide_give_the_homogeneous_state() {
    for nu in [0.3, 0.495] {
        let material = Material::new(103e3, nu).unwrap();
        for aspect in [0.4, 1.0, 2.5] {
            for squeeze in [0.02, 0.15] {
                let state = squeezed(aspect, material, Interface::Frictionless, squeeze);
                let (lateral, pressure) = homogeneous(material, 1.0 - squeeze);
                let area = PI * (lateral * RADIUS_M).powi(2);
                // Tolerance of Newton's method.
                assert_relative_eq!(state.force_n(), area * pressure, max_relative = 1e-7);
                for point in state.pressure() {
                    assert_relative_eq!(point.pressure_pa, pressure, max_relative = 1e-6);
                }
            }
        }
    }
}

#[test]
fn thin_discs_that_stick_are_as_stiff_as_gent_and_lindley_say() {
    // E(1 + 2S²) with S = R/2H, for incompressible material and S well above one. The bulk modulus,
    // 1,667 E, adds 1/κ to the compliance.
    let material = Material::new(1e5, 0.4999).unwrap();
    for shape in [2.0_f64, 4.0] {
        let aspect = 1.0 / (4.0 * shape);
        let state = squeezed(aspect, material, Interface::Bonded, 1e-3);
        let apparent = state.force_n() / (PI * RADIUS_M * RADIUS_M * 1e-3);
        let incompressible = 1e5 * (1.0 + 2.0 * shape * shape);
        let kappa = 1e5 / (3.0 * (1.0 - 2.0 * 0.4999));
        let expected = 1.0 / (1.0 / incompressible + 1.0 / kappa);
        // The parabola of pressure is the leading order in the thickness; the compression adds
        // several tenths of a per cent.
        assert_relative_eq!(apparent, expected, max_relative = 0.05);
        let points = state.pressure();
        let [first, last] = [points[0], points[points.len() / 2]];
        // Between: p = p₀ (1 − r²/R²).
        let parabola = 1.0 - (last.r_m / RADIUS_M).powi(2);
        assert_relative_eq!(
            last.pressure_pa / first.pressure_pa,
            parabola,
            max_relative = 0.1
        );
    }
}
