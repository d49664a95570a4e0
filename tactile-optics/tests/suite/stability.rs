//! Accuracy near every limit, no allocation, and properties for random inputs.
use proptest::prelude::*;
use tactile_optics::surface::Dimple;
use tactile_optics::trace::{Slab, SlabLayer, TraceOptions, path, trace};
use tactile_optics::{
    Angle, Led, OpticsError, acceptance_angle, critical_angle, fresnel, led_cone, normal_incidence,
    propagation,
};

/// Whether n² ≥ 2m² for doubles that are integer multiples of 2⁻⁵², in 128-bit integers.
fn exactly_unlimited(n: f64, m: f64) -> bool {
    let whole = |x: f64| (x * 4_503_599_627_370_496.0) as u128;
    let (n, m) = (whole(n), whole(m));
    n * n >= 2 * m * m
}

#[test]
fn reflectance_of_nearly_equal_media_is_the_square_of_the_step() {
    for k in 1..60 {
        let step = 0.5_f64.powi(k);
        let n2 = 1.4 * (1.0 + step);
        let exact = ((n2 - 1.4) / (n2 + 1.4)).powi(2);
        let found = fresnel(1.4, n2, 0.0).unwrap();
        // Nine roundings in all, on both sides.
        assert!((found.reflectance_s - exact).abs() <= 2e-15 * exact, "{k}");
        assert!((found.reflectance_p - exact).abs() <= 2e-15 * exact, "{k}");
    }
}

#[test]
fn grazing_transmittance_is_linear_in_the_complement() {
    // T_s → 4 n₁ c₁/√(n₂² − n₁²) as the angle approaches π/2: half the complement gives half the
    // transmittance.
    let near = |c: f64| {
        fresnel(1.0, 1.4, std::f64::consts::FRAC_PI_2 - c)
            .unwrap()
            .transmittance_s
    };
    for c in [1e-4, 1e-6, 1e-8] {
        let complement = std::f64::consts::FRAC_PI_2 - (std::f64::consts::FRAC_PI_2 - c);
        let expected = 4.0 * complement / (1.4_f64 * 1.4 - 1.0).sqrt();
        assert!((near(c) / expected - 1.0).abs() < 10.0 * c.max(1e-9), "{c}");
    }
}

#[test]
fn nothing_allocates() {
    let layers = [
        SlabLayer {
            index: 1.40_f64,
            thickness_m: 2e-3,
        },
        SlabLayer {
            index: 1.41,
            thickness_m: 8e-3,
        },
    ];
    let indices = [1.38, 1.39, 1.40, 1.41];
    let mut profile = [0.0; 16];
    let mut vertices = [[0.0; 3]; 64];
    let counted = allocation_counter::measure(|| {
        assert!(led_cone(&indices, 1.0, 1.0).unwrap().trapped);
        let passing = normal_incidence(&indices, 1.0).unwrap();
        assert!(passing.transmittance > 0.9);
        let slab = Slab::new(&layers, 1.0, 30e-3).unwrap();
        let dimple = Dimple::new([15e-3, 0.0], 4e-3, 1.5e-3).unwrap();
        let options = TraceOptions::default().with_rays(500).unwrap();
        trace(&slab, &Led::default(), &dimple, &options, &mut profile).unwrap();
        path(&slab, &dimple, 0.3, 0.4, &mut vertices).unwrap();
    });
    assert_eq!(counted.count_total, 0);
}

#[test]
fn a_path_stays_in_the_slab_and_ends_where_light_leaves() {
    let layers = [SlabLayer {
        index: 1.41_f64,
        thickness_m: 5e-3,
    }];
    let slab = Slab::new(&layers, 1.0, 30e-3).unwrap();
    let mut vertices = [[0.0; 3]; 200];
    let guided = path(
        &slab,
        &tactile_optics::surface::Flat,
        0.5,
        1.0,
        &mut vertices,
    )
    .unwrap();
    assert!(
        (vertices[guided - 1][0] - 30e-3).abs() < 1e-12,
        "trapped: it reaches the far edge"
    );
    assert!(
        vertices[..guided]
            .iter()
            .all(|v| v[2] <= 0.0 && v[2] >= -5e-3 - 1e-15)
    );
    // In a slab of 1.2 a ray at 60° is beyond the acceptance angle of 41.6° and leaves through the
    // top, which it reaches first.
    let thin = [SlabLayer {
        index: 1.2_f64,
        thickness_m: 5e-3,
    }];
    let slab = Slab::new(&thin, 1.0, 30e-3).unwrap();
    let leaves = path(
        &slab,
        &tactile_optics::surface::Flat,
        0.5,
        60_f64.to_radians(),
        &mut vertices,
    )
    .unwrap();
    assert!(
        leaves == 2 && vertices[1][2].abs() < 1e-15,
        "{:?}",
        &vertices[..leaves]
    );
    assert!(
        path(
            &slab,
            &tactile_optics::surface::Flat,
            1.5,
            0.0,
            &mut vertices
        )
        .is_err()
    );
    assert!(
        path(
            &slab,
            &tactile_optics::surface::Flat,
            0.5,
            f64::NAN,
            &mut vertices
        )
        .is_err()
    );
}

#[test]
fn meaningless_input_is_named() {
    for bad in [f64::NAN, f64::INFINITY, 0.0, -1.4] {
        assert!(matches!(
            acceptance_angle(bad, 1.0),
            Err(OpticsError::OutOfRange { .. })
        ));
        assert!(matches!(
            critical_angle(1.4, bad),
            Err(OpticsError::OutOfRange { .. })
        ));
        assert!(matches!(
            fresnel(bad, 1.0, 0.1),
            Err(OpticsError::OutOfRange { .. })
        ));
        assert!(matches!(
            fresnel(1.0, bad, 0.1),
            Err(OpticsError::OutOfRange { .. })
        ));
        assert!(matches!(
            propagation(bad, 0.1),
            Err(OpticsError::OutOfRange { .. })
        ));
    }
    for bad in [f64::NAN, -0.1, 1.6] {
        assert!(fresnel(1.0, 1.4, bad).is_err());
    }
    assert!(propagation(1.4, -0.1).is_err() && propagation(1.4, f64::NAN).is_err());
    assert!(propagation(1.4, f64::INFINITY).is_err());
}

proptest! {
    #[test]
    fn energy_is_split_without_loss(
        n1 in 1.0_f64..3.0, n2 in 1.0_f64..3.0, angle in 0.0_f64..1.57
    ) {
        let f = fresnel(n1, n2, angle).unwrap();
        // R and T are computed separately. Near the critical angle both depend strongly on the
        // rounding of the common sine.
        prop_assert!((f.reflectance_s + f.transmittance_s - 1.0).abs() < 1e-13);
        prop_assert!((f.reflectance_p + f.transmittance_p - 1.0).abs() < 1e-13);
        prop_assert!(f.reflectance_p <= f.reflectance_s + 1e-15);
    }

    #[test]
    fn light_retraces_its_way(n1 in 1.0_f64..2.0, n2 in 1.0_f64..2.0, angle in 0.0_f64..1.5) {
        let forth = fresnel(n1, n2, angle).unwrap();
        if let Some(refracted) = forth.refraction && refracted.complement > 1e-3 {
            let back = fresnel(n2, n1, refracted.radians).unwrap();
            // Steep near grazing incidence on either side (the reverse path is then near its
            // critical angle): the relative condition is proportional to the inverse square of the
            // complement.
            let grazing = refracted.complement.min(std::f64::consts::FRAC_PI_2 - angle);
            let tolerance = 1e-14 / grazing.powi(2);
            prop_assert!((back.transmittance_s - forth.transmittance_s).abs() < tolerance);
            prop_assert!((back.transmittance_p - forth.transmittance_p).abs() < tolerance);
            prop_assert!((back.refraction.unwrap().radians - angle).abs() < tolerance);
        }
    }

    #[test]
    fn whether_all_is_trapped_is_decided_exactly(m in 1.0_f64..1.4, k in -4_i64..=4) {
        let n = f64::from_bits(((m * 2.0_f64.sqrt()).to_bits() as i64 + k) as u64);
        let all = acceptance_angle(n, m).unwrap().complement == 0.0;
        prop_assert_eq!(all, exactly_unlimited(n, m));
    }

    #[test]
    fn acceptance_is_the_entry_angle_of_the_critical_ray(n in 1.01_f64..1.41, n0 in 0.98_f64..1.0) {
        let acceptance = acceptance_angle(n, n0).unwrap();
        prop_assume!(acceptance.complement > 0.0);
        let critical = critical_angle(n, n0).unwrap().unwrap();
        // A ray that enters at θᵢ travels at π/2 − θ_c to the axis.
        let angle: Angle = propagation(n, n0 * acceptance.radians.sin()).unwrap().unwrap();
        prop_assert!((angle.radians - critical.complement).abs() < 1e-14);
    }

    #[test]
    fn scaling_every_index_changes_no_angle(n in 1.0_f64..2.0, power in -300_i32..300) {
        let scale = 2.0_f64.powi(power);
        let scaled = acceptance_angle(n * scale, scale).unwrap();
        prop_assert_eq!(scaled, acceptance_angle(n, 1.0).unwrap());
    }

    #[test]
    fn order_and_direction_of_a_stack_do_not_matter_beyond_its_own_steps(
        indices in prop::collection::vec(1.0_f64..2.0, 1..8),
        n0 in 1.0_f64..1.5,
    ) {
        let reversed: Vec<f64> = indices.iter().rev().copied().collect();
        let forth = normal_incidence(&indices, n0).unwrap();
        let back = normal_incidence(&reversed, n0).unwrap();
        prop_assert!((forth.transmittance - back.transmittance).abs() < 1e-14);
        prop_assert!((forth.transmittance + forth.reflectance - 1.0).abs() < 1e-14);
        // Light after several reflections adds to the transmitted light.
        prop_assert!(forth.transmittance >= forth.single_pass - 1e-15);
        // A layer cut in two is the same layer.
        let mut cut = indices.clone();
        cut.insert(1, indices[0]);
        let same = normal_incidence(&cut, n0).unwrap();
        prop_assert!((same.transmittance - forth.transmittance).abs() < 1e-14);
    }
}
