//! All parts together, in the order of the crate documentation. The light of the sensor is
//! proportional to a power of the pressure. The lens has vignetting and distortion, pixels are
//! oblong, and the illumination changes from frame to frame.
#![allow(clippy::print_stdout)]

use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};
use tactile_force::{
    Branch, CalibrationFrame, ContactOptions, DotPair, DriftCorrection, ForceMeter, ForceOptions,
    ForceWorkspace, LensFit, PressureCurve, PressureCurveOptions, ProfileShape,
};

use crate::simulated::{PIXEL_M, SHAPE, Sensor, contact_radius};

/// The sensor with its illumination changed by up to ±5 %.
fn flickering(sensor: Sensor, rng: &mut ChaCha8Rng) -> Sensor {
    Sensor {
        illumination: 0.95 + 0.1 * rng.random::<f64>(),
        ..sensor
    }
}

/// Dots seen through the lens: every twentieth pixel, at its true position.
fn lens(sensor: &Sensor) -> LensFit {
    let mut dots = Vec::new();
    for row in (5..SHAPE.0).step_by(20) {
        for column in (5..SHAPE.1).step_by(20) {
            let pixel = [column as f64, row as f64];
            let target_m = sensor.place(pixel[0], pixel[1]).map(|p| p * PIXEL_M);
            dots.push(DotPair { pixel, target_m });
        }
    }
    LensFit::from_dots(&dots, SHAPE).unwrap()
}

#[test]
fn moduli_are_right_with_every_effect_at_once() {
    let contact = ContactOptions::default().with_drift(DriftCorrection::Automatic);
    for q in [0.8, 1.2] {
        let sensor = Sensor {
            q,
            barrel: 0.03,
            aspect: 1.02,
            ..Sensor::default()
        };
        let mut rng = ChaCha8Rng::seed_from_u64(11);
        let lens = lens(&sensor).geometry;
        let reference = sensor.reference();
        let options = ForceOptions::default().with_contact(contact);
        let meter = ForceMeter::new(lens.pixel_size_m(), &options)
            .unwrap()
            .with_lens(lens);
        let mut workspace = ForceWorkspace::default();
        let mut frames = Vec::new();
        for k in 0..24_u64 {
            let force = (k % 12 + 1) as f64 / 12.0;
            let place = [
                105.0 + 30.0 * rng.random::<f64>(),
                90.0 + 25.0 * rng.random::<f64>(),
            ];
            let frame = flickering(sensor, &mut rng).frame(force, 4e-3, place, Branch::Loading, k);
            let seen = meter
                .detect_with(&mut workspace, frame.view(), &reference)
                .unwrap()
                .unwrap();
            let centroid = seen.centroid_px.map(|c| c.value);
            let pixel_area = lens.mean_pixel_area_m2(centroid, seen.equivalent_radius_px);
            let histogram = workspace.grey_histogram(pixel_area).unwrap();
            frames.push(CalibrationFrame::new(histogram, force, Branch::Loading).unwrap());
        }
        let curve = PressureCurve::fit(&frames, &PressureCurveOptions::default()).unwrap();
        let mut errors = Vec::new();
        for k in 0..24_u64 {
            let force = [0.15, 0.25, 0.4][k as usize % 3];
            // Any position at which the contact fits.
            let place = [
                60.0 + 120.0 * rng.random::<f64>(),
                60.0 + 85.0 * rng.random::<f64>(),
            ];
            let frame =
                flickering(sensor, &mut rng).frame(force, 2.5e-3, place, Branch::Loading, 100 + k);
            let m = meter
                .measure_with(
                    &mut ForceWorkspace::default(),
                    frame.view(),
                    &reference,
                    &curve,
                )
                .unwrap();
            assert_eq!(m.profile.unwrap().shape, ProfileShape::Hertz);
            let at = m.centroid_m.unwrap().map(|c| c.value / PIXEL_M);
            let off = (at[0] - place[0]).hypot(at[1] - place[1]);
            assert!(off < 0.15, "{at:?} {place:?}");
            // Hertz: E ∝ F/a³.
            let radius = m.contact_radius_m.unwrap().value / contact_radius(force, 2.5e-3);
            errors.push((m.force_n.value / force / radius.powi(3) - 1.0).abs());
        }
        errors.sort_by(f64::total_cmp);
        println!(
            "q {q}: modulus off by {:.4} in the median, {:.4} at worst",
            errors[12], errors[23]
        );
        assert!(
            errors[12] < 0.008 && errors[23] < 0.015,
            "q {q}: {errors:?}"
        );
    }
}
