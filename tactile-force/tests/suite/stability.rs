//! What the numbers must survive: pedestals, equal pixels, cancellation, other units, other precision.

use ndarray::{Array2, array};
use proptest::prelude::*;
use tactile_force::{
    CalibrationPair, ContactOptions, ForceMeasurement, ForceOptions, GaussianProfile, HertzProfile,
    ImageMoments, LinearCalibration, PixelGrid, Polarity, measure_force,
};

#[test]
fn a_pedestal_of_a_billion_costs_no_digit_that_the_pixels_have() {
    let blob = GaussianProfile::new([13.3_f64, 17.7], 4.0, 1.0).unwrap();
    let grid = PixelGrid {
        rows: 32,
        columns: 32,
        size: [1.0; 2],
        first: [0.0; 2],
    };
    // Rounded to what 1e9 + x can hold, so that subtracting the pedestal is exact.
    let raised = blob.image(&grid).mapv(|v| v + 1e9);
    let plain = raised.mapv(|v| v - 1e9);
    let (a, b) = (
        ImageMoments::of(raised.view(), 1e9).unwrap(),
        ImageMoments::of(plain.view(), 0.0).unwrap(),
    );
    assert_eq!(
        (a.sum, a.centroid_px, a.radius_of_gyration_px),
        (b.sum, b.centroid_px, b.radius_of_gyration_px)
    );
    // The variance comes from pixels about the first one in twice the digits.
    assert!((a.variance / b.variance - 1.0).abs() < 4.0 * f64::EPSILON);
}

#[test]
fn equal_pixels_have_no_variance_at_all() {
    for value in [0.1, 1e300, 1e-300, -7.7e9] {
        for size in [(1, 1), (3, 7), (16, 16)] {
            let m = ImageMoments::of(Array2::from_elem(size, value).view(), value).unwrap();
            assert_eq!(
                (m.variance, m.mean, m.sum, m.centroid_px),
                (0.0, value, 0.0, None)
            );
        }
    }
}

#[test]
fn a_negative_second_moment_has_no_radius() {
    let m = ImageMoments::of(array![[-1.0, 4.0, -1.0]].view(), 0.0).unwrap();
    assert_eq!(
        (m.centroid_px, m.radius_of_gyration_px),
        (Some([1.0, 0.0]), None)
    );
}

#[test]
fn order_does_not_matter_where_everything_cancels() {
    let mut image = Array2::from_shape_fn(
        (16, 16),
        |(y, x)| if (x + y) % 2 == 0 { -1e16 } else { 1e16 },
    );
    image[[3, 4]] += 2.0;
    image[[9, 12]] += 2.0;
    let m = ImageMoments::of(image.view(), 0.0).unwrap();
    assert_eq!((m.sum, m.centroid_px), (4.0, Some([8.0, 6.0])));
    let turned = ImageMoments::of(image.t(), 0.0).unwrap();
    assert_eq!((turned.sum, turned.centroid_px), (4.0, Some([6.0, 8.0])));
}

fn pressed<const DARK: bool>(flip: bool) -> ForceMeasurement<f64> {
    let grid = PixelGrid {
        rows: 150,
        columns: 170,
        size: [1.0; 2],
        first: [0.0; 2],
    };
    let light = HertzProfile::new([80.2, 70.9], 33.4, 120.0)
        .unwrap()
        .image(&grid);
    let noise =
        |y: usize, x: usize, k: usize| ((y * 7919 + x * 104_729 + k * 31) % 13) as f64 / 4.0 - 1.5;
    let sign = if DARK { -1.0 } else { 1.0 };
    let image = |k: usize, scale: f64| {
        let image = Array2::from_shape_fn((150, 170), |(y, x)| {
            (128.0 + sign * (noise(y, x, k) + scale * light[[y, x]])).round() as u8
        });
        if flip { image.t().to_owned() } else { image }
    };
    let pairs: Vec<_> = (0..5)
        .map(|k| 1e5 * f64::from(k))
        .map(|v| CalibrationPair::loading(v, 1e-6 * v))
        .collect();
    let calibration = LinearCalibration::fit(&pairs, &Default::default()).unwrap();
    let polarity = if DARK {
        Polarity::Darker
    } else {
        Polarity::Brighter
    };
    let contact = ContactOptions::default().with_polarity(polarity);
    let options = ForceOptions::default().with_contact(contact);
    measure_force(
        image(1, 1.0).view(),
        image(0, 0.0).view(),
        [2e-5; 2],
        &calibration,
        &options,
    )
    .unwrap()
}

#[test]
fn x_and_y_are_treated_alike() {
    let (a, b) = (pressed::<false>(false), pressed::<false>(true));
    let ([ax, ay], [bx, by]) = (a.profile.unwrap().centre_px, b.profile.unwrap().centre_px);
    // Sums run in another order: rounding.
    assert!((ax.value - by.value).abs() < 1e-9 && (ay.value - bx.value).abs() < 1e-9);
    assert_eq!(a.contact.unwrap().area_px, b.contact.unwrap().area_px);
    assert!((a.force_n.value - b.force_n.value).abs() < 1e-15);
}

#[test]
fn darkness_measures_as_light_does() {
    let (light, dark) = (pressed::<false>(false), pressed::<true>(false));
    // Halves round away from zero, up in one image and down in the other: up to half a level in one of 4 pixels.
    assert!((light.force_n.value / dark.force_n.value - 1.0).abs() < 5e-3);
    let radius = |m: &ForceMeasurement<f64>| m.profile.unwrap().radius_px.value;
    assert!((radius(&light) / radius(&dark) - 1.0).abs() < 2e-3);
}

#[test]
fn single_precision_is_double_precision_rounded_once() {
    let wide = HertzProfile::new([7.25_f64, 8.5], 5.5, 100.0).unwrap();
    let narrow = HertzProfile::new([7.25_f32, 8.5], 5.5, 100.0).unwrap();
    let (a, b) = (wide.whole(), narrow.whole());
    assert_eq!(
        (a.integral as f32, a.radius_of_gyration as f32),
        (b.integral, b.radius_of_gyration)
    );
    let part = wide.within([[0.0, 6.0], [2.0, 9.5]]).unwrap();
    let same = narrow.within([[0.0, 6.0], [2.0, 9.5]]).unwrap();
    assert_eq!(
        (part.integral as f32, part.centroid.map(|c| c as f32)),
        (same.integral, same.centroid)
    );
}

proptest! {
    #[test]
    fn blobs_scale_with_their_unit(power in -40_i32..40, a in 0.05_f64..20.0, cx in -3.0_f64..12.0, cy in -3.0_f64..12.0) {
        // Powers of two change no digit.
        let unit = 2.0_f64.powi(power);
        let grid = |u: f64| PixelGrid { rows: 9, columns: 9, size: [u; 2], first: [0.0; 2] };
        let image = HertzProfile::new([cx, cy], a, 3.0).unwrap().image(&grid(1.0));
        let scaled = HertzProfile::new([cx * unit, cy * unit], a * unit, 3.0).unwrap().image(&grid(unit));
        prop_assert_eq!(image, scaled);
    }

    #[test]
    fn pixels_of_a_blob_add_up_to_its_part(a in 0.05_f64..20.0, cx in -5.0_f64..14.0, cy in -5.0_f64..14.0) {
        let blob = HertzProfile::new([cx, cy], a, 1.0).unwrap();
        let grid = PixelGrid { rows: 9, columns: 9, size: [1.0; 2], first: [0.5; 2] };
        let sum = blob.image(&grid).sum();
        let part = blob.within([[0.0, 9.0], [0.0, 9.0]]);
        // 81 pixels of rounding, and the edge's position: an ulp of 14 where the profile has depth d costs 14/d ulps.
        let whole = part.map_or(0.0, |p| p.integral);
        prop_assert!((sum - whole).abs() <= 1e-13 * (whole + sum) + 1e-15, "{sum} {whole}");
    }

    #[test]
    fn a_gaussian_is_known_to_its_last_tail(c in -60.0_f64..60.0, sd in 0.5_f64..5.0) {
        // ∫ over two halves is the integral over both, however small.
        let blob = GaussianProfile::new([c, 0.0], sd, 1.0).unwrap();
        let part = |x: [f64; 2]| blob.within([x, [-9.0, 9.0]]).map_or(0.0, |p| p.integral);
        let (whole, halves) = (part([0.0, 8.0]), part([0.0, 3.0]) + part([3.0, 8.0]));
        prop_assert!((whole - halves).abs() <= 1e-12 * whole + f64::MIN_POSITIVE, "{whole:e} {halves:e}");
    }
}

/// Of a wide contact only every so many rows are looked at well inside the edge: the answer stays that of the profile.
#[test]
fn rows_left_out_of_a_wide_contact_do_not_move_the_fit() {
    let pairs: Vec<_> = (0..5)
        .map(|k| 1e6 * f64::from(k))
        .map(|v| CalibrationPair::loading(v, v))
        .collect();
    let calibration = LinearCalibration::fit(&pairs, &Default::default()).unwrap();
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
            &calibration,
            &Default::default(),
        )
        .unwrap();
        let (fit, found) = (m.profile.unwrap(), m.contact_radius_m.unwrap().value);
        // Rounding to grey levels and one sample a pixel at the edge leave 10⁻⁴, as for contacts whose pixels all count.
        assert!((found / radius - 1.0).abs() < 2e-4, "{radius}: {found}");
        assert!(
            (fit.peak.value / 200.0 - 1.0).abs() < 2e-3,
            "{}",
            fit.peak.value
        );
        assert!((fit.centre_px[0].value - x).hypot(fit.centre_px[1].value - y) < 0.01);
    }
}
