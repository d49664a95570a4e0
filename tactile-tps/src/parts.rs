//! The parts of a spline: its centres, their weights, the affine part.

use nalgebra::{Point, SMatrix, SVector};

use crate::{Kernel, Scalar, Spline, centres::Frame, far::Parts};

impl<T: Scalar, const D: usize, const M: usize, K: Kernel> Spline<T, D, M, K> {
    /// Number of distinct centres.
    pub(crate) fn count(&self) -> usize {
        self.centres.len() / D
    }

    /// The terms of the kernel sum, each with its centre xᵢ and its weight wᵢ in the kernel's units: the distinct source points, in
    /// their order.
    ///
    /// ```
    /// # use nalgebra::Point2;
    /// # use tactile_tps::{FitOptions, ThinPlateSpline};
    /// # fn main() -> Result<(), tactile_tps::TpsError> {
    /// # let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.4, 0.6]].map(Point2::from);
    /// # let targets = sources.map(|p| Point2::new(p.x + 0.1 * p.y * p.y, p.y));
    /// let warp = ThinPlateSpline::fit(&sources, &targets, &FitOptions::default())?;
    /// assert!(warp.terms().zip(&sources).all(|((centre, _), source)| (centre - source).norm() < 1e-15));
    /// let sum: nalgebra::Vector2<f64> = warp.terms().map(|(_, w)| w).sum();
    /// let moment: nalgebra::Matrix2<f64> = warp.terms().map(|(x, w)| w * x.coords.transpose()).sum();
    /// assert!(warp.terms().len() == 5 && sum.norm() < 1e-15 && moment.norm() < 1e-15);
    /// # Ok(())
    /// # }
    /// ```
    pub fn terms(&self) -> impl ExactSizeIterator<Item = (Point<T, D>, SVector<f64, M>)> + '_ {
        let (n, unit) = (self.count(), self.unit());
        (0..n).map(move |j| {
            let inside = |k: usize| self.centres[k * n + j].widen();
            let centre = Point::from(SVector::from_fn(|k, _| {
                T::narrow(inside(k) * self.frame.scale + self.frame.centre[k])
            }));
            let weight = SVector::from_fn(|k, _| self.weights[k * n + j].widen() / unit);
            (centre, weight)
        })
    }

    /// The affine part x ↦ A x + a₀ beside the kernel sum, in the points' units.
    ///
    /// Kernels are scaled to unit size inside; what that leaves of a kernel like r² ln r, a multiple of r², is
    /// affine by the side conditions and is accounted for here.
    ///
    /// ```
    /// # use nalgebra::Point2;
    /// # use tactile_tps::{FitOptions, Kernel, R2LogR, ThinPlateSpline};
    /// # fn main() -> Result<(), tactile_tps::TpsError> {
    /// # let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.4, 0.6]].map(Point2::from);
    /// # let targets = sources.map(|p| Point2::new(p.x + 0.1 * p.y * p.y, p.y));
    /// let warp = ThinPlateSpline::fit(&sources, &targets, &FitOptions::default())?;
    /// let (linear, offset) = warp.affine();
    /// let x = Point2::new(0.7, 0.2);
    /// let term = |(c, w): (Point2<f64>, nalgebra::Vector2<f64>)| w * R2LogR.jet((x - c).norm_squared()).value;
    /// let by_hand = linear * x.coords + offset + warp.terms().map(term).sum::<nalgebra::Vector2<f64>>();
    /// assert!((warp.apply(&x).coords - by_hand).norm() < 1e-14);
    /// # Ok(())
    /// # }
    /// ```
    pub fn affine(&self) -> (SMatrix<f64, M, D>, SVector<f64, M>) {
        let Frame { centre, scale } = self.frame;
        let linear = SMatrix::from_fn(|i, j| self.affine.gradient[i][j].widen() / scale);
        let kernel = |s: f64| self.kernel.jet(s).value;
        let square = kernel(scale * scale) / self.unit() - kernel(1.0);
        let n = self.count();
        let offset = SVector::from_fn(|i, _| {
            let norm = |j: usize| {
                (0..D)
                    .map(|k| self.centres[k * n + j].widen().powi(2))
                    .sum::<f64>()
            };
            let second: f64 = (0..n)
                .map(|j| self.weights[i * n + j].widen() * norm(j))
                .sum();
            let shift: f64 = (0..D)
                .map(|k| self.affine.gradient[i][k].widen() * (centre[k] / scale))
                .sum();
            self.affine.constant[i].widen() - shift - square * second
        });
        (linear, offset)
    }

    /// How much larger the kernel is outside than in the frame.
    pub(crate) fn unit(&self) -> f64 {
        self.frame.scale.powi(self.kernel.degree().unwrap_or(0))
    }

    /// Coordinates of the centres and their weights, column by column.
    pub(crate) fn columns(&self) -> ([&[T]; D], [&[T]; M]) {
        let n = self.count();
        (
            core::array::from_fn(|k| &self.centres[k * n..(k + 1) * n]),
            core::array::from_fn(|m| &self.weights[m * n..(m + 1) * n]),
        )
    }

    pub(crate) fn parts(&self) -> Parts<'_, T, K, D, M> {
        let (centres, weights) = self.columns();
        Parts {
            kernel: &self.kernel,
            frame: self.frame,
            centres,
            weights,
            affine: &self.affine,
        }
    }
}
