//! Estimators tested on balls pressed in finite elements at finite strain.

use super::*;

/// A load of a scene: force and contact radius.
struct Scene {
    name: String,
    youngs_modulus_pa: f64,
    poisson_ratio: f64,
    radius_m: f64,
    guide: Waveguide,
    loads: Vec<LoadState>,
}

/// The scenes of `fem_press/scenes.csv`. Without the data there are none, and a line is printed.
fn scenes() -> Vec<Scene> {
    let Some(path) = test_support::published("fem_press/scenes.csv") else {
        return Vec::new();
    };
    let text = std::fs::read_to_string(path).expect("readable");
    let mut scenes: Vec<Scene> = Vec::new();
    for line in text.lines().skip(1) {
        // The layers are a quoted JSON list that contains commas.
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
        let load = LoadState::new(exact(number(after[1])))
            .with_indentation(exact(number(after[2])))
            .with_radius(Estimate::new(number(after[3]), number(after[4])));
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

/// `--nocapture` prints every error and its standard error.
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
        type Seen = fn(LoadState) -> LoadState;
        let lengths: [(&str, Seen, f64); 2] =
            [("radius", by_radius, 0.02), ("depth", by_depth, 0.15)];
        for (length, seen, tolerance) in lengths {
            for load in &scene.loads {
                let deep = load.indentation_m.unwrap().value > 0.8 * scene.radius_m;
                let series = LoadSeries::new([seen(*load)]);
                if length == "depth" && deep {
                    assert!(estimator.estimate(&series).is_err());
                    continue;
                }
                let found = estimator.estimate(&series).unwrap();
                let gap = found.youngs_modulus_pa / scene.youngs_modulus_pa - 1.0;
                assert!(gap.abs() < tolerance, "{} {length}: {gap}", scene.name);
                let (name, ratio) = (&scene.name, found.loads[0].contact_ratio.unwrap());
                let error = found.standard_error_pa / found.youngs_modulus_pa;
                println!("{name} {length} a/R {ratio:.2}: {gap:+.4} ± {error:.4}");
                let covered = found.interval_95.contains(scene.youngs_modulus_pa);
                assert!(covered, "{} {length}: {gap}", scene.name);
            }
        }
    }
}
