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

#[cfg(test)]
mod tests {
    use super::*;

    /// Every interval has a slope of its own, so that a neighbour's would be seen; outside the table its ends hold.
    #[test]
    fn tables_are_linear_between_their_levels() {
        let values: [f64; LEVELS] = std::array::from_fn(|k| 3.0 + (k * k) as f64);
        let step = 0.5;
        let variance = PixelVariance::Pressure {
            values: &values,
            step,
        };
        for k in 0..LEVELS - 1 {
            let expected = 0.75 * values[k] + 0.25 * values[k + 1];
            // Whole numbers and quarters below 2¹⁴ are exact.
            assert_eq!(variance.at((k as f64 + 0.25) * step), expected, "{k}");
        }
        assert_eq!(variance.at(-1.0), values[0]);
        assert_eq!(variance.at(1e9), values[LEVELS - 1]);
    }
}
