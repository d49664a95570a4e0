//! Digits, and names that write to the terminal.
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
