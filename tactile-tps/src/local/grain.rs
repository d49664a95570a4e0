//! The grain of coordinates, such as whole pixels or thousandths of a millimetre.

use nalgebra::Point;

/// Exponents of the tested grains, in powers of ten. Finer grains are not distinguishable from
/// double precision.
const POWERS: std::ops::RangeInclusive<i32> = -12..=3;

/// Standard deviation of a number rounded to a grain of 1.
const OF_ROUNDING: f64 = 0.288_675;

/// The largest power of ten of which all coordinates are multiples. Zero if there is none.
pub(super) fn of_pairs<const D: usize>(
    sources: &[Point<f64, D>],
    targets: &[Point<f64, D>],
) -> f64 {
    let largest = largest_of(sources, targets);
    let multiple = |x: f64, grain: f64| {
        let steps = x / grain;
        // If the grain is far larger than a number, the number is close to zero steps.
        if steps.round() == 0.0 && x.abs() > f64::EPSILON * largest {
            return false;
        }
        // Tolerance for decimals rounded to binary.
        (steps - steps.round()).abs() <= 1e-15 * steps.abs() + 1e-9 && steps.abs() < 1e14
    };
    let mut power = *POWERS.end();
    for x in sources.iter().chain(targets).flat_map(|p| p.iter()) {
        while !multiple(*x, 10_f64.powi(power)) {
            power -= 1;
            if power < *POWERS.start() {
                return 0.0;
            }
        }
    }
    10_f64.powi(power)
}

/// The minimum noise of a coordinate: its rounding.
pub(super) fn least_noise<const D: usize>(
    sources: &[Point<f64, D>],
    targets: &[Point<f64, D>],
    grain: f64,
) -> f64 {
    (OF_ROUNDING * grain)
        .max(f64::EPSILON * largest_of(sources, targets))
        .max(f64::MIN_POSITIVE.sqrt())
}

/// The largest coordinate.
fn largest_of<const D: usize>(sources: &[Point<f64, D>], targets: &[Point<f64, D>]) -> f64 {
    let all = sources.iter().chain(targets).map(|p| p.coords.amax());
    all.fold(0.0, f64::max)
}
