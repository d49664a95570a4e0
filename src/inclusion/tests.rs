//! Ring means of discs with known profile and noise.
use super::rings::{RingError, ring_means};
use ndarray::Array2;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;

fn disc(centre: [f64; 2], value: impl Fn(f64) -> f64) -> Array2<f64> {
    Array2::from_shape_fn((140, 150), |(y, x)| {
        let r = (x as f64 - centre[0]).hypot(y as f64 - centre[1]) * 0.25e-3;
        if r < 15e-3 { value(r) } else { 0.0 }
    })
}

#[test]
fn a_profile_is_read_from_its_image() {
    let light = |r: f64| 100.0 + 40.0 * (-(r / 5e-3).powi(2)).exp();
    let image = disc([76.3, 70.8], light);
    let rings = ring_means(&image.view(), [0.25e-3; 2], 7.0, 15e-3).unwrap();
    // Pixels at the rim are inside or outside as a whole, which changes the centre by a hundredth
    // of a pixel over 11,000 pixels.
    assert!((rings.centre_px[0] - 76.3).abs() < 0.1 && (rings.centre_px[1] - 70.8).abs() < 0.1);
    for (r, p) in rings.radii_m.iter().zip(&rings.pressure_pa) {
        if *r < 0.9 * 15e-3 {
            let expected = 7.0 * light(*r);
            // A ring is as wide as a pixel, and the curvature within it is below a thousandth.
            assert!((p / expected - 1.0).abs() < 3e-3, "{r} {p} {expected}");
        }
    }
    assert!(rings.asymmetry < 2e-3);
}

#[test]
fn the_stated_error_is_the_scatter_of_the_means() {
    let clean = disc([74.0, 70.0], |_| 120.0);
    let truth = ring_means(&clean.view(), [0.25e-3; 2], 1.0, 15e-3).unwrap();
    let (mut squares, mut count) = (0.0, 0.0);
    for seed in 0..20 {
        let mut rng = rand::rngs::ChaCha8Rng::seed_from_u64(seed);
        let noisy = clean.mapv(|value| value + 2.0 * rng.sample::<f64, _>(StandardNormal));
        let rings = ring_means(&noisy.view(), [0.25e-3; 2], 1.0, 15e-3).unwrap();
        for k in 3..40 {
            let z = (rings.pressure_pa[k] - truth.pressure_pa[k]) / rings.standard_error_pa[k];
            squares += z * z;
            count += 1.0;
        }
    }
    // 740 values of variance one: the mean square is 1 ± 0.05.
    let ratio = squares / count;
    assert!((ratio - 1.0).abs() < 0.2, "{ratio}");
}

#[test]
fn a_steep_rim_is_no_noise() {
    // The pressure of a flat punch, singular at the rim, with noise of 1.9 grey levels.
    let clean = disc([74.0, 70.0], |r| {
        40.0 / (1.0 - (r / 15.05e-3).powi(2)).sqrt()
    });
    let mut rng = rand::rngs::ChaCha8Rng::seed_from_u64(1);
    let noisy = clean.mapv(|value| value + 1.9 * rng.sample::<f64, _>(StandardNormal));
    let rings = ring_means(&noisy.view(), [0.25e-3; 2], 1.0, 15e-3).unwrap();
    let area = |radius: f64| core::f64::consts::TAU * radius * 0.25e-3 / 0.25e-3f64.powi(2);
    let noise = rings.standard_error_pa[30] * area(rings.radii_m[30]).sqrt();
    // 5,000 differences determine the noise to 1 %. The number of pixels of a ring is within 5 % of
    // its area.
    assert!((noise / 1.9 - 1.0).abs() < 0.06, "{noise}");
}

#[test]
fn harmonics_are_those_of_the_pressure_and_not_of_its_noise() {
    // An amplitude of 2 % around each ring, on a profile that falls by a third, gives 2 % apart
    // from pixels cut by the edge of a ring. Noise of 1 % per pixel adds only its own scatter, 0.05
    // %.
    for (amplitude, tolerance) in [(0.02, 1e-3), (0.0, 2e-3)] {
        let mut image = disc([74.0, 70.0], |r| 100.0 - 2e3 * r);
        let mut rng = rand::rngs::ChaCha8Rng::seed_from_u64(3);
        for ((y, x), value) in image.indexed_iter_mut() {
            let angle = (y as f64 - 70.0).atan2(x as f64 - 74.0);
            let noise = rng.sample::<f64, _>(StandardNormal);
            *value = *value * (1.0 + amplitude * (2.0 * angle).cos()) + noise;
        }
        let rings = ring_means(&image.view(), [0.25e-3; 2], 1.0, 15e-3).unwrap();
        let found = rings.harmonics;
        assert!((found - amplitude).abs() < tolerance, "{found}");
    }
}

#[test]
fn dark_frames_and_cut_faces_are_refused() {
    let dark = Array2::zeros((50, 50));
    let found = ring_means(&dark.view(), [0.25e-3; 2], 1.0, 15e-3);
    assert_eq!(found, Err(RingError::NoContact));
    let cut = disc([30.0, 70.0], |_| 100.0);
    let found = ring_means(&cut.view(), [0.25e-3; 2], 1.0, 15e-3);
    assert!(matches!(found, Err(RingError::Cut { .. })), "{found:?}");
}
