//! One random stream per row of each frame.

use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;

/// What a stream is used for; streams of different uses never meet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub(super) enum Purpose {
    /// Noise of the frames of a scene.
    Frames = 0,
    /// Noise of the force gauge of a calibration.
    Gauge = 1,
    /// Noise of the frames of a calibration.
    CalibrationFrames = 2,
    /// Where the bumps of a surface pattern lie.
    Pattern = 3,
}

/// The stream of row `row` of frame `frame`. `frame` must stay below 2⁴⁸, `row` below 2¹⁶.
pub(super) fn row_stream(seed: u64, purpose: Purpose, frame: u64, row: usize) -> ChaCha8Rng {
    let mut key = [0_u8; 32];
    key[..8].copy_from_slice(&seed.to_le_bytes());
    key[8] = purpose as u8;
    let mut rng = ChaCha8Rng::from_seed(key);
    rng.set_stream(frame << 16 | row as u64);
    rng
}
