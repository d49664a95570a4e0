//! Uniaxial compression: the law of its states, its frames and its limits.

use super::relative;
use tactile_simulate::{
    Camera, Elastic, SimulateError, SurfacePattern, UniaxialOptions, UniaxialScene,
};

#[test]
fn uniaxial_states_obey_their_law_and_balance_the_force() {
    let forces = vec![0.01, 0.3, 0.7, 1.1];
    let scene = UniaxialScene::new(UniaxialOptions {
        forces_n: forces.clone(),
        material: Elastic {
            youngs_modulus_pa: 62e3,
            poisson_ratio: 0.45,
        },
        face_m: [9e-3, 11e-3],
        ..UniaxialOptions::default()
    })
    .unwrap();
    for (s, force) in scene.states().iter().zip(forces) {
        assert_eq!(s.force_n, force);
        let close = |x: f64, y: f64| assert!(relative(x, y) < 1e-12, "{x} {y}");
        close(-s.cauchy_zz_pa * s.area_m2, force);
        // Cauchy from second Piola–Kirchhoff: σ = F S Fᵀ / det F.
        close(
            s.cauchy_zz_pa,
            s.second_piola_zz_pa * s.stretch_z / s.stretch_lateral.powi(2),
        );
        close(s.second_piola_zz_pa, 62e3 * s.strain_zz);
        close(0.5 * (s.stretch_lateral.powi(2) - 1.0), -0.45 * s.strain_zz);
        assert!(s.stretch_z < 1.0 && s.stretch_lateral > 1.0);
    }
    for (i, j) in [(0, 1), (1, 3), (2, 3)] {
        // From state i as the reference: e = (e_j − e_i)/λ_i², and S likewise.
        let [from, to] = [&scene.states()[i], &scene.states()[j]];
        let square = from.stretch_z.powi(2);
        let stress_pa = (to.second_piola_zz_pa - from.second_piola_zz_pa) / square;
        let strain = (to.strain_zz - from.strain_zz) / square;
        assert!(relative(stress_pa / strain, 62e3) < 1e-12);
        let axial = to.stretch_z / from.stretch_z;
        assert!(relative(strain, 0.5 * (axial * axial - 1.0)) < 1e-12);
    }
}

#[test]
fn uniaxial_frames_carry_the_force() {
    let mut options = UniaxialOptions {
        camera: Camera::default().coarser(4).ideal(),
        ..UniaxialOptions::default()
    };
    options.centre_px = Some([170.2, 133.9]);
    let background = options.camera.background_grey;
    let scene = UniaxialScene::new(options).unwrap();
    let area = scene.options().camera.pixel_size_m.iter().product::<f64>();
    for (k, force) in [(0, 0.2), (1, 0.7), (2, 1.2)] {
        let light: f64 = scene.expected_frame(k).iter().map(|v| v - background).sum();
        assert!(relative(light * area / scene.grey_per_pascal(), force) < 1e-12);
        assert!(relative(scene.pressure_pa(k).sum() * area, force) < 1e-12);
    }
}

#[test]
fn a_force_beyond_the_material_law_is_an_error_and_so_are_bad_patterns() {
    let limit = 103e3 * 144e-6 / 27.0_f64.sqrt();
    let with = |force_n: f64, change: fn(&mut SurfacePattern)| {
        let mut options = UniaxialOptions {
            forces_n: vec![force_n],
            camera: Camera::default().coarser(4),
            ..UniaxialOptions::default()
        };
        change(&mut options.pattern);
        UniaxialScene::new(options)
    };
    let at = |force_n| with(force_n, |_| {});
    assert!(at(0.999 * limit).is_ok() && at(f64::NAN).is_err());
    assert!(matches!(
        at(1.001 * limit),
        Err(SimulateError::Overload { .. })
    ));
    assert!(with(0.2, |pattern| pattern.bump_share = 0.6).is_err());
    assert!(with(0.2, |pattern| pattern.bump_height_m = [2e-3, 1e-3]).is_err());
}
