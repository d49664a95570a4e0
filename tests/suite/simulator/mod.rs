//! The scene simulator against itself: its truth is consistent.
mod noise;
mod tabulated;

use ndarray::Array2;
use tactile_simulate::{
    CalibrationRun, Camera, ContactModel, Elastic, ElasticSphere, Gain, Illumination, PressLoad,
    PressOptions, PressScene, Response, SimulateError,
};

/// The default scene on a quarter of the pixels a side.
fn small() -> PressOptions {
    let camera = Camera::default().coarser(4);
    PressOptions {
        camera,
        ..PressOptions::default()
    }
}

fn relative(found: f64, expected: f64) -> f64 {
    (found / expected - 1.0).abs()
}

#[test]
fn the_light_of_an_ideal_frame_sums_to_the_force() {
    let mut options = small();
    options.camera = Camera {
        pixel_size_m: [90e-6, 75e-6],
        ..options.camera.ideal()
    };
    options.centre_px = Some([170.37, 131.8]);
    let background = options.camera.background_grey;
    let scene = PressScene::new(options).unwrap();
    for (k, force) in [(0, 0.7), (1, 1.2)] {
        let truth = scene.truth(k);
        let light: f64 = scene.expected_frame(k).iter().map(|v| v - background).sum();
        let area = scene.options().camera.pixel_size_m.iter().product::<f64>();
        // 10⁵ pixels of up to 215 grey levels, each rounded to 1 ulp (3e-14), against a sum of 10⁶:
        // below 1e-13.
        assert!(relative(light * area / scene.truth(0).grey_per_pascal, force) < 1e-12);
        assert!(relative(light, truth.integrated_pixel_value) < 1e-12);
        assert!(relative(truth.visible_force_n, force) < 1e-12);
        assert!(relative(truth.pressure_pa().sum() * area, force) < 1e-12);
        for axis in 0..2 {
            let error = truth.centroid_px[axis] - [170.37, 131.8][axis];
            // Rim pixels are weighed at their centres, which shifts the centroid by some 1e-5 px.
            assert!(error.abs() < 1e-4, "{error}");
        }
    }
}

#[test]
fn the_bent_response_integrates_exactly() {
    let mut options = small();
    options.camera = options.camera.ideal();
    options.response = Response::Quadratic { droop: 0.2 };
    let (area, background) = (
        options.camera.pixel_size_m.iter().product::<f64>(),
        options.camera.background_grey,
    );
    let scene = PressScene::new(options).unwrap();
    for k in 0..2 {
        let contact = scene.truth(k).contact;
        let (p0, a) = (contact.peak_pressure_pa, contact.contact_radius_m);
        // ∫ p² dS = π a² p₀²/2.
        let squared = 0.5 * std::f64::consts::PI * a * a * p0 * p0;
        // The response bends relative to the largest load's peak: κ/p_max.
        let droop_per_pascal = 0.2 / scene.truth(1).contact.peak_pressure_pa;
        let expected =
            scene.truth(0).grey_per_pascal * (contact.force_n - droop_per_pascal * squared) / area;
        let light: f64 = scene.expected_frame(k).iter().map(|v| v - background).sum();
        assert!(relative(light, expected) < 1e-12);
        assert!(relative(scene.truth(k).integrated_pixel_value, expected) < 1e-12);
    }
    let brightest = scene.expected_frame(1).iter().copied().fold(0.0, f64::max);
    // The largest load's peak is where the gain put it, less the curvature within one pixel.
    assert!((brightest - 215.0).abs() < 0.1, "{brightest}");
}

#[test]
fn light_as_a_power_of_the_pressure_integrates_as_hertz_says() {
    for exponent in [0.8, 1.0, 1.3] {
        let mut options = small();
        options.camera = options.camera.ideal();
        options.response = Response::Power { exponent };
        let scene = PressScene::new(options).unwrap();
        let area = scene.options().camera.pixel_size_m.iter().product::<f64>();
        let largest = scene.truth(1).contact.peak_pressure_pa;
        for k in 0..2 {
            let contact = scene.truth(k).contact;
            let a = contact.contact_radius_m;
            // ∫ (1 − r²/a²)^{n/2} dS = πa²/(1 + n/2).
            let disc = std::f64::consts::PI * a * a / (1.0 + 0.5 * exponent);
            let peak = largest * (contact.peak_pressure_pa / largest).powf(exponent);
            let expected = scene.truth(0).grey_per_pascal * peak * disc / area;
            let found = scene.truth(k).integrated_pixel_value;
            assert!(
                relative(found, expected) < 1e-4,
                "n = {exponent}: {found} {expected}"
            );
        }
    }
}

#[test]
fn blur_keeps_force_and_centroid_and_reaches_in_from_beyond_the_edge() {
    let mut options = small();
    options.camera = Camera {
        blur_sigma_px: 3.0,
        ..options.camera.ideal()
    };
    options.centre_px = Some([171.3, 120.4]);
    let background = options.camera.background_grey;
    let blurred = PressScene::new(options.clone()).unwrap();
    let moments = |image: &Array2<f64>| {
        let (mut s, mut x) = (0.0, 0.0);
        for ((_, c), v) in image.indexed_iter() {
            s += v - background;
            x += (v - background) * c as f64;
        }
        (s, x / s)
    };
    let (sum, x) = moments(&blurred.expected_frame(0));
    assert!(relative(sum, blurred.truth(0).integrated_pixel_value) < 1e-12);
    assert!(
        (x - 171.3).abs() < 1e-4,
        "rim pixels shift the centroid of pixel averages by some 1e-5 px"
    );
    // A contact whose rim lies just left of the frame still lightens the first column.
    let radius_px = blurred.truth(0).contact.contact_radius_m / options.camera.pixel_size_m[0];
    options.centre_px = Some([-radius_px - 1.5, 120.4]);
    let beyond = PressScene::new(options).unwrap();
    assert_eq!(beyond.truth(0).visible_force_n, 0.0);
    assert!(beyond.expected_frame(0)[[120, 0]] > background + 0.1);
}

#[test]
fn shear_moves_the_contact_by_force_over_stiffness() {
    let mut options = small();
    options.loads = vec![
        PressLoad::normal(0.7),
        PressLoad {
            shear_n: [0.2, -0.1],
            ..PressLoad::normal(0.7)
        },
    ];
    options.shear_stiffness_n_per_m = [400.0, 500.0];
    let scene = PressScene::new(options).unwrap();
    let (before, after) = (centre_m(&scene.truth(0)), centre_m(&scene.truth(1)));
    assert!(relative(after[0] - before[0], 0.2 / 400.0) < 1e-12);
    assert!(relative(after[1] - before[1], -0.1 / 500.0) < 1e-12);
}

#[test]
fn the_apparent_surface_scales_with_the_cube_root_of_the_force() {
    let truth = PressScene::new(small()).unwrap().simulate().truth;
    let map = truth[0].scaling_to(&truth[1]);
    assert!(relative(map.scale, (1.2_f64 / 0.7).cbrt()) < 1e-14);
    let (height0, height1) = (truth[0].apparent_height_m(), truth[1].apparent_height_m());
    // The middle of the frame is the centre, half a pixel from the nearest pixel's.
    assert!(relative(height1[[130, 174]] / height0[[130, 174]], map.scale) < 1e-3);
    let strain = map.green_lagrange_strain()[(2, 2)];
    assert!(relative(strain, 0.5 * ((1.2_f64 / 0.7).powf(2.0 / 3.0) - 1.0)) < 1e-13);
}

#[test]
fn a_brighter_gain_saturates_and_the_truth_counts_it() {
    let mut options = small();
    options.gain = Gain::PeakGrey(400.0);
    options.camera = options.camera.ideal();
    let scene = PressScene::new(options).unwrap();
    let frame = scene.frame(1, 0);
    let truth = scene.truth(1);
    assert!(truth.saturated_pixels > 1000);
    // Rounding puts light from 254.5 on at 255 as well.
    let bright = frame.iter().filter(|&&v| v == 255).count();
    assert!(bright >= truth.saturated_pixels && bright < truth.saturated_pixels + 100);
}

/// A gain that suits a large soft ball's low pressure is too high for a small rigid one: its sums
/// are no longer in proportion to the force.
#[test]
fn a_calibration_that_saturates_is_refused_and_says_what_helps() {
    let large = ElasticSphere {
        radius_m: 20e-3,
        material: Elastic::CL2003X,
    };
    let scene = PressScene::new(PressOptions {
        object: large,
        ..small()
    });
    let scene = scene.unwrap();
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
fn no_force_is_no_light() {
    let mut options = small();
    options.loads = vec![PressLoad::normal(0.0)];
    options.camera = options.camera.ideal();
    let made = PressScene::new(options).unwrap().simulate();
    assert_eq!(made.frames[0], made.reference);
    assert_eq!(made.truth[0].visible_force_n, 0.0);
    assert!(made.truth[0].centroid_px[0].is_nan());
}

#[test]
fn every_meaningless_value_is_named() {
    type Spoil = fn(&mut PressOptions, f64);
    let cases: [(&str, Spoil, &[f64]); 14] = [
        (
            "radius_m",
            |o, v| o.object.radius_m = v,
            &[0.0, -1.0, f64::INFINITY],
        ),
        (
            "youngs_modulus_pa",
            |o, v| o.object.material.youngs_modulus_pa = v,
            &[0.0, -1.0],
        ),
        (
            "poisson_ratio",
            |o, v| o.object.material.poisson_ratio = v,
            &[-1.0, 0.6],
        ),
        (
            "thickness_m",
            |o, v| o.waveguide.layers[1].thickness_m = v,
            &[0.0, f64::INFINITY],
        ),
        (
            "refractive_index",
            |o, v| o.waveguide.layers[1].refractive_index = v,
            &[0.9],
        ),
        (
            "force_n",
            |o, v| o.loads[1].force_n = v,
            &[-0.1, f64::INFINITY],
        ),
        (
            "shear_n",
            |o, v| o.loads[0].shear_n[1] = v,
            &[f64::INFINITY],
        ),
        (
            "shear_stiffness_n_per_m",
            |o, v| o.shear_stiffness_n_per_m[0] = v,
            &[0.0],
        ),
        ("pixel_size_m", |o, v| o.camera.pixel_size_m[1] = v, &[0.0]),
        (
            "background_grey",
            |o, v| o.camera.background_grey = v,
            &[-1.0],
        ),
        ("vignetting", |o, v| o.camera.vignetting = v, &[-0.1, 1.1]),
        (
            "blur_sigma_px",
            |o, v| o.camera.blur_sigma_px = v,
            &[-0.1, 1e6],
        ),
        (
            "full_well_electrons",
            |o, v| o.camera.full_well_electrons = v,
            &[0.0],
        ),
        (
            "read_noise_grey",
            |o, v| o.camera.read_noise_grey = v,
            &[-1.0, f64::INFINITY],
        ),
    ];
    for (name, spoil, values) in cases {
        for &value in values.iter().chain(&[f64::NAN]) {
            let mut options = small();
            spoil(&mut options, value);
            match PressScene::new(options) {
                Err(SimulateError::OutOfRange { field, .. }) => assert_eq!(field, name),
                other => panic!("{name} = {value} gave {other:?}"),
            }
        }
    }
    let spoiled = |spoil: fn(&mut PressOptions)| {
        let mut options = small();
        spoil(&mut options);
        PressScene::new(options).err()
    };
    assert!(matches!(
        spoiled(|o| o.loads.clear()),
        Some(SimulateError::TooFew { field: "loads", .. })
    ));
    assert!(matches!(
        spoiled(|o| o.waveguide.layers.clear()),
        Some(SimulateError::TooFew { .. })
    ));
    assert!(matches!(
        spoiled(|o| o.camera.shape = [0, 3]),
        Some(SimulateError::TooFew { .. })
    ));
    assert!(spoiled(|o| o.gain = Gain::PeakGrey(f64::NAN)).is_some());
    assert!(spoiled(|o| o.response = Response::Quadratic { droop: 0.51 }).is_some());
    assert!(spoiled(|o| o.response = Response::Power { exponent: 0.2 }).is_some());
    assert!(spoiled(|o| o.response = Response::Power { exponent: f64::NAN }).is_some());
    assert!(spoiled(|o| o.law = ContactModel::Tabulated(vec![])).is_some());
    assert!(spoiled(|o| o.centre_px = Some([f64::NAN, 0.0])).is_some());
    let bad = Illumination {
        level: -1.0,
        ..Illumination::default()
    };
    let mut options = small();
    options.loads[0].illumination = bad;
    assert!(PressScene::new(options).is_err());
    let rigid = ElasticSphere {
        radius_m: 1e-3,
        material: Elastic::RIGID,
    };
    assert!(
        PressScene::new(PressOptions {
            object: rigid,
            ..small()
        })
        .is_ok()
    );
}

/// The contact's centre (x, y) in metres from the first pixel's centre.
fn centre_m(truth: &tactile_simulate::PressTruth) -> [f64; 2] {
    std::array::from_fn(|k| truth.centre_px[k] * truth.pixel_size_m[k])
}
