//! Sums of kernels over all centres, for blocks of query points at once.
//!
//! Queries are the lanes and centres the outer loop: every query's sum runs over the centres in the same order,
//! whether it comes alone or among thousands, so the bits are the same.

use crate::{
    Jet, Kernel,
    real::{Lane, Scalar},
};

/// Queries in a full block; long enough for the compiler to vectorise, short enough for the first-level cache.
pub(crate) const BLOCK: usize = 64;
/// Queries in the blocks that take what is left.
pub(crate) const TAIL: usize = 8;

/// The kernel sum of a spline, in its frame.
#[derive(Clone, Copy)]
pub(crate) struct Sum<'a, T, K, const D: usize, const M: usize> {
    pub(crate) kernel: &'a K,
    /// Coordinates of the centres, axis by axis.
    pub(crate) centres: [&'a [T]; D],
    /// Weights of the centres, output by output.
    pub(crate) weights: [&'a [T]; M],
}

/// Sums for `W` queries: U, its gradient and its Hessian, as far as the order asked for.
pub(crate) struct Lanes<T, const D: usize, const M: usize, const W: usize> {
    pub(crate) value: [[T; W]; M],
    pub(crate) gradient: [[[T; W]; D]; M],
    pub(crate) hessian: [[[[T; W]; D]; D]; M],
}

impl<T: Scalar, const D: usize, const M: usize, const W: usize> Lanes<T, D, M, W> {
    #[inline(always)]
    pub(crate) fn new() -> Self {
        let zero = [T::zero(); W];
        Self {
            value: [zero; M],
            gradient: [[zero; D]; M],
            hessian: [[[zero; D]; D]; M],
        }
    }

    #[inline(always)]
    fn add_value<L: Lane<T>>(&mut self, l: usize, weight: &[L; M], value: L) {
        for m in 0..M {
            add(&mut self.value[m][l], weight[m], value);
        }
    }

    /// Adds a term's value, gradient 2U'd and, at second order, Hessian 2U' I + 4U'' d dᵀ (derivatives by s = |d|²).
    #[inline(always)]
    fn add_jet<L: Lane<T>, const ORDER: usize>(
        &mut self,
        l: usize,
        weight: &[L; M],
        d: &[L; D],
        jet: Jet<L>,
    ) {
        self.add_value(l, weight, jet.value);
        let slope = L::from_f64(2.0) * jet.first;
        for k in 0..D {
            let along = slope * d[k];
            for m in 0..M {
                add(&mut self.gradient[m][k][l], weight[m], along);
            }
        }
        if ORDER == 2 {
            self.add_hessian(l, weight, d, slope, L::from_f64(4.0) * jet.second);
        }
    }

    #[inline(always)]
    fn add_hessian<L: Lane<T>>(
        &mut self,
        l: usize,
        weight: &[L; M],
        d: &[L; D],
        slope: L,
        bend: L,
    ) {
        for k in 0..D {
            for i in 0..=k {
                let own = if i == k { slope } else { L::from_f64(0.0) };
                let curve = (bend * d[k]).mul_add(d[i], own);
                for m in 0..M {
                    add(&mut self.hessian[m][k][i][l], weight[m], curve);
                }
            }
        }
    }
}

/// An accumulator's next value.
#[inline(always)]
fn add<T: Scalar, L: Lane<T>>(sum: &mut T, a: L, b: L) {
    *sum = a.mul_add(b, L::new(*sum)).get();
}

impl<T: Scalar, K: Kernel, const D: usize, const M: usize> Sum<'_, T, K, D, M> {
    /// Sums up to derivatives of the given `ORDER` (0, 1 or 2) at the queries `x`, axis by axis.
    #[inline(always)]
    pub(crate) fn block<L: Lane<T>, const W: usize, const ORDER: usize>(
        &self,
        x: &[[T; W]; D],
        sums: &mut Lanes<T, D, M, W>,
    ) {
        let n = self.centres[0].len();
        let centres = self.centres.map(|axis| &axis[..n]);
        let weights = self.weights.map(|output| &output[..n]);
        for j in 0..n {
            let centre: [L; D] = core::array::from_fn(|k| L::new(centres[k][j]));
            let weight: [L; M] = core::array::from_fn(|m| L::new(weights[m][j]));
            for l in 0..W {
                let d: [L; D] = core::array::from_fn(|k| L::new(x[k][l]) - centre[k]);
                let mut s = d[0] * d[0];
                for k in 1..D {
                    s = d[k].mul_add(d[k], s);
                }
                if ORDER == 0 {
                    sums.add_value(l, &weight, self.kernel.jet(s).value);
                } else {
                    sums.add_jet::<L, ORDER>(l, &weight, &d, self.kernel.jet(s));
                }
            }
        }
    }
}
