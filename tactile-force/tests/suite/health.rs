//! Changes of a sensor are found in time, and a healthy one is left in peace.

use rand::{SeedableRng, rngs::ChaCha8Rng};
use rand_distr::{Distribution, StandardNormal};
use tactile_force::{
    Branch, ChartState, ContactDetector, ContactOptions, Detection, DetectorWorkspace, Estimate,
    ForceError, FrameCondition, HealthMonitor, HealthOptions, StuckPixels,
};

use crate::simulated::Sensor;

/// Conditions of frames whose brightness scatters by `sd`, and noise ratios by 2 %.
struct Stream {
    rng: ChaCha8Rng,
    sd: f64,
}

impl Stream {
    fn new(sd: f64, seed: u64) -> Self {
        Self {
            rng: ChaCha8Rng::seed_from_u64(seed),
            sd,
        }
    }

    fn next(&mut self, gain: f64, noise: f64) -> FrameCondition {
        let z: [f64; 2] = [
            StandardNormal.sample(&mut self.rng),
            StandardNormal.sample(&mut self.rng),
        ];
        FrameCondition {
            brightness: Estimate::new(gain * (1.0 + self.sd * z[0]), self.sd),
            background_grey: 40.0 * gain,
            noise_ratio: noise * (1.0 + 0.02 * z[1]),
        }
    }

    /// A monitor that has learned its baseline.
    fn learned(&mut self) -> HealthMonitor {
        let mut monitor = HealthMonitor::new(HealthOptions::default());
        for _ in 0..400 {
            monitor.update(&self.next(1.0, 1.0));
        }
        monitor
    }
}

#[test]
fn a_healthy_sensor_is_suspected_less_than_once_in_twenty_thousand_frames() {
    for sd in [0.002, 0.005, 0.01, 0.02] {
        let mut alarms = 0;
        // A hundred baselines of 20 000 frames each. A run ends with its alarm.
        for seed in 0..100 {
            let mut stream = Stream::new(sd, seed);
            let mut monitor = stream.learned();
            alarms += usize::from(
                (0..20_000).any(|_| monitor.update(&stream.next(1.0, 1.0)).has_changed()),
            );
        }
        // One in 40 000 was asked for: 40 runs in 100 would be right, with a mean that is known.
        // The bar is one a run.
        assert!(alarms < 60, "scatter {sd}: {alarms} runs of 100");
    }
}

#[test]
fn a_gain_that_changes_by_two_percent_is_found_within_fifty_frames() {
    for (sd, share) in [(0.002, 1.0), (0.005, 1.0), (0.01, 1.0), (0.02, 0.97)] {
        for gain in [0.98, 1.02] {
            let found = (0..300)
                .filter(|seed| {
                    let mut stream = Stream::new(sd, 1000 + seed);
                    let mut monitor = stream.learned();
                    (0..50).any(|_| {
                        monitor.update(&stream.next(gain, 1.0)).brightness == ChartState::Changed
                    })
                })
                .count();
            assert!(
                found as f64 >= 300.0 * share,
                "scatter {sd}, gain {gain}: {found} of 300"
            );
        }
    }
}

#[test]
fn noise_that_grows_by_a_fifth_is_found_and_named() {
    let mut stream = Stream::new(0.005, 5);
    let mut monitor = stream.learned();
    let reports: Vec<_> = (0..50)
        .map(|_| monitor.update(&stream.next(1.0, 1.2)))
        .collect();
    assert!(reports.iter().any(|r| r.noise == ChartState::Changed));
    assert!(reports.iter().all(|r| r.brightness == ChartState::Healthy));
}

#[test]
fn a_stream_that_scatters_too_much_says_so() {
    let mut stream = Stream::new(0.2, 6);
    let mut monitor = stream.learned();
    let report = monitor.update(&stream.next(1.0, 1.0));
    assert!(
        matches!(report.brightness, ChartState::Insensitive { delay_frames } if delay_frames > 50.0)
    );
}

#[test]
fn frames_show_gain_background_and_noise_under_a_contact_too() {
    let sensor = Sensor {
        vignetting: 0.1,
        ..Sensor::default()
    };
    let reference = sensor.reference();
    let detector = ContactDetector::new(ContactOptions::default());
    let mut workspace = DetectorWorkspace::default();
    let mut condition = |sensor: Sensor, force: f64, seed: u64| {
        let frame = sensor.frame(force, 2.5e-3, [121.3, 97.6], Branch::Loading, seed);
        let _: Detection = detector
            .detect_with(&mut workspace, frame.view(), &reference)
            .unwrap();
        workspace.condition(&reference).unwrap()
    };
    for (k, force) in [0.0, 0.1, 0.4].into_iter().enumerate() {
        let plain = condition(sensor, force, k as u64);
        let brighter = condition(
            Sensor {
                illumination: 1.02,
                ..sensor
            },
            force,
            10 + k as u64,
        );
        // Four standard errors, and as much again for the tiles that the contact's edge grazes.
        for (found, truth) in [(plain, 1.0), (brighter, 1.02)] {
            let error = (found.brightness.value - truth).abs();
            assert!(
                error < 8.0 * found.brightness.standard_error,
                "{force}: {found:?}"
            );
            // The ratio of two thousand pixels' worth of tiles: 200 tiles give it to 5 %.
            assert!((found.noise_ratio - 1.0).abs() < 0.35, "{force}: {found:?}");
        }
    }
}

#[test]
fn stuck_pixels_are_found_among_noise_and_loads() {
    let sensor = Sensor::default();
    let mut stuck = StuckPixels::new((200, 240)).unwrap();
    let planted = [(10, 12), (99, 120), (199, 239)];
    for k in 0..24 {
        let force = if k % 3 == 0 { 0.3 } else { 0.0 };
        let mut frame = sensor.frame(force, 2.5e-3, [121.3, 97.6], Branch::Loading, k);
        for (place, level) in planted.iter().zip([0, 255, 41]) {
            frame[*place] = level;
        }
        assert!(k >= 16 || stuck.pixels().is_empty());
        stuck.update(frame.view()).unwrap();
    }
    assert_eq!(stuck.pixels(), planted);
    let other = ndarray::Array2::<u8>::zeros((3, 3));
    assert!(matches!(
        stuck.update(other.view()),
        Err(ForceError::SizeMismatch { .. })
    ));
    assert!(StuckPixels::new((0, 3)).is_err());
}
