//! A session notices that its sensor has changed, and leaves a healthy one in peace.
use super::sensors::{Effects, Simulated};
use tactile_imaging::force::{ChartState, HealthOptions};
use tactile_imaging::pipeline::{LightContact, Pipeline, Session};
use tactile_simulate::Camera;

const BASELINE: usize = 100;

#[test]
fn a_change_of_gain_is_found_within_fifty_frames_and_not_before() {
    let camera = Camera::default().coarser(4);
    let stage = LightContact::gauged(camera.pixel_size_m, &super::drift_corrected());
    let pipeline = Pipeline::new(stage.unwrap(), super::SAMPLE).unwrap();
    let health = HealthOptions::default()
        .with_baseline_frames(BASELINE)
        .unwrap();
    // Lamps that flicker by up to 1 %, a standard deviation of 0.6 %.
    let flicker = Effects {
        lamps: 0.01,
        ..Effects::NONE
    };
    for (seed, gain) in [(1, 1.02), (2, 0.98)] {
        let mut simulated = Simulated::new(flicker, camera, seed);
        let reference = simulated.reference();
        let session = Session::new(&pipeline, &[reference.view()]).unwrap();
        let mut session = session.with_health(health);
        let mut number = 0;
        let mut state = |gain: f64| {
            number += 1;
            let frame = simulated.pressed_frame(gain, number);
            session.push(frame.view()).unwrap();
            session.health().expect("a background").brightness
        };
        for _ in 0..BASELINE {
            assert_eq!(state(1.0), ChartState::Learning);
        }
        for k in 0..BASELINE {
            assert_eq!(state(1.0), ChartState::Healthy, "{k} after the baseline");
        }
        // Three and a half standard deviations of the flicker: a few frames.
        let found = (0..50).find(|_| state(gain) == ChartState::Changed);
        assert!(found.is_some_and(|k| k < 20), "gain {gain}: {found:?}");
    }
}
