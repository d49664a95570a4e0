//! The consistency of the scene simulator.
mod noise;
mod recorded;
mod series;
mod tabulated;
mod uniaxial;

use proptest::prelude::*;
use std::f64::consts::PI;
use tactile_simulate::{
    CalibrationRun, Camera, ContactModel, Elastic, ElasticSphere, Gain, PressLoad, PressOptions,
    PressScene, Response, SimulateError,
};

/// The default scene with pixels wider by this factor.
fn coarser(factor: usize) -> PressOptions {
    PressOptions {
        camera: Camera::default().coarser(factor),
        ..PressOptions::default()
    }
}

fn small() -> PressOptions {
    coarser(4)
}

/// The default scene without noise, blur and vignetting.
fn ideal() -> PressOptions {
    let mut options = small();
    options.camera = options.camera.ideal();
    options
}

fn relative(found: f64, expected: f64) -> f64 {
    (found / expected - 1.0).abs()
}

/// Light above the background.
fn light(scene: &PressScene, load: usize) -> f64 {
    let background = scene.options().camera.background_grey;
    let frame = scene.expected_frame(load);
    frame.iter().map(|v| v - background).sum()
}

#[test]
fn the_light_of_an_ideal_frame_integrates_as_hertz_says() {
    for (response, tolerance) in [
        (Response::Linear, 1e-12),
        (Response::Quadratic { droop: 0.2 }, 1e-12),
        (Response::Power { exponent: 0.8 }, 1e-4),
        (Response::Power { exponent: 1.3 }, 1e-4),
    ] {
        let mut options = ideal();
        options.camera.pixel_size_m = [90e-6, 75e-6];
        options.centre_px = Some([170.37, 131.8]);
        options.response = response;
        let scene = PressScene::new(options).unwrap();
        let area = scene.options().camera.pixel_size_m.iter().product::<f64>();
        let largest = scene.truth(1).contact.peak_pressure_pa;
        for (k, force) in [(0, 0.7), (1, 1.2)] {
            let truth = scene.truth(k);
            let (a, p0) = (
                truth.contact.contact_radius_m,
                truth.contact.peak_pressure_pa,
            );
            // ∫ (1 − r²/a²)^{n/2} dS = πa²/(1 + n/2).
            let disc = |n: f64| PI * a * a / (1.0 + 0.5 * n);
            let seen = match response {
                // The curvature of the response is relative to the peak of the largest load.
                Response::Quadratic { droop } => force - droop / largest * p0 * p0 * disc(2.0),
                Response::Power { exponent } => {
                    largest * (p0 / largest).powf(exponent) * disc(exponent)
                }
                _ => force,
            };
            // 10⁵ pixels of up to 215 grey levels, each rounded to 1 ulp (3e-14), relative to a sum
            // of 10⁶: below 1e-13.
            let expected = seen * truth.grey_per_pascal / area;
            assert!(
                relative(light(&scene, k), expected) < tolerance,
                "{response:?}"
            );
            assert!(relative(truth.integrated_pixel_value, expected) < tolerance);
            assert!(relative(truth.visible_force_n, force) < 1e-12);
            assert!(relative(truth.pressure_pa().sum() * area, force) < 1e-12);
            for axis in 0..2 {
                let error = truth.centroid_px[axis] - [170.37, 131.8][axis];
                // Rim pixels are evaluated at their centres, which shifts the centroid by about
                // 1e-5 px.
                assert!(error.abs() < 1e-4, "{error}");
            }
        }
        let brightest = scene.expected_frame(1).iter().copied().fold(0.0, f64::max);
        // The gain determines the peak of the largest load, apart from the curvature within one
        // pixel.
        assert!((brightest - 215.0).abs() < 0.1, "{brightest}");
    }
}

#[test]
fn blur_keeps_force_and_centroid_and_reaches_in_from_beyond_the_edge() {
    let mut options = ideal();
    options.camera.blur_sigma_px = 3.0;
    options.centre_px = Some([171.3, 120.4]);
    let background = options.camera.background_grey;
    let blurred = PressScene::new(options.clone()).unwrap();
    let sum = light(&blurred, 0);
    assert!(relative(sum, blurred.truth(0).integrated_pixel_value) < 1e-12);
    let columns = blurred.expected_frame(0);
    let columns = columns
        .indexed_iter()
        .map(|((_, c), v)| (v - background) * c as f64);
    let x = columns.sum::<f64>() / sum;
    assert!(
        (x - 171.3).abs() < 1e-4,
        "rim pixels shift the centroid by some 1e-5 px"
    );
    // A contact whose rim is just left of the frame still brightens the first column.
    let radius_px = blurred.truth(0).contact.contact_radius_m / options.camera.pixel_size_m[0];
    options.centre_px = Some([-radius_px - 1.5, 120.4]);
    let beyond = PressScene::new(options).unwrap();
    assert_eq!(beyond.truth(0).visible_force_n, 0.0);
    assert!(beyond.expected_frame(0)[[120, 0]] > background + 0.1);
}

#[test]
fn the_apparent_surface_scales_with_the_cube_root_of_the_force() {
    let truth = PressScene::new(small()).unwrap().simulate().truth;
    let map = truth[0].scaling_to(&truth[1]);
    assert!(relative(map.scale, (1.2_f64 / 0.7).cbrt()) < 1e-14);
    let (height0, height1) = (truth[0].apparent_height_m(), truth[1].apparent_height_m());
    // The middle of the frame is the centre, half a pixel from the nearest pixel centre.
    assert!(relative(height1[[130, 174]] / height0[[130, 174]], map.scale) < 1e-3);
    let strain = map.green_lagrange_strain()[(2, 2)];
    assert!(relative(strain, 0.5 * ((1.2_f64 / 0.7).powf(2.0 / 3.0) - 1.0)) < 1e-13);
}

#[test]
fn a_brighter_gain_saturates_and_no_force_is_no_light() {
    let mut options = ideal();
    options.gain = Gain::PeakGrey(400.0);
    let scene = PressScene::new(options).unwrap();
    let truth = scene.truth(1);
    assert!(truth.saturated_pixels > 1000);
    // Light of 254.5 and more is also rounded to 255.
    let bright = scene.frame(1, 0).iter().filter(|&&v| v == 255).count();
    assert!(bright >= truth.saturated_pixels && bright < truth.saturated_pixels + 100);
    let loads = vec![PressLoad::normal(0.0)];
    let made = PressScene::new(PressOptions { loads, ..ideal() })
        .unwrap()
        .simulate();
    assert_eq!(made.frames[0], made.reference);
    assert_eq!(made.truth[0].visible_force_n, 0.0);
    assert!(made.truth[0].centroid_px[0].is_nan());
}

/// A gain that suits the low pressure of a large soft ball is too high for a small rigid ball: its
/// sums are not proportional to the force.
#[test]
fn a_calibration_that_saturates_is_refused_and_says_what_helps() {
    let object = ElasticSphere {
        radius_m: 20e-3,
        material: Elastic::CL2003X,
    };
    let scene = PressScene::new(PressOptions { object, ..small() }).unwrap();
    let options = CalibrationRun::default();
    let error = scene.calibrate(&options).unwrap_err();
    assert!(
        matches!(error, SimulateError::CalibrationSaturates { force_n } if force_n < 1.0),
        "{error}"
    );
    assert!(error.to_string().contains("a larger indenter"), "{error}");
    let larger = scene.unsaturated(options).unwrap();
    assert!(larger.indenter.radius_m > options.indenter.radius_m);
    assert!(scene.calibrate(&larger).is_ok());
}

#[test]
fn every_meaningless_value_is_named() {
    let spoiled = |spoil: &dyn Fn(&mut PressOptions)| {
        let mut options = small();
        spoil(&mut options);
        PressScene::new(options).err()
    };
    let named = |name: &str, values: &[f64], spoil: fn(&mut PressOptions, f64)| {
        for &value in values.iter().chain(&[f64::NAN]) {
            match spoiled(&|o| spoil(o, value)) {
                Some(SimulateError::OutOfRange { field, .. }) => assert_eq!(field, name),
                other => panic!("{name} = {value} gave {other:?}"),
            }
        }
    };
    const INF: f64 = f64::INFINITY;
    named("radius_m", &[0.0, -1.0, INF], |o, v| o.object.radius_m = v);
    named("youngs_modulus_pa", &[0.0, -1.0], |o, v| {
        o.object.material.youngs_modulus_pa = v;
    });
    named("poisson_ratio", &[-1.0, 0.6], |o, v| {
        o.object.material.poisson_ratio = v;
    });
    named("thickness_m", &[0.0, INF], |o, v| {
        o.waveguide.layers[1].thickness_m = v;
    });
    named("refractive_index", &[0.9], |o, v| {
        o.waveguide.layers[1].refractive_index = v;
    });
    named("the force in N", &[-0.1, INF], |o, v| {
        o.loads[1].force_n = v
    });
    named("shear_n", &[INF], |o, v| o.loads[0].shear_n[1] = v);
    named("shear_stiffness_n_per_m", &[0.0], |o, v| {
        o.shear_stiffness_n_per_m[0] = v;
    });
    named("pixel_size_m", &[0.0], |o, v| o.camera.pixel_size_m[1] = v);
    named("background_grey", &[-1.0], |o, v| {
        o.camera.background_grey = v;
    });
    named("vignetting", &[-0.1, 1.1], |o, v| o.camera.vignetting = v);
    named("blur_sigma_px", &[-0.1, 1e6], |o, v| {
        o.camera.blur_sigma_px = v;
    });
    named("full_well_electrons", &[0.0], |o, v| {
        o.camera.full_well_electrons = v;
    });
    named("read_noise_grey", &[-1.0, INF], |o, v| {
        o.camera.read_noise_grey = v;
    });
    let too_few: [fn(&mut PressOptions); 3] = [
        |o| o.loads.clear(),
        |o| o.waveguide.layers.clear(),
        |o| o.camera.shape = [0, 3],
    ];
    for spoil in too_few {
        assert!(matches!(
            spoiled(&spoil),
            Some(SimulateError::TooFew { .. })
        ));
    }
    let refused: [fn(&mut PressOptions); 7] = [
        |o| o.gain = Gain::PeakGrey(f64::NAN),
        |o| o.response = Response::Quadratic { droop: 0.51 },
        |o| o.response = Response::Power { exponent: 0.2 },
        |o| o.response = Response::Power { exponent: f64::NAN },
        |o| o.law = ContactModel::Tabulated(vec![]),
        |o| o.centre_px = Some([f64::NAN, 0.0]),
        |o| o.loads[0].illumination.level = -1.0,
    ];
    assert!(refused.iter().all(|spoil| spoiled(spoil).is_some()));
    assert!(spoiled(&|o| o.object.material = Elastic::RIGID).is_none());
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..ProptestConfig::default() })]

    /// Every scene, however unusual its frame, gives frames of the right size. The visible force
    /// lies between zero and the force, and the light is that of the visible force unless it is
    /// clipped.
    #[test]
    fn any_scene_keeps_its_books(
        shape in (1_usize..60, 1_usize..60),
        pixel in (1e-5_f64..1e-3, 1e-5_f64..1e-3),
        centre in (-80.0_f64..140.0, -80.0_f64..140.0),
        force in 0.0_f64..3.0,
        radius_m in 1e-4_f64..2e-2,
        youngs_modulus_pa in 1e3_f64..1e9,
        blur_sigma_px in 0.0_f64..3.0,
        seed in any::<u64>(),
    ) {
        let camera = Camera {
            shape: shape.into(),
            pixel_size_m: pixel.into(),
            blur_sigma_px,
            vignetting: 0.0,
            ..Camera::default()
        };
        let material = Elastic { youngs_modulus_pa, poisson_ratio: 0.4 };
        let scene = PressScene::new(PressOptions {
            object: ElasticSphere { radius_m, material },
            loads: vec![PressLoad::normal(force)],
            centre_px: Some(centre.into()),
            camera,
            seed,
            ..PressOptions::default()
        }).unwrap();
        let made = scene.simulate();
        prop_assert_eq!(made.frames[0].dim(), shape);
        let truth = &made.truth[0];
        prop_assert!(truth.visible_force_n >= 0.0 && truth.visible_force_n <= force * (1.0 + 1e-9));
        let carried = light(&scene, 0) * camera.pixel_size_m.iter().product::<f64>();
        // Blur moves light across the edge, but does not create any.
        let most = force * truth.grey_per_pascal;
        prop_assert!(carried >= -1e-9 * most.max(1e-12) && carried <= most * (1.0 + 1e-9) + 1e-12);
        if blur_sigma_px == 0.0 {
            let visible = truth.visible_force_n * truth.grey_per_pascal;
            prop_assert!((carried - visible).abs() <= 1e-9 * most);
        }
    }
}
