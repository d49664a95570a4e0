//! The camera's noise has the moments it states, and is the same for the same seed.
use super::{relative, small};
use ndarray::Array2;
use tactile_simulate::{Camera, PressOptions, PressScene};

#[test]
fn noise_has_the_stated_mean_and_variance() {
    let camera = Camera {
        shape: [400, 500],
        ..Camera::default()
    };
    for grey in [0.3, 4.0, 15.0, 120.0, 200.0] {
        let light = Array2::from_elem((400, 500), grey);
        let image = camera.expose(light.view(), 7, 3);
        let n = image.len() as f64;
        let mean = image.iter().map(|&v| f64::from(v)).sum::<f64>() / n;
        let variance = image
            .iter()
            .map(|&v| (f64::from(v) - mean).powi(2))
            .sum::<f64>()
            / (n - 1.0);
        // Rounding adds 1/12 where the noise spans a level or more; below that, and where noise is
        // clipped at black, the moments are those of the rounded law, so only the brighter fields
        // are checked.
        if grey < 4.0 {
            continue;
        }
        let photons = grey * 255.0 / camera.full_well_electrons;
        let expected = photons + camera.read_noise_grey.powi(2) + 1.0 / 12.0;
        // Five standard errors: a false alarm in 10⁶.
        assert!(
            (mean - grey).abs() < 5.0 * (expected / n).sqrt() + 0.02,
            "mean {mean} of {grey}"
        );
        assert!(
            relative(variance, expected) < 5.0 * (2.0 / n).sqrt() + 0.02,
            "variance {variance} {expected}"
        );
    }
}

#[test]
fn faint_light_is_poisson() {
    // 20 electrons a grey level and no read noise: at 2 grey levels the count is Poisson of mean
    // 40.
    let camera = Camera {
        shape: [400, 500],
        full_well_electrons: 5100.0,
        read_noise_grey: 0.0,
        ..Camera::default()
    };
    let image = camera.expose(Array2::from_elem((400, 500), 2.0).view(), 1, 1);
    let zero = image.iter().filter(|&&v| v == 0).count() as f64 / image.len() as f64;
    // Grey 0 is fewer than 10 electrons: P(X ≤ 9 | 40) = 9.2e-9; grey ≤ 1 is fewer than 30: 0.0374…
    // by summation.
    let at_most = |k: u32| {
        let mut term = (-40.0_f64).exp();
        let mut sum = term;
        for i in 1..=k {
            term *= 40.0 / f64::from(i);
            sum += term;
        }
        sum
    };
    let dim = image.iter().filter(|&&v| v <= 1).count() as f64 / image.len() as f64;
    let expected = at_most(29);
    let error = (expected * (1.0 - expected) / image.len() as f64).sqrt();
    assert!(zero < 1e-4);
    assert!((dim - expected).abs() < 5.0 * error, "{dim} {expected}");
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
