//! Estimators against balls pressed in finite elements at finite strain.

use super::*;
use tactile_elasticity::curve::{
    Baseline, ContactPoint, CurveOptions, IndentationCurve, Indenter, fit_curve,
};

/// A load of a scene: force, contact radius.
struct Scene {
    name: String,
    youngs_modulus_pa: f64,
    poisson_ratio: f64,
    radius_m: f64,
    guide: Waveguide,
    loads: Vec<LoadState>,
}

/// The scenes of `fem_press/scenes.csv`; none with one printed line where the data are not there.
fn scenes() -> Vec<Scene> {
    let Some(path) = test_support::published("fem_press/scenes.csv") else {
        return Vec::new();
    };
    let text = std::fs::read_to_string(path).expect("readable");
    let mut scenes: Vec<Scene> = Vec::new();
    for line in text.lines().skip(1) {
        // The layers are a quoted JSON list with commas of its own.
        let open = line.find('[').expect("layers");
        let close = line.find(']').expect("layers");
        let layers: Vec<serde_json::Value> =
            serde_json::from_str(&line[open..=close].replace("\"\"", "\"")).expect("JSON");
        let before: Vec<&str> = line[..open].trim_end_matches('"').split(',').collect();
        let after: Vec<&str> = line[close + 1..]
            .trim_start_matches('"')
            .split(',')
            .collect();
        let number = |text: &str| text.parse::<f64>().expect("a number");
        let layer = |l: &serde_json::Value| Layer {
            thickness_m: l["thickness_m"].as_f64().unwrap(),
            youngs_modulus_pa: l["youngs_modulus_pa"].as_f64().unwrap(),
            poisson_ratio: l["poisson_ratio"].as_f64().unwrap(),
        };
        let load = LoadState {
            indentation_m: Some(exact(number(after[2]))),
            contact_radius_m: Some(Estimate::new(number(after[3]), number(after[4]))),
            ..LoadState::new(exact(number(after[1])))
        };
        match scenes.last_mut().filter(|s| s.name == before[0]) {
            Some(scene) => scene.loads.push(load),
            None => scenes.push(Scene {
                name: before[0].to_owned(),
                youngs_modulus_pa: number(before[1]),
                poisson_ratio: number(before[2]),
                radius_m: number(before[3]),
                guide: if layers.is_empty() {
                    Waveguide::rigid()
                } else {
                    Waveguide::new(layers.iter().map(layer).collect()).unwrap()
                },
                loads: vec![load],
            }),
        }
    }
    scenes
}

/// `--nocapture` prints every error beside the standard error.
#[allow(clippy::print_stdout)]
#[test]
fn balls_are_read_through_layers_and_on_a_flat() {
    for scene in scenes() {
        let estimator = SphereOnWaveguide::new(
            scene.radius_m,
            scene.poisson_ratio,
            &scene.guide,
            Bond::Bonded,
        )
        .unwrap();
        for (evidence, tolerance) in [
            (Evidence::ContactRadius, 0.02),
            (Evidence::Indentation, 0.15),
        ] {
            let estimator = estimator.clone().with_evidence(evidence);
            for load in &scene.loads {
                let deep = load.indentation_m.unwrap().value > 0.8 * scene.radius_m;
                if evidence == Evidence::Indentation && deep {
                    assert!(estimator.estimate(&LoadSeries::new([*load])).is_err());
                    continue;
                }
                let found = estimator.estimate(&LoadSeries::new([*load])).unwrap();
                let gap = found.youngs_modulus_pa / scene.youngs_modulus_pa - 1.0;
                assert!(gap.abs() < tolerance, "{} {evidence:?}: {gap}", scene.name);
                let (name, ratio) = (&scene.name, found.loads[0].contact_ratio.unwrap());
                let error = found.standard_error_pa / found.youngs_modulus_pa;
                println!("{name} {evidence:?} a/R {ratio:.2}: {gap:+.4} ± {error:.4}");
                let covered = found.interval_95.contains(scene.youngs_modulus_pa);
                assert!(covered, "{} {evidence:?}: {gap}", scene.name);
            }
        }
    }
}

/// The indentations of all balls on a rigid flat as one curve: in units of E and R they are one
/// ball.
#[test]
fn a_curve_of_a_soft_ball_is_read_at_finite_strain() {
    let scenes = scenes();
    let on_flat = scenes.iter().filter(|s| s.guide.layers().is_empty());
    let (radius, modulus, nu) = (3e-3, SAMPLE, 0.495);
    let mut points = vec![(0.0, 0.0)];
    for scene in on_flat {
        let force_unit = scene.youngs_modulus_pa * scene.radius_m.powi(2);
        let depths = scene.loads.iter().map(|l| l.indentation_m.unwrap().value);
        points.extend(depths.zip(&scene.loads).map(|(depth, load)| {
            let force = load.force_n.value / force_unit * modulus * radius * radius;
            (depth / scene.radius_m * radius, force)
        }));
    }
    points.retain(|p| p.0 < 0.24 * radius);
    if points.len() < 2 {
        return; // no data
    }
    let (z, f): (Vec<f64>, Vec<f64>) = points.into_iter().unzip();
    let curve = IndentationCurve::new(&z, &f).unwrap();
    let ball = Indenter::Ball { radius_m: radius };
    let options = CurveOptions {
        baseline: Baseline::Zero,
        contact_point: ContactPoint::At(0.0),
    };
    let fit = |kind| fit_curve(&curve, &ball, nu, kind, &options).unwrap();
    let found = fit(EstimatorKind::SphereOnFlat);
    assert!((found.youngs_modulus_pa / modulus - 1.0).abs() < 0.02);
    // Hertz is a quarter off, and its interval says so.
    let hertz = fit(EstimatorKind::HertzSphere);
    assert!((hertz.youngs_modulus_pa / modulus - 1.0).abs() > 0.15);
    for fit in [found, hertz] {
        assert!(fit.interval_95.contains(modulus), "{}", fit.model);
    }
}
