//! Quantiles, of distributions and of values, and degrees of freedom.

#[cfg(feature = "intervals")]
use statrs::distribution::{ContinuousCDF, Normal, StudentsT};

/// Two-sided 95 % quantile of Student's t with so many degrees of freedom, of the normal
/// distribution where `degrees` is `None` or not positive.
///
/// ```
/// use tactile_core::statistics::quantile_95;
/// assert!((quantile_95(Some(4.0)) - 2.776).abs() < 1e-3);
/// assert!((quantile_95(None) - 1.960).abs() < 1e-3);
/// // No repetition at all.
/// assert_eq!(quantile_95(Some(0.0)), f64::INFINITY);
/// ```
#[must_use]
#[cfg(feature = "intervals")]
pub fn quantile_95(degrees: Option<f64>) -> f64 {
    const UPPER_TAIL: f64 = 0.975;
    let z = Normal::standard().inverse_cdf(UPPER_TAIL);
    // A count that is NaN, zero or negative has no distribution: nothing bounds the value.
    match degrees.and_then(|n| Some((n, StudentsT::new(0.0, 1.0, n).ok()?))) {
        // The iteration behind the inverse loses digits with the degrees of freedom, and does not
        // end for millions of them, as where a calibration is free of scatter. The expansion about
        // the normal quantile is good to 1e-11 from a thousand on (Fisher & Cornish, Technometrics
        // 2, 1960).
        Some((n, _)) if n > 1e3 => {
            let first = (z.powi(3) + z) / 4.0;
            let second = (5.0 * z.powi(5) + 16.0 * z.powi(3) + 3.0 * z) / 96.0;
            let third = (3.0 * z.powi(7) + 19.0 * z.powi(5) + 17.0 * z.powi(3) - 15.0 * z) / 384.0;
            z + (first + (second + third / n) / n) / n
        }
        Some((_, t)) => t.inverse_cdf(UPPER_TAIL),
        None if degrees.is_some() => f64::INFINITY,
        None => z,
    }
}

/// The value that exceeds a `share` of the values, ordered by [`f64::total_cmp`], in O(n). Without
/// values it is 0. The values are left in another order.
///
/// ```
/// use tactile_core::statistics::{median, quantile};
/// let mut values = [3.0, 1.0, 2.0, 5.0, 4.0];
/// assert_eq!((median(&mut values), quantile(&mut values, 0.9)), (3.0, 5.0));
/// assert_eq!((median(&mut [1.0, 2.0]), median(&mut [])), (2.0, 0.0));
/// ```
#[must_use]
pub fn quantile(values: &mut [f64], share: f64) -> f64 {
    let Some(last) = values.len().checked_sub(1) else {
        return 0.0;
    };
    let at = (share * values.len() as f64) as usize;
    *values
        .select_nth_unstable_by(at.min(last), f64::total_cmp)
        .1
}

/// The middle of the values, the upper one of two. See [`quantile`].
#[must_use]
pub fn median(values: &mut [f64]) -> f64 {
    quantile(values, 0.5)
}

/// Degrees of freedom of a sum of independent variances vᵢ, each estimated with νᵢ degrees of
/// freedom: those whose quantile is the mean of the parts' quantiles, t = Σ vᵢ t(νᵢ)/Σ vᵢ (Cochran
/// & Cox, Experimental Designs, 2nd ed. 1957, §4.14). `None` where all are known.
///
/// The usual rule of Welch and Satterthwaite lets 95 % intervals hold 87 to 93 % where a variance
/// of one degree of freedom stands beside a known one, these hold 94 to 98 %. Quantiles are
/// interpolated to 1 %.
///
/// ```
/// use tactile_core::statistics::{effective_degrees_of_freedom, quantile_95};
/// // One estimated variance beside a known one of the same size.
/// let degrees = effective_degrees_of_freedom(&[(1.0, Some(4.0)), (1.0, None)]);
/// let mean = 0.5 * (quantile_95(Some(4.0)) + quantile_95(None));
/// assert!((quantile_95(degrees) / mean - 1.0).abs() < 0.01);
/// assert_eq!(effective_degrees_of_freedom(&[(1.0, None)]), None);
/// assert_eq!(effective_degrees_of_freedom(&[(1.0, Some(4.0)), (0.0, None)]), Some(4.0));
/// ```
#[must_use]
pub fn effective_degrees_of_freedom(parts: &[(f64, Option<f64>)]) -> Option<f64> {
    let counts = |part: &&(f64, Option<f64>)| part.0 > 0.0;
    let mut counted = parts.iter().filter(counts);
    // One part alone keeps its count exactly, without the error of the interpolation.
    if let (Some((_, degrees)), None) = (counted.next(), counted.next()) {
        return *degrees;
    }
    let (mut total, mut estimated) = (0.0, 0.0);
    for (variance, degrees) in parts.iter().filter(counts) {
        total += variance;
        // A known variance widens the sum, but its quantile is the normal one.
        estimated += degrees.map_or(0.0, |n| variance * excess_of(n));
    }
    (estimated > 0.0).then(|| degrees_of(estimated / total))
}

/// Degrees of freedom, and how far the quantile of Student's t lies above the normal one.
const EXCESS: [(f64, f64); 11] = [
    (1.0, 10.746_241),
    (1.25, 6.067_987),
    (1.5, 4.056_699),
    (2.0, 2.342_689),
    (3.0, 1.222_482),
    (4.0, 0.816_481),
    (6.0, 0.486_948),
    (10.0, 0.268_175),
    (20.0, 0.125_999),
    (50.0, 0.048_595),
    (200.0, 0.011_932),
];

/// t(ν) less the normal quantile, by interpolation of logarithms. It falls as 1/ν at the end.
fn excess_of(degrees: f64) -> f64 {
    interpolated(degrees, EXCESS.map(|(n, excess)| [n, excess]))
}

/// The inverse of [`excess_of`].
fn degrees_of(excess: f64) -> f64 {
    let mut points = EXCESS.map(|(n, excess)| [excess, n]);
    points.reverse();
    interpolated(excess, points)
}

/// Straight lines through the logarithms of points, and on beyond the first and the last.
fn interpolated<const N: usize>(x: f64, points: [[f64; 2]; N]) -> f64 {
    let after = points.partition_point(|p| p[0] < x).clamp(1, N - 1);
    let [[x0, y0], [x1, y1]] = [points[after - 1], points[after]];
    y0 * ((x / x0).ln() / (x1 / x0).ln() * (y1 / y0).ln()).exp()
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    /// Tables of Student's t, to the digits printed there.
    #[test]
    fn quantiles_are_those_of_the_tables() {
        for (degrees, expected) in [
            (None, 1.959_963_984_540_054),
            (Some(1.0), 12.706_204_736_174_7),
            (Some(10.0), 2.228_138_851_964_94),
        ] {
            assert_relative_eq!(quantile_95(degrees), expected, max_relative = 1e-7);
        }
    }

    /// The sum of two estimates with ν = 4 each keeps the quantile of either. A part that vanishes
    /// leaves the other's.
    #[test]
    fn degrees_of_sums_are_those_of_the_mean_quantile() {
        for degrees in [1.0, 1.7, 4.0, 33.0, 5e3] {
            let both = effective_degrees_of_freedom(&[(1.0, Some(degrees)), (2.0, Some(degrees))]);
            assert_relative_eq!(both.unwrap(), degrees, max_relative = 1e-9);
            let excess = quantile_95(Some(degrees)) - quantile_95(None);
            assert_relative_eq!(excess_of(degrees), excess, max_relative = 0.04);
        }
    }

    /// Without a step where the expansion takes over, and with an end.
    #[test]
    fn quantiles_of_many_degrees_reach_the_normal_one() {
        // Two implementations at one place: the iteration has seven digits there.
        let step = quantile_95(Some(1001.0)) - quantile_95(Some(1000.0));
        // −z (z² + 1)/(4 n²) for a step of one.
        assert!((step + 2.4e-6).abs() < 5e-7, "{step:e}");
        for degrees in [1e6, 1e12, 1e25, f64::MAX] {
            // 1.2e-6 at a million.
            assert_relative_eq!(
                quantile_95(Some(degrees)),
                quantile_95(None),
                max_relative = 2e-6
            );
        }
    }
}
