//! Samples of a spline at points: scaling to the frame, the kernel sum, and scaling back.

use nalgebra::{Point, SMatrix, SVector};

use crate::{
    Kernel,
    centres::Frame,
    evaluate::{BLOCK, Lanes, Sum, TAIL},
    real::{Lane, Scalar},
    simd::Job,
};

/// The affine part of a spline in its frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Linear<T, const D: usize, const M: usize> {
    pub(crate) constant: [T; M],
    pub(crate) gradient: [[T; D]; M],
}

/// A spline's value and derivatives at one point.
#[derive(Clone, Copy)]
pub(crate) struct Sample<T, const D: usize, const M: usize> {
    pub(crate) value: [T; M],
    pub(crate) gradient: [[T; D]; M],
    pub(crate) hessian: [[[T; D]; D]; M],
}

impl<T: Scalar, const D: usize, const M: usize> Sample<T, D, M> {
    #[inline(always)]
    pub(crate) fn point(&self) -> Point<T, M> {
        Point::from(SVector::from(self.value))
    }

    /// Largest value.
    pub(crate) fn size(&self) -> f64 {
        self.value
            .iter()
            .fold(0.0, |size, x| f64::max(size, x.widen().abs()))
    }

    #[inline(always)]
    pub(crate) fn jacobian(&self) -> SMatrix<T, M, D> {
        SMatrix::from_fn(|i, j| self.gradient[i][j])
    }

    #[inline(always)]
    pub(crate) fn hessian(&self) -> [SMatrix<T, D, D>; M] {
        self.hessian
            .map(|h| SMatrix::from_fn(|i, j| if i >= j { h[i][j] } else { h[j][i] }))
    }
}

/// Samples at all points, block by block.
pub(crate) struct Each<'a, T: Scalar, K, F, const D: usize, const M: usize, const ORDER: usize> {
    pub(crate) sum: Sum<'a, T, K, D, M>,
    pub(crate) affine: &'a Linear<T, D, M>,
    pub(crate) frame: Frame<D>,
    pub(crate) points: &'a [Point<T, D>],
    pub(crate) sink: F,
}

impl<T, K, F, const D: usize, const M: usize, const ORDER: usize> Job<T>
    for Each<'_, T, K, F, D, M, ORDER>
where
    T: Scalar,
    K: Kernel,
    F: FnMut(usize, Sample<T, D, M>),
{
    type Output = ();

    #[inline(always)]
    fn run<L: Lane<T>>(mut self) {
        let full = self.points.len() / BLOCK * BLOCK;
        for start in (0..full).step_by(BLOCK) {
            self.chunk::<L, BLOCK>(start, BLOCK);
        }
        for start in (full..self.points.len()).step_by(TAIL) {
            self.chunk::<L, TAIL>(start, TAIL.min(self.points.len() - start));
        }
    }
}

impl<T, K, F, const D: usize, const M: usize, const ORDER: usize> Each<'_, T, K, F, D, M, ORDER>
where
    T: Scalar,
    K: Kernel,
    F: FnMut(usize, Sample<T, D, M>),
{
    /// Samples `used` ≤ `W` points from `start` on.
    #[inline(always)]
    fn chunk<L: Lane<T>, const W: usize>(&mut self, start: usize, used: usize) {
        let mut x = [[T::zero(); W]; D];
        for l in 0..W {
            let inside = self.frame.inside(&self.points[start + l.min(used - 1)]);
            (0..D).for_each(|k| x[k][l] = T::narrow(inside[k]));
        }
        let mut sums = Lanes::<T, D, M, W>::new();
        self.sum.block::<L, W, ORDER>(&x, &mut sums);
        for l in 0..used {
            let point = core::array::from_fn(|k| x[k][l]);
            let sample = self.finish::<L, W>(&point, &sums, l);
            (self.sink)(start + l, sample);
        }
    }

    /// Adds the affine part and returns to the units of the points.
    #[inline(always)]
    fn finish<L: Lane<T>, const W: usize>(
        &self,
        x: &[T; D],
        sums: &Lanes<T, D, M, W>,
        l: usize,
    ) -> Sample<T, D, M> {
        let (affine, scale) = (self.affine, T::narrow(self.frame.scale));
        let mut sample = Sample {
            value: [T::zero(); M],
            gradient: [[T::zero(); D]; M],
            hessian: [[[T::zero(); D]; D]; M],
        };
        for m in 0..M {
            let start = L::new(sums.value[m][l]) + L::new(affine.constant[m]);
            let along = |sum: L, k: usize| L::new(affine.gradient[m][k]).mul_add(L::new(x[k]), sum);
            sample.value[m] = (0..D).fold(start, along).get();
            for k in (0..D).filter(|_| ORDER > 0) {
                sample.gradient[m][k] = (affine.gradient[m][k] + sums.gradient[m][k][l]) / scale;
                for i in (0..=k).filter(|_| ORDER > 1) {
                    sample.hessian[m][k][i] = sums.hessian[m][k][i][l] / scale / scale;
                }
            }
        }
        sample
    }
}
