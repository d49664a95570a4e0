//! A polynomial in Chebyshev form over the calibrated range.

/// F(V) = Σ c_k T_k(t), or V/scale times that, with t from −1 to 1 over the range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Basis {
    pub(super) middle: f64,
    pub(super) half: f64,
    /// Largest |V|, if the curve is to pass through the origin.
    pub(super) through_origin: Option<f64>,
}

impl Basis {
    pub(super) fn over(values: &[f64], through_origin: bool) -> Self {
        let [low, high] = extremes(values);
        let reach = low.abs().max(high.abs());
        Self {
            middle: 0.5 * (low + high),
            half: 0.5 * (high - low),
            through_origin: through_origin.then_some(reach),
        }
    }

    /// Basis functions and their derivatives at V; `each` gets (k, φ_k, φ_k′).
    pub(super) fn each(&self, v: f64, terms: usize, mut each: impl FnMut(usize, f64, f64)) {
        let t = (v - self.middle) / self.half;
        let (mut now, mut next) = ([1.0, 0.0], [t, 1.0]);
        for k in 0..terms {
            let (value, by_v) = (now[0], now[1] / self.half);
            match self.through_origin {
                None => each(k, value, by_v),
                Some(scale) => each(k, v / scale * value, (value + v * by_v) / scale),
            }
            let after = [
                2.0 * t * next[0] - now[0],
                2.0 * next[0] + 2.0 * t * next[1] - now[1],
            ];
            (now, next) = (next, after);
        }
    }

    pub(super) fn value(&self, coefficients: &[f64], v: f64) -> f64 {
        let mut sum = 0.0;
        self.each(v, coefficients.len(), |k, value, _| {
            sum += coefficients[k] * value
        });
        sum
    }

    pub(super) fn slope(&self, coefficients: &[f64], v: f64) -> f64 {
        let mut sum = 0.0;
        self.each(v, coefficients.len(), |k, _, slope| {
            sum += coefficients[k] * slope
        });
        sum
    }
}

pub(super) fn extremes(values: &[f64]) -> [f64; 2] {
    let least = values.iter().copied().fold(f64::INFINITY, f64::min);
    [
        least,
        values.iter().copied().fold(f64::NEG_INFINITY, f64::max),
    ]
}

/// The V in [low, high] where a rising function takes the value `target`, by bisection to the last bit of sense.
pub(super) fn invert(low: f64, high: f64, target: f64, f: impl Fn(f64) -> f64) -> Option<f64> {
    if !(f(low) <= target && target <= f(high)) {
        return None;
    }
    let (mut low, mut high) = (low, high);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            break;
        }
        if f(middle) < target {
            low = middle
        } else {
            high = middle
        }
    }
    Some(0.5 * (low + high))
}
