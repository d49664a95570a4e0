//! The inverse of every law agrees with the law. A law reports the limits of its validity, and is
//! chosen within them.

use super::*;
use tactile_elasticity::laws::RigidBallLaw;

#[test]
fn every_law_inverts_itself() {
    let forces = [1e-3, 2e-3, 5e-3];
    let on_waveguide = HertzSphere::new(4e-3, NU)
        .unwrap()
        .with_waveguide(&waveguide());
    finds(&on_waveguide, &hertz_loads(waveguide().as_body(), &forces));
    let punch =
        |d: f64| LoadState::new(exact(2.0 * reduced() * 2e-3 * d)).with_indentation(exact(d));
    finds(
        &FlatPunch::new(2e-3, NU).unwrap(),
        &[punch(1e-5), punch(3e-5)],
    );
    let angle = 1.2f64;
    let cone = |d: f64| {
        let a = std::f64::consts::FRAC_2_PI * angle.tan() * d;
        LoadState::new(exact(reduced() * a * d))
            .with_indentation(exact(d))
            .with_radius(exact(a))
    };
    finds(&Cone::new(angle, NU).unwrap(), &[cone(1e-5), cone(3e-5)]);
}

#[test]
fn layers_invert_themselves_thick_or_thin() {
    let (r, h) = (5e-3, 2e-3);
    let layer = LayerEquation::new(Bond::Bonded, NU).unwrap();
    let load = |a_over_h: f64| {
        let c = layer.solve(a_over_h).unwrap();
        let (a, d) = (a_over_h * h, (c.chi * h).powi(2) / r);
        let force = 4.0 / 3.0 * reduced() * r.sqrt() * d.powf(1.5) * c.force_ratio;
        LoadState::new(exact(force))
            .with_radius(exact(a))
            .with_indentation(exact(d))
    };
    let loads = [load(0.05), load(0.4), load(1.3)];
    finds(&BondedLayer::new(r, h, NU, Bond::Bonded).unwrap(), &loads);
}

/// The linear contact of a ball with the layers of `guide`.
fn layered_load(guide: &Waveguide, r: f64, modulus: f64, a: f64) -> LoadState {
    let top = guide.layers()[0];
    let top = Body::elastic(top.youngs_modulus_pa, top.poisson_ratio).unwrap();
    let total = Body::elastic(modulus, NU).unwrap().compliance_per_pa() + top.compliance_per_pa();
    let layers = LayerEquation::of_layers(guide, Bond::Bonded).unwrap();
    let layers = layers.with_share(top.compliance_per_pa() / total);
    let contact = layers.solve(a / guide.thickness_m()).unwrap();
    let force = 4.0 / 3.0 / total * a.powi(3) / r * contact.force_ratio_same_radius;
    LoadState::new(exact(force))
        .with_radius(exact(a))
        .with_indentation(exact(a * a / r * contact.indentation_ratio))
}

#[test]
fn a_sphere_on_layers_inverts_itself() {
    let guide = waveguide();
    let loads = [0.2e-3, 1e-3, 2.5e-3].map(|a| layered_load(&guide, 4e-3, SAMPLE, a));
    let linear = SphereOnWaveguide::new(4e-3, NU, &guide, Bond::Bonded)
        .unwrap()
        .without_finite_strain();
    let found = linear.estimate(&LoadSeries::new(loads.as_slice())).unwrap();
    // The interpolation of the table, 5·10⁻⁶ in ln F.
    let gap = found.youngs_modulus_pa / SAMPLE - 1.0;
    assert!(gap.abs() < 3e-5, "{gap:e}");
    // In series the soft layers below contribute as if they were in contact: the modulus is larger
    // by half, or doubled.
    let deep = |load| {
        let estimator = HertzSphere::new(4e-3, NU).unwrap().with_waveguide(&guide);
        let found = estimator.estimate(&LoadSeries::new([load])).unwrap();
        found.youngs_modulus_pa / SAMPLE - 1.0
    };
    assert!(deep(by_radius(loads[1])) > 1.0 && deep(by_depth(loads[1])) > 0.5);
}

#[test]
fn a_rigid_flat_and_a_deep_layer_are_hertz() {
    let loads = hertz_loads(Body::rigid(), &[1e-6, 4e-6]);
    let flat = SphereOnWaveguide::new(4e-3, NU, &Waveguide::rigid(), Bond::Bonded).unwrap();
    finds(&flat.clone().without_finite_strain(), &loads);
    let top = Body::elastic(80e3, 0.5).unwrap();
    let loads = hertz_loads(top, &[1e-6, 4e-6]);
    let deep = guide(&[[10.0, 80e3]], 0.5);
    let layered = SphereOnWaveguide::new(4e-3, NU, &deep, Bond::Bonded).unwrap();
    let found = layered
        .without_finite_strain()
        .estimate(&LoadSeries::new(loads));
    // a/h is 10⁻⁵, and the effect of the layer is of the same order.
    assert!((found.unwrap().youngs_modulus_pa / SAMPLE - 1.0).abs() < 1e-4);
}

#[test]
fn far_stiffer_samples_are_bounded_from_below_only() {
    // A sample of 5 MPa on a waveguide of 50 kPa: with 1 % of noise in a there is no upper limit.
    let guide = waveguide();
    let e = guide
        .as_body()
        .reduced_modulus_pa(Body::elastic(5e6, NU).unwrap())
        .unwrap();
    let load = |f: f64, error: f64| {
        let a = HertzContact::from_force(f, 4e-3, e)
            .unwrap()
            .contact_radius_m
            * (1.0 + error);
        LoadState::new(exact(f)).with_radius(Estimate::new(a, 0.01 * a))
    };
    let estimator = HertzSphere::new(4e-3, NU).unwrap().with_waveguide(&guide);
    let found = estimator
        .estimate(&LoadSeries::new([load(0.01, 0.0)]))
        .unwrap();
    assert!(found.interval_95.upper.is_none() && found.interval_95.lower > 200e3);
    assert!(found.warnings.contains(&Warning::UnboundedAbove));
    let refused = estimator.estimate(&LoadSeries::new([load(0.01, -0.01)]));
    let Err(ElasticityError::StifferThanResolvable { lower_bound_pa }) = refused else {
        panic!("{refused:?}");
    };
    assert!(lower_bound_pa.unwrap() > 200e3);
}

/// Balls softer and stiffer than the guide, larger and smaller than its thickness: the fraction of
/// the compliance that belongs to the sample is always found.
#[test]
fn balls_of_every_stiffness_and_size_invert_on_layers() {
    for guide in &[waveguide(), guide(&[[4e-3, 50e3]], 0.495)] {
        for radius in [3e-3, 10e-3, 20e-3] {
            let estimator = SphereOnWaveguide::new(radius, NU, guide, Bond::Bonded)
                .unwrap()
                .without_finite_strain();
            for modulus in [30e3, 100e3, 250e3] {
                let radii = [0.1, 0.5, 1.2].map(|ratio| ratio * radius);
                for a in radii
                    .into_iter()
                    .filter(|a| *a <= 1.6 * guide.thickness_m())
                {
                    let load = by_radius(layered_load(guide, radius, modulus, a));
                    let found = estimator.estimate(&LoadSeries::new([load])).unwrap();
                    let gap = found.youngs_modulus_pa / modulus - 1.0;
                    // The 5·10⁻⁶ of the table in ln F, times the amplification by the compliance of
                    // the guide.
                    assert!(gap.abs() < 2e-4, "{radius} {modulus} {a}: {gap:e}");
                }
            }
        }
    }
}

/// Contacts of rigid balls by the finite elements of `tactile-fem` (ν 0.4999): layers (thickness,
/// modulus), ball radius, force, contact radius. None was used for the fit of the law.
#[test]
fn rigid_balls_follow_finite_elements() {
    const PAPER: &[[f64; 2]] = &[[2e-3, 136e3], [3e-3, 80e3], [5e-3, 34e3]];
    const STACK: &[[f64; 2]] = &[[4e-3, 70e3], [4e-3, 140e3]];
    const DEEP: &[[f64; 2]] = &[[10e-3, 60e3]];
    for (layers, ball_radius_m, force_n, a) in [
        (DEEP, 4e-3, 0.0738096, 1.405844e-3),
        (DEEP, 4e-3, 0.6228510, 2.759746e-3),
        (DEEP, 8e-3, 0.7286625, 3.723915e-3),
        (&[[4e-3, 90e3]], 4e-3, 0.1503754, 1.532135e-3),
        (&[[4e-3, 90e3]], 8e-3, 2.5621142, 4.362591e-3),
        (STACK, 4e-3, 0.9677733, 2.928463e-3),
        (STACK, 8e-3, 0.1083749, 1.896468e-3),
        (PAPER, 4e-3, 0.1128228, 1.263046e-3),
        (PAPER, 8e-3, 0.8279150, 3.324237e-3),
    ] {
        let law = RigidBallLaw::new(&guide(layers, 0.4999), [a; 2]).unwrap();
        let found = law.log_force(ball_radius_m, a);
        // Three standard errors, in which the radius of the elements has 0.1 %.
        let z = (found.value() - f64::ln(force_n)) / found.error().hypot(3e-3);
        assert!(z.abs() < 3.0, "{layers:?} {ball_radius_m} {a}: {z}");
        assert!(found.error() < 0.012);
    }
}
