//! The paper's ratio and the regression; bad input of all estimators.

use super::*;
use tactile_elasticity::strain::GreenLagrange;

fn strained(stress: f64, strain: f64) -> LoadState {
    LoadState {
        contact_area_m2: Some(exact(1e-4)),
        mean_strain: Some(exact(strain)),
        ..LoadState::new(exact(stress * 1e-4))
    }
}

#[test]
fn stress_over_strain() {
    let line = [0.01, 0.03, 0.05].map(|e| strained(SAMPLE * e, e));
    finds(&PaperRatio::default(), &line);
    finds(&StressStrainRegression::default(), &line);
    finds(
        &StressStrainRegression::default().with_zero_at_origin(),
        &line,
    );
    // An offset biases the ratio, not the slope, and is found.
    let wobble = [3.0, -3.0, -3.0, 3.0];
    let offset: Vec<_> = [0.01, 0.02, 0.03, 0.04]
        .iter()
        .zip(wobble)
        .map(|(&e, w)| strained(300.0 + SAMPLE * e + w, e))
        .collect();
    let slope = StressStrainRegression::default()
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
    assert_eq!(
        ratio.estimate(&LoadSeries::new([second])).unwrap_err(),
        ElasticityError::TooFewLoads {
            expected: 2,
            found: 1
        }
    );
    assert_eq!(
        ratio
            .estimate(&LoadSeries::new([second, second]))
            .unwrap_err(),
        ElasticityError::EqualLoads
    );
}

#[test]
fn bad_input_is_named() {
    use ElasticityError as E;
    let ratio = PaperRatio::default();
    let fail = |load: LoadState| ratio.estimate(&LoadSeries::new([load])).unwrap_err();
    assert_eq!(fail(strained(100.0, 0.0)), E::ZeroStrain);
    assert_eq!(
        fail(strained(100.0, -0.1)),
        E::OppositeSigns {
            stress_pa: 100.0,
            strain: -0.1
        }
    );
    for area in [0.0, -1e-6] {
        let load = LoadState {
            contact_area_m2: Some(exact(area)),
            ..strained(100.0, 0.1)
        };
        assert_eq!(
            fail(load),
            E::NotPositive {
                quantity: Quantity::ContactArea,
                found: area
            }
        );
    }
    assert_eq!(
        fail(strained(f64::NAN, 0.1)),
        E::NotFinite {
            quantity: Quantity::Force
        }
    );
    assert_eq!(
        fail(strained(100.0, f64::NAN)),
        E::NotFinite {
            quantity: Quantity::Strain
        }
    );
    assert_eq!(
        fail(LoadState::new(exact(1.0))),
        E::TooFewLoads {
            expected: 1,
            found: 0
        }
    );
    let bare = LoadState {
        mean_strain: Some(exact(0.1)),
        ..LoadState::new(exact(1.0))
    };
    assert_eq!(
        fail(bare),
        E::Missing {
            load: 0,
            quantity: Quantity::ContactArea
        }
    );
    let line = StressStrainRegression::default();
    assert_eq!(
        line.estimate(&LoadSeries::new([strained(10.0, 0.1); 3]))
            .unwrap_err(),
        E::EqualLoads
    );
    assert_eq!(
        line.estimate(&LoadSeries::new([strained(10.0, 0.1)]))
            .unwrap_err(),
        E::TooFewLoads {
            expected: 3,
            found: 1
        }
    );
    for nu in [-1.0, 0.500001, f64::NAN, 7.0] {
        assert!(
            matches!(HertzSphere::new(1e-3, nu), Err(E::PoissonRatio { .. })),
            "{nu}"
        );
    }
    for radius in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(
            HertzSphere::new(radius, 0.3),
            Err(E::NotPositive {
                quantity: Quantity::Radius,
                ..
            })
        ));
    }
    let sphere = HertzSphere::new(4e-3, NU).unwrap();
    let empty: [LoadState; 0] = [];
    assert_eq!(
        sphere.estimate(&LoadSeries::new(empty)).unwrap_err(),
        E::TooFewLoads {
            expected: 1,
            found: 0
        }
    );
    let pulled = LoadState {
        contact_radius_m: Some(exact(1e-3)),
        ..LoadState::new(exact(-1.0))
    };
    assert!(matches!(
        sphere.estimate(&LoadSeries::new([pulled])),
        Err(E::NotPositive {
            quantity: Quantity::Force,
            ..
        })
    ));
    let flat = LoadState {
        contact_radius_m: Some(exact(0.0)),
        ..LoadState::new(exact(1.0))
    };
    assert!(matches!(
        sphere.estimate(&LoadSeries::new([flat])),
        Err(E::NotPositive {
            quantity: Quantity::ContactRadius,
            ..
        })
    ));
    for wrong in [-0.1, f64::NAN, f64::INFINITY] {
        let none = SharedErrors::default();
        let one_wrong = [
            SharedErrors {
                force_scale: wrong,
                ..none
            },
            SharedErrors {
                length_scale: wrong,
                ..none
            },
            SharedErrors {
                size: wrong,
                ..none
            },
            SharedErrors {
                poisson_ratio: wrong,
                ..none
            },
            SharedErrors {
                other_body: wrong,
                ..none
            },
        ];
        for shared in one_wrong {
            let refused = LoadSeries::new([flat]).with_shared_errors(shared);
            assert!(matches!(refused, Err(E::Negative { .. })));
        }
    }
}

/// A face of 1 cm² of ν = ½, squeezed by e: λ_z = √(1 − 2e), A = A₀ (1 + e), F = E e λ_z A₀.
#[test]
fn growing_faces_give_their_stretches_and_the_area_without_load() {
    let load = |e: f64| LoadState {
        contact_area_m2: Some(Estimate::new(1e-4 * (1.0 + e), 1e-9)),
        ..LoadState::new(Estimate::new(
            100e3 * e * (1.0 - 2.0 * e).sqrt() * 1e-4,
            1e-4,
        ))
    };
    let squeezes = [0.02, 0.05, 0.1];
    let series = LoadSeries::new(squeezes.map(load));
    let found = UniaxialLoads::new(&series, 0.5, &GreenLagrange).unwrap();
    // Steps to the area end where it moves by 1e-14; the bisection for a stretch is exact to
    // rounding.
    assert!((found.unloaded_area_m2 / 1e-4 - 1.0).abs() < 1e-9);
    for ([lateral, axial], e) in found.stretches.iter().zip(squeezes) {
        assert!((lateral - (1.0 + e).sqrt()).abs() < 1e-9, "{lateral}");
        assert!((axial - (1.0 - 2.0 * e).sqrt()).abs() < 1e-9, "{axial}");
    }
}
