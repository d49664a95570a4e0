//! Sums of products carried in twice the working precision.
//!
//! Knuth's two-sum and the fused two-product (Ogita, Rump & Oishi 2005, "Accurate sum and dot product").

/// An unevaluated sum `hi + lo`, |lo| no more than half an ulp of `hi`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DoubleDouble {
    pub(crate) hi: f64,
    pub(crate) lo: f64,
}

/// a + b exactly.
fn two_sum(a: f64, b: f64) -> DoubleDouble {
    let hi = a + b;
    let of_b = hi - a;
    DoubleDouble {
        hi,
        lo: (a - (hi - of_b)) + (b - of_b),
    }
}

/// a · b exactly (unless it underflows).
fn two_product(a: f64, b: f64) -> DoubleDouble {
    let hi = a * b;
    DoubleDouble {
        hi,
        lo: a.mul_add(b, -hi),
    }
}

impl DoubleDouble {
    pub(crate) fn zero() -> Self {
        Self { hi: 0.0, lo: 0.0 }
    }

    pub(crate) fn add(self, x: f64) -> Self {
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
    pub(crate) fn add_product(self, a: f64, b: f64) -> Self {
        self.add_sum(two_product(a, b))
    }

    /// self + a·b·c.
    pub(crate) fn add_triple(self, a: f64, b: f64, c: f64) -> Self {
        let ab = two_product(a, b);
        self.add(ab.lo * c).add_product(ab.hi, c)
    }

    pub(crate) fn value(self) -> f64 {
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
        let triple = DoubleDouble::zero()
            .add_triple(3.0, 5.0, 7.0)
            .add(-105.0)
            .value();
        assert_eq!(triple, 0.0);
    }
}
