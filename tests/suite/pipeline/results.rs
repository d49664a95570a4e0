//! Results: sentences for people, JSON for programs, and what may cross threads.
use super::trial;
use tactile_imaging::pipeline::{
    BallFit, ImageFolder, PipelineError, Press, Report, Session, Update,
};

#[test]
fn everything_can_cross_threads() {
    fn crosses<T: Send + Sync>() {}
    crosses::<tactile_imaging::Pipeline>();
    crosses::<Session>();
    crosses::<PipelineError>();
    crosses::<tactile_imaging::pipeline::Measurement>();
    crosses::<Press<'_>>();
    crosses::<Update>();
    crosses::<Report>();
    crosses::<ImageFolder>();
    crosses::<tactile_imaging::simulate::FrameStream>();
}

/// The sentence of a result; it must be writable as JSON.
fn told<T: std::fmt::Display + serde::Serialize>(result: &T) -> String {
    assert!(!serde_json::to_value(result).unwrap().is_null());
    result.to_string()
}

#[test]
fn every_result_can_be_read_by_people_and_programs() {
    let trial = trial(&[0.7, 1.2], 6);
    let pipeline = trial.pipeline().unwrap();
    let mut session = Session::new(&pipeline, &[trial.simulation.reference.view()]).unwrap();
    let empty = trial.scene.reference(3);
    assert_eq!(
        told(&session.push(empty.view()).unwrap()),
        "frame 1: no contact"
    );
    assert!(
        told(session.drift()).ends_with("1 frame without contact"),
        "{}",
        session.drift()
    );
    let update = session.push(trial.simulation.frames[0].view()).unwrap();
    let line = told(&update);
    assert!(
        line.starts_with("frame 2: force 0.") && line.contains(" ± "),
        "{line}"
    );
    assert!(told(&update.contact.unwrap()).contains(" mm   centroid ("));
    let mut press = trial.press(&pipeline).unwrap();
    let measured = press.measure();
    assert!(told(&measured).contains("cautions:"));
    assert!(told(measured.youngs_modulus_pa.as_ref().unwrap()).contains(" kPa"));
    assert!(told(measured.frames[0].as_ref().unwrap()).contains("contact radius"));
    assert!(told(measured.matching.as_ref().unwrap()).contains("control points matched"));
    assert!(told(measured.strain.as_ref().unwrap()).contains("e_zz"));
    assert!(measured.flags.iter().all(|flag| !told(flag).is_empty()));
    assert!(told(press.report()).contains("surface"));
    assert!(
        press
            .report()
            .skips
            .iter()
            .all(|skip| told(skip).ends_with("saved)"))
    );
    let ball = BallFit {
        radius_m: 3e-3,
        centre_m: [1e-3, 2e-3],
        contact_radius_m: 1.5e-3,
        mean_absolute_error_m: 28e-6,
        pixels: 900,
        iterations: 4,
    };
    assert!(
        told(&ball).starts_with("ball of radius 3.000 mm at (1.000, 2.000) mm"),
        "{ball}"
    );
}
