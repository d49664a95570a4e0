//! The fall of the temperature towards what the residuals leave.
//!
//! Among undecided matches the residual variance f follows the temperature v: near the fixed point v* it is `f(v) − v* = a (v − v*)` with a of
//! eight or nine tenths, and setting `v ← f(v)` takes a hundred iterations. The excess `v − f(v)` is nearly linear there, so that its root
//! follows from the last two temperatures (the secant method).

/// Share of the secant's step that is taken: the warp lags behind the temperature, which must not fall below the noise.
const DAMPED: f64 = 0.8;
/// Longest step, in excesses.
const LONGEST: f64 = 8.0;
/// Excesses below this share of the variance are near the fixed point. Farther away, where the matches choose between partners, a longer
/// step ends in worse ones: the Chui–Rangarajan noise levels then have errors up to a tenth larger (`--example peer_cases`).
const NEAR: f64 = 0.02;

/// The last temperature, and its excess.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Extrapolation {
    variance: f64,
    excess: f64,
}

impl Extrapolation {
    /// The variance that should follow `variance`, where the matches at it leave `residual`: at most that.
    pub(super) fn next(&mut self, variance: f64, residual: f64) -> f64 {
        let excess = variance - residual;
        let last = std::mem::replace(self, Self { variance, excess });
        let step = last.variance - variance;
        let near = excess > 0.0 && excess <= NEAR * variance;
        // The excess must have shrunk since a temperature above this one.
        if !near || step <= 0.0 || last.excess <= excess {
            return residual;
        }
        let slope = (last.excess - excess) / step;
        variance - excess * (DAMPED / slope).clamp(1.0, LONGEST)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Iterations from 1.01 until the temperature is within 1e-6 of a fixed point at 1 that residuals approach by the factor 0.9.
    fn iterations(mut next: impl FnMut(f64, f64) -> f64) -> usize {
        let mut variance = 1.01;
        (0..1000)
            .find(|_| {
                variance = next(variance, 1.0 + 0.9 * (variance - 1.0));
                assert!(variance >= 1.0, "below the fixed point: {variance}");
                variance < 1.0 + 1e-6
            })
            .expect("it converges")
    }

    #[test]
    fn a_linear_fall_is_taken_in_a_few_steps() {
        let plain = iterations(|_, residual| residual);
        let mut extrapolation = Extrapolation::default();
        let found = iterations(|variance, residual| extrapolation.next(variance, residual));
        // Two plain steps, then each a fifth of what is left: ln(1e4)/ln(5) = 6; plain ln(1e4)/ln(1/0.9) = 87.
        assert!(found < 10 && plain > 80, "{found} instead of {plain}");
    }

    #[test]
    fn a_rising_excess_is_not_extrapolated() {
        let mut extrapolation = Extrapolation::default();
        extrapolation.next(1.0, 0.995);
        // Past a plateau the residuals fall faster than the temperature.
        assert_eq!(extrapolation.next(0.995, 0.98), 0.98);
    }
}
