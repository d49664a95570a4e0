//! The scenes whose results are recorded.
use super::Answers;
use super::readings::{contact, estimates, modulus, press, tensor};
use crate::common::press_of;
use ndarray::Array2;
use tactile_files::scene::Scene;
use tactile_imaging::elasticity::modulus::{FlatPunch, HertzSphere, PaperRatio, StrainReference};
use tactile_imaging::force::{CalibrationPair, Estimate, Source};
use tactile_imaging::pipeline::{
    DarkContact, EstimatorChoice, MatcherChoice, Object, Pipeline, ReconstructionChoice, Session,
    StagesConfig, StrainChoice, SurfaceInput, WarpChoice,
};
use tactile_simulate::{
    CalibrationRun, Camera, Elastic, ElasticSphere, Gain, PressOptions, PressScene, Trial,
    UniaxialOptions, UniaxialScene, write_folder,
};

pub(super) fn all(answers: &mut Answers) {
    ball(answers);
    block(answers);
    dark(answers);
    stages_by_name(answers);
    stream(answers);
    scene_file(answers);
}

/// A camera of 174 × 130 pixels on 30 mm × 22 mm.
fn coarse() -> Camera {
    Camera {
        shape: [130, 174],
        pixel_size_m: [172.4e-6; 2],
        ..Camera::default()
    }
}

fn trial(forces: &[f64], seed: u64) -> Trial {
    crate::common::trial(coarse(), forces, seed)
}

fn ball(answers: &mut Answers) {
    answers.scene = "ball";
    let trial = trial(&[0.7, 1.2], 1);
    let pipeline = trial
        .pipeline()
        .expect("a pipeline")
        .with_control_points(100);
    let mut measured = trial.press(&pipeline).expect("a press");
    press(answers, "", &mut measured);
    estimates(answers, &mut measured);
    let everything = measured.measure();
    answers.add("flags", [everything.flags.len() as f64]);
}

/// A patterned block between plates: its shape is unknown, and the modulus is stress over strain.
fn block(answers: &mut Answers) {
    answers.scene = "block";
    let scene = UniaxialScene::new(UniaxialOptions {
        camera: Camera {
            shape: [120, 120],
            pixel_size_m: [14e-3 / 120.0; 2],
            ..Camera::default()
        },
        gain: Gain::PeakGrey(180.0),
        ..UniaxialOptions::default()
    })
    .expect("a scene");
    let per_grey =
        scene.options().camera.pixel_size_m.iter().product::<f64>() / scene.grey_per_pascal();
    let pairs = [0.0, 1e5, 2e5, 3e5].map(|value| CalibrationPair::loading(value, per_grey * value));
    let object = Object::Unknown { poisson_ratio: 0.5 };
    let pixel_size_m = scene.options().camera.pixel_size_m;
    let pipeline = Pipeline::from_pairs(&pairs, pixel_size_m, object)
        .expect("a pipeline")
        .with_settings(|settings| settings.state_exact())
        .expect("settings")
        .with_control_points(60);
    let reference = scene.reference(0);
    let frames = [0, 1, 2].map(|load| scene.frame(load, 0));
    let mut measured = press_of(&pipeline, reference.view(), frames);
    press(answers, "", &mut measured);
    estimates(answers, &mut measured);
}

fn exactly(value: f64) -> Estimate {
    Estimate::new(value, 0.0)
}

/// A sensor that darkens with depth, with forces from a gauge.
fn dark(answers: &mut Answers) {
    answers.scene = "dark";
    let table = [(0.0, 0.0), (50.0, 0.2e-3), (200.0, 1e-3)];
    let pixel_m = 0.1e-3;
    // A ball of 4 mm. The grey values are rounded, and repeated noise prevents regions of constant
    // level.
    let frame = |depth_m: f64| {
        Array2::from_shape_fn((90, 100), |(row, column)| {
            let (x, y) = (
                pixel_m * (column as f64 - 51.3),
                pixel_m * (row as f64 - 44.8),
            );
            let depth = (depth_m - (4e-3 - (16e-6_f64 - x * x - y * y).max(0.0).sqrt())).max(0.0);
            let level = if depth < 0.2e-3 {
                depth / 0.2e-3 * 50.0
            } else {
                50.0 + (depth - 0.2e-3) / 0.8e-3 * 150.0
            };
            220 - (level + ((7 * row + 3 * column) % 5) as f64 * 0.2).floor() as u8
        })
    };
    let contact = DarkContact::new(&table, [pixel_m; 2]).expect("a table");
    let depths = DarkContact::depth_table(&table).expect("a table");
    let punch = Object::FlatPunch {
        radius_m: 2e-3,
        poisson_ratio: 0.45,
    };
    for (name, object) in [("ball/", Object::sphere(4e-3)), ("punch/", punch)] {
        let pipeline = Pipeline::new(contact.clone(), object)
            .expect("a pipeline")
            .with_surface(depths.clone(), SurfaceInput::Signal)
            .with_settings(|settings| {
                settings.assumptions.state(Source::Gain, 0.01);
                settings.assumptions.state(Source::PixelSize, 0.002);
            })
            .expect("errors")
            .with_control_points(80);
        let pipeline = match name {
            "punch/" => pipeline.with_estimator(FlatPunch::new(2e-3, 0.45).expect("a punch")),
            _ => pipeline.with_estimator(HertzSphere::new(4e-3, 0.5).expect("a ball")),
        };
        let (reference, frames) = (frame(0.0), [frame(0.4e-3), frame(0.6e-3)]);
        let mut measured = pipeline.press(reference.view()).expect("a press");
        measured.add_gauged_frame(frames[0].view(), Some(exactly(0.4)));
        measured.add_gauged_frame(frames[1].view(), Some(exactly(0.8)));
        press(answers, name, &mut measured);
        let name = format!("{name}modulus");
        modulus(answers, &name, &measured.modulus().expect("a modulus"));
    }
}

/// Every stage that a configuration can name, one at a time.
fn stages_by_name(answers: &mut Answers) {
    answers.scene = "by name";
    let trial = trial(&[0.7, 1.2], 2);
    let default = StagesConfig {
        // The law of the simulated contacts.
        estimator: EstimatorChoice::Sphere,
        ..StagesConfig::default()
    };
    let mut configs: Vec<(&str, StagesConfig)> = Vec::new();
    let mut choose = |name, set: &dyn Fn(&mut StagesConfig)| {
        let mut config = default;
        set(&mut config);
        configs.push((name, config));
    };
    let surface = ReconstructionChoice::TsaiShah;
    choose(surface.into(), &|config| config.reconstruction = surface);
    for choice in [
        MatcherChoice::RelaxationLabelling,
        MatcherChoice::CoherentPointDrift,
        MatcherChoice::LinearAssignment,
        MatcherChoice::NearestNeighbour,
    ] {
        choose(choice.into(), &|config| config.matcher = choice);
    }
    for choice in [
        WarpChoice::ThinPlateSpline,
        WarpChoice::CubicSpline,
        WarpChoice::Rigid,
    ] {
        choose(choice.into(), &|config| config.warp = choice);
    }
    for choice in [
        StrainChoice::EulerAlmansi,
        StrainChoice::Hencky,
        StrainChoice::Biot,
        StrainChoice::Infinitesimal,
    ] {
        choose(choice.into(), &|config| config.strain = choice);
    }
    let ratio = EstimatorChoice::PaperRatio;
    choose(ratio.into(), &|config| config.estimator = ratio);
    for (name, config) in configs {
        let pipeline = trial
            .pipeline()
            .and_then(|pipeline| pipeline.with_stages(&config))
            .expect("a pipeline")
            .with_control_points(40);
        let measured = trial.press(&pipeline).expect("a press");
        let heights = &measured.surface(1).expect("a surface").surface.heights;
        let heights: Vec<f64> = heights.iter().copied().filter(|h| h.is_finite()).collect();
        answers.add(
            format!("{name}/height sum"),
            [heights.iter().map(|h| h.abs()).sum::<f64>()],
        );
        let points = measured.control_points(1).expect("points");
        answers.add(
            format!("{name}/points"),
            points.iter().step_by(9).flat_map(|p| [p.x, p.y, p.z]),
        );
        let partners = &measured.matching(1).expect("a match").assignment;
        answers.add(
            format!("{name}/partners"),
            partners.iter().map(|a| a.map_or(-1.0, |j| j as f64)),
        );
        let strain = measured.strain(1).map(|strain| strain.summary.mean);
        answers.add(format!("{name}/strain"), strain.iter().flat_map(tensor));
        let found = measured.modulus().expect("a modulus");
        modulus(answers, &format!("{name}/modulus"), &found);
    }
}

/// A stream whose strain is followed.
fn stream(answers: &mut Answers) {
    answers.scene = "stream";
    let trial = trial(&[0.7, 0.9, 1.2, 1.0], 3);
    let pipeline = trial
        .pipeline()
        .expect("a pipeline")
        .with_control_points(60);
    let ratio = PaperRatio::default().with_reference(StrainReference::FirstLoad);
    let ratio = ratio.with_sphere_radius(3e-3).expect("a ball");
    let ratio = pipeline.clone().with_estimator(ratio);
    let reference = || trial.simulation.reference.view();
    let mut session = Session::new(&pipeline, &[reference()]).expect("a session");
    let mut by_strain = Session::new(&ratio, &[reference()]).expect("a session");
    session
        .push(trial.scene.reference(9).view())
        .expect("an update");
    answers.add("drift", [session.drift().last_grey]);
    for (number, frame) in trial.simulation.frames.iter().enumerate() {
        let name = format!("frame {number}");
        by_strain.push(frame.view()).expect("an update");
        by_strain.strain().expect("a strain");
        let reading = session
            .push(frame.view())
            .expect("an update")
            .contact
            .expect("a contact");
        contact(answers, &name, &reading);
        if let Some(found) = session.strain().expect("a strain") {
            answers.add(format!("{name}/matched"), [found.matched as f64]);
            answers.add(format!("{name}/residual"), [found.report.residual]);
            answers.add(format!("{name}/strain"), tensor(&found.strain.summary.mean));
            answers.add(
                format!("{name}/strain error"),
                tensor(&found.strain.summary.standard_error),
            );
        }
    }
    for (name, mut session) in [("modulus", session), ("modulus by strain", by_strain)] {
        modulus(answers, name, &session.modulus().expect("a modulus"));
    }
}

/// A scene file with its images, measured as by a user.
fn scene_file(answers: &mut Answers) {
    answers.scene = "scene file";
    let options = PressOptions {
        camera: coarse(),
        object: ElasticSphere {
            radius_m: 20e-3,
            material: Elastic::CL2003X,
        },
        seed: 4,
        ..PressOptions::default()
    };
    let made = PressScene::new(options).expect("a scene");
    let folder = tempfile::tempdir().expect("a folder");
    // A ball as small as the object would saturate the camera.
    let calibration = made
        .unsaturated(CalibrationRun::default())
        .and_then(|options| made.calibrate(&options))
        .expect("an indenter that does not saturate");
    let path = write_folder(&made, &calibration, folder.path()).expect("files");
    let scene = Scene::read(&path).expect("a scene");
    let data = scene.load().expect("its files");
    let pipeline = scene
        .pipeline(&data)
        .expect("its pipeline")
        .with_control_points(60);
    let mut measured = scene.press(&pipeline, &data).expect("a press");
    press(answers, "", &mut measured);
    estimates(answers, &mut measured);
}
