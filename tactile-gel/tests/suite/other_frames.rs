//! Frames of other sensors, and valid frames.

use crate::sensors::{BALL_PX, PIXEL_M, calibrated, calibrated_with, flat, gel, presses, random};
use ndarray::{Array3, Axis};
use tactile_gel::simulate::{ColourGel, ElasticFace, HertzPress};
use tactile_gel::{BallPress, CalibrationDoubt, FrameDoubt, GelError, GelSensor, Turn};

fn pressed(gel: &ColourGel, seed: u64) -> Array3<u8> {
    let k = seed as usize;
    let at = [80.0 + 160.0 * random(k, 0), 70.0 + 100.0 * random(k, 1)];
    let press = HertzPress::ball(at, 50.0, 10.0 + 12.0 * random(k, 2));
    gel.frame(&ElasticFace::HALF_SPACE.depth_px(gel.shape, &[press]), seed)
}

fn of(
    frame: &Array3<u8>,
    change: impl Fn(usize, usize, usize) -> (usize, usize, usize),
) -> Array3<u8> {
    Array3::from_shape_fn(frame.dim(), |(r, c, k)| frame[change(r, c, k)])
}

/// Each foreign frame is recognised, and none gives "no contact".
#[test]
fn frames_of_others_are_named() {
    let gel = gel();
    let sensor = calibrated(&gel).0;
    let [rows, columns] = gel.shape;
    for seed in [1, 2] {
        let frame = pressed(&gel, seed);
        let named = |name: &str, frame: &Array3<u8>, wanted: &dyn Fn(&FrameDoubt) -> bool| {
            let found = sensor.read(frame).unwrap();
            assert!(
                found.doubts.iter().any(wanted),
                "{name}: {:?}",
                found.doubts
            );
        };
        named("exchanged", &of(&frame, |r, c, k| (r, c, 2 - k)), &|d| {
            matches!(
                d,
                FrameDoubt::ChannelsExchanged([2, 1, 0]) | FrameDoubt::NoSurface
            )
        });
        named(
            "half a turn",
            &of(&frame, |r, c, k| (rows - 1 - r, columns - 1 - c, k)),
            &|d| matches!(d, FrameDoubt::Turned(Turn::Half)),
        );
        named(
            "mirrored",
            &of(&frame, |r, c, k| (r, columns - 1 - c, k)),
            &|d| matches!(d, FrameDoubt::Turned(_) | FrameDoubt::NoSurface),
        );
        named(
            "bright",
            &frame.mapv(|v| (f64::from(v) * 1.4).min(255.0) as u8),
            &|d| matches!(d, FrameDoubt::Exposure(_)),
        );
        named("dark", &frame.mapv(|v| (f64::from(v) * 0.6) as u8), &|d| {
            matches!(d, FrameDoubt::Exposure(_))
        });
        let mut tinted = frame.clone();
        tinted
            .index_axis_mut(Axis(2), 0)
            .mapv_inplace(|v| (f64::from(v) * 0.82) as u8);
        named("tinted", &tinted, &|d| matches!(d, FrameDoubt::Balance(_)));
        named("black", &frame.mapv(|_| 0), &|d| *d == FrameDoubt::Black);
        named("white", &frame.mapv(|_| 255), &|d| *d == FrameDoubt::White);
        let noise = Array3::from_shape_fn(frame.dim(), |(r, c, k)| {
            (255.0 * random(r * 977 + c, k)) as u8
        });
        named("noise", &noise, &|d| *d == FrameDoubt::Noise);
        for turn in [0.5, 2.0] {
            let other = ColourGel {
                turn,
                lamps: [0.8, 1.1, 0.95],
                fall_off: 0.7,
                ..gel.clone()
            };
            named("another unit", &flat(&other, seed), &|d| {
                matches!(
                    d,
                    FrameDoubt::AnotherPattern(_)
                        | FrameDoubt::ChannelsExchanged(_)
                        | FrameDoubt::Turned(_)
                )
            });
        }
    }
}

/// Exposures within a tenth, other noise and other objects belong to this sensor.
#[test]
fn right_frames_are_not_flagged() {
    let gel = gel();
    let sensor = calibrated(&gel).0;
    let frames: usize = std::env::var("FRAMES")
        .ok()
        .and_then(|n| n.parse().ok())
        .unwrap_or(30);
    for seed in 0..frames {
        let exposed = ColourGel {
            gain: 0.9 + 0.2 * random(seed, 9),
            noise: 0.5 + 1.5 * random(seed, 10),
            ..gel.clone()
        };
        let frame = sensor.read(pressed(&exposed, seed as u64).view()).unwrap();
        assert!(
            frame.doubts.is_empty(),
            "{seed} {}: {:?}",
            exposed.gain,
            frame.doubts
        );
        assert_eq!(frame.contacts.len(), 1, "{seed} {}", exposed.gain);
        let frame = sensor.read(flat(&exposed, seed as u64).view()).unwrap();
        assert!(
            frame.doubts.is_empty() && frame.contacts.is_empty(),
            "{seed} {}",
            exposed.gain
        );
    }
}

/// A calibration doubts a ball whose diameter was given instead of its radius, and lengths in
/// millimetres.
#[test]
fn a_wrong_ball_is_doubted() {
    let gel = gel();
    let (reference, frames) = (flat(&gel, 0), presses(&gel));
    let doubts = |factor: f64| {
        calibrated_with(&reference, &frames, factor * BALL_PX * PIXEL_M)
            .1
            .doubts
    };
    assert!(doubts(1.0).is_empty(), "{:?}", doubts(1.0));
    let twice = doubts(2.0);
    assert!(
        twice
            .iter()
            .any(|d| matches!(d, CalibrationDoubt::BallSize(f) if (1.5..2.6).contains(f))),
        "{twice:?}"
    );
    assert!(
        doubts(1e3)
            .iter()
            .any(|d| matches!(d, CalibrationDoubt::LargeLength(_)))
    );
    let exchanged = of(&reference, |r, c, k| (r, c, 2 - k));
    let presses: Vec<_> = frames
        .iter()
        .map(|frame| BallPress::new(frame, BALL_PX * PIXEL_M))
        .collect();
    let refused = GelSensor::calibrate(exchanged.view(), PIXEL_M, &presses);
    assert!(
        matches!(refused, Err(GelError::OtherFrames { .. })),
        "{refused:?}"
    );
}
