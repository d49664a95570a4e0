//! Force, centroid and contact radius in simulated frames, compared with the truth of the scene.
//!
//! The noise of the default camera is 1 % of the brightest signal (2 of 200 grey levels, mostly
//! photon noise).
#![allow(clippy::print_stdout)]

mod study;

use crate::hostile::Hostile;
use ndarray::Array2;
use study::{study, study_with};
use tactile_imaging::force::{
    CalibrationPair, ContactOptions, DriftCorrection, ForceError, ForceMeter, ForceOptions,
    ForceWorkspace, LinearCalibration, ReferenceFrame, measure_force,
};
use tactile_simulate::{Camera, Gain, Illumination, PressLoad, PressOptions, PressScene};

/// A quarter of the default resolution, so that a thousand frames take seconds.
fn camera() -> Camera {
    Camera {
        vignetting: 0.0,
        ..Camera::default().coarser(4)
    }
}

fn press(camera: Camera) -> PressOptions {
    PressOptions {
        camera,
        loads: vec![PressLoad::normal(0.7)],
        centre_px: Some([170.3, 131.8]),
        ..PressOptions::default()
    }
}

/// The true calibration of the sensor without its error: the test covers only the error from the
/// frames.
fn calibration(scene: &PressScene) -> LinearCalibration {
    let camera = scene.options().camera;
    let newton_per_grey =
        camera.pixel_size_m.iter().product::<f64>() / scene.truth(0).grey_per_pascal;
    let pairs: Vec<_> = (0..11)
        .map(|k| 0.2 * f64::from(k))
        .map(|f| CalibrationPair::loading(f / newton_per_grey, f))
        .collect();
    LinearCalibration::fit(&pairs).unwrap()
}

/// A reference with different noise for every seed.
fn dark(scene: &PressScene, seed: u64) -> Array2<u8> {
    PressScene::new(PressOptions {
        seed,
        ..scene.options().clone()
    })
    .unwrap()
    .reference(0)
}

#[test]
fn a_thousand_seeds() {
    let scene = PressScene::new(press(camera())).unwrap();
    let s = study(&scene, 1000, &ForceOptions::default());
    assert!(s.force.worst() < 2e-3 && s.radius.worst() < 3e-3);
    assert!(s.centroid.iter().all(|c| c.rms() < 0.01) && s.centre.rms() < 0.01);
    for errors in s.all() {
        // 68.3 % is expected for a normal distribution. The binomial standard deviation for a
        // thousand seeds is 1.5 %.
        assert!(
            (0.66..=0.71).contains(&errors.inside_one_sigma()),
            "{}: {}",
            errors.name,
            errors.inside_one_sigma()
        );
    }
}

#[test]
fn vignetting_is_corrected_on_request() {
    // In a corner, where the lens absorbs 2 % of the light. The calibration of the scene is valid
    // for the middle.
    let mut options = press(camera());
    options.camera.vignetting = 0.03;
    options.centre_px = Some([60.3, 51.8]);
    let scene = PressScene::new(options).unwrap();
    let plain = study(&scene, 20, &ForceOptions::default());
    assert!(plain.force.rms() > 0.01);
    let flat = study_with(&scene, 200, &ForceOptions::default(), |r| {
        r.with_flat_field().unwrap()
    });
    assert!(flat.force.worst() < 2e-3 && flat.radius.worst() < 3e-3);
    // 200 seeds: 68.3 ± 3.3 %.
    assert!(
        (0.58..=0.78).contains(&flat.force.inside_one_sigma()),
        "{}",
        flat.force.inside_one_sigma()
    );
}

#[test]
fn blur_oblong_pixels_and_small_contacts() {
    type Change = fn(&mut PressOptions);
    let cases: [(&str, Change); 4] = [
        ("no blur", |o| o.camera.blur_sigma_px = 0.0),
        ("blur of 2 px", |o| o.camera.blur_sigma_px = 2.0),
        ("oblong pixels", |o| {
            o.camera.pixel_size_m = [86.2e-6, 120e-6];
        }),
        ("radius of 9 px", |o| o.loads[0].force_n = 0.01),
    ];
    for (name, change) in cases {
        let mut options = press(camera());
        change(&mut options);
        println!("{name}");
        let scene = PressScene::new(options).unwrap();
        let s = study(&scene, 200, &ForceOptions::default());
        // Three standard deviations of the noise. 200 seeds: 68.3 ± 3.3 %.
        assert!(s.force.worst() < 5e-3 && s.radius.rms() < 1e-3 && s.centroid[0].rms() < 0.01);
        for errors in [&s.force, &s.centre, &s.radius] {
            assert!(
                (0.58..=0.78).contains(&errors.inside_one_sigma()),
                "{name} {}",
                errors.name
            );
        }
    }
}

#[test]
fn illumination_drift_is_corrected_on_request() {
    let mut options = press(camera());
    options.loads[0].illumination = Illumination {
        level: 1.05,
        tilt: [0.1, -0.06],
    };
    let scene = PressScene::new(options).unwrap();
    let with =
        |drift| ForceOptions::default().with_contact(ContactOptions::default().with_drift(drift));
    let uncorrected = study(&scene, 20, &with(DriftCorrection::None));
    assert!(uncorrected.force.rms() > 0.03);
    let corrected = study(&scene, 100, &with(DriftCorrection::TiltedIllumination));
    assert!(corrected.force.worst() < 2e-3 && corrected.radius.worst() < 3e-3);
    // 100 seeds: 68.3 ± 4.7 %.
    assert!((0.55..=0.82).contains(&corrected.force.inside_one_sigma()));
}

#[test]
fn false_alarms_are_as_rare_as_stated() {
    let mut options = press(camera());
    options.camera.shape = [130, 174];
    let scene = PressScene::new(options).unwrap();
    let meter = ForceMeter::new([1e-5; 2], &ForceOptions::default()).unwrap();
    let (calibration, mut workspace) = (calibration(&scene), ForceWorkspace::default());
    let alarms = (0..1000)
        .filter(|seed| {
            let reference = ReferenceFrame::new(dark(&scene, *seed).view()).unwrap();
            let frame = dark(&scene, 10_000 + seed);
            meter
                .measure_with(&mut workspace, frame.view(), &reference, &calibration)
                .unwrap()
                .contact
                .is_some()
        })
        .count();
    // The stated rate is one in a thousand. More than five have a probability of 6e-4.
    assert!(alarms <= 5, "{alarms}");
}

#[test]
fn faint_contacts_are_found() {
    // A peak of three grey levels, below three standard deviations of a difference.
    let gain = Gain::PeakGrey(3.0);
    let scene = PressScene::new(PressOptions {
        gain,
        ..press(camera())
    })
    .unwrap();
    let s = study(&scene, 50, &ForceOptions::default());
    assert!(s.force.rms() < 0.03, "{}", s.force.rms());
}

/// No case may panic, and errors must be reported.
#[test]
fn hostile_scenes_end_civilly() {
    let base = press(camera());
    let calibration = calibration(&PressScene::new(base.clone()).unwrap());
    for kind in Hostile::ALL {
        let made = kind.simulate(&base).unwrap();
        let (frame, reference) = (made.frames[0].view(), made.reference.view());
        let options = ForceOptions::default();
        let result = measure_force(frame, reference, made.pixel_size_m, &calibration, &options);
        if kind == Hostile::SaturatedContact {
            assert!(matches!(result, Err(ForceError::SaturatedContact { .. })));
            continue;
        }
        let contact = result.unwrap().contact;
        match kind {
            Hostile::NoiseOnly
            | Hostile::AllSaturated
            | Hostile::AllBlack
            | Hostile::PressedReference => assert!(contact.is_none(), "{kind:?}"),
            Hostile::SeveralContacts => {
                assert_eq!(contact.unwrap().other_contacts, made.truth.len() - 1);
            }
            Hostile::CutByEdge | Hostile::InCorner | Hostile::FillsFrame => {
                assert!(contact.unwrap().touches_edge, "{kind:?}");
            }
            _ => {}
        }
    }
}
