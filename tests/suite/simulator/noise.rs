//! The noise of the camera has the stated moments, and equal seeds give equal noise.
use super::{relative, small};
use ndarray::Array2;
use tactile_simulate::{Camera, PressOptions, PressScene};

const SHAPE: [usize; 2] = [400, 500];

#[test]
fn noise_has_the_stated_mean_and_variance() {
    let camera = Camera {
        shape: SHAPE,
        ..Camera::default()
    };
    // Rounding adds 1/12 if the noise is at least one level, as in these fields.
    for grey in [4.0, 15.0, 120.0, 200.0] {
        let image = camera.expose(Array2::from_elem(SHAPE, grey).view(), 7, 3);
        let image = image.mapv(f64::from);
        let (n, mean, variance) = (image.len() as f64, image.mean().unwrap(), image.var(1.0));
        let photons = grey * 255.0 / camera.full_well_electrons;
        let expected = photons + camera.read_noise_grey.powi(2) + 1.0 / 12.0;
        // Five standard errors: a probability of 10⁻⁶ of a false alarm.
        let off = 5.0 * (expected / n).sqrt() + 0.02;
        assert!((mean - grey).abs() < off, "mean {mean} of {grey}");
        let off = 5.0 * (2.0 / n).sqrt() + 0.02;
        assert!(
            relative(variance, expected) < off,
            "variance {variance} {expected}"
        );
    }
}

#[test]
fn faint_light_is_poisson() {
    // 20 electrons per grey level and no read noise: at 2 grey levels the count has a Poisson
    // distribution of mean 40.
    let camera = Camera {
        shape: SHAPE,
        full_well_electrons: 5100.0,
        read_noise_grey: 0.0,
        ..Camera::default()
    };
    let image = camera.expose(Array2::from_elem(SHAPE, 2.0).view(), 1, 1);
    let n = image.len() as f64;
    let share = |most: u8| image.iter().filter(|&&v| v <= most).count() as f64 / n;
    // Grey 0 means fewer than 10 electrons: P(X ≤ 9 | 40) = 9.2e-9. Grey ≤ 1 means fewer than 30:
    // 0.0374…, by summation.
    let (mut term, mut expected) = ((-40.0_f64).exp(), 0.0);
    for i in 1..=30 {
        expected += term;
        term *= 40.0 / f64::from(i);
    }
    let error = (expected * (1.0 - expected) / n).sqrt();
    assert!(share(0) < 1e-4);
    assert!(
        (share(1) - expected).abs() < 5.0 * error,
        "{} {expected}",
        share(1)
    );
}

#[test]
fn the_same_seed_gives_the_same_bits_in_any_order_and_another_seed_others() {
    let scene = PressScene::new(small()).unwrap();
    let made = scene.simulate();
    assert_eq!(scene.frame(1, 0), made.frames[1]);
    assert_eq!(scene.frame(0, 0), made.frames[0]);
    assert_eq!(scene.reference(0), made.reference);
    assert_ne!(scene.reference(1), made.reference);
    let other = PressScene::new(PressOptions { seed: 2, ..small() }).unwrap();
    assert_ne!(other.reference(0), made.reference);
}
