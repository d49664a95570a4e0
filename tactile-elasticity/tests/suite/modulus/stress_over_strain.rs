//! The ratio of the paper and the regression; invalid input of all estimators.

use super::*;

fn strained(stress: f64, strain: f64) -> LoadState {
    LoadState::new(exact(stress * 1e-4))
        .with_area(exact(1e-4))
        .with_strain(exact(strain))
}

#[test]
fn stress_over_strain() {
    let line = [0.01, 0.03, 0.05].map(|e| strained(SAMPLE * e, e));
    finds(&PaperRatio::default(), &line);
    finds(&StressStrainRegression, &line);
    // An offset biases the ratio, but not the slope, and is detected.
    let wobble = [3.0, -3.0, -3.0, 3.0];
    let offset: Vec<_> = [0.01, 0.02, 0.03, 0.04]
        .iter()
        .zip(wobble)
        .map(|(&e, w)| strained(300.0 + SAMPLE * e + w, e))
        .collect();
    let slope = StressStrainRegression
        .estimate(&LoadSeries::new(offset.as_slice()))
        .unwrap();
    assert!((slope.youngs_modulus_pa / SAMPLE - 1.0).abs() < 1e-9);
    assert!(
        slope
            .warnings
            .iter()
            .any(|w| matches!(w, Warning::Intercept { .. }))
    );
    assert!(
        PaperRatio::default()
            .estimate(&LoadSeries::new(offset.as_slice()))
            .unwrap()
            .youngs_modulus_pa
            > 1.2 * SAMPLE
    );
}

#[test]
fn strain_counted_from_the_first_load() {
    let (first, second) = (
        strained(1000.0, 0.0),
        strained(1000.0 + SAMPLE * 0.02, 0.02),
    );
    let ratio = PaperRatio::default().with_reference(StrainReference::FirstLoad);
    finds(&ratio, &[first, second]);
    let refused = |loads: &[LoadState]| ratio.estimate(&LoadSeries::new(loads)).unwrap_err();
    let (expected, found) = (2, 1);
    assert_eq!(
        refused(&[second]),
        ElasticityError::TooFewLoads { expected, found }
    );
    assert_eq!(refused(&[second; 2]), ElasticityError::EqualLoads);
}

fn refuses(estimator: &dyn ModulusEstimator, loads: &[LoadState], message: &str) {
    let error = estimator.estimate(&LoadSeries::new(loads)).unwrap_err();
    assert!(error.to_string().starts_with(message), "{error}");
}

#[test]
fn bad_input_is_named() {
    let with_radius =
        |force: f64, radius: f64| LoadState::new(exact(force)).with_radius(exact(radius));
    let with_area = |area: f64| strained(100.0, 0.1).with_area(exact(area));
    let bare = LoadState::new(exact(1.0)).with_strain(exact(0.1));
    let ratio = PaperRatio::default();
    let line = StressStrainRegression;
    let sphere = HertzSphere::new(4e-3, NU).unwrap();
    refuses(&ratio, &[strained(100.0, 0.0)], "the strain is zero");
    let opposite = "stress (100 Pa) and strain (-0.1)";
    refuses(&ratio, &[strained(100.0, -0.1)], opposite);
    refuses(&ratio, &[with_area(0.0)], "contact area must be");
    refuses(&ratio, &[with_area(-1e-6)], "contact area must be");
    refuses(&ratio, &[strained(f64::NAN, 0.1)], "force is not a");
    refuses(&ratio, &[strained(100.0, f64::NAN)], "strain is not a");
    refuses(&ratio, &[LoadState::new(exact(1.0))], "0 usable loads");
    refuses(&ratio, &[bare], "load 0 has no contact area");
    refuses(&line, &[strained(10.0, 0.1); 3], "all loads are equal");
    refuses(&line, &[strained(10.0, 0.1)], "1 usable loads, at least 3");
    refuses(&sphere, &[], "0 usable loads, at least 1");
    refuses(&sphere, &[with_radius(-1.0, 1e-3)], "force must be");
    refuses(&sphere, &[with_radius(1.0, 0.0)], "contact radius must");
    for nu in [-1.0, 0.500001, f64::NAN, 7.0] {
        let refused = HertzSphere::new(1e-3, nu);
        assert!(matches!(refused, Err(ElasticityError::PoissonRatio { .. })));
    }
    for radius in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let error = HertzSphere::new(radius, 0.3).unwrap_err();
        assert!(error.to_string().starts_with("radius must be greater"));
    }
    let ball = || Bodies::new(Object::sphere(3e-3), None);
    for error in [-0.1, f64::NAN, f64::INFINITY] {
        let factor = Uncertain::exact(1.0).by(Source::Guide, error);
        for refused in [
            ball().with_size_error(error),
            ball().with_poisson_ratio_error(error),
            ball().with_adhesion_j_per_m2(error),
        ] {
            assert!(matches!(refused, Err(ElasticityError::Negative { .. })));
        }
        let unknown = error.is_nan() || error.is_infinite();
        assert_eq!(ball().with_guide_error(factor).is_err(), unknown);
        let noisy = LoadState::new(Estimate::new(1.0, error)).with_radius(exact(1e-3));
        refuses(&sphere, &[noisy], "standard error");
    }
}
