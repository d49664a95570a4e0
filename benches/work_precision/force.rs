//! The contact radius of a frame: with and without the fit of the profile, and with different
//! settings of the fit.

use crate::study::Study;
use tactile_imaging::force::{
    CalibrationPair, ForceMeter, ForceOptions, ForceWorkspace, LinearCalibration, ReferenceFrame,
};
use tactile_simulate::{
    CalibrationRun as SimulatedRun, Camera, PressLoad, PressOptions, PressScene,
};

const SEEDS: u32 = 4;

pub(crate) fn frame(study: &mut Study) {
    study.error_label = "rms error of the contact radius, relative";
    let camera = study.choose(Camera::default().coarser(4), Camera::default());
    let options = PressOptions {
        loads: vec![PressLoad::normal(0.7)],
        camera,
        ..PressOptions::default()
    };
    let scene = PressScene::new(options).expect("a valid scene");
    let series = scene
        .calibrate(&SimulatedRun {
            steps: 5,
            ..SimulatedRun::default()
        })
        .expect("valid");
    let pairs: Vec<_> = series
        .pairs
        .iter()
        .map(|p| CalibrationPair::loading(p.integrated_pixel_value, p.force_n))
        .collect();
    let calibration = LinearCalibration::fit(&pairs).expect("enough pairs");
    let reference = ReferenceFrame::new(scene.reference(0).view()).expect("a frame");
    let frames: Vec<_> = (0..SEEDS).map(|seed| scene.frame(0, seed)).collect();
    let truth = scene.truth(0);
    for (knob, setting, is_default, options) in [
        ("profile", "default", true, ForceOptions::default()),
        (
            "profile",
            "skipped",
            false,
            ForceOptions::default().without_profile(),
        ),
    ] {
        let meter = ForceMeter::new(truth.pixel_size_m, &options).expect("valid");
        let mut workspace = ForceWorkspace::default();
        let mut radius = |frame: &ndarray::Array2<u8>| {
            let measured = meter
                .measure_with(&mut workspace, frame.view(), &reference, &calibration)
                .expect("valid");
            measured.contact_radius_m.expect("a contact").value
        };
        let job = || frames.iter().map(&mut radius).collect::<Vec<f64>>();
        study.run(knob, setting, is_default, job, |found| {
            let square = |a: &f64| (a / truth.contact.contact_radius_m - 1.0).powi(2);
            (found.iter().map(square).sum::<f64>() / found.len() as f64).sqrt()
        });
        study.entries.last_mut().expect("an entry").seconds /= f64::from(SEEDS);
    }
}
