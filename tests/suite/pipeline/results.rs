//! Results: sentences for users, JSON for programs, and types that can be sent between threads.
use super::trial;
use tactile_imaging::pipeline::{BallFit, PipelineError, Press, Report, Session, Update};
use tactile_imaging::sfs::Domain;

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
    crosses::<tactile_simulate::FrameStream>();
}

/// The sentence of a result. The result must also be serialisable as JSON.
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
    let update = session.push(empty.view()).unwrap();
    assert_eq!(told(&update), "frame 0: no contact");
    assert!(told(session.drift()).ends_with("1 frame without contact"));
    let update = session.push(trial.simulation.frames[0].view()).unwrap();
    let line = told(&update);
    assert!(
        line.starts_with("frame 1: force 0.") && line.contains(" ± "),
        "{line}"
    );
    assert!(told(&update.contact.unwrap()).contains(" mm   centroid ("));
    let press = trial.press(&pipeline).unwrap();
    let measured = press.measure();
    assert!(told(&measured).contains("cautions:"));
    assert!(told(measured.youngs_modulus_pa.as_ref().unwrap()).contains(" kPa"));
    assert!(told(measured.frames[0].as_ref().unwrap()).contains("contact radius"));
    assert!(told(measured.matching.as_ref().unwrap()).contains("control points matched"));
    assert!(told(measured.strain.as_ref().unwrap()).contains("e_zz"));
    assert!(measured.flags.iter().all(|flag| !told(flag).is_empty()));
    assert!(told(&press.report()).contains("surface"));
    let skips = press.report().skips;
    assert!(skips.iter().all(|skip| told(skip).contains(" frame")));
    let cap = |(r, c): (usize, usize)| {
        let square = (r as f64 - 20.0).powi(2) + (c as f64 - 10.0).powi(2);
        (900.0 - square).max(0.0).sqrt() / 1e4 - 2.5e-3
    };
    let heights = ndarray::Array2::from_shape_fn((40, 30), cap);
    let ball = BallFit::of_radius(heights.view(), &Domain::new([1e-4; 2]).unwrap(), 3e-3).unwrap();
    let says = "ball of radius 3.000 mm at (1.000, 2.000) mm";
    assert!(told(&ball).starts_with(says), "{ball}");
}
