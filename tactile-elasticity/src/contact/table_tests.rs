use super::*;
use crate::modulus::{
    Estimate, LoadSeries, LoadState, ModulusEstimator, TabulatedContact, Warning,
};

fn samples(of: impl Fn(f64, f64) -> f64) -> Vec<Sample> {
    let grid = (0..8).flat_map(|i| (0..12).map(move |j| (i, j)));
    grid.map(|(i, j)| {
        let (ratio, log_modulus) = (0.1 + 0.1 * f64::from(j), 10.0 + 0.3 * f64::from(i));
        Sample {
            ratio,
            log_modulus,
            value: of(ratio, log_modulus),
        }
    })
    .collect()
}

#[test]
fn a_polynomial_is_found_again_with_its_slopes() {
    let of = |x: f64, m: f64| 0.3 * x * x - 0.1 * x.powi(4) * (m - 11.0) + 0.2 * (m - 11.0).powi(3);
    let surface = Surface::fit(&samples(of), 8).unwrap();
    let (x, m) = (0.77, 11.4);
    let value = surface.at(x, m);
    assert!((value.value - of(x, m)).abs() < 1e-12);
    let in_ratio = x * (0.6 * x - 0.4 * x.powi(3) * (m - 11.0));
    let in_modulus = -0.1 * x.powi(4) + 0.6 * (m - 11.0).powi(2);
    assert!((value.ratio_slope - in_ratio).abs() < 1e-11);
    assert!((value.modulus_slope - in_modulus).abs() < 1e-11);
    assert!(surface.error < 1e-12);
}

#[test]
fn the_error_is_that_of_a_sample_left_out() {
    // Alternating scatter of ±0.1 %, which no polynomial of degree 6 can follow.
    let scatter = |x: f64| 1e-3 * (-1f64).powf((x * 10.0).round());
    let surface = Surface::fit(&samples(|x, m| x * m + scatter(x)), 8).unwrap();
    let error = surface.error;
    assert!((1e-3..4e-3).contains(&error), "{error}");
}

const RADIUS: f64 = 3e-3;

fn guide() -> Waveguide {
    let layer = |thickness_m, youngs_modulus_pa| Layer {
        thickness_m,
        youngs_modulus_pa,
        poisson_ratio: 0.495,
    };
    Waveguide::new(vec![layer(2e-3, 136e3), layer(8e-3, 50e3)]).unwrap()
}

/// A plausible law with plain arithmetic: Hertz's law of two bodies, stiffened with a/R.
fn invented_force(a: f64, e: f64) -> f64 {
    let reduced = 1.0 / ((1.0 - 0.495 * 0.495) * (1.0 / e + 1.0 / 70e3));
    4.0 / 3.0 * reduced * a.powi(3) / RADIUS * (0.1 * (a / RADIUS).powi(2)).exp()
}

fn curve(youngs_modulus_pa: f64, largest_ratio: f64) -> ContactCurve {
    let radii = (1..=16).map(|k| RADIUS * (0.1 + (largest_ratio - 0.1) * f64::from(k - 1) / 15.0));
    let contact_radius_m: Vec<f64> = radii.collect();
    ContactCurve {
        youngs_modulus_pa,
        force_n: (contact_radius_m.iter())
            .map(|&a| invented_force(a, youngs_modulus_pa))
            .collect(),
        contact_radius_m,
    }
}

fn table() -> ContactTable {
    let moduli = (0..7).map(|k| 20e3 * 20f64.powf(f64::from(k) / 6.0));
    // The contacts of a stiff ball end earlier.
    let curves = moduli.map(|e| curve(e, 1.25 - 0.1 * (e / 20e3).log10()));
    ContactTable::new(RADIUS, 0.495, &guide(), curves.collect()).unwrap()
}

fn load(a: f64, e: f64) -> LoadState {
    let force = invented_force(a, e);
    LoadState::new(Estimate::new(force, 1e-3 * force)).with_radius(Estimate::new(a, 1e-6))
}

#[test]
fn forces_and_moduli_between_the_contacts() {
    let table = table();
    let estimator = TabulatedContact::new(table.clone(), RADIUS, 0.495, &guide()).unwrap();
    for e in [31e3, 62e3, 103e3, 247e3] {
        for ratio in [0.13, 0.5, 0.97] {
            let a = ratio * RADIUS;
            let force = table.force_n(a, e).unwrap();
            // The sixth power of ln E is neglected: 5·10⁻⁵ of the force.
            assert!(
                (force / invented_force(a, e) - 1.0).abs() < 1e-4,
                "{e} {ratio}"
            );
        }
        let loads = LoadSeries::new([load(0.6 * RADIUS, e), load(0.9 * RADIUS, e)]);
        let found = estimator.estimate(&loads).unwrap();
        // The guide has up to four fifths of the compliance, so an error of the force counts five
        // times.
        assert!((found.youngs_modulus_pa / e - 1.0).abs() < 5e-4);
        assert!(found.interval_95.contains(e) && found.fit.observations == 2);
    }
    assert!(table.interpolation_error() < 1e-4);
}

/// The error of the table affects ln E more at loads that depend on it less. If it were treated as
/// a common relative error at all loads, it would be inferred from the difference between two, and
/// the result would be extrapolated far outside both.
#[test]
fn the_modulus_of_two_loads_lies_between_what_each_says() {
    // On a guide that stiffens under a large contact, the force of a stiff ball depends on E the
    // more, the larger the contact.
    let stiffening = |a: f64, e: f64| {
        let guide_pa = 70e3 * (1.0 + 2.0 * (a / RADIUS).powi(2));
        4.0 / 3.0 / (1.0 / e + 1.0 / guide_pa) * a.powi(3) / RADIUS
    };
    let moduli = (0..7).map(|k| 20e3 * 20f64.powf(f64::from(k) / 6.0));
    let curves = moduli.map(|e| {
        let mut curve = curve(e, 1.2);
        curve.force_n = (curve.contact_radius_m.iter())
            .map(|&a| stiffening(a, e))
            .collect();
        curve
    });
    let table = ContactTable::new(RADIUS, 0.495, &guide(), curves.collect()).unwrap();
    let estimator = TabulatedContact::new(table, RADIUS, 0.495, &guide()).unwrap();
    let e = 200e3;
    // Half a per cent of the force, a typical mesh error, at one of two loads.
    let loads = [(0.6, 1.0), (0.9, 0.995)].map(|(ratio, off)| {
        let a = ratio * RADIUS;
        let force = off * stiffening(a, e);
        LoadState::new(Estimate::new(force, 1e-4 * force)).with_radius(Estimate::new(a, 1e-8))
    });
    let estimate = estimator.estimate(&LoadSeries::new(loads)).unwrap();
    let [first, second] = [0, 1].map(|k| estimate.loads[k].youngs_modulus_pa.unwrap());
    assert!(second < 0.99 * first, "{first} {second}");
    let found = estimate.youngs_modulus_pa;
    assert!(second <= found && found <= first, "{found}");
    assert!(estimate.interval_95.contains(e), "{estimate:?}");
}

#[test]
fn what_the_table_does_not_hold_is_not_answered() {
    let table = table();
    assert_eq!(table.force_n(1.3 * RADIUS, 60e3), None);
    assert_eq!(table.force_n(0.055 * RADIUS, 60e3), None);
    assert_eq!(table.force_n(0.5 * RADIUS, 500e3), None);
    // 20 kPa reaches 1.25, 400 kPa 1.12.
    assert!(table.force_n(1.24 * RADIUS, 20e3).is_some());
    assert_eq!(table.force_n(1.2 * RADIUS, 380e3), None);

    let estimator = TabulatedContact::new(table, RADIUS, 0.495, &guide()).unwrap();
    let refused = |a: f64, e: f64| {
        let error = estimator.estimate(&LoadSeries::new([load(a, e)]));
        error.unwrap_err()
    };
    let far = refused(1.4 * RADIUS, 60e3).to_string();
    assert!(far.starts_with("contact radius = "), "{far}");
    // If one load is inside the range, the one outside is skipped and reported.
    let both = LoadSeries::new([load(0.8 * RADIUS, 60e3), load(1.4 * RADIUS, 60e3)]);
    let found = estimator.estimate(&both).unwrap();
    assert!(!found.loads[1].used && found.fit.observations == 1);
    let warning = found.warnings[0];
    assert!(matches!(warning, Warning::LargeContact { load: 1, .. }));
    let stiff = refused(0.8 * RADIUS, 2e6);
    let ElasticityError::StifferThanResolvable { lower_bound_pa } = stiff else {
        panic!("{stiff}");
    };
    assert!(lower_bound_pa.is_some_and(|bound| bound > 250e3));
    let soft = refused(0.8 * RADIUS, 5e3).to_string();
    assert!(soft.starts_with("Young's modulus = "), "{soft}");
}

#[test]
fn another_ball_or_guide_is_refused() {
    let refused = |radius, nu, guide: &Waveguide| {
        let refused = TabulatedContact::new(table(), radius, nu, guide);
        refused.err().map(|error| match error {
            ElasticityError::TableMismatch { quantity, .. } => quantity,
            other => panic!("{other}"),
        })
    };
    assert_eq!(refused(RADIUS, 0.495, &guide()), None);
    assert_eq!(refused(3.01e-3, 0.495, &guide()), Some(Quantity::Radius));
    assert_eq!(refused(RADIUS, 0.5, &guide()), Some(Quantity::PoissonRatio));
    let flat = Waveguide::rigid();
    assert_eq!(refused(RADIUS, 0.495, &flat), Some(Quantity::Layers));
    type Change = fn(&mut Layer);
    let changed: [(Quantity, Change); 3] = [
        (Quantity::Thickness, |l| l.thickness_m *= 1.1),
        (Quantity::YoungsModulus, |l| l.youngs_modulus_pa *= 1.1),
        (Quantity::PoissonRatio, |l| l.poisson_ratio = 0.49),
    ];
    for (quantity, change) in changed {
        let mut layers = guide().layers().to_vec();
        change(&mut layers[1]);
        let other = Waveguide::new(layers).unwrap();
        assert_eq!(refused(RADIUS, 0.495, &other), Some(quantity));
    }
}

#[test]
fn curves_without_meaning_are_refused() {
    let refuses = |message: &str, change: fn(&mut Vec<ContactCurve>)| {
        let mut curves = vec![curve(30e3, 1.0), curve(60e3, 1.0), curve(120e3, 1.0)];
        change(&mut curves);
        let error = ContactTable::new(RADIUS, 0.495, &guide(), curves).unwrap_err();
        assert!(error.to_string().starts_with(message), "{error}");
    };
    refuses("Young's modulus: expected 2", |c| c.truncate(1));
    refuses("Young's modulus = 30000 is beyond", |c| c.swap(0, 1));
    refuses("Young's modulus must be", |c| {
        c[0].youngs_modulus_pa = f64::NAN
    });
    refuses("contact radius: expected 4", |c| {
        c[1].contact_radius_m.truncate(3)
    });
    refuses("contact radius must be", |c| {
        c[1].contact_radius_m[4] = -1.0
    });
    refuses("force: expected 16", |c| c[1].force_n.truncate(5));
    refuses("force = ", |c| c[1].force_n.swap(2, 3));
    // The stiffer ball has the smaller force.
    refuses("the force of the table does not always increase", |c| {
        c[1].force_n.iter_mut().for_each(|f| *f *= 0.3);
    });
}

#[cfg(feature = "serde")]
#[test]
fn a_table_is_read_as_it_was_written() {
    let table = table();
    let text = serde_json::to_string(&table).unwrap();
    assert_eq!(serde_json::from_str::<ContactTable>(&text).unwrap(), table);
    let other = text.replace("\"version\":1", "\"version\":2");
    let error = serde_json::from_str::<ContactTable>(&other).unwrap_err();
    assert!(error.to_string().contains("version 2"), "{error}");
}
