//! Every estimator finds what its own law was fed, says how well, and refuses what it cannot use.

use nalgebra::DMatrix;
use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};
use rand_distr::StandardNormal;
use tactile_elasticity::contact::{
    Body, Bond, HertzContact, Layer, LayerEquation, LayerKernel, Waveguide, cone, flat_punch,
    reduced_modulus_pa, tatara_indentation_m,
};
use tactile_elasticity::modulus::*;
use tactile_elasticity::{ElasticityError, Quantity};

const SAMPLE: f64 = 60e3;
const NU: f64 = 0.48;

fn exact(x: f64) -> Estimate<f64> {
    Estimate::exact(x)
}

fn waveguide() -> Waveguide<f64> {
    let layer = |thickness_m, youngs_modulus_pa| Layer { thickness_m, youngs_modulus_pa, poisson_ratio: 0.5 };
    Waveguide::new(vec![layer(2e-3, 1.36e5), layer(3e-3, 8.0e4), layer(5e-3, 3.4e4)]).unwrap()
}

fn reduced() -> f64 {
    reduced_modulus_pa(Body::rigid(), Body::elastic(SAMPLE, NU).unwrap()).unwrap()
}

/// Hertz loads of a 4 mm sphere of the sample on `other`.
fn hertz_loads(other: Body<f64>, forces: &[f64]) -> Vec<LoadState<f64>> {
    let e = reduced_modulus_pa(other, Body::elastic(SAMPLE, NU).unwrap()).unwrap();
    (forces.iter())
        .map(|&f| {
            let c = HertzContact::from_force(f, 4e-3, e).unwrap();
            LoadState::new(exact(f))
                .with_contact_radius(exact(c.contact_radius_m))
                .with_indentation(exact(c.indentation_m))
        })
        .collect()
}

/// The same, with the indentation that of both contacts: the waveguide's and a rigid plate's. Relative error as stated.
fn between_plates(forces: &[f64], relative: f64) -> Vec<LoadState<f64>> {
    let far = hertz_loads(Body::rigid(), forces);
    (hertz_loads(waveguide().as_body(), forces).into_iter().zip(far))
        .map(|(near, far)| {
            let indentation = near.indentation_m.unwrap().value + far.indentation_m.unwrap().value;
            let a = near.contact_radius_m.unwrap().value;
            LoadState::new(Estimate::new(near.force_n.value, relative * near.force_n.value))
                .with_contact_radius(Estimate::new(a, relative * a))
                .with_indentation(Estimate::new(indentation, relative * indentation))
        })
        .collect()
}

fn finds(estimator: &dyn ModulusEstimator<f64>, loads: &[LoadState<f64>]) {
    let found = estimator.estimate(loads).unwrap();
    let gap = (found.youngs_modulus_pa / SAMPLE - 1.0).abs();
    assert!(gap < 1e-9, "{}: off by {gap:e}", found.estimator);
}

#[test]
fn every_law_inverts_itself() {
    let forces = [1e-3, 2e-3, 5e-3];
    finds(&HertzSphere::new(4e-3, NU).unwrap(), &hertz_loads(Body::rigid(), &forces));
    let on_waveguide = HertzSphere::new(4e-3, NU).unwrap().with_waveguide(&waveguide());
    finds(&on_waveguide, &hertz_loads(waveguide().as_body(), &forces));
    let punch = |d: f64| {
        LoadState::new(exact(flat_punch(reduced(), 2e-3, d).unwrap().force_n)).with_indentation(exact(d))
    };
    finds(&FlatPunch::new(2e-3, NU).unwrap(), &[punch(1e-5), punch(3e-5)]);
    let angle = 1.2f64;
    let cone = |d: f64| {
        let c = cone(reduced(), angle.tan(), d).unwrap();
        LoadState::new(exact(c.force_n))
            .with_indentation(exact(d))
            .with_contact_radius(exact(c.contact_radius_m))
    };
    finds(&Cone::new(angle, NU).unwrap(), &[cone(1e-5), cone(3e-5)]);
    let squeezed = |a: f64| {
        let d = tatara_indentation_m(a, 3e-3, NU).unwrap();
        LoadState::new(exact(4.0 / 3.0 * reduced() * a.powi(3) / 3e-3)).with_indentation(exact(d))
    };
    finds(&TataraSphere::new(3e-3, NU).unwrap(), &[squeezed(3e-4), squeezed(1.6e-3)]);
    finds(
        &SphereBetweenPlates::new(4e-3, NU).unwrap().with_waveguide(&waveguide()),
        &between_plates(&forces, 0.0),
    );
}

#[test]
fn layers_invert_themselves_thick_or_thin() {
    let (r, h) = (5e-3, 2e-3);
    let layer = LayerEquation::new(&LayerKernel::new(Bond::Bonded, NU).unwrap());
    let load = |a_over_h: f64| {
        let c = layer.solve(a_over_h).unwrap();
        let (a, d) = (a_over_h * h, (c.chi * h).powi(2) / r);
        let force = 4.0 / 3.0 * reduced() * r.sqrt() * d.powf(1.5) * c.force_ratio;
        LoadState::new(exact(force)).with_contact_radius(exact(a)).with_indentation(exact(d))
    };
    let loads = [load(0.05), load(0.4), load(1.3)];
    let theory = |t| BondedLayer::new(r, h, NU, Bond::Bonded, t).unwrap();
    finds(&theory(LayerTheory::IntegralEquation), &loads);
    // The published series errs as its authors' readers found; the corrected one only where χ is large.
    let off = |t, i: usize| {
        ModulusEstimator::<f64>::estimate(&theory(t), &loads[i..=i]).unwrap().youngs_modulus_pa / SAMPLE - 1.0
    };
    assert!(off(LayerTheory::CorrectedSeries, 0).abs() < 1e-5);
    assert!(off(LayerTheory::CorrectedSeries, 1).abs() < 5e-3);
    assert!(off(LayerTheory::PublishedSeries, 1) > 0.03);
    let thin = ModulusEstimator::<f64>::estimate(&theory(LayerTheory::PublishedSeries), &loads).unwrap();
    assert!(thin.warnings.iter().any(|w| matches!(w, Warning::ThinLayer { load: 2, .. })));
}

#[test]
fn a_sphere_on_a_shallow_waveguide_inverts_itself() {
    let (r, guide) = (4e-3, waveguide());
    let total = Body::elastic(SAMPLE, NU).unwrap().compliance_per_pa() + guide.compliance_per_pa();
    let share = guide.compliance_per_pa() / total;
    let kernel = LayerKernel::new(Bond::Bonded, 0.5).unwrap();
    let layer = LayerEquation::new(&kernel).with_share(share);
    let loads = [0.02, 0.1, 0.25].map(|a_over_h| {
        let (c, a) = (layer.solve(a_over_h).unwrap(), a_over_h * guide.thickness_m());
        let force = 4.0 / 3.0 / total * a.powi(3) / r * c.force_ratio_same_radius;
        LoadState::new(exact(force))
            .with_contact_radius(exact(a))
            .with_indentation(exact(a * a / r * c.indentation_ratio))
    });
    finds(&SphereOnWaveguide::new(r, NU, &guide, Bond::Bonded).unwrap(), &loads);
    // Taken as deep, the waveguide spoils the indentation far more than the contact radius.
    let deep = |evidence| {
        let estimator = HertzSphere::new(r, NU).unwrap().with_waveguide(&guide).with_evidence(evidence);
        estimator.estimate(&loads[1..2]).unwrap().youngs_modulus_pa / SAMPLE - 1.0
    };
    assert!(deep(Evidence::ContactRadius).abs() < 0.01 && deep(Evidence::Indentation) > 0.1);
}

#[test]
fn far_stiffer_samples_are_bounded_from_below_only() {
    // A sample of 5 MPa through a waveguide of 50 kPa: 1 % of noise in a leaves no upper limit.
    let guide = waveguide();
    let e = reduced_modulus_pa(guide.as_body(), Body::elastic(5e6, NU).unwrap()).unwrap();
    let load = |f: f64, error: f64| {
        let a = HertzContact::from_force(f, 4e-3, e).unwrap().contact_radius_m * (1.0 + error);
        LoadState::new(exact(f)).with_contact_radius(Estimate::new(a, 0.01 * a))
    };
    let estimator = HertzSphere::new(4e-3, NU).unwrap().with_waveguide(&guide);
    let found = estimator.estimate(&[load(0.01, 0.0)]).unwrap();
    assert!(found.interval_95.upper.is_none() && found.interval_95.lower > 200e3);
    assert!(found.warnings.contains(&Warning::UnboundedAbove));
    let refused = estimator.estimate(&[load(0.01, -0.01)]);
    assert!(
        matches!(refused, Err(ElasticityError::StifferThanResolvable { lower_bound_pa }) if lower_bound_pa > 200e3)
    );
}

/// 2000 noisy experiments: 95 % ± four standard deviations of the count (0.5 %).
#[test]
fn intervals_cover_what_they_promise() {
    let estimator = HertzSphere::new(4e-3, NU)
        .unwrap()
        .with_waveguide(&waveguide())
        .with_force_scale_error(0.01)
        .unwrap();
    let clean = hertz_loads(waveguide().as_body(), &[2e-3, 4e-3, 6e-3, 8e-3]);
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let mut covered = 0;
    for _ in 0..2000 {
        let mut normal = || rng.sample::<f64, _>(StandardNormal);
        let scale = 1.0 + 0.01 * normal();
        let loads: Vec<_> = (clean.iter())
            .map(|l| {
                let (f, a) = (l.force_n.value, l.contact_radius_m.unwrap().value);
                LoadState::new(Estimate::new(f * scale * (1.0 + 0.005 * normal()), 0.005 * f))
                    .with_contact_radius(Estimate::new(a * (1.0 + 0.004 * normal()), 0.004 * a))
            })
            .collect();
        covered += usize::from(estimator.estimate(&loads).unwrap().interval_95.contains(SAMPLE));
    }
    assert!((1860..=1940).contains(&covered), "{covered} of 2000");
}

#[test]
fn a_force_covariance_says_the_same_as_a_shared_scale() {
    let loads = hertz_loads(Body::rigid(), &[1e-3, 3e-3]);
    let f = [1e-3, 3e-3];
    let covariance = DMatrix::from_fn(2, 2, |i, j| 1e-4 * f[i] * f[j]);
    let plain = HertzSphere::new(4e-3, NU).unwrap().with_evidence(Evidence::ContactRadius);
    let one = plain.clone().with_force_covariance(&covariance).unwrap().estimate(&loads).unwrap();
    let other = plain.with_force_scale_error(0.01).unwrap().estimate(&loads).unwrap();
    assert!((one.standard_error_pa / other.standard_error_pa - 1.0).abs() < 1e-6);
    assert!((one.standard_error_pa / SAMPLE - 0.01).abs() < 1e-6);
}

fn strained(stress: f64, strain: f64) -> LoadState<f64> {
    LoadState::new(exact(stress * 1e-4)).with_contact_area(exact(1e-4)).with_mean_strain(exact(strain))
}

#[test]
fn stress_over_strain() {
    let line = [0.01, 0.03, 0.05].map(|e| strained(SAMPLE * e, e));
    finds(&PaperRatio::new(), &line);
    finds(&StressStrainRegression::new(), &line);
    finds(&StressStrainRegression::new().with_intercept(Intercept::Zero), &line);
    // An offset biases the ratio, not the slope, and is found.
    let wobble = [3.0, -3.0, -3.0, 3.0];
    let offset: Vec<_> = [0.01, 0.02, 0.03, 0.04]
        .iter()
        .zip(wobble)
        .map(|(&e, w)| strained(300.0 + SAMPLE * e + w, e))
        .collect();
    let slope = StressStrainRegression::new().estimate(&offset).unwrap();
    assert!((slope.youngs_modulus_pa / SAMPLE - 1.0).abs() < 1e-9);
    assert!(slope.warnings.iter().any(|w| matches!(w, Warning::Intercept { .. })));
    assert!(PaperRatio::new().estimate(&offset).unwrap().youngs_modulus_pa > 1.2 * SAMPLE);
}

#[test]
fn strain_counted_from_the_first_load() {
    let (first, second) = (strained(1000.0, 0.0), strained(1000.0 + SAMPLE * 0.02, 0.02));
    let ratio = PaperRatio::new().with_reference(StrainReference::FirstLoad);
    finds(&ratio, &[first, second]);
    assert_eq!(
        ratio.estimate(&[second]).unwrap_err(),
        ElasticityError::TooFewLoads { expected: 2, found: 1 }
    );
    assert_eq!(ratio.estimate(&[second, second]).unwrap_err(), ElasticityError::EqualLoads);
}

#[test]
fn bad_input_is_named() {
    use ElasticityError as E;
    let ratio = PaperRatio::new();
    let fail = |load: LoadState<f64>| ratio.estimate(&[load]).unwrap_err();
    assert_eq!(fail(strained(100.0, 0.0)), E::ZeroStrain);
    assert_eq!(fail(strained(100.0, -0.1)), E::OppositeSigns { stress_pa: 100.0, strain: -0.1 });
    for area in [0.0, -1e-6] {
        let load = strained(100.0, 0.1).with_contact_area(exact(area));
        assert_eq!(fail(load), E::NotPositive { quantity: Quantity::ContactArea, found: area });
    }
    assert_eq!(fail(strained(f64::NAN, 0.1)), E::NotFinite { quantity: Quantity::Force });
    assert_eq!(fail(strained(100.0, f64::NAN)), E::NotFinite { quantity: Quantity::Strain });
    assert_eq!(fail(LoadState::new(exact(1.0))), E::TooFewLoads { expected: 1, found: 0 });
    let bare = LoadState::new(exact(1.0)).with_mean_strain(exact(0.1));
    assert_eq!(fail(bare), E::Missing { load: 0, quantity: Quantity::ContactArea });
    let line = StressStrainRegression::new();
    assert_eq!(line.estimate(&[strained(10.0, 0.1); 3]).unwrap_err(), E::EqualLoads);
    assert_eq!(line.estimate(&[strained(10.0, 0.1)]).unwrap_err(), E::TooFewLoads { expected: 3, found: 1 });
    for nu in [-1.0, 0.500001, f64::NAN, 7.0] {
        assert!(matches!(HertzSphere::new(1e-3, nu), Err(E::PoissonRatio { .. })), "{nu}");
    }
    for radius in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(
            HertzSphere::new(radius, 0.3),
            Err(E::NotPositive { quantity: Quantity::Radius, .. })
        ));
    }
    let sphere = HertzSphere::new(4e-3, NU).unwrap();
    let empty: [LoadState<f64>; 0] = [];
    assert_eq!(sphere.estimate(&empty).unwrap_err(), E::TooFewLoads { expected: 1, found: 0 });
    let pulled = LoadState::new(exact(-1.0)).with_contact_radius(exact(1e-3));
    assert!(matches!(sphere.estimate(&[pulled]), Err(E::NotPositive { quantity: Quantity::Force, .. })));
    let flat = LoadState::new(exact(1.0)).with_contact_radius(exact(0.0));
    assert!(matches!(
        sphere.estimate(&[flat]),
        Err(E::NotPositive { quantity: Quantity::ContactRadius, .. })
    ));
    assert!(matches!(sphere.clone().with_size_error(-0.1), Err(E::Negative { .. })));
    assert!(matches!(sphere.with_force_scale_error(f64::NAN), Err(E::Negative { .. })));
}

#[test]
fn one_load_without_errors_has_no_interval() {
    let loads = hertz_loads(Body::rigid(), &[1e-3]);
    let only =
        HertzSphere::new(4e-3, NU).unwrap().with_evidence(Evidence::ContactRadius).estimate(&loads).unwrap();
    assert!(only.warnings.contains(&Warning::NoErrorEstimate) && only.interval_95.upper.is_none());
}

#[test]
fn large_contacts_are_flagged_with_their_ratio() {
    let loads = hertz_loads(Body::rigid(), &[1e-3, 0.5]);
    let found = HertzSphere::new(4e-3, NU).unwrap().estimate(&loads).unwrap();
    assert_eq!(found.warnings.len(), 1);
    assert!(matches!(found.warnings[0], Warning::LargeContact { load: 1, ratio, .. } if ratio > 0.5));
}

#[test]
fn f32_agrees_with_f64() {
    let loads = hertz_loads(Body::rigid(), &[1e-3, 2e-3]);
    let narrow = |e: Estimate<f64>| Estimate::new(e.value as f32, e.standard_error as f32);
    let single: Vec<LoadState<f32>> = loads
        .iter()
        .map(|l| LoadState::new(narrow(l.force_n)).with_contact_radius(narrow(l.contact_radius_m.unwrap())))
        .collect();
    let found = HertzSphere::new(4e-3f32, NU as f32).unwrap().estimate(&single).unwrap();
    // Three roundings of a at 6·10⁻⁸ each, cubed.
    assert!((f64::from(found.youngs_modulus_pa) / SAMPLE - 1.0).abs() < 1e-6);
}

#[test]
fn loads_choose_their_law() {
    let forces = [1e-3, 4e-3, 1.6e-2];
    let candidates = sphere_as_sample(4e-3, NU, &waveguide()).unwrap();
    let choice = select_estimator(&candidates, &between_plates(&forces, 0.003)).unwrap();
    assert_eq!(choice.chosen().estimator, EstimatorKind::SphereBetweenPlates);
    assert!((choice.chosen().youngs_modulus_pa / SAMPLE - 1.0).abs() < 1e-9);
    // Hertz with one contact takes the plate's approach for twice what it is: many standard errors off.
    assert!(matches!(choice.reason, SelectionReason::BetterFit { margin } if margin > 10.0));
    assert!((choice.weights.iter().sum::<f64>() - 1.0).abs() < 1e-12 && choice.weights[0] > 0.99);
    assert_eq!(choice.estimates.len() + choice.left_out.len(), candidates.len());

    // A sliding layer tells itself from a glued and from a deep one.
    let equation = LayerEquation::new(&LayerKernel::new(Bond::Free, NU).unwrap());
    let load = |ratio: f64| {
        let (h, contact) = (2e-3, equation.solve(ratio).unwrap());
        let hertz = 4.0 / 3.0 * reduced() * (ratio * h).powi(3) / 4e-3;
        let depth = (contact.chi * h).powi(2) / 4e-3;
        LoadState::new(exact(hertz * contact.force_ratio_same_radius))
            .with_indentation(Estimate::new(depth, 0.003 * depth))
    };
    let layer =
        select_estimator(&sphere_on_sample(4e-3, NU, Some(2e-3)).unwrap(), &[0.2, 0.5, 0.9, 1.3].map(load))
            .unwrap();
    assert_eq!(layer.chosen().estimator, EstimatorKind::FreeLayerIntegralEquation);
    assert!((layer.chosen().youngs_modulus_pa / SAMPLE - 1.0).abs() < 1e-6);
}

#[test]
fn one_load_is_answered_by_the_most_general_law() {
    let mut loads = between_plates(&[1e-3], 0.01);
    loads[0].indentation_m = None;
    let choice = select_estimator(&sphere_as_sample(4e-3, NU, &waveguide()).unwrap(), &loads).unwrap();
    assert_eq!(choice.chosen().estimator, EstimatorKind::SphereOnWaveguide);
    assert!(matches!(choice.reason, SelectionReason::MostGeneral { behind } if behind.abs() < 1e-9));
    assert!(select_estimator::<f64>(&[], &loads).is_err());
}

#[test]
fn forces_that_share_an_error_cancel_in_their_ratio_not_in_their_mean() {
    let load = |force: f64, strain: f64| {
        LoadState::new(Estimate::new(force, 0.01 * force))
            .with_contact_area(exact(1e-4))
            .with_mean_strain(exact(strain))
    };
    let loads = [load(0.02, 0.0), load(0.08, 0.01)];
    let ratio = PaperRatio::new().with_reference(StrainReference::FirstLoad);
    let shared = DMatrix::from_fn(2, 2, |i, j| (0.01f64).powi(2) * [0.02, 0.08][i] * [0.02, 0.08][j]);
    let common = ratio.clone().with_force_covariance(&shared).unwrap().estimate(&loads).unwrap();
    // One factor on both forces is one factor on their difference: 1 %.
    assert!((common.standard_error_pa / common.youngs_modulus_pa - 0.01).abs() < 1e-12);
    // Independent errors of 1 % of 20 and 80 mN on a difference of 60 mN.
    let apart = ratio.estimate(&loads).unwrap();
    let expected = 0.01 * 0.02f64.hypot(0.08) / 0.06;
    assert!((apart.standard_error_pa / apart.youngs_modulus_pa - expected).abs() < 1e-12);
    let wrong = PaperRatio::new().with_force_covariance(&DMatrix::<f64>::zeros(3, 3)).unwrap();
    let mismatch = wrong.estimate(&[load(0.08, 0.01)]).unwrap_err();
    assert_eq!(
        mismatch,
        ElasticityError::LengthMismatch { quantity: Quantity::Force, expected: 1, found: 3 }
    );
}

/// Student's t with Welch and Satterthwaite's degrees of freedom, against quantiles from tables.
#[test]
fn errors_learnt_from_few_repetitions_widen_the_interval() {
    let load = |force: Estimate<f64>, strain: Estimate<f64>| {
        [LoadState::new(force).with_contact_area(exact(1e-4)).with_mean_strain(strain)]
    };
    let half_width = |loads: &[LoadState<f64>]| {
        let found = PaperRatio::new().estimate(loads).unwrap();
        (found.interval_95.upper.unwrap() / found.interval_95.lower).ln() / 2.0 * found.youngs_modulus_pa
            / found.standard_error_pa
    };
    let force = Estimate::new(0.1, 0.002);
    let strain = Estimate::new(0.02, 0.0004);
    assert!((half_width(&load(force, strain)) - 1.959_964).abs() < 1e-5);
    let learnt = force.with_degrees_of_freedom(5.0);
    assert!((half_width(&load(learnt, exact(0.02))) - 2.570_582).abs() < 1e-5);
    // Half of the variance with five degrees of freedom, half known: 5/0.5² = 20.
    assert!((half_width(&load(learnt, strain)) - 2.085_963).abs() < 1e-5);
    let refused = PaperRatio::new().estimate(&load(force.with_degrees_of_freedom(f64::NAN), strain));
    assert!(refused.is_err());
}
