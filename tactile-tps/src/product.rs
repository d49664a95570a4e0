//! Products with the kernel matrix, whose entries are computed as they are needed.

use core::ops::Range;

use crate::{
    Kernel,
    evaluate::{BLOCK, Lanes, Sum, TAIL},
    real::Lane,
    simd::{Job, dispatch},
};

/// wᵀKw, summed over the outputs.
pub(crate) fn energy<K: Kernel, const D: usize, const M: usize>(
    kernel: &K,
    centres: [&[f64]; D],
    weights: [&[f64]; M],
) -> f64 {
    let mut residuals = vec![0.0; M * centres[0].len()];
    let sum = Sum {
        kernel,
        centres,
        weights,
    };
    dispatch(Subtract {
        sum,
        places: centres,
        range: 0..centres[0].len(),
        residuals: &mut residuals,
    });
    let products = weights
        .iter()
        .copied()
        .flatten()
        .zip(&residuals)
        .map(|(w, r)| -w * r);
    f64::max(products.sum(), 0.0)
}

/// Subtracts the kernel sum at the places of a range, which begins at a multiple of [`BLOCK`].
pub(crate) struct Subtract<'a, K, const D: usize, const M: usize> {
    pub(crate) sum: Sum<'a, f64, K, D, M>,
    pub(crate) places: [&'a [f64]; D],
    pub(crate) range: Range<usize>,
    /// Of all places, output by output.
    pub(crate) residuals: &'a mut [f64],
}

impl<K: Kernel, const D: usize, const M: usize> Job<f64> for Subtract<'_, K, D, M> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lane<f64>>(mut self) {
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
    fn block<L: Lane<f64>, const W: usize>(&mut self, start: usize, used: usize) {
        let n = self.places[0].len();
        let mut x = [[0.0; W]; D];
        for k in 0..D {
            x[k][..used].copy_from_slice(&self.places[k][start..start + used]);
        }
        let mut sums = Lanes::<f64, D, M, W>::new();
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
