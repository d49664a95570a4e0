//! Digits kept near every edge; no allocation; properties over random inputs.
use proptest::prelude::*;
use tactile_optics::surface::{Dimple, Flat};
use tactile_optics::trace::{Slab, SlabLayer, TraceOptions, path, trace};
use tactile_optics::{
    Led, OpticsError, acceptance_angle, critical_angle, fresnel, led_cone, normal_incidence,
    propagation,
};

/// Whether n² ≥ 2m² for doubles that are whole multiples of 2⁻⁵², in 128-bit integers.
fn exactly_unlimited(n: f64, m: f64) -> bool {
    let whole = |x: f64| (x * 4_503_599_627_370_496.0) as u128;
    let (n, m) = (whole(n), whole(m));
    n * n >= 2 * m * m
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
    let layer = |index| {
        [SlabLayer {
            index,
            thickness_m: 5e-3,
        }]
    };
    let (dense, thin) = (layer(1.41), layer(1.2));
    let [dense, thin] = [&dense, &thin].map(|layers| Slab::new(layers, 1.0, 30e-3).unwrap());
    let mut vertices = [[0.0; 3]; 200];
    let guided = path(&dense, &Flat, 0.5, 1.0, &mut vertices).unwrap();
    assert!(
        (vertices[guided - 1][0] - 30e-3).abs() < 1e-12,
        "trapped: it reaches the far edge"
    );
    let is_inside = |v: &[f64; 3]| v[2] <= 0.0 && v[2] >= -5e-3 - 1e-15;
    assert!(vertices[..guided].iter().all(is_inside));
    // In a slab of 1.2 a ray at 60° is beyond the acceptance angle of 41.6° and leaves at the top,
    // which it meets first.
    let leaves = path(&thin, &Flat, 0.5, 60_f64.to_radians(), &mut vertices).unwrap();
    assert!(
        leaves == 2 && vertices[1][2].abs() < 1e-15,
        "{:?}",
        &vertices[..leaves]
    );
    assert!(path(&thin, &Flat, 1.5, 0.0, &mut vertices).is_err());
    assert!(path(&thin, &Flat, 0.5, f64::NAN, &mut vertices).is_err());
}

#[test]
fn meaningless_input_is_named() {
    for bad in [f64::NAN, f64::INFINITY, 0.0, -1.4] {
        let found = [
            acceptance_angle(bad, 1.0).err(),
            critical_angle(1.4, bad).err(),
            fresnel(bad, 1.0, 0.1).err(),
            fresnel(1.0, bad, 0.1).err(),
            propagation(bad, 0.1).err(),
        ];
        let is_named = |e: &Option<_>| matches!(e, Some(OpticsError::OutOfRange { .. }));
        assert!(found.iter().all(is_named), "{bad}: {found:?}");
    }
    for bad in [f64::NAN, -0.1, 1.6] {
        assert!(fresnel(1.0, 1.4, bad).is_err());
    }
    for bad in [f64::NAN, -0.1, f64::INFINITY] {
        assert!(propagation(1.4, bad).is_err());
    }
}

proptest! {
    #[test]
    fn energy_is_split_without_loss(
        n1 in 1.0_f64..3.0, n2 in 1.0_f64..3.0, angle in 0.0_f64..1.57
    ) {
        let f = fresnel(n1, n2, angle).unwrap();
        // R and T are computed apart; near the critical angle both are steep in the rounding of the
        // sine they share.
        prop_assert!((f.reflectance_s + f.transmittance_s - 1.0).abs() < 1e-13);
        prop_assert!((f.reflectance_p + f.transmittance_p - 1.0).abs() < 1e-13);
        prop_assert!(f.reflectance_p <= f.reflectance_s + 1e-15);
    }

    #[test]
    fn whether_all_is_trapped_is_decided_exactly(m in 1.0_f64..1.4, k in -4_i64..=4) {
        let n = f64::from_bits(((m * 2.0_f64.sqrt()).to_bits() as i64 + k) as u64);
        let all = acceptance_angle(n, m).unwrap().complement == 0.0;
        prop_assert_eq!(all, exactly_unlimited(n, m));
    }

    #[test]
    fn scaling_every_index_changes_no_angle(n in 1.0_f64..2.0, power in -300_i32..300) {
        let scale = 2.0_f64.powi(power);
        let scaled = acceptance_angle(n * scale, scale).unwrap();
        prop_assert_eq!(scaled, acceptance_angle(n, 1.0).unwrap());
    }
}
