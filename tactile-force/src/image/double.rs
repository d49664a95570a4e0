//! Double-double arithmetic: a number as the unevaluated sum of two doubles (Dekker 1971, Knuth).

use std::ops::{Add, Mul, Sub};

#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Double {
    high: f64,
    low: f64,
}

impl From<f64> for Double {
    fn from(high: f64) -> Self {
        Self { high, low: 0.0 }
    }
}

impl Double {
    /// a − b exactly.
    pub(super) fn difference(a: f64, b: f64) -> Self {
        two_sum(a, -b)
    }

    pub(super) fn value(self) -> f64 {
        self.high + self.low
    }

    pub(super) fn abs(self) -> Self {
        if self.value() < 0.0 {
            Self::default() - self
        } else {
            self
        }
    }

    /// a/b to about 30 digits.
    pub(super) fn over(self, b: Self) -> Self {
        let first = self.high / b.high;
        let rest = self - b * first.into();
        let second = rest.value() / b.high;
        quick(first, second)
    }
}

/// a + b as a rounded sum and what the rounding lost.
fn two_sum(a: f64, b: f64) -> Double {
    let high = a + b;
    let other = high - a;
    Double {
        high,
        low: (a - (high - other)) + (b - other),
    }
}

fn quick(a: f64, b: f64) -> Double {
    let high = a + b;
    Double {
        high,
        low: b - (high - a),
    }
}

impl Add for Double {
    type Output = Self;

    fn add(self, b: Self) -> Self {
        let (s, t) = (two_sum(self.high, b.high), two_sum(self.low, b.low));
        let u = quick(s.high, s.low + t.high);
        quick(u.high, u.low + t.low)
    }
}

impl Sub for Double {
    type Output = Self;

    fn sub(self, b: Self) -> Self {
        self + Self {
            high: -b.high,
            low: -b.low,
        }
    }
}

impl Mul for Double {
    type Output = Self;

    fn mul(self, b: Self) -> Self {
        let high = self.high * b.high;
        let low = self.high.mul_add(b.high, -high);
        quick(high, low + (self.high * b.low + self.low * b.high))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keeps_what_doubles_lose() {
        let third = Double::from(1.0).over(3.0.into());
        let sum = third + third + third - 1.0.into();
        assert!(sum.value().abs() < 1e-31);
        let a = Double::from(1e16) + 1.0.into();
        assert_eq!(
            (a * a - Double::from(1e16) * 1e16.into()).value(),
            2e16 + 1.0
        );
    }
}
