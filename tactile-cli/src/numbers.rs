//! Numbers as arguments and in text.
use std::time::Duration;

/// An argument that is a positive, finite number.
pub fn positive(text: &str) -> Result<f64, String> {
    let value = text.parse().ok();
    value
        .filter(|v: &f64| *v > 0.0 && v.is_finite())
        .ok_or_else(|| "expected a number above zero".to_owned())
}

/// An argument that is a finite number.
pub fn finite(text: &str) -> Result<f64, String> {
    let value = text.parse().ok();
    value
        .filter(|v: &f64| v.is_finite())
        .ok_or_else(|| "expected a finite number".to_owned())
}

/// An argument that is a finite number of at least zero.
pub fn not_negative(text: &str) -> Result<f64, String> {
    let value = text.parse().ok();
    value
        .filter(|v: &f64| *v >= 0.0 && v.is_finite())
        .ok_or_else(|| "expected a number of at least zero".to_owned())
}

/// An argument of `N` finite numbers between commas.
pub fn list<const N: usize>(text: &str) -> Result<[f64; N], String> {
    let numbers: Result<Vec<f64>, _> = text.split(',').map(|part| finite(part.trim())).collect();
    numbers
        .ok()
        .and_then(|numbers| numbers.try_into().ok())
        .ok_or_else(|| format!("expected {N} finite numbers between commas"))
}

/// An argument that is one positive number, or two between commas: the size of a pixel along x and y.
pub fn one_or_two(text: &str) -> Result<[f64; 2], String> {
    let numbers: Result<Vec<f64>, _> = text.split(',').map(|part| positive(part.trim())).collect();
    match numbers.as_deref() {
        Ok(&[both]) => Ok([both; 2]),
        Ok(&[x, y]) => Ok([x, y]),
        _ => Err("expected one number above zero, or two between a comma".to_owned()),
    }
}

/// Four significant digits, for numbers whose error is not known.
pub fn four_digits(value: f64) -> String {
    digits(value, 4)
}

/// So many significant digits; plain where the number is neither tiny nor huge.
pub fn digits(value: f64, significant: usize) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    let power = value.abs().log10().floor() as i32;
    let last = significant as i32 - 1;
    if (-4..=last.max(5)).contains(&power) {
        format!("{value:.*}", (last - power).max(0) as usize)
    } else {
        format!("{value:.*e}", last.max(0) as usize)
    }
}

/// `1 point`, `2 points`.
pub fn count(n: usize, noun: &str) -> String {
    format!("{n} {noun}{}", if n == 1 { "" } else { "s" })
}

/// The median of repeated times in milliseconds; it sorts them.
pub fn median_ms(times: &mut [Duration]) -> f64 {
    times.sort_unstable();
    times
        .get(times.len() / 2)
        .map_or(0.0, |t| t.as_secs_f64() * 1e3)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digits_are_significant_ones() {
        assert_eq!(four_digits(1234.56), "1235");
        assert_eq!(four_digits(0.012_345_6), "0.01235");
        assert_eq!(four_digits(1.5e-7), "1.500e-7");
        assert_eq!(four_digits(0.0), "0");
        assert_eq!(four_digits(-2.0), "-2.000");
        assert_eq!(four_digits(f64::NAN), "NaN");
    }

    #[test]
    fn arguments_are_checked() {
        assert_eq!(list::<3>("0, 0,1"), Ok([0.0, 0.0, 1.0]));
        assert!(list::<3>("0,0").is_err() && list::<2>("0,nan").is_err());
        assert_eq!(one_or_two("20"), Ok([20.0, 20.0]));
        assert!(one_or_two("20,0").is_err() && positive("inf").is_err());
    }
}
