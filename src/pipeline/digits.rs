//! Numbers in words: as many digits as their error allows.

use crate::force::Estimate;

/// A value with its standard error, scaled to a unit: two significant digits of the error decide the decimals.
pub fn with_error(value: f64, error: f64, scale: f64) -> String {
    let (value, error) = (value * scale, error * scale);
    if !(error > 0.0 && error.is_finite()) {
        return format!("{value:.4}");
    }
    let decimals = (1 - error.log10().floor() as i32).max(0) as usize;
    // Beyond the twelfth decimal it is rounding.
    if decimals > 12 {
        return format!("{value:.4}");
    }
    format!("{value:.decimals$} ± {error:.decimals$}")
}

/// An estimate with its standard error, scaled to a unit.
pub(super) fn estimate(e: Estimate, scale: f64) -> String {
    with_error(e.value, e.standard_error, scale)
}

#[cfg(test)]
mod tests {
    use super::with_error;

    #[test]
    fn a_value_has_the_digits_that_its_error_allows() {
        assert_eq!(with_error(3.27124e-3, 4.1e-8, 1e3), "3.271240 ± 0.000041");
        assert_eq!(with_error(103_384.0, 140.0, 1e-3), "103.38 ± 0.14");
        assert_eq!(with_error(0.7, 0.0, 1.0), "0.7000");
        assert_eq!(
            with_error(0.7, 3e-17, 1.0),
            "0.7000",
            "rounding is no error"
        );
    }
}
