//! Scene files from end to end: a simulated scene is written to a folder and measured, and every
//! invalid input gives its sentence.

use ndarray::Array2;
use std::fs;
use std::path::Path;
use tactile_files::io::write_grey_image;
use tactile_files::scene::{LoadedCalibration, Scene};
use tactile_imaging::Pipeline;
use tactile_imaging::elasticity::modulus::{EstimatorKind, ModulusEstimator};
use tactile_imaging::elasticity::strain::Hencky;
use tactile_imaging::pipeline::{MatcherChoice, Measurement, PipelineError, StagesConfig};
use tactile_imaging::sfs::EquallySpaced;
use tactile_imaging::tps::AffineModel;
use tactile_simulate::{CalibrationRun, Camera, Elastic, PressOptions, PressScene, write_folder};

/// The error of the paper: ±5.38 % for both polymers.
const PAPER_ERROR: f64 = 0.0538;

#[test]
fn a_simulated_scene_on_disk_gives_the_polymers_moduli() {
    for (material, seed) in [(Elastic::CL2000X, 3), (Elastic::CL2003X, 4)] {
        let folder = tempfile::tempdir().unwrap();
        let mut options = PressOptions {
            camera: Camera::default().coarser(4),
            ..PressOptions::default()
        };
        (options.object.material, options.seed) = (material, seed);
        let scene = PressScene::new(options).unwrap();
        let calibration = scene.calibrate(&CalibrationRun::default()).unwrap();
        let path = write_folder(&scene, &calibration, folder.path()).unwrap();
        let measured = Scene::measure_file(path).unwrap();
        let modulus = measured.youngs_modulus_pa.unwrap();
        let error = modulus.value / material.youngs_modulus_pa - 1.0;
        assert!(error.abs() < PAPER_ERROR, "error {error}");
        assert_eq!(modulus.estimator, EstimatorKind::HertzSphere);
        assert_eq!(measured.estimators[0].estimator, EstimatorKind::PaperRatio);
        // a/R above 0.3 has a flag.
        let mut flags = measured.flags.iter().map(ToString::to_string);
        assert!(flags.any(|flag| flag.contains("a/R")));
    }
}

/// A round blob that rises to `peak`.
fn blob(peak: f64) -> Array2<u8> {
    Array2::from_shape_fn((60, 80), |(r, c)| {
        let square = (c as f64 - 40.2).powi(2) + (r as f64 - 30.4).powi(2);
        (peak * (1.0 - square / 400.0).max(0.0).sqrt()).round() as u8
    })
}

fn write_image(path: impl AsRef<Path>, image: Array2<u8>) {
    write_grey_image(path.as_ref(), image.view()).unwrap();
}

/// A small valid scene: frames of 60 × 80 pixels with a bright round blob.
pub(crate) fn small_scene(folder: &Path) {
    write_image(
        folder.join("reference.png"),
        Array2::from_elem((60, 80), 10),
    );
    write_image(folder.join("one.png"), 10 + blob(100.0));
    write_image(folder.join("two.pgm"), 10 + blob(130.0));
    let pairs = "integrated_pixel_value,force_N\n0,0\n50000,0.5\n100000,1.0\n150000,1.5\n";
    fs::write(folder.join("pairs.csv"), pairs).unwrap();
    let depths = "darkness_grey_levels,depth_mm\n1,0.02\n60,1.9\n";
    fs::write(folder.join("depth.csv"), depths).unwrap();
}

pub(crate) const VALID: &str = r#"
reference = "reference.png"
pixel_size_m = [1e-4, 1e-4]
[calibration]
pairs = "pairs.csv"
[[frames]]
image = "one.png"
force_N = 0.8
[[frames]]
image = "two.pgm"
[object]
shape = "sphere"
radius_m = 0.02
poisson_ratio = 0.5
[waveguide]
layers = [{ refractive_index = 1.41, thickness_m = 0.1, youngs_modulus_pa = 1e7 }]
"#;

fn sentence(folder: &Path, text: &str) -> String {
    let path = folder.join("scene.toml");
    fs::write(&path, text).unwrap();
    match Scene::measure_file(&path) {
        Ok(measured) => match measured.youngs_modulus_pa {
            Ok(modulus) => format!("measured {}", modulus.value),
            Err(error) => Scene::read(&path).unwrap().measure_error(error).to_string(),
        },
        Err(error) => error.to_string(),
    }
}

#[test]
fn every_mistake_gets_one_sentence_with_file_and_field() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    small_scene(at);
    write_image(at.join("small.png"), Array2::from_elem((5, 7), 10));
    write_image(at.join("white.png"), Array2::from_elem((60, 80), 255));
    fs::write(at.join("short.csv"), "1,2\n").unwrap();
    let bad = "integrated_pixel_value,force_N\n1,2\n3,x\n";
    fs::write(at.join("bad.csv"), bad).unwrap();
    let mistakes = include_str!("mistakes.txt").lines();
    let mut from = String::new();
    for line in mistakes.filter(|line| !line.is_empty() && !line.starts_with('#')) {
        let line = line.replace('¶', "\n");
        let Some(mistake) = line.strip_prefix("    ") else {
            assert!(VALID.contains(&line), "{line} is in the valid file");
            from = line;
            continue;
        };
        let (to, wanted) = mistake.split_once("=> ").expect("a sentence");
        let answer = sentence(at, &VALID.replacen(&from, to.trim_end(), 1));
        for part in ["scene.toml"].into_iter().chain(wanted.split(" & ")) {
            assert!(
                answer.contains(part),
                "{from} -> {to}: `{part}` in: {answer}"
            );
        }
        assert!(!answer.contains('\n'), "one sentence: {answer}");
    }
}

#[test]
fn a_depth_table_needs_gauge_readings() {
    let folder = tempfile::tempdir().unwrap();
    small_scene(folder.path());
    let bright = Array2::from_elem((60, 80), 200);
    write_image(folder.path().join("bright.png"), bright.clone());
    write_image(folder.path().join("dark.png"), bright - blob(50.0));
    let text = VALID
        .replace("pairs = \"pairs.csv\"", "depth_table = \"depth.csv\"")
        .replace("reference.png", "bright.png")
        .replace("one.png", "dark.png")
        .replace("[[frames]]\nimage = \"two.pgm\"\n", "");
    let answer = sentence(folder.path(), &text);
    assert!(answer.starts_with("measured "), "{answer}");
    let answer = sentence(folder.path(), &text.replace("force_N = 0.8\n", ""));
    let named = answer.contains("frames[1].force_N") && answer.contains("gauge");
    assert!(named, "{answer}");
}

#[test]
fn a_missing_scene_file_is_named() {
    let error = Scene::read("/no/such/scene.toml").unwrap_err().to_string();
    assert!(error.contains("/no/such/scene.toml"), "{error}");
}

/// All results of a scene as text, except the times.
fn measured(scene: &Scene, pipeline: &Pipeline) -> String {
    let data = scene.load().unwrap();
    let press = scene.press(pipeline, &data).unwrap();
    let points: Vec<_> = press.control_points(1).unwrap().to_vec();
    let strain = press.strain(1).unwrap().summary.clone();
    format!("{points:?} {strain:?} {:?}", press.modulus().unwrap())
}

#[test]
fn stages_by_name_are_those_given_as_values() {
    let folder = tempfile::tempdir().unwrap();
    let made = PressScene::new(PressOptions {
        camera: Camera::default().coarser(8),
        ..PressOptions::default()
    });
    let made = made.unwrap();
    let calibration = made.calibrate(&CalibrationRun::default()).unwrap();
    let path = write_folder(&made, &calibration, folder.path()).unwrap();
    let text = fs::read_to_string(&path).unwrap();
    // Without the estimator chosen by the simulator.
    let text = text.replace("[stages]\nestimator = \"sphere\"\n", "");
    fs::write(&path, &text).unwrap();
    let scene_of =
        |table: &str| Scene::parse(&format!("{text}\n[stages]\n{table}"), &path).unwrap();
    let by_name = |table: &str| {
        let scene = scene_of(table);
        measured(&scene, &scene.pipeline(&scene.load().unwrap()).unwrap())
    };
    let scene = Scene::read(&path).unwrap();
    let data = scene.load().unwrap();
    let of_scene = scene.pipeline(&data).unwrap();
    let LoadedCalibration::Pairs(pairs) = &data.calibration else {
        panic!("pairs")
    };
    let pipeline = Pipeline::from_pairs(pairs, scene.pixel_size_m, scene.object).unwrap();
    let waveguide = of_scene.settings().waveguide.clone();
    let pipeline = pipeline
        .with_settings(|settings| settings.waveguide = waveguide)
        .unwrap();
    // `{:?}` prints every bit of a number.
    assert_eq!(by_name(""), measured(&scene, &pipeline));
    let named = by_name("sampler = \"equally-spaced\"\nwarp = \"affine\"\nstrain = \"hencky\"");
    let swapped = pipeline.with_sampler(EquallySpaced);
    let swapped = swapped.with_warp(AffineModel::General).with_strain(Hencky);
    assert_eq!(named, measured(&scene, &swapped));
    let printed = scene_of("as_printed = true\nmatcher = \"coherent-point-drift\"");
    let expected = StagesConfig {
        matcher: MatcherChoice::CoherentPointDrift,
        ..StagesConfig::as_printed()
    };
    assert_eq!(printed.stages, expected);
    let ratio = scene_of("estimator = \"paper-ratio\"")
        .pipeline(&data)
        .unwrap();
    assert_eq!(ratio.estimator().unwrap().kind(), EstimatorKind::PaperRatio);
    let heights = |name: &str| {
        let scene = scene_of(&format!("reconstruction = \"{name}\""));
        let pipeline = scene.pipeline(&data).unwrap();
        let press = scene.press(&pipeline, &data).unwrap();
        press.surface(1).unwrap().surface.heights.clone()
    };
    assert!(heights("tsai-shah") != heights("eikonal"));
}

#[test]
fn a_flat_field_is_asked_for_by_its_key() {
    let folder = tempfile::tempdir().unwrap();
    small_scene(folder.path());
    for (text, wanted) in [
        (VALID.to_string(), false),
        (format!("flat_field = \"reference\"{VALID}"), true),
    ] {
        let scene = Scene::parse(&text, folder.path().join("scene.toml")).unwrap();
        assert_eq!(scene.flat_field, wanted);
        let pipeline = scene.pipeline(&scene.load().unwrap()).unwrap();
        assert_eq!(pipeline.settings().flat_field, wanted);
    }
}

#[test]
fn a_gauge_alone_gives_force_contact_and_modulus() {
    let folder = tempfile::tempdir().unwrap();
    small_scene(folder.path());
    let gauged = VALID
        .replace(
            "[calibration]\npairs = \"pairs.csv\"\n",
            "gauge_error = \"exact\"\n",
        )
        .replace(
            "image = \"two.pgm\"",
            "image = \"two.pgm\"\nforce_N = 1.1\nforce_error_N = 0.02",
        );
    let path = folder.path().join("scene.toml");
    fs::write(&path, &gauged).unwrap();
    let measured = Scene::measure_file(&path).unwrap();
    let force = |frame: usize| {
        let force = measured.frames[frame].as_ref().unwrap().force_n.clone();
        force.map(|f| (f.value, f.standard_error)).unwrap()
    };
    assert_eq!([force(0), force(1)], [(0.8, 0.0), (1.1, 0.02)]);
    fs::write(&path, VALID).unwrap();
    let calibrated = Scene::measure_file(&path).unwrap();
    let radius = |m: &Measurement| m.frames[0].as_ref().unwrap().contact_radius_m;
    // The contact is detected from the light.
    assert_eq!(radius(&measured), radius(&calibrated));
    assert!(measured.youngs_modulus_pa.is_ok());
    // One frame has no force: a calibration is missing.
    let half = gauged.replace("force_N = 1.1\nforce_error_N = 0.02", "");
    assert!(sentence(folder.path(), &half).contains("`calibration`: it is missing"));
}

#[test]
fn a_waveguide_can_be_rigid() {
    let layers = "[waveguide]\nlayers = [{ refractive_index = 1.41, thickness_m = 0.1, \
                  youngs_modulus_pa = 1e7 }]\n";
    let without = VALID.replace(layers, "");
    for text in [without.clone(), format!("waveguide = \"rigid\"\n{without}")] {
        assert!(Scene::parse(&text, "scene.toml").unwrap().layers.is_empty());
    }
    let wrong = Scene::parse(&format!("waveguide = \"soft\"\n{without}"), "scene.toml");
    let wrong = wrong.unwrap_err().to_string();
    assert!(wrong.contains("expected a table with `layers`"), "{wrong}");
}

#[test]
fn what_a_stage_cannot_do_withholds_nothing_of_the_others() {
    let folder = tempfile::tempdir().unwrap();
    small_scene(folder.path());
    let path = folder.path().join("scene.toml");
    // The law of a flat punch needs depths, which light does not give.
    let text = VALID
        .replace("shape = \"sphere\"", "shape = \"flat_punch\"")
        .replace("[object]", "[stages]\nestimator = \"flat-punch\"\n[object]");
    fs::write(&path, text).unwrap();
    let measured = Scene::measure_file(&path).unwrap();
    assert!(matches!(
        measured.youngs_modulus_pa,
        Err(PipelineError::Modulus(_))
    ));
    for frame in &measured.frames {
        let frame = frame.as_ref().unwrap();
        assert!(frame.force_n.is_ok() && frame.surface_height_m.is_ok());
    }
    assert!(measured.strain.is_ok() && measured.matching.is_ok());
    assert!(
        !measured.estimators.is_empty(),
        "stress over strain has an answer"
    );
    let json = serde_json::to_value(&measured).unwrap();
    assert!(json["youngs_modulus_pa"]["error"].is_string());
    assert!(json["strain"]["mean"].is_array());
    assert!(json["frames"][0]["force_n"]["value"].is_number());
    // An empty frame in the middle affects only its own results.
    let text = VALID.replace("image = \"two.pgm\"", "image = \"reference.png\"");
    fs::write(&path, text).unwrap();
    let measured = Scene::measure_file(&path).unwrap();
    assert!(measured.frames[0].is_ok());
    assert_eq!(
        measured.frames[1],
        Err(PipelineError::NoContact { frame: 1 })
    );
    assert!(measured.strain.is_err() && measured.youngs_modulus_pa.is_err());
}
