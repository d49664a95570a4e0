//! Right-hand sides of the equations for a spline's influences.

use nalgebra::Point;

use crate::{Factorization, Kernel, Scalar, null_space::MAX, real::Lane, simd::Job};

/// One right-hand side: the kernels and affine functions at a point, or their derivative along an axis.
pub(crate) struct Column<const D: usize> {
    point: [f64; D],
    axis: Option<usize>,
    pub(crate) affine: [f64; MAX],
    /// Length of the frame's unit for a derivative, else one.
    pub(crate) unit: f64,
}

impl<const D: usize> Column<D> {
    pub(crate) fn value<T: Scalar, K>(
        factorization: &Factorization<T, D, K>,
        point: &Point<T, D>,
    ) -> Self {
        let (span, point) = (
            &factorization.system.span,
            factorization.centres.frame.inside(point),
        );
        let affine = core::array::from_fn(|c| {
            if c <= span.directions {
                span.value(c, &point)
            } else {
                0.0
            }
        });
        Self {
            point,
            axis: None,
            affine,
            unit: 1.0,
        }
    }

    pub(crate) fn slope<T: Scalar, K>(
        factorization: &Factorization<T, D, K>,
        point: &Point<T, D>,
        axis: usize,
    ) -> Self {
        let (span, frame) = (&factorization.system.span, &factorization.centres.frame);
        let affine = core::array::from_fn(|c| {
            if c <= span.directions {
                span.slope(c, axis)
            } else {
                0.0
            }
        });
        Self {
            point: frame.inside(point),
            axis: Some(axis),
            affine,
            unit: frame.scale,
        }
    }
}

/// Writes a column's kernel about every centre.
pub(crate) struct Fill<'a, K, const D: usize> {
    pub(crate) kernel: &'a K,
    pub(crate) axes: [&'a [f64]; D],
    pub(crate) column: &'a Column<D>,
    pub(crate) terms: &'a mut [f64],
}

impl<K: Kernel, const D: usize> Job<f64> for Fill<'_, K, D> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lane<f64>>(self) {
        let n = self.terms.len();
        let axes = self.axes.map(|axis| &axis[..n]);
        let point = self.column.point.map(L::new);
        for (i, term) in self.terms.iter_mut().enumerate() {
            let d: [L; D] = core::array::from_fn(|k| point[k] - L::new(axes[k][i]));
            let s = d.iter().fold(L::from_f64(0.0), |s, d| d.mul_add(*d, s));
            *term = match self.column.axis {
                None => self.kernel.jet(s).value.get(),
                Some(axis) => (L::from_f64(2.0) * self.kernel.jet(s).first * d[axis]).get(),
            };
        }
    }
}
