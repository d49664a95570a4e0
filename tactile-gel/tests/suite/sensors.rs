//! Sensors calibrated on simulated gels.

use ndarray::{Array2, Array3};
use tactile_gel::simulate::{ColourGel, ElasticFace, HertzPress};
use tactile_gel::{BallPress, CalibrationReport, GelSensor};

pub(crate) const PIXEL_M: f64 = 5e-5;
/// Radius of the ball of the calibrations in pixels.
pub(crate) const BALL_PX: f64 = 40.0;

/// A gel of 240 × 320 pixels.
pub(crate) fn gel() -> ColourGel {
    ColourGel {
        shape: [240, 320],
        ..ColourGel::default()
    }
}

pub(crate) fn flat(gel: &ColourGel, seed: u64) -> Array3<u8> {
    gel.frame(&Array2::zeros((gel.shape[0], gel.shape[1])), seed)
}

/// Pseudo-random numbers from 0 to 1, one per index.
pub(crate) fn random(index: usize, digit: usize) -> f64 {
    let mix = (index * 7919 + digit * 104_729 + 1) as f64;
    (mix.sin() * 43_758.545_3).rem_euclid(1.0)
}

/// Frames of twelve balls on a half-space, at different positions and depths.
pub(crate) fn presses(gel: &ColourGel) -> Vec<Array3<u8>> {
    let press = |k: usize| {
        let at = [60.0 + 200.0 * random(k, 0), 60.0 + 120.0 * random(k, 1)];
        HertzPress::ball(at, BALL_PX, 11.0 + 9.0 * random(k, 2))
    };
    (0..12)
        .map(|k| {
            gel.frame(
                &ElasticFace::HALF_SPACE.depth_px(gel.shape, &[press(k)]),
                100 + k as u64,
            )
        })
        .collect()
}

pub(crate) fn calibrated_with(
    reference: &Array3<u8>,
    frames: &[Array3<u8>],
    ball_radius_m: f64,
) -> (GelSensor, CalibrationReport) {
    let presses: Vec<_> = frames
        .iter()
        .map(|frame| BallPress::new(frame, ball_radius_m))
        .collect();
    GelSensor::calibrate(reference.view(), PIXEL_M, &presses).unwrap()
}

pub(crate) fn calibrated(gel: &ColourGel) -> (GelSensor, CalibrationReport) {
    calibrated_with(&flat(gel, 0), &presses(gel), BALL_PX * PIXEL_M)
}
