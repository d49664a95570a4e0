//! Axes: tick positions and their labels.
use super::scale::Scale;

/// A round value on an axis.
pub(super) struct Tick {
    /// The value on the axis's scale: a decimal logarithm on a logarithmic one.
    pub(super) at: f64,
    /// The value itself as text.
    pub(super) label: String,
}

/// About `wanted` ticks between the ends of a range on its scale (decimal logarithms on a logarithmic one).
pub(super) fn ticks(scale: Scale, [from, to]: [f64; 2], wanted: usize) -> Vec<Tick> {
    let (low, high) = (from.min(to), from.max(to));
    match scale {
        Scale::Log10 => (decades(low, high, wanted).into_iter())
            .map(|at| Tick {
                at,
                label: label(10_f64.powf(at)),
            })
            .collect(),
        Scale::Linear => {
            let values = nice_ticks(low, high, wanted);
            let largest = values.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
            let power = common_power(largest);
            (values.into_iter())
                .map(|at| Tick {
                    at,
                    label: label_with_power(at, power),
                })
                .collect()
        }
    }
}

/// The value as a multiple of the power of ten that the axis's labels share.
fn label_with_power(value: f64, power: i32) -> String {
    if power == 0 {
        return label(clean(value));
    }
    let mantissa = clean(value / 10_f64.powi(power));
    if mantissa == 0.0 {
        "0".into()
    } else {
        format!("{}×10{}", label(mantissa), superscript(power))
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
        let ticks = ticks(scale, range, wanted).into_iter();
        ticks.map(|tick| tick.label).collect()
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
