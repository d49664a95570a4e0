//! Tick positions and their labels.

/// Round values from `lo` to `hi`, about `wanted` of them: steps of 1, 2 or 5 times a power of ten.
pub(super) fn nice_ticks(lo: f64, hi: f64, wanted: usize) -> Vec<f64> {
    let rough = (hi - lo) / wanted.max(1) as f64;
    if !(rough > 0.0 && rough.is_finite()) {
        return vec![lo];
    }
    let power = 10f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].map(|m| m * power).into_iter().find(|s| *s >= rough * 0.999);
    let step = step.unwrap_or(10.0 * power);
    let first = (lo / step - 1e-9).ceil() as i64;
    let last = (hi / step + 1e-9).floor() as i64;
    (first..=last.min(first.saturating_add(100))).map(|i| i as f64 * step).collect()
}

/// A number as short as it can be read: 0.25, 1200, 3×10⁶.
pub(super) fn label(v: f64) -> String {
    let size = v.abs();
    if size < 1e-300 {
        "0".into()
    } else if (1e-3..1e5).contains(&size) {
        let digits = (3 - size.log10().floor() as i32).max(0) as usize;
        let text = format!("{v:.digits$}");
        if text.contains('.') { trim(&text).into() } else { text }
    } else {
        let mut power = size.log10().floor() as i32;
        let mut mantissa = trim(&format!("{:.4}", v / 10f64.powi(power))).to_owned();
        if mantissa == "10" {
            (mantissa, power) = ("1".into(), power + 1);
        }
        format!("{mantissa}×10{}", superscript(power))
    }
}

fn trim(text: &str) -> &str {
    text.trim_end_matches('0').trim_end_matches('.')
}

fn superscript(n: i32) -> String {
    const DIGITS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    let digit = |c: char| c.to_digit(10).map_or('⁻', |d| DIGITS[d as usize]);
    n.to_string().chars().map(digit).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_inside() {
        assert_eq!(nice_ticks(0.0, 1.0, 5).len(), 6);
        assert!(nice_ticks(-3.0, 97.0, 5).iter().all(|t| t.rem_euclid(20.0) == 0.0));
        assert_eq!(nice_ticks(1.0, 1.0, 5), [1.0]);
    }

    #[test]
    fn labels_are_short() {
        let labels = [0.25, 1200.0, 3e6, -2.5e-7, 0.0].map(label);
        assert_eq!(labels, ["0.25", "1200", "3×10⁶", "-2.5×10⁻⁷", "0"]);
    }
}
