//! Axes: tick positions and their labels.
use super::scale::Scale;
use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};
use plotters::coord::types::RangedCoordf64;
use std::ops::Range;

/// One axis: its range, round values in it, and how their labels are written.
pub(super) struct Axis {
    inner: RangedCoordf64,
    /// On the axis, as the range is: decimal logarithms on a logarithmic one.
    ticks: Vec<f64>,
    scale: Scale,
    power: i32,
}

impl Axis {
    /// From the first to the second value with about `wanted` ticks; both are decimal logarithms on a logarithmic axis.
    pub(super) fn new(scale: Scale, [from, to]: [f64; 2], wanted: usize) -> Self {
        let (lo, hi) = (from.min(to), from.max(to));
        let ticks = match scale {
            Scale::Linear => nice_ticks(lo, hi, wanted),
            Scale::Log10 => decades(lo, hi, wanted),
        };
        let largest = ticks.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
        Self {
            inner: (from..to).into(),
            ticks,
            scale,
            power: common_power(largest),
        }
    }
}

impl Ranged for Axis {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        self.inner.map(value, limit)
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        if hint.weight().allow_light_points() {
            Vec::new()
        } else {
            self.ticks.clone()
        }
    }

    fn range(&self) -> Range<f64> {
        self.inner.range()
    }
}

impl ValueFormatter<f64> for Axis {
    fn format_ext(&self, v: &f64) -> String {
        match self.scale {
            Scale::Log10 => label(10f64.powf(*v)),
            Scale::Linear if self.power == 0 => label(clean(*v)),
            Scale::Linear => {
                let mantissa = clean(v / 10f64.powi(self.power));
                let power = superscript(self.power);
                if mantissa == 0.0 {
                    "0".into()
                } else {
                    format!("{}×10{power}", label(mantissa))
                }
            }
        }
    }
}

/// The power of ten that all labels of an axis share; 0 where plain numbers are short.
fn common_power(largest: f64) -> i32 {
    if largest == 0.0 || (0.01..1e5).contains(&largest) {
        0
    } else {
        largest.log10().floor() as i32
    }
}

/// Rounded to 1e-9, and never a negative zero.
fn clean(v: f64) -> f64 {
    (v * 1e9).round() / 1e9 + 0.0
}

/// Powers of ten between two logarithms; with 2 and 5 times them where these alone are too few.
fn decades(lo: f64, hi: f64, wanted: usize) -> Vec<f64> {
    let between = |step: i64, factors: &[f64]| -> Vec<f64> {
        let powers = (lo.floor() as i64)..=(hi.ceil() as i64).min(lo.floor() as i64 + 700);
        let round = powers.filter(|p| p.rem_euclid(step) == 0);
        let all = round.flat_map(|p| factors.iter().map(move |f| p as f64 + f.log10()));
        all.filter(|v| (lo - 1e-9..=hi + 1e-9).contains(v))
            .collect()
    };
    let step = ((hi - lo) / wanted.max(1) as f64).ceil().max(1.0) as i64;
    let plain = between(step, &[1.0]);
    if plain.len() > 2 {
        plain
    } else {
        between(1, &[1.0, 2.0, 5.0])
    }
}

/// Round values from `lo` to `hi`, about `wanted` of them: steps of 1, 2 or 5 times a power of ten.
pub(super) fn nice_ticks(lo: f64, hi: f64, wanted: usize) -> Vec<f64> {
    let rough = (hi - lo) / wanted.max(1) as f64;
    if !(rough > 0.0 && rough.is_finite()) {
        return vec![lo];
    }
    let power = 10f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0]
        .map(|m| m * power)
        .into_iter()
        .find(|s| *s >= rough * 0.999);
    let step = step.unwrap_or(10.0 * power);
    let first = (lo / step - 1e-9).ceil() as i64;
    let last = (hi / step + 1e-9).floor() as i64;
    (first..=last.min(first.saturating_add(100)))
        .map(|i| i as f64 * step)
        .collect()
}

/// A number as short as it can be read: 0.25, 1200, 3×10⁶.
pub(super) fn label(v: f64) -> String {
    let size = v.abs();
    if size < 1e-300 {
        "0".into()
    } else if (1e-3..1e5).contains(&size) {
        let digits = (3 - size.log10().floor() as i32).max(0) as usize;
        let text = format!("{v:.digits$}");
        if text.contains('.') {
            trim(&text).into()
        } else {
            text
        }
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

    fn labels(scale: Scale, range: [f64; 2], wanted: usize) -> Vec<String> {
        let axis = Axis::new(scale, range, wanted);
        axis.ticks.iter().map(|v| axis.format_ext(v)).collect()
    }

    #[test]
    fn ticks_are_round_and_inside() {
        assert_eq!(nice_ticks(0.0, 1.0, 5).len(), 6);
        assert!(
            nice_ticks(-3.0, 97.0, 5)
                .iter()
                .all(|t| t.rem_euclid(20.0) == 0.0)
        );
        assert_eq!(nice_ticks(1.0, 1.0, 5), [1.0]);
    }

    #[test]
    fn labels_are_short() {
        let labels = [0.25, 1200.0, 3e6, -2.5e-7, 0.0].map(label);
        assert_eq!(labels, ["0.25", "1200", "3×10⁶", "-2.5×10⁻⁷", "0"]);
    }

    #[test]
    fn an_axis_keeps_one_power_of_ten() {
        assert_eq!(
            labels(Scale::Linear, [-6e-4, 1.1e-3], 4),
            ["-0.5×10⁻³", "0", "0.5×10⁻³", "1×10⁻³"]
        );
        assert_eq!(
            labels(Scale::Linear, [0.0, 0.2], 4),
            ["0", "0.05", "0.1", "0.15", "0.2"]
        );
    }

    #[test]
    fn logarithmic_ticks_are_powers_of_ten_or_2_and_5_times_them() {
        assert_eq!(
            labels(Scale::Log10, [0.3, 4.2], 5),
            ["10", "100", "1000", "10000"]
        );
        assert_eq!(labels(Scale::Log10, [-0.1, 1.1], 5), ["1", "2", "5", "10"]);
        assert_eq!(labels(Scale::Log10, [-12.0, 0.0], 4).len(), 5);
    }
}
