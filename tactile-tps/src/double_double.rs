//! Double-double arithmetic: unevaluated sums of two `f64` (Dekker 1971; Joldes, Muller & Popescu 2017).

use core::{
    cmp::Ordering,
    ops::{Add, Div, Mul, Neg, Sub},
};

use crate::real::Real;

/// high + low with |low| at most half a unit in the last place of high: about 31 decimal digits.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct DoubleDouble {
    pub(crate) high: f64,
    pub(crate) low: f64,
}

/// a + b and what rounding took from it.
#[inline(always)]
pub(crate) fn two_sum(a: f64, b: f64) -> DoubleDouble {
    let high = a + b;
    let part = high - a;
    DoubleDouble {
        high,
        low: (a - (high - part)) + (b - part),
    }
}

/// The same for |a| ≥ |b|.
#[inline(always)]
fn quick_two_sum(a: f64, b: f64) -> DoubleDouble {
    let high = a + b;
    DoubleDouble {
        high,
        low: b - (high - a),
    }
}

#[inline(always)]
fn two_product(a: f64, b: f64) -> DoubleDouble {
    let high = a * b;
    DoubleDouble {
        high,
        low: a.mul_add(b, -high),
    }
}

impl DoubleDouble {
    pub(crate) const ZERO: Self = Self {
        high: 0.0,
        low: 0.0,
    };

    /// 2ᵏ x.
    fn scale(self, k: i32) -> Self {
        let factor = 2f64.powi(k);
        Self {
            high: self.high * factor,
            low: self.low * factor,
        }
    }
}

impl Add for DoubleDouble {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        let (sum, rest) = (two_sum(self.high, other.high), two_sum(self.low, other.low));
        let first = quick_two_sum(sum.high, sum.low + rest.high);
        quick_two_sum(first.high, first.low + rest.low)
    }
}

impl Neg for DoubleDouble {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self {
            high: -self.high,
            low: -self.low,
        }
    }
}

impl Sub for DoubleDouble {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Mul for DoubleDouble {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        let product = two_product(self.high, other.high);
        let cross = self.high.mul_add(other.low, self.low * other.high);
        quick_two_sum(product.high, product.low + cross)
    }
}

impl Div for DoubleDouble {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        let first = self.high / other.high;
        let rest = self - other * Self::from_f64(first);
        let second = rest.high / other.high;
        let rest = rest - other * Self::from_f64(second);
        quick_two_sum(first, second) + Self::from_f64(rest.high / other.high)
    }
}

impl PartialOrd for DoubleDouble {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        match self.high.partial_cmp(&other.high) {
            Some(Ordering::Equal) => self.low.partial_cmp(&other.low),
            order => order,
        }
    }
}

impl Real for DoubleDouble {
    #[inline(always)]
    fn from_f64(x: f64) -> Self {
        Self { high: x, low: 0.0 }
    }

    /// One step of Heron's rule on the `f64` root.
    fn sqrt(self) -> Self {
        if self.high <= 0.0 {
            return Self::ZERO;
        }
        let root = self.high.sqrt();
        let rest = self - two_product(root, root);
        quick_two_sum(root, rest.high / (2.0 * root))
    }

    /// One step of Newton's rule on eʸ = x.
    fn ln(self) -> Self {
        if self.high <= 0.0 {
            return Self::ZERO;
        }
        // 2ᵏ is split off first, so that e⁻ʸ can neither over- nor underflow.
        let k = self.high.log2().round();
        let x = self.scale(-(k as i32));
        let y = Self::from_f64(x.high.ln());
        let mantissa = y + x * (-y).exp() - Self::from_f64(1.0);
        mantissa + LN_2 * Self::from_f64(k)
    }

    /// Taylor's series after dividing by 2⁹, squared back nine times.
    fn exp(self) -> Self {
        let k = (self.high / LN_2.high).round();
        let x = (self - LN_2 * Self::from_f64(k)).scale(-9);
        let mut sum = Self::ZERO;
        for n in (1..=10).rev() {
            sum = (sum + Self::from_f64(1.0)) * x / Self::from_f64(f64::from(n));
        }
        // eˣ − 1 doubles its argument without losing digits: (1 + s)² − 1 = 2s + s².
        for _ in 0..9 {
            sum = sum.scale(1) + sum * sum;
        }
        (sum + Self::from_f64(1.0)).scale(k as i32)
    }

    #[inline(always)]
    fn mul_add(self, a: Self, b: Self) -> Self {
        self * a + b
    }
}

/// ln 2 to twice the working precision.
const LN_2: DoubleDouble = DoubleDouble {
    high: core::f64::consts::LN_2,
    low: 2.319_046_813_846_299_6e-17,
};

#[cfg(test)]
mod tests {
    use super::*;

    /// Relative distance of two numbers that should be equal to some 31 digits.
    fn off(a: DoubleDouble, b: DoubleDouble) -> f64 {
        ((a - b).high / b.high).abs()
    }

    /// A few roundings of 2⁻¹⁰⁵ each.
    const CLOSE: f64 = 1e-30;

    #[test]
    fn inverse_operations_undo_each_other() {
        for i in 1..200 {
            let x = DoubleDouble::from_f64(f64::from(i) * 0.37) / DoubleDouble::from_f64(7.0);
            let y = DoubleDouble::from_f64(f64::from(i * i)) / DoubleDouble::from_f64(11.0);
            assert!(off(x / y * y, x) < CLOSE);
            assert!(off(x.sqrt() * x.sqrt(), x) < CLOSE);
            assert!(off(x.ln().exp(), x) < 1e-28, "{x:?}");
            assert!(off(x + y - y, x) < CLOSE * (1.0 + y.high / x.high));
        }
    }

    #[test]
    fn logarithms_of_powers_and_products_agree() {
        let ten = DoubleDouble::from_f64(10.0).ln();
        // ln 10 = 2.302585092994045684017991454684364207601101488628772976033…
        let expected = DoubleDouble {
            high: core::f64::consts::LN_10,
            low: -2.170_756_223_382_249_4e-16,
        };
        assert!(off(ten, expected) < CLOSE);
        let hundred = DoubleDouble::from_f64(100.0).ln();
        assert!(off(hundred, ten + ten) < CLOSE);
    }
}
