//! Presses of flat faces.
use criterion::Criterion;
use tactile_imaging::force::CalibrationPair;
use tactile_imaging::{Object, Pipeline};
use tactile_simulate::{PressOptions, PressScene, SurfacePattern, UniaxialOptions, UniaxialScene};

/// All results of two frames of a flat face that is as large as the ball's larger contact, plain
/// and speckled, for comparison with `everything_of_two_frames`.
pub(crate) fn flat_faces(c: &mut Criterion) {
    let ball = PressScene::new(PressOptions::default()).expect("default options");
    let side_m = ball.truth(1).contact.contact_radius_m * std::f64::consts::PI.sqrt();
    let smooth = SurfacePattern {
        bump_height_m: [0.0; 2],
        ..SurfacePattern::default()
    };
    let mut group = c.benchmark_group("pipeline");
    group.sample_size(10);
    for (name, pattern) in [("plain", smooth), ("speckled", SurfacePattern::default())] {
        let scene = UniaxialScene::new(UniaxialOptions {
            pattern,
            face_m: [side_m; 2],
            forces_n: vec![0.3, 0.6],
            ..UniaxialOptions::default()
        });
        let scene = scene.expect("a face");
        let camera = scene.options().camera;
        let newtons_per_grey =
            camera.pixel_size_m.iter().product::<f64>() / scene.grey_per_pascal();
        let pairs = [0.0, 1e7, 2e7, 3e7, 4e7]
            .map(|sum| CalibrationPair::loading(sum, newtons_per_grey * sum));
        let block = Object::Block { poisson_ratio: 0.5 };
        let pipeline = Pipeline::from_pairs(&pairs, camera.pixel_size_m, block).expect("a sensor");
        let (reference, frames) = (scene.reference(0), [0, 1].map(|load| scene.frame(load, 0)));
        let measure = || {
            let mut press = pipeline.press(reference.view()).expect("a reference");
            for frame in &frames {
                press.add_frame(frame.view());
            }
            press.measure()
        };
        let modulus = measure().youngs_modulus_pa.expect("a modulus").value;
        let error = 100.0 * (modulus / scene.options().material.youngs_modulus_pa - 1.0);
        assert!(
            error.abs() < 3.0,
            "modulus error of a {name} face {error} %"
        );
        group.bench_function(format!("everything_of_a_{name}_face"), |b| b.iter(measure));
    }
    group.finish();
}
