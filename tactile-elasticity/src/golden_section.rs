//! Minimum of a function of one variable.

/// Part of a bracket that a golden section leaves.
const RATIO: f64 = 0.618_033_988_749_894_8;

/// Argument of the least of a function that has one minimum in [low, high]: the better of the last bracket's two inner points.
///
/// Every section takes one evaluation and leaves 0.62 of the bracket; `sections` of them, fewer where the bracket is down to
/// rounding.
pub(crate) fn golden_section(
    mut low: f64,
    mut high: f64,
    sections: usize,
    at: impl Fn(f64) -> f64,
) -> f64 {
    let evaluated = |x: f64| (x, at(x));
    let left = |low: f64, high: f64| evaluated(high - RATIO * (high - low));
    let right = |low: f64, high: f64| evaluated(low + RATIO * (high - low));
    let (mut a, mut b) = (left(low, high), right(low, high));
    for _ in 0..sections {
        if a.1 <= b.1 {
            high = low + RATIO * (high - low);
            (a, b) = (left(low, high), a);
        } else {
            low = high - RATIO * (high - low);
            (a, b) = (b, right(low, high));
        }
        if high - low <= 1e-12 * (high.abs() + low.abs()) {
            break;
        }
    }
    if a.1 <= b.1 { a.0 } else { b.0 }
}

#[test]
fn the_minimum_of_a_parabola_and_of_a_kink() {
    for minimum in [-0.3, 0.2, 0.7] {
        let smooth = golden_section(-1.0, 1.0, 60, |x| (x - minimum).powi(2));
        // Where a parabola rises by one rounding.
        assert!((smooth - minimum).abs() < 1e-7, "{smooth}");
        let kink = golden_section(-1.0, 1.0, 60, |x: f64| (x - minimum).abs());
        assert!((kink - minimum).abs() < 1e-11, "{kink}");
    }
    // At an end of the bracket.
    assert!((golden_section(0.0, 1.0, 60, |x| x)) < 1e-11);
}
