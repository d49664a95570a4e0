//! Sums of products carried in twice the working precision.
//!
//! Knuth's two-sum and the fused two-product (Ogita, Rump & Oishi 2005, "Accurate sum and dot product").

use nalgebra::RealField;

/// An unevaluated sum `hi + lo`, |lo| no more than half an ulp of `hi`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DoubleDouble<T> {
    pub(crate) hi: T,
    pub(crate) lo: T,
}

/// a + b exactly.
fn two_sum<T: RealField + Copy>(a: T, b: T) -> DoubleDouble<T> {
    let hi = a + b;
    let of_b = hi - a;
    DoubleDouble {
        hi,
        lo: (a - (hi - of_b)) + (b - of_b),
    }
}

/// a · b exactly (unless it underflows).
fn two_product<T: RealField + Copy>(a: T, b: T) -> DoubleDouble<T> {
    let hi = a * b;
    DoubleDouble {
        hi,
        lo: a.mul_add(b, -hi),
    }
}

impl<T: RealField + Copy> DoubleDouble<T> {
    pub(crate) fn zero() -> Self {
        Self {
            hi: T::zero(),
            lo: T::zero(),
        }
    }

    pub(crate) fn add(self, x: T) -> Self {
        let sum = two_sum(self.hi, x);
        let low = self.lo + sum.lo;
        let hi = sum.hi + low;
        Self {
            hi,
            lo: low - (hi - sum.hi),
        }
    }

    pub(crate) fn add_sum(self, other: Self) -> Self {
        self.add(other.lo).add(other.hi)
    }

    /// self + a·b.
    pub(crate) fn add_product(self, a: T, b: T) -> Self {
        self.add_sum(two_product(a, b))
    }

    /// self + a·b·c.
    pub(crate) fn add_triple(self, a: T, b: T, c: T) -> Self {
        let ab = two_product(a, b);
        self.add(ab.lo * c).add_product(ab.hi, c)
    }

    pub(crate) fn value(self) -> T {
        self.hi + self.lo
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cancelling_products_keep_their_difference() {
        // (1 + u)(1 - u) - 1 = -u², far below the rounding of the product itself.
        let u = 2f64.powi(-40);
        let difference = DoubleDouble::zero()
            .add_product(1.0 + u, 1.0 - u)
            .add(-1.0)
            .value();
        assert_eq!(difference, -u * u);
        let triple = DoubleDouble::<f32>::zero()
            .add_triple(3.0, 5.0, 7.0)
            .add(-105.0)
            .value();
        assert_eq!(triple, 0.0);
    }
}
