//! Linear and logarithmic axes, and their labels.
use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};
use std::ops::Range;

/// A linear or logarithmic axis.
#[derive(Clone, Debug)]
pub(super) struct Axis {
    /// The ends, as decimal logarithms if the axis is logarithmic.
    pub(super) ends: [f64; 2],
    pub(super) logarithmic: bool,
    pub(super) down: bool,
}

/// Smallest and largest finite value, or (0, 1) if there is none.
pub(super) fn spread(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let start = [f64::INFINITY, f64::NEG_INFINITY];
    let finite = values.filter(|v| v.is_finite());
    let [low, high] = finite.fold(start, |[low, high], v| [low.min(v), high.max(v)]);
    if low > high { [0.0, 1.0] } else { [low, high] }
}

/// The range of colours. It is at least a thousandth of the values, so that rounding errors are not
/// visible.
pub(super) fn value_range(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let [low, high] = spread(values);
    // A homogeneous strain varies only in its last bits, which the full range of colours would
    // exaggerate.
    let least = 1e-3 * low.abs().max(high.abs());
    let more = (0.5 * (least - (high - low))).max(0.0);
    [low - more, high + more]
}

impl Axis {
    /// An axis from the smallest to the largest value, extended by the share `margin` at both ends.
    /// It is never empty.
    pub(super) fn around(
        values: impl Iterator<Item = f64>,
        logarithmic: bool,
        margin: f64,
    ) -> Self {
        let scaled = values.map(|v| if logarithmic { v.log10() } else { v });
        let [low, high] = spread(scaled);
        let width = high - low;
        let more = if width > 1e-9 * low.abs().max(high.abs()) {
            margin * width
        } else if low == 0.0 {
            0.5
        } else {
            0.1 * low.abs()
        };
        Self {
            ends: [low - more, high + more],
            logarithmic,
            down: false,
        }
    }

    /// The same axis, directed downwards on the page.
    pub(super) fn downwards(self) -> Self {
        Self { down: true, ..self }
    }

    pub(super) fn length(&self) -> f64 {
        self.ends[1] - self.ends[0]
    }

    /// Position of a value between the ends, from 0 to 1.
    pub(super) fn share(&self, value: f64) -> f64 {
        let value = if self.logarithmic {
            value.log10()
        } else {
            value
        };
        (value - self.ends[0]) / self.length()
    }

    /// About `wanted` round values between the ends.
    pub(super) fn ticks(&self, wanted: usize) -> Vec<f64> {
        let [low, high] = self.ends;
        let rough = self.length() / wanted.max(1) as f64;
        if self.logarithmic {
            // Powers of ten, and 2 and 5 times these if there are too few.
            let step = rough.ceil().max(1.0);
            let factors: &[f64] = if self.length() > 2.0 {
                &[1.0]
            } else {
                &[1.0, 2.0, 5.0]
            };
            let powers = multiples(step, low.floor(), high);
            let all = powers.flat_map(|p| factors.iter().map(move |f| p + f.log10()));
            let inside = all.filter(|v| (low - 1e-9..=high + 1e-9).contains(v));
            return inside.map(|v| 10_f64.powf(v)).collect();
        }
        let power = 10_f64.powf(rough.log10().floor());
        let round = [1.0, 2.0, 5.0].map(|m| m * power).into_iter();
        let step = round.into_iter().find(|s| *s >= rough * 0.999);
        multiples(step.unwrap_or(10.0 * power), low, high).collect()
    }
}

/// The multiples of a step from `low` to `high`, at most a hundred.
fn multiples(step: f64, low: f64, high: f64) -> impl Iterator<Item = f64> {
    let first = (low / step - 1e-9).ceil();
    let count = (high / step + 1e-9).floor() - first;
    (0..=count.clamp(0.0, 100.0) as i32).map(move |k| (first + f64::from(k)) * step)
}

impl Ranged for Axis {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, (from, to): (i32, i32)) -> i32 {
        let (from, to) = if self.down { (to, from) } else { (from, to) };
        from + (self.share(*value) * f64::from(to - from)).round() as i32
    }

    fn key_points<H: KeyPointHint>(&self, hint: H) -> Vec<f64> {
        self.ticks(hint.bold_points())
    }

    fn range(&self) -> Range<f64> {
        self.ends[0]..self.ends[1]
    }
}

impl ValueFormatter<f64> for Axis {
    /// All numbers on a linear axis share one power of ten, so that they are easy to compare.
    fn format_ext(&self, value: &f64) -> String {
        let largest = self.ends[0].abs().max(self.ends[1].abs());
        if self.logarithmic {
            return label(*value, 0.0);
        }
        if largest == 0.0 || (0.01..1e5).contains(&largest) {
            // Enough decimals to distinguish neighbouring ticks.
            let step = self.length() / 10.0;
            return label(*value, -step.log10().floor());
        }
        let power = largest.log10().floor() as i32;
        match label(value / 10_f64.powi(power), 0.0) {
            zero if zero == "0" => zero,
            mantissa => format!("{mantissa}×10{}", superscript(power)),
        }
    }
}

/// A number with at least four digits and this number of decimals, in its shortest form: 0.25,
/// 1200, 3×10⁶.
pub(super) fn label(value: f64, decimals: f64) -> String {
    // Steps such as 0.1 leave rounding errors on values that should be zero.
    let size = value.abs();
    if size < 1e-12 {
        return "0".into();
    }
    let mut power = size.log10().floor() as i32;
    if (-3..5).contains(&power) {
        return short(format!(
            "{value:.*}",
            (3 - power).max(decimals as i32).max(0) as usize
        ));
    }
    let mut mantissa = short(format!("{:.4}", value / 10_f64.powi(power)));
    if mantissa == "10" {
        (mantissa, power) = ("1".into(), power + 1);
    }
    format!("{mantissa}×10{}", superscript(power))
}

/// The number without trailing zeros after the decimal point.
fn short(text: String) -> String {
    if text.contains('.') {
        let text = text.trim_end_matches('0').trim_end_matches('.');
        return text.into();
    }
    text
}

fn superscript(n: i32) -> String {
    let digits: Vec<char> = "⁰¹²³⁴⁵⁶⁷⁸⁹".chars().collect();
    let digit = |c: char| c.to_digit(10).map_or('⁻', |d| digits[d as usize]);
    n.to_string().chars().map(digit).collect()
}
