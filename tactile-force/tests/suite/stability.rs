//! Required invariances: rotated images, dark contacts, omitted rows.

use ndarray::Array2;
use tactile_force::{
    ContactOptions, DriftCorrection, ForceMeasurement, ForceOptions, Polarity, measure_force,
};

use crate::blob::{calibration, hertz};

fn pressed(dark: bool, flip: bool) -> ForceMeasurement {
    let light = hertz((150, 170), [80.2, 70.9], 33.4, 120.0);
    let noise =
        |y: usize, x: usize, k: usize| ((y * 7919 + x * 104_729 + k * 31) % 13) as f64 / 4.0 - 1.5;
    let sign = if dark { -1.0 } else { 1.0 };
    let image = |k: usize, scale: f64| {
        let image = Array2::from_shape_fn((150, 170), |(y, x)| {
            (128.0 + sign * (noise(y, x, k) + scale * light[[y, x]])).round() as u8
        });
        if flip { image.t().to_owned() } else { image }
    };
    let polarity = if dark {
        Polarity::Darker
    } else {
        Polarity::Brighter
    };
    // The light is determined from tiles of 8 × 32 pixels, which differ in a rotated image.
    let contact = ContactOptions::default()
        .with_polarity(polarity)
        .with_drift(DriftCorrection::None);
    let options = ForceOptions::default().with_contact(contact);
    measure_force(
        image(1, 1.0).view(),
        image(0, 0.0).view(),
        [2e-5; 2],
        &calibration(),
        &options,
    )
    .unwrap()
}

#[test]
fn x_and_y_are_treated_alike() {
    let (a, b) = (pressed(false, false), pressed(false, true));
    let ([ax, ay], [bx, by]) = (a.profile.unwrap().centre_px, b.profile.unwrap().centre_px);
    // Sums have another order: rounding.
    assert!((ax.value - by.value).abs() < 1e-9 && (ay.value - bx.value).abs() < 1e-9);
    assert_eq!(a.contact.unwrap().area_px, b.contact.unwrap().area_px);
    assert!((a.force_n.value - b.force_n.value).abs() < 1e-15);
}

#[test]
fn darkness_measures_as_light_does() {
    let (light, dark) = (pressed(false, false), pressed(true, false));
    // Halves are rounded away from zero, up in one image and down in the other: up to half a level
    // in one of 4 pixels.
    assert!((light.force_n.value / dark.force_n.value - 1.0).abs() < 5e-3);
    let radius = |m: &ForceMeasurement| m.profile.unwrap().radius_px.value;
    assert!((radius(&light) / radius(&dark) - 1.0).abs() < 2e-3);
}

/// In a wide contact, only every n-th row well inside the edge is used: the result remains that of
/// the profile.
#[test]
fn rows_left_out_of_a_wide_contact_do_not_move_the_fit() {
    let reference = Array2::from_elem((600, 620), 12_u8);
    for radius in [118.3, 190.7, 268.4] {
        let (x, y) = (309.7, 298.2);
        let frame = Array2::from_shape_fn((600, 620), |(row, column)| {
            let r2 = (column as f64 - x).powi(2) + (row as f64 - y).powi(2);
            12 + (200.0 * (1.0 - r2 / (radius * radius)).max(0.0).sqrt()).round() as u8
        });
        let m = measure_force(
            frame.view(),
            reference.view(),
            [1.0, 1.0],
            &calibration(),
            &Default::default(),
        )
        .unwrap();
        let (fit, found) = (m.profile.unwrap(), m.contact_radius_m.unwrap().value);
        // Rounding to grey levels and one sample per pixel at the edge cause errors of 10⁻⁴, as in
        // contacts for which all pixels are used.
        assert!((found / radius - 1.0).abs() < 2e-4, "{radius}: {found}");
        assert!(
            (fit.peak.value / 200.0 - 1.0).abs() < 2e-3,
            "{}",
            fit.peak.value
        );
        assert!((fit.centre_px[0].value - x).hypot(fit.centre_px[1].value - y) < 0.01);
    }
}
