//! The variance of a pixel as a function of the profile's level.

use crate::frame::DifferenceNoise;

/// Number of levels at which a tabulated variance is known.
pub(crate) const LEVELS: usize = 65;

/// Variance of one pixel at a level of the profile.
#[derive(Clone, Copy, Debug)]
pub(crate) enum PixelVariance<'a> {
    /// Grey levels: background + gain × level.
    Grey(&'a DifferenceNoise),
    /// Pressures: values at `LEVELS` even steps from zero.
    Pressure {
        values: &'a [f64; LEVELS],
        step: f64,
    },
}

impl PixelVariance<'_> {
    #[inline]
    pub(super) fn at(&self, level: f64) -> f64 {
        match self {
            Self::Grey(noise) => noise.background + noise.gain * level.max(0.0),
            Self::Pressure { values, step } => {
                let place = (level / step).clamp(0.0, (LEVELS - 1) as f64);
                let below = (place as usize).min(LEVELS - 2);
                let share = place - below as f64;
                values[below] + share * (values[below + 1] - values[below])
            }
        }
    }
}
