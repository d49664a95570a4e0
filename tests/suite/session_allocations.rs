//! A session allocates nothing per frame once its buffers have their size.
use tactile_imaging::pipeline::Session;
use tactile_simulate::Trial;
use tactile_simulate::{CalibrationRun, Camera, PressLoad, PressOptions};

/// Surface, control points, match, spline and strain of a frame work in the memory of the frames
/// before.
#[test]
fn following_strain_allocates_nothing_after_warm_up() {
    let camera = Camera::default().coarser(4);
    let loads = [0.7, 0.8, 0.95, 1.1, 1.2].map(PressLoad::normal).to_vec();
    let options = PressOptions {
        camera,
        loads,
        ..PressOptions::default()
    };
    let trial = Trial::new(options, &CalibrationRun::default()).unwrap();
    let pipeline = trial.pipeline().unwrap();
    let mut session = Session::new(&pipeline, &[trial.simulation.reference.view()]).unwrap();
    let mut cycle = trial.simulation.frames.iter().cycle();
    let mut follow = |session: &mut Session, frames: usize| {
        for frame in cycle.by_ref().take(frames) {
            session.push(frame.view()).unwrap();
            if let Some(found) = session.strain().unwrap() {
                assert!(found.matched > 190 && found.strain.field.strains.len() == 200);
            }
        }
    };
    follow(&mut session, 4 * Session::MOST_LOADS);
    let count = allocation_counter::measure(|| follow(&mut session, 20));
    assert_eq!(count.count_total, 0, "{count:?}");
}
