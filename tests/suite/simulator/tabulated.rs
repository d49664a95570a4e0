//! Contacts given as tables of the radius.
use super::{relative, small};
use tactile_simulate::{
    ContactModel, ContactState, LoadCycle, PressLoad, PressOptions, PressScene, SimulateError,
};

/// Hertz's contact of `scene` at `load` as a table of `samples` distances out to 1.3 a.
fn tabulated(scene: &PressScene, load: usize, samples: usize) -> ContactState {
    let contact = scene.truth(load).contact;
    let reach = 1.3 * contact.contact_radius_m;
    let radius_m: Vec<f64> = (0..samples)
        .map(|k| reach * k as f64 / (samples - 1) as f64)
        .collect();
    ContactState {
        force_n: contact.force_n,
        contact_radius_m: contact.contact_radius_m,
        indentation_m: contact.indentation_m,
        pressure_pa: radius_m.iter().map(|&r| contact.pressure_pa(r)).collect(),
        height_m: vec![-1e-4; samples],
        radius_m,
    }
}

#[test]
fn a_table_of_hertz_is_seen_as_hertz() {
    let options = PressOptions {
        centre_px: Some([170.37, 131.8]),
        ..small()
    };
    let exact = PressScene::new(options.clone()).unwrap();
    let states = (0..2).map(|k| tabulated(&exact, k, 81)).collect();
    let table = PressScene::new(PressOptions {
        law: ContactModel::Tabulated(states),
        ..options.clone()
    })
    .unwrap();
    let area = options.camera.pixel_size_m.iter().product::<f64>();
    for load in 0..2 {
        let (expected, found) = (exact.truth(load), table.truth(load));
        let peak = expected.contact.peak_pressure_pa;
        let difference = (expected.pressure_pa() - found.pressure_pa())
            .fold(0.0, |worst: f64, v| worst.max(v.abs()));
        // At the rim the pixel is represented by 16 midpoints per side. Inside, only rounding
        // remains.
        assert!(difference < 1e-3 * peak, "{difference} of {peak} Pa");
        assert!(relative(found.visible_force_n, expected.visible_force_n) < 2e-5);
        assert!(relative(found.pressure_pa().sum() * area, expected.contact.force_n) < 2e-5);
        let [seen, wanted] = [&found, &expected].map(|truth| truth.integrated_pixel_value);
        assert!(relative(seen, wanted) < 2e-5);
        let (seen, wanted) = (table.frame(load, 0), exact.frame(load, 0));
        let other = seen.iter().zip(&wanted).filter(|(a, b)| a != b).count();
        // The same noise is added to the same light: a difference of 1e-4 grey levels changes the
        // rounding of one pixel in 10⁴.
        assert!(other < 20, "{other} of {} pixels", seen.len());
        let a = found.contact.contact_radius_m;
        assert!(relative(found.contact.apparent_height_m(0.6 * a), 0.8 * a) < 1e-3);
    }
}

#[test]
fn a_tabulated_contact_refuses_loads_beyond_its_last_state() {
    let scene = PressScene::new(small()).unwrap();
    let law = ContactModel::Tabulated(vec![tabulated(&scene, 0, 40)]);
    let with = |force_n: f64| {
        PressScene::new(PressOptions {
            law: law.clone(),
            loads: vec![PressLoad::normal(force_n)],
            ..small()
        })
    };
    // The force of a solver's state is the requested force within its tolerance.
    assert!(with(0.7 * (1.0 + 1e-10)).is_ok() && with(0.0).is_ok());
    let reaches = |maximum: f64| (maximum / 0.7 - 1.0).abs() < 1e-8;
    assert!(matches!(
        with(0.71),
        Err(SimulateError::OutOfRange { field: "the force in N", maximum, .. }) if reaches(maximum)
    ));
    let scene = with(0.7).unwrap();
    let mut cycle = LoadCycle::default();
    assert!(scene.stream(cycle).is_err(), "1.2 N in the cycle");
    cycle.largest_force_n = 0.7;
    assert_eq!(scene.stream(cycle).unwrap().count(), 88);
    // Below the only state the contact decreases like Hertz's.
    let radius = |scene: &PressScene| scene.truth(0).contact.contact_radius_m;
    let shrunk = radius(&with(0.1).unwrap()) / radius(&scene);
    assert!(relative(shrunk, (0.1_f64 / 0.7).cbrt()) < 1e-12);
}
