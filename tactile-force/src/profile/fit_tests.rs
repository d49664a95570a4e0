use super::*;

/// Each interval has a different slope, so that a mix-up with a neighbour would be detected.
/// Outside the table its end values apply.
#[test]
fn tables_are_linear_between_their_levels() {
    let values: [f64; VARIANCE_LEVELS] = std::array::from_fn(|k| 3.0 + (k * k) as f64);
    let step = 0.5;
    let variance = PixelVariance::Pressure {
        values: &values,
        step,
    };
    for k in 0..VARIANCE_LEVELS - 1 {
        let expected = 0.75 * values[k] + 0.25 * values[k + 1];
        // Integers and quarters below 2¹⁴ are exact.
        assert_eq!(variance.at((k as f64 + 0.25) * step), expected, "{k}");
    }
    assert_eq!(variance.at(-1.0), values[0]);
    assert_eq!(variance.at(1e9), values[VARIANCE_LEVELS - 1]);
}
