//! Intervals cover what they promise.

use super::*;

/// 2000 noisy experiments: 95 % ± four standard deviations of the count (0.5 %).
#[test]
fn intervals_cover_what_they_promise() {
    let estimator = HertzSphere::new(4e-3, NU)
        .unwrap()
        .with_waveguide(&waveguide());
    let clean = hertz_loads(waveguide().as_body(), &[2e-3, 4e-3, 6e-3, 8e-3]);
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let mut covered = 0;
    for _ in 0..2000 {
        let mut normal = || rng.sample::<f64, _>(StandardNormal);
        let scale = 1.0 + 0.01 * normal();
        let loads: Vec<_> = (clean.iter())
            .map(|l| {
                let (f, a) = (l.force_n.value, l.contact_radius_m.unwrap().value);
                LoadState {
                    contact_radius_m: Some(Estimate::new(a * (1.0 + 0.004 * normal()), 0.004 * a)),
                    ..LoadState::new(Estimate::new(
                        f * scale * (1.0 + 0.005 * normal()),
                        0.005 * f,
                    ))
                }
            })
            .collect();
        let series = LoadSeries::new(loads).with_shared_errors(force_scale(0.01));
        covered += usize::from(
            estimator
                .estimate(&series.unwrap())
                .unwrap()
                .interval_95
                .contains(SAMPLE),
        );
    }
    assert!((1860..=1940).contains(&covered), "{covered} of 2000");
}

/// 2000 experiments whose lengths and guide are wrong together, as where the guide was checked by
/// the same pixels: 95 % ± four standard deviations of the count.
#[test]
fn intervals_cover_where_lengths_and_the_guide_err_together() {
    let loads = hertz_loads(waveguide().as_body(), &[2e-3, 6e-3]);
    let (length_scale, other_body) = (0.01, 0.05);
    for correlation in [0.9, -0.9] {
        let shared = SharedErrors {
            length_scale,
            other_body,
            length_with_other_body: correlation,
            ..SharedErrors::default()
        };
        let mut rng = ChaCha8Rng::seed_from_u64(11);
        let mut covered = 0;
        for _ in 0..2000 {
            let mut normal = || rng.sample::<f64, _>(StandardNormal);
            let (both, own) = (normal(), normal());
            let of_guide = correlation * both + (1.0 - correlation * correlation).sqrt() * own;
            let guide = waveguide();
            let layers = guide.layers().iter().map(|layer| Layer {
                youngs_modulus_pa: layer.youngs_modulus_pa / (1.0 + other_body * of_guide),
                ..*layer
            });
            let stated = Waveguide::new(layers.collect()).unwrap();
            let measured = loads.iter().map(|load| {
                let a = load.contact_radius_m.unwrap().value * (1.0 + length_scale * both);
                LoadState {
                    contact_radius_m: Some(exact(a)),
                    indentation_m: None,
                    ..*load
                }
            });
            let series = LoadSeries::new(measured.collect::<Vec<_>>());
            let series = series.with_shared_errors(shared).unwrap();
            let estimator = HertzSphere::new(4e-3, NU).unwrap();
            let found = estimator.with_waveguide(&stated).estimate(&series).unwrap();
            covered += usize::from(found.interval_95.contains(SAMPLE));
        }
        assert!(
            (1860..=1940).contains(&covered),
            "{correlation}: {covered} of 2000"
        );
    }
    let wrong = SharedErrors {
        length_with_other_body: 1.1,
        ..SharedErrors::default()
    };
    assert!(LoadSeries::new(loads).with_shared_errors(wrong).is_err());
}

/// Johnson, Kendall and Roberts: with Q² = 6πwR P₁ and P₁ = F + Q the contact's radius is that of
/// P₁, its pressure is p₀ (s - ε/s) with s = √(1 − r²/a²) and ε = Q/3P₁. Light shows where it is
/// positive, s² > ε: a force P₁ (1 − 3ε + 2ε^(3/2)), in a radius a √(1 − ε).
#[test]
fn adhesion_is_as_wide_as_the_contact_it_makes() {
    let force_n = 0.02;
    for adhesion_n in [1e-6, 1e-5, 1e-4] {
        let half: f64 = 0.5 * adhesion_n;
        let attracted_n = force_n + half + (adhesion_n * force_n + half * half).sqrt();
        let rim = (attracted_n - force_n) / (3.0 * attracted_n);
        let seen_n = attracted_n * (1.0 - 3.0 * rim + 2.0 * rim.powf(1.5));
        let softer = 1.0 - seen_n / attracted_n / (1.0 - rim).powf(1.5);
        let shared = SharedErrors {
            adhesion_n,
            ..SharedErrors::default()
        };
        let load = by_radius(hertz_loads(Body::rigid(), &[force_n])[0]);
        let series = LoadSeries::new([load]).with_shared_errors(shared).unwrap();
        let estimator = HertzSphere::new(4e-3, NU).unwrap();
        let found = estimator.estimate(&series).unwrap();
        let stated = found.standard_error_pa / SAMPLE;
        // The missing rim takes off up to a third at 7 % of the force.
        assert!(
            softer < stated && stated < 1.6 * softer,
            "{adhesion_n}: {softer} {stated}"
        );
    }
}

#[test]
fn a_force_covariance_says_the_same_as_a_shared_scale() {
    let f = [1e-3, 3e-3];
    let loads = hertz_loads(Body::rigid(), &f).into_iter().map(by_radius);
    let covariance = DMatrix::from_fn(2, 2, |i, j| 1e-4 * f[i] * f[j]);
    let plain = HertzSphere::new(4e-3, NU).unwrap();
    let series = LoadSeries::new(loads.collect::<Vec<_>>());
    let correlated = series.clone().with_force_covariance(&covariance).unwrap();
    let one = plain.estimate(&correlated).unwrap();
    let scaled = series.with_shared_errors(force_scale(0.01)).unwrap();
    let other = plain.estimate(&scaled).unwrap();
    assert!((one.standard_error_pa / other.standard_error_pa - 1.0).abs() < 1e-6);
    assert!((one.standard_error_pa / SAMPLE - 0.01).abs() < 1e-6);
}

#[test]
fn one_load_without_errors_has_no_interval() {
    let load = by_radius(hertz_loads(Body::rigid(), &[1e-3])[0]);
    let only = HertzSphere::new(4e-3, NU)
        .unwrap()
        .estimate(&LoadSeries::new([load]))
        .unwrap();
    assert!(only.warnings.contains(&Warning::NoErrorEstimate) && only.interval_95.upper.is_none());
}

#[test]
fn forces_that_share_an_error_cancel_in_their_ratio_not_in_their_mean() {
    let load = |force: f64, strain: f64| LoadState {
        contact_area_m2: Some(exact(1e-4)),
        mean_strain: Some(exact(strain)),
        ..LoadState::new(Estimate::new(force, 0.01 * force))
    };
    let loads = LoadSeries::new([load(0.02, 0.0), load(0.08, 0.01)]);
    let ratio = PaperRatio::default().with_reference(StrainReference::FirstLoad);
    let shared = DMatrix::from_fn(2, 2, |i, j| {
        (0.01f64).powi(2) * [0.02, 0.08][i] * [0.02, 0.08][j]
    });
    let correlated = loads.clone().with_force_covariance(&shared).unwrap();
    let common = ratio.estimate(&correlated).unwrap();
    // One factor on both forces is one factor on their difference: 1 %.
    assert!((common.standard_error_pa / common.youngs_modulus_pa - 0.01).abs() < 1e-12);
    // Independent errors of 1 % of 20 and 80 mN on a difference of 60 mN.
    let apart = ratio.estimate(&loads).unwrap();
    let expected = 0.01 * 0.02f64.hypot(0.08) / 0.06;
    assert!((apart.standard_error_pa / apart.youngs_modulus_pa - expected).abs() < 1e-12);
    let wrong = LoadSeries::new([load(0.08, 0.01)]);
    let mismatch = wrong.with_force_covariance(&DMatrix::zeros(3, 3));
    let message = "force: expected 1 entries, found 3";
    assert_eq!(mismatch.unwrap_err().to_string(), message);
}

/// Student's t, and the mean quantile of Cochran and Cox, against quantiles from tables.
#[test]
fn errors_learnt_from_few_repetitions_widen_the_interval() {
    let load = |force: Estimate, strain: Estimate| {
        LoadSeries::new([LoadState {
            contact_area_m2: Some(exact(1e-4)),
            mean_strain: Some(strain),
            ..LoadState::new(force)
        }])
    };
    let half_width = |loads: &LoadSeries| {
        let found = PaperRatio::default().estimate(loads).unwrap();
        (found.interval_95.upper.unwrap() / found.interval_95.lower).ln() / 2.0
            * found.youngs_modulus_pa
            / found.standard_error_pa
    };
    let force = Estimate::new(0.1, 0.002);
    let strain = Estimate::new(0.02, 0.0004);
    assert!((half_width(&load(force, strain)) - 1.959_964).abs() < 1e-5);
    let learnt = force.with_degrees_of_freedom(5.0);
    assert!((half_width(&load(learnt, exact(0.02))) - 2.570_582).abs() < 1e-5);
    // Half of the variance with five degrees of freedom, half known: the mean of both quantiles,
    // interpolated to 1 %.
    assert!((half_width(&load(learnt, strain)) / 2.265_273 - 1.0).abs() < 0.01);
    let refused =
        PaperRatio::default().estimate(&load(force.with_degrees_of_freedom(f64::NAN), strain));
    assert!(refused.is_err());
}

/// A regression of many loads takes time and memory in proportion to them: a matrix of all pairs of
/// these would be 3 GB.
#[test]
fn twenty_thousand_loads_are_one_linear_regression() {
    let forces: Vec<f64> = (0..20_000).map(|i| 1e-3 + 1e-7 * f64::from(i)).collect();
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let mut normal = || rng.sample::<f64, _>(StandardNormal);
    let loads: Vec<_> = (hertz_loads(Body::rigid(), &forces).iter())
        .map(|l| {
            let (f, a) = (l.force_n.value, l.contact_radius_m.unwrap().value);
            let d = l.indentation_m.unwrap().value;
            LoadState {
                contact_radius_m: Some(Estimate::new(a * (1.0 + 0.004 * normal()), 0.004 * a)),
                indentation_m: Some(Estimate::new(d * (1.0 + 0.01 * normal()), 0.01 * d)),
                mean_strain: Some(Estimate::new(
                    f / (std::f64::consts::PI * a * a) / SAMPLE,
                    1e-4,
                )),
                ..LoadState::new(Estimate::new(f * (1.0 + 0.005 * normal()), 0.005 * f))
            }
        })
        .collect();
    let series = LoadSeries::new(loads)
        .with_shared_errors(force_scale(1e-4))
        .unwrap();
    let hertz = HertzSphere::new(4e-3, NU)
        .unwrap()
        .estimate(&series)
        .unwrap();
    // The errors of single loads average to 0.005 % (force 0.5 %, three times the radius's 0.4 %
    // and 1.5 times the depth's 1 %, by √20000): the shared 0.01 % stays.
    let relative = hertz.standard_error_pa / hertz.youngs_modulus_pa;
    assert!((1e-4..1.4e-4).contains(&relative), "{relative}");
    assert!((hertz.youngs_modulus_pa / SAMPLE - 1.0).abs() < 4.0 * relative);
    assert_eq!(
        (hertz.loads.len(), hertz.fit.observations),
        (20_000, 40_000)
    );
    let ratio = PaperRatio::default().with_reference(StrainReference::Unloaded);
    let ratio = ratio.estimate(&series).unwrap();
    assert_eq!(ratio.fit.observations, 20_000);
}

/// A ball on a layer thin beside its contact and stiff beneath: there the plain iteration for the
/// guide's part of the compliance swings between two values, and gave an interval that was reversed
/// and missed its own estimate.
#[test]
fn a_thin_layer_on_a_stiff_base_has_an_interval_around_its_estimate() {
    let guide = guide(&[[1e-3, 100e3]], 0.495);
    let ball = SphereOnWaveguide::new(6e-3, 0.495, &guide, Bond::Bonded).unwrap();
    for radius in [1.5e-3, 2e-3, 3e-3, 4e-3] {
        for force in [0.05, 0.2, 1.0] {
            let load = LoadState {
                contact_radius_m: Some(Estimate::new(radius, 0.005 * radius)),
                ..LoadState::new(Estimate::new(force, 0.01 * force))
            };
            if let Ok(found) = ball.estimate(&LoadSeries::new([load])) {
                holds_its_estimate(&found);
            }
        }
    }
}

fn holds_its_estimate(found: &ModulusEstimate) {
    let interval = found.interval_95;
    let estimate = found.youngs_modulus_pa;
    assert!(interval.lower < estimate, "{found:?}");
    assert!(
        interval.upper.is_none_or(|upper| estimate < upper),
        "{found:?}"
    );
    // To first order the interval is as wide as its standard error: an end that did not converge is
    // not. Scatter that exceeds the errors widens it by Student's t.
    let excess = |w: &Warning| matches!(w, Warning::ExcessScatter { .. });
    let first_order = estimate - 1.96 * found.standard_error_pa;
    let off = (interval.lower - first_order) / found.standard_error_pa;
    let relative = found.standard_error_pa / estimate;
    let wide = relative > 0.1 || found.warnings.iter().any(excess);
    assert!(wide || off.abs() < 1.0, "{off}: {found:?}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Guides of one or two layers, balls and loads at random.
    #[test]
    fn an_interval_holds_its_own_estimate(
        thickness in 0.15..3.0f64,
        split in 0.1..0.9f64,
        below in 0.2..20.0f64,
        nu in 0.3..0.5f64,
        ball_pa in 4.0..6.0f64,
        ratios in prop::collection::vec(0.1..1.1f64, 1..4),
    ) {
        let radius = 4e-3;
        let total = thickness * radius;
        let guide = guide(&[[split * total, 1e5], [(1.0 - split) * total, 1e5 * below]], nu);
        let ball = SphereOnWaveguide::new(radius, 0.49, &guide, Bond::Bonded).unwrap();
        let modulus = 10f64.powf(ball_pa);
        let bodies = [(modulus, 0.49), (1e5, nu)].map(|(e, nu)| Body::elastic(e, nu).unwrap());
        let reduced = reduced_modulus_pa(bodies[0], bodies[1]).unwrap();
        let loads: Vec<_> = ratios
            .iter()
            .map(|ratio| {
                let a = ratio * radius;
                let force = 4.0 / 3.0 * reduced * a.powi(3) / radius;
                LoadState {
                    contact_radius_m: Some(Estimate::new(a, 0.003 * a)),
                    ..LoadState::new(Estimate::new(force, 0.005 * force))
                }
            })
            .collect();
        if let Ok(found) = ball.estimate(&LoadSeries::new(loads)) {
            holds_its_estimate(&found);
        }
    }
}
