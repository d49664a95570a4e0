//! Numbers and foreign text in the format of terminals and pictures.
use tactile_imaging::core::Estimate;
use tactile_imaging::pipeline::with_error;

/// Foreign text for terminals and pictures: control characters and marks for the direction of
/// writing are replaced.
///
/// Without this a file name could clear the screen, forge a line of the result, or make an SVG file
/// unreadable.
pub(crate) fn printable(text: &str) -> String {
    let hidden = |c: char| {
        c.is_control()
            || matches!(c, '\u{200e}' | '\u{200f}')
            || matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
    };
    let seen = |c| if hidden(c) { '\u{fffd}' } else { c };
    text.chars().map(seen).collect()
}

/// Four significant digits, for numbers of unknown error.
pub(crate) fn four_digits(value: f64) -> String {
    digits(value, 4)
}

/// A number with significant digits, without an exponent unless the value is very small or large.
pub(crate) fn digits(value: f64, significant: usize) -> String {
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

/// A value with its standard error in a unit with 1 unit = `1 / scale`.
pub(crate) fn in_unit(estimate: Estimate, scale: f64) -> String {
    with_error(estimate.value, estimate.standard_error, scale)
}

/// `1 point`, `2 points`.
pub(crate) fn count(n: usize, noun: &str) -> String {
    format!("{n} {noun}{}", if n == 1 { "" } else { "s" })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digits_are_significant_ones() {
        let texts = [1234.56, 0.012_345_6, 1.5e-7, 0.0, -2.0, f64::NAN].map(four_digits);
        let expected = ["1235", "0.01235", "1.500e-7", "0", "-2.000", "NaN"];
        assert_eq!(texts, expected);
    }

    #[test]
    fn names_of_files_cannot_write_to_the_terminal() {
        let name = "a\u{1b}[2J\nb\u{202e}c.png µ";
        assert_eq!(printable(name), "a\u{fffd}[2J\u{fffd}b\u{fffd}c.png µ");
    }
}
