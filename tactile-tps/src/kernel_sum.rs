//! The sum over the kernels of all centres, for blocks of queries.
//!
//! Queries are the lanes of vectorised loops, and centres are the outer loop. The sum of each query
//! runs over the centres in the same order, whether it is evaluated alone or among thousands, so
//! the bits are the same.

use core::ops::Range;

use crate::{
    Kernel, KernelDerivatives,
    lanes::{Job, Lane, dispatch},
};

/// Number of queries in a full block: enough for the compiler to vectorise, and few enough for the
/// first-level cache.
pub(crate) const BLOCK: usize = 64;

/// Number of queries in the smaller blocks for the remainder.
pub(crate) const TAIL: usize = 8;

/// The kernel sum of a spline, in its frame.
#[derive(Clone, Copy)]
pub(crate) struct KernelSum<'a, K, const D: usize, const M: usize> {
    pub(crate) kernel: &'a K,
    /// Coordinates of the centres, by axes.
    pub(crate) centres: [&'a [f64]; D],
    /// Weights of the centres, by outputs.
    pub(crate) weights: [&'a [f64]; M],
}

/// Sums for `W` queries: U, its gradient and its Hessian, up to the requested order.
pub(crate) struct Lanes<const D: usize, const M: usize, const W: usize> {
    pub(crate) value: [[f64; W]; M],
    pub(crate) gradient: [[[f64; W]; D]; M],
    pub(crate) hessian: [[[[f64; W]; D]; D]; M],
}

impl<const D: usize, const M: usize, const W: usize> Lanes<D, M, W> {
    #[inline(always)]
    pub(crate) fn new() -> Self {
        let zero = [0.0; W];
        Self {
            value: [zero; M],
            gradient: [[zero; D]; M],
            hessian: [[[zero; D]; D]; M],
        }
    }

    #[inline(always)]
    fn add_value<L: Lane>(&mut self, l: usize, weight: &[L; M], value: L) {
        for m in 0..M {
            add(&mut self.value[m][l], weight[m], value);
        }
    }

    /// Adds the value of a term, its gradient 2U'd and, at second order, its Hessian 2U' I + 4U'' d
    /// dᵀ (derivatives by s = |d|²).
    #[inline(always)]
    fn add_derivatives<L: Lane, const ORDER: usize>(
        &mut self,
        l: usize,
        weight: &[L; M],
        d: &[L; D],
        term: KernelDerivatives<L>,
    ) {
        self.add_value(l, weight, term.value);
        let slope = L::from_f64(2.0) * term.first;
        for k in 0..D {
            let along = slope * d[k];
            for m in 0..M {
                add(&mut self.gradient[m][k][l], weight[m], along);
            }
        }
        if ORDER == 2 {
            self.add_hessian(l, weight, d, slope, L::from_f64(4.0) * term.second);
        }
    }

    #[inline(always)]
    fn add_hessian<L: Lane>(&mut self, l: usize, weight: &[L; M], d: &[L; D], slope: L, bend: L) {
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
fn add<L: Lane>(sum: &mut f64, a: L, b: L) {
    *sum = a.mul_add(b, L::from_f64(*sum)).get();
}

impl<K: Kernel, const D: usize, const M: usize> KernelSum<'_, K, D, M> {
    /// Sums up to derivatives of the given `ORDER` (0, 1 or 2) at the queries `x`, given by axes.
    #[inline(always)]
    pub(crate) fn block<L: Lane, const W: usize, const ORDER: usize>(
        &self,
        x: &[[f64; W]; D],
        sums: &mut Lanes<D, M, W>,
    ) {
        let n = self.centres[0].len();
        let centres = self.centres.map(|axis| &axis[..n]);
        let weights = self.weights.map(|output| &output[..n]);
        // The data of a centre are read once for all queries of the block.
        for j in 0..n {
            let centre: [L; D] = core::array::from_fn(|k| L::from_f64(centres[k][j]));
            let weight: [L; M] = core::array::from_fn(|m| L::from_f64(weights[m][j]));
            for l in 0..W {
                let d: [L; D] = core::array::from_fn(|k| L::from_f64(x[k][l]) - centre[k]);
                let mut s = d[0] * d[0];
                for k in 1..D {
                    s = d[k].mul_add(d[k], s);
                }
                if ORDER == 0 {
                    sums.add_value(l, &weight, self.kernel.derivatives(s).value);
                } else {
                    sums.add_derivatives::<L, ORDER>(l, &weight, &d, self.kernel.derivatives(s));
                }
            }
        }
    }
}

impl<K: Kernel, const D: usize, const M: usize> KernelSum<'_, K, D, M> {
    /// Subtracts the kernel sum at the points of a range, which starts at a multiple of [`BLOCK`],
    /// from `residuals`.
    ///
    /// `residuals` holds the values of all points, by outputs.
    pub(crate) fn subtract(self, places: [&[f64]; D], range: Range<usize>, residuals: &mut [f64]) {
        dispatch(Subtract {
            sum: self,
            places,
            range,
            residuals,
        });
    }
}

/// Subtracts the kernel sum at the points of a range, which starts at a multiple of [`BLOCK`].
struct Subtract<'a, K, const D: usize, const M: usize> {
    sum: KernelSum<'a, K, D, M>,
    places: [&'a [f64]; D],
    range: Range<usize>,
    /// Residuals of all points, by outputs.
    residuals: &'a mut [f64],
}

impl<K: Kernel, const D: usize, const M: usize> Job for Subtract<'_, K, D, M> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lane>(mut self) {
        let Range { start: first, end } = self.range;
        let full = first + (end - first) / BLOCK * BLOCK;
        for start in (first..full).step_by(BLOCK) {
            self.block::<L, BLOCK>(start, BLOCK);
        }
        for start in (full..end).step_by(TAIL) {
            self.block::<L, TAIL>(start, TAIL.min(end - start));
        }
    }
}

impl<K: Kernel, const D: usize, const M: usize> Subtract<'_, K, D, M> {
    #[inline(always)]
    fn block<L: Lane, const W: usize>(&mut self, start: usize, used: usize) {
        let n = self.places[0].len();
        let mut x = [[0.0; W]; D];
        for k in 0..D {
            x[k][..used].copy_from_slice(&self.places[k][start..start + used]);
        }
        let mut sums = Lanes::<D, M, W>::new();
        self.sum.block::<L, W, 0>(&x, &mut sums);
        for m in 0..M {
            let residuals = &mut self.residuals[m * n + start..m * n + start + used];
            residuals
                .iter_mut()
                .zip(&sums.value[m])
                .for_each(|(r, sum)| *r -= sum);
        }
    }
}
