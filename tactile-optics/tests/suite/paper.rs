//! The numbers of the paper (§2.2, §3.4, Table 1), and published indices of the materials.
use tactile_optics::{
    Dispersion, OpticsError, SensorParameters, SensorSpecification, acceptance_angle, led_cone,
};

#[test]
fn acceptance_angles_and_the_led_cone() {
    let layers = [1.38_f64, 1.39, 1.40, 1.41];
    let printed = [71.98, 74.89, 78.46, 83.73];
    for (index, printed) in layers.into_iter().zip(printed) {
        let angle = acceptance_angle(index, 1.0).unwrap();
        assert!(angle.complement > 0.0);
        // The paper truncates to two decimals.
        let degrees = angle.radians.to_degrees();
        assert_eq!((degrees * 100.0).floor() / 100.0, printed);
    }
    let cone = led_cone(&layers, 1.0, 143.96_f64.to_radians()).unwrap();
    assert!(cone.trapped);
    // 2 × 71.9894 = 143.9789 untruncated.
    assert!((cone.margin.to_degrees() - 0.0189).abs() < 1e-3);
    let wider = led_cone(&layers, 1.0, 144.0_f64.to_radians()).unwrap();
    assert!(!wider.trapped);
}

#[test]
fn cones_at_the_extremes() {
    let dense = |full_angle| led_cone(&[1.5, 1.6], 1.0, full_angle);
    assert!(dense(core::f64::consts::PI).unwrap().trapped);
    assert!(!led_cone(&[1.4, 1.0], 1.0, 0.0).unwrap().trapped);
    assert!(dense(3.2).is_err() && dense(f64::NAN).is_err());
    assert_eq!(
        led_cone(&[], 1.0_f64, 1.0),
        Err(OpticsError::Empty {
            quantity: "stack of layers"
        })
    );
    assert!(
        led_cone(&[1.4, -1.0], 1.0, 1.0).is_err() && led_cone(&[1.4], f64::INFINITY, 1.0).is_err()
    );
}

#[test]
fn the_specification() {
    let camera = SensorParameters {
        side_m: 30e-3_f64,
        pixel_m: 4.65e-6,
        frame_rate_hz: 80.0,
        largest_force_n: 2.0,
        newton_per_grey: 8.7e-8,
        pixel_noise_grey: 0.76,
        summed_pixels: 1392.0 * 1042.0,
    };
    let sensor = SensorSpecification::new(&camera, 3.0).unwrap();
    assert_eq!(sensor.grid_elements.round(), 6452.0);
    assert_eq!(sensor.temporal_resolution_s, 12.5e-3);
    // 0.76 grey levels over 1.45 million pixels, with equal noise of the reference: 1300 grey
    // levels, 0.11 mN.
    let one_sigma = 0.76 * (2.0 * 1392.0 * 1042.0_f64).sqrt() * 8.7e-8;
    assert!((sensor.force_resolution_n - 3.0 * one_sigma).abs() < 1e-18);
    assert!((sensor.force_levels * 3.0 * one_sigma - 2.0).abs() < 1e-12);
    let refused = |change: fn(&mut SensorParameters)| {
        let mut changed = camera;
        change(&mut changed);
        SensorSpecification::new(&changed, 3.0).is_err()
    };
    assert!(refused(|p| p.side_m = 0.0) && refused(|p| p.frame_rate_hz = f64::INFINITY));
    assert!(refused(|p| p.pixel_noise_grey = f64::NAN));
    assert!(SensorSpecification::new(&camera, 0.0).is_err());
    // A camera without noise is a valid limit.
    assert!(!refused(|p| p.pixel_noise_grey = 0.0));
}

#[test]
fn indices_and_abbe_numbers_of_the_materials() {
    for (material, index, abbe, tolerance) in [
        (Dispersion::N_BK7, 1.5168, 64.17, 2e-5),
        (Dispersion::BOROFLOAT_33, 1.471, 65.41, 6e-4),
    ] {
        let [d, f, c] = [587.56e-9, 486.13e-9, 656.27e-9].map(|w| material.index(w).unwrap());
        assert!((d - index).abs() < tolerance);
        assert!(((d - 1.0) / (f - c) / abbe - 1.0).abs() < 0.02);
    }
    // Tabulated values at 0.5 and 0.6 µm. The residuals of the fits are below 5.6e-4.
    for (material, at_500, at_600) in [
        (Dispersion::PDMS_5_1, 1.40675, 1.40202),
        (Dispersion::PDMS_10_1, 1.39951, 1.39456),
        (Dispersion::PDMS_20_1, 1.41189, 1.40715),
    ] {
        assert!((material.index(0.5e-6_f64).unwrap() - at_500).abs() < 5.6e-4);
        assert!((material.index(0.6e-6_f64).unwrap() - at_600).abs() < 5.6e-4);
    }
    assert!((Dispersion::PDMS_RTV615.index(0.6e-6).unwrap() - 1.4297).abs() < 1e-3);
    // The published fit ends at 750 nm. There is no extrapolation at either end.
    assert!(Dispersion::PDMS_10_1.index(0.3e-6_f64).is_err());
    assert!(Dispersion::PDMS_10_1.index(0.85e-6_f64).is_err());
    assert!(Dispersion::N_BK7.index(f64::NAN).is_err());
    // Normal dispersion: the index decreases with the wavelength.
    let falling = |m: Dispersion| {
        (400..700)
            .all(|nm| m.index(nm as f64 * 1e-9).unwrap() > m.index((nm + 1) as f64 * 1e-9).unwrap())
    };
    assert!(
        falling(Dispersion::N_BK7)
            && falling(Dispersion::BOROFLOAT_33)
            && falling(Dispersion::PDMS_20_1)
    );
}
