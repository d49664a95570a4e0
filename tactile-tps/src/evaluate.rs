//! The fitted spline: values, Jacobians and Hessians at one or many points, its terms and its
//! energy.

use nalgebra::{Point, SMatrix, SVector};
#[cfg(feature = "rayon")]
use rayon::prelude::*;

use crate::{
    FitReport, Kernel, R2LogR, TpsError,
    error::same_length,
    frame::Frame,
    kernel_sum::{BLOCK, KernelSum, Lanes, TAIL},
    lanes::{Job, Lane, UNIT_ROUNDOFF, dispatch},
};

/// The affine part of a spline, in its frame.
#[derive(Clone, Copy, Debug, PartialEq)]
struct AffinePart<const D: usize, const M: usize> {
    constant: [f64; M],
    gradient: [[f64; D]; M],
}

/// A thin-plate spline from `D`-space to `M`-space: f(x) = a₀ + A x + Σᵢ wᵢ U(|x − xᵢ|).
///
/// [`Default`] is the zero spline.
/// The weights satisfy Σ wᵢ = 0 and Σ wᵢ xᵢᵀ = 0 and minimise Σ weightᵢ |f(xᵢ) − yᵢ|² + λ wᵀKw
/// (Wahba 1990).
///
/// With as many outputs as axes it is a map of space: it is the identity along directions that the
/// source points do not span ([`Warp::rank`](crate::Warp::rank)). With another number of outputs it
/// is constant along them.
#[derive(Clone, Debug)]
pub struct Spline<const D: usize, const M: usize, K = R2LogR> {
    kernel: K,
    frame: Frame<D>,
    /// Centres in the frame, by axes.
    centres: Vec<f64>,
    /// Weights in the frame, by outputs.
    weights: Vec<f64>,
    affine: AffinePart<D, M>,
    /// Largest Σ |wᵢ| of an output.
    weight: f64,
    /// Largest target.
    level: f64,
    /// Report of the fit.
    pub report: FitReport,
}

impl<const D: usize, const M: usize, K: Kernel + Default> Default for Spline<D, M, K> {
    /// The zero spline, to be filled by
    /// [`Factorization::refit_with`](crate::Factorization::refit_with).
    fn default() -> Self {
        Self::zero(K::default())
    }
}

/// A spline that maps space onto itself.
///
/// ```
/// use nalgebra::Point3;
/// use tactile_tps::{FitOptions, NegR, ThinPlateSpline};
/// # fn main() -> Result<(), tactile_tps::TpsError> {
/// let sources = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.3, 0.4,
///     0.2]].map(Point3::from);
/// let targets = sources.map(|p| p * 2.0);
/// let warp: ThinPlateSpline<3, NegR> = ThinPlateSpline::fit(&sources, &targets,
///     &FitOptions::new(NegR))?;
/// assert!((warp.jacobian(&Point3::new(0.5, 0.5,
///     0.5)) - nalgebra::Matrix3::identity() * 2.0).norm() < 1e-13);
/// # Ok(())
/// # }
/// ```
pub type ThinPlateSpline<const D: usize, K = R2LogR> = Spline<D, D, K>;

/// A solution in the frame, from which a spline is filled.
pub(crate) struct Solution<'a, const D: usize, const M: usize> {
    pub(crate) frame: Frame<D>,
    /// Coordinates of the centres, by axes.
    pub(crate) axes: &'a [Vec<f64>; D],
    /// Weights of the centres, by outputs.
    pub(crate) weights: &'a [f64],
    pub(crate) constant: [f64; M],
    pub(crate) gradient: [[f64; D]; M],
    /// Largest target.
    pub(crate) level: f64,
}

impl<const D: usize, const M: usize, K: Kernel> Spline<D, M, K> {
    /// The zero spline, to be filled by a fit.
    pub(crate) fn zero(kernel: K) -> Self {
        Self {
            kernel,
            frame: Frame::default(),
            centres: Vec::new(),
            weights: Vec::new(),
            affine: AffinePart {
                constant: [0.0; M],
                gradient: [[0.0; D]; M],
            },
            weight: 0.0,
            level: 0.0,
            report: FitReport::default(),
        }
    }

    /// Stores a solution, reusing memory if possible.
    pub(crate) fn assign(&mut self, kernel: &K, solution: &Solution<'_, D, M>) {
        self.kernel.clone_from(kernel);
        self.frame = solution.frame;
        self.centres.clear();
        for axis in solution.axes {
            self.centres.extend_from_slice(axis);
        }
        self.weights.clear();
        self.weights.extend_from_slice(solution.weights);
        self.affine = AffinePart {
            constant: solution.constant,
            gradient: solution.gradient.map(|row| row),
        };
        let sums = self.columns().1.map(|w| w.iter().map(|x| x.abs()).sum());
        self.weight = sums.into_iter().fold(0.0, f64::max);
        self.level = solution.level;
        self.report.digits = digits(if self.level > 0.0 {
            self.rounding(0.0) / self.level
        } else {
            0.0
        });
    }

    /// Expected rounding error of the sum at squared distance `s` from the centre of the frame.
    fn rounding(&self, s: f64) -> f64 {
        // The farthest centre is about one unit further away. Below two units the terms do not
        // become smaller.
        let distance = f64::max(s.sqrt() + 1.0, 2.0);
        let term = self.kernel.derivatives(distance * distance).value;
        UNIT_ROUNDOFF * self.weight * term.abs()
    }

    /// Number of accurate decimal digits of the sum of the spline's terms at a point.
    ///
    /// It is −log₁₀ of the expected rounding error, relative to the value or the targets, whichever
    /// is larger. Far from the points it decreases, because the terms grow faster than the sum.
    /// Values with few digits are better replaced by those of the [affine part](Self::affine).
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use tactile_tps::{FitOptions, ThinPlateSpline};
    /// # fn main() -> Result<(), tactile_tps::TpsError> {
    /// let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.4,
    ///     0.6]].map(Point2::from);
    /// let targets = sources.map(|p| Point2::new(p.x + 0.1 * p.y * p.y, p.y));
    /// let warp = ThinPlateSpline::fit(&sources, &targets, &FitOptions::default())?;
    /// let near = warp.digits(&Point2::new(0.5, 0.5));
    /// let far = warp.digits(&Point2::new(1e6, 1e6));
    /// assert!(near > 14.0 && far < near);
    /// # Ok(())
    /// # }
    /// ```
    pub fn digits(&self, point: &Point<f64, D>) -> f64 {
        let size = self
            .apply(point)
            .iter()
            .fold(0.0, |size, x| f64::max(size, x.abs()));
        let distance_squared = self.frame.inside(point).iter().map(|x| x * x).sum();
        digits(self.rounding(distance_squared) / f64::max(size, self.level))
    }

    /// wᵀKw, summed over the outputs, in the units of the kernel. O(n²).
    ///
    /// For r² ln r in the plane, and −r in space, the integral ∫ |∂²f|² of all second derivatives
    /// is 8π times this value.
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use tactile_tps::{FitOptions, ThinPlateSpline};
    /// # fn main() -> Result<(), tactile_tps::TpsError> {
    /// let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.4,
    ///     0.6]].map(Point2::from);
    /// let targets = sources.map(|p| Point2::new(p.x + 0.1 * p.y * p.y, p.y));
    /// let warp = ThinPlateSpline::fit(&sources, &targets, &FitOptions::default())?;
    /// let straight = ThinPlateSpline::fit(&sources, &sources, &FitOptions::default())?;
    /// assert!(warp.bending_energy() > 1e-4 && straight.bending_energy() < 1e-25);
    /// # Ok(())
    /// # }
    /// ```
    pub fn bending_energy(&self) -> f64 {
        let (centres, weights) = self.columns();
        let sum = KernelSum {
            kernel: &self.kernel,
            centres,
            weights,
        };
        let mut negative = vec![0.0; M * self.count()];
        sum.subtract(centres, 0..self.count(), &mut negative);
        let products = self.weights.iter().zip(&negative).map(|(w, r)| -w * r);
        // The energy of an affine spline is 0, which rounding can make negative.
        f64::max(products.sum(), 0.0) / self.unit()
    }

    /// Number of distinct centres.
    fn count(&self) -> usize {
        self.centres.len() / D
    }

    /// The terms of the kernel sum, each with its centre xᵢ and its weight wᵢ in the units of the
    /// kernel: the distinct source points, in order.
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use tactile_tps::{FitOptions, ThinPlateSpline};
    /// # fn main() -> Result<(), tactile_tps::TpsError> {
    /// let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.4,
    ///     0.6]].map(Point2::from);
    /// let targets = sources.map(|p| Point2::new(p.x + 0.1 * p.y * p.y, p.y));
    /// let warp = ThinPlateSpline::fit(&sources, &targets, &FitOptions::default())?;
    /// assert!(warp.terms().zip(&sources).all(|((centre, _),
    ///     source)| (centre - source).norm() < 1e-15));
    /// let sum: nalgebra::Vector2<f64> = warp.terms().map(|(_, w)| w).sum();
    /// let moment: nalgebra::Matrix2<f64> = warp.terms().map(|(x,
    ///     w)| w * x.coords.transpose()).sum();
    /// assert!(warp.terms().len() == 5 && sum.norm() < 1e-15 && moment.norm() < 1e-15);
    /// # Ok(())
    /// # }
    /// ```
    pub fn terms(&self) -> impl ExactSizeIterator<Item = (Point<f64, D>, SVector<f64, M>)> + '_ {
        let (n, unit) = (self.count(), self.unit());
        (0..n).map(move |j| {
            let inside = |k: usize| self.centres[k * n + j];
            let centre = Point::from(SVector::from_fn(|k, _| {
                inside(k) * self.frame.scale + self.frame.centre[k]
            }));
            let weight = SVector::from_fn(|k, _| self.weights[k * n + j] / unit);
            (centre, weight)
        })
    }

    /// The affine part x ↦ A x + a₀ in addition to the kernel sum, in the units of the points.
    ///
    /// Kernels are scaled to unit size internally. This changes a kernel such as r² ln r by a
    /// multiple of r². By the side conditions the sum of these multiples is affine, and it is
    /// included here.
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use tactile_tps::{FitOptions, Kernel, R2LogR, ThinPlateSpline};
    /// # fn main() -> Result<(), tactile_tps::TpsError> {
    /// let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.4,
    ///     0.6]].map(Point2::from);
    /// let targets = sources.map(|p| Point2::new(p.x + 0.1 * p.y * p.y, p.y));
    /// let warp = ThinPlateSpline::fit(&sources, &targets, &FitOptions::default())?;
    /// let (linear, offset) = warp.affine();
    /// let x = Point2::new(0.7, 0.2);
    /// let term = |(c, w): (Point2<f64>,
    ///     nalgebra::Vector2<f64>)| w * R2LogR.derivatives((x - c).norm_squared()).value;
    /// let by_hand = linear * x.coords + offset
    ///     + warp.terms().map(term).sum::<nalgebra::Vector2<f64>>();
    /// assert!((warp.apply(&x).coords - by_hand).norm() < 1e-14);
    /// # Ok(())
    /// # }
    /// ```
    pub fn affine(&self) -> (SMatrix<f64, M, D>, SVector<f64, M>) {
        let Frame { centre, scale } = self.frame;
        let linear = SMatrix::from_fn(|i, j| self.affine.gradient[i][j] / scale);
        let kernel = |s: f64| self.kernel.derivatives(s).value;
        // Remainder of the kernel's scaling, per r². For r² ln r it is the logarithm of the scale.
        let square = kernel(scale * scale) / self.unit() - kernel(1.0);
        let n = self.count();
        let offset = SVector::from_fn(|i, _| {
            let norm = |j: usize| (0..D).map(|k| self.centres[k * n + j].powi(2)).sum::<f64>();
            let second: f64 = (0..n).map(|j| self.weights[i * n + j] * norm(j)).sum();
            let shift: f64 = (0..D)
                .map(|k| self.affine.gradient[i][k] * (centre[k] / scale))
                .sum();
            self.affine.constant[i] - shift - square * second
        });
        (linear, offset)
    }

    /// Ratio of the kernel outside to that in the frame.
    fn unit(&self) -> f64 {
        self.frame.scale.powi(self.kernel.degree().unwrap_or(0))
    }

    /// Coordinates and weights of the centres, by columns.
    fn columns(&self) -> ([&[f64]; D], [&[f64]; M]) {
        let n = self.count();
        (
            core::array::from_fn(|k| &self.centres[k * n..(k + 1) * n]),
            core::array::from_fn(|m| &self.weights[m * n..(m + 1) * n]),
        )
    }

    /// f(x).
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use tactile_tps::{FitOptions, ThinPlateSpline};
    /// # fn main() -> Result<(), tactile_tps::TpsError> {
    /// let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.4,
    ///     0.6]].map(Point2::from);
    /// let targets = sources.map(|p| Point2::new(p.x + 0.1 * p.y * p.y, p.y));
    /// let warp = ThinPlateSpline::fit(&sources, &targets, &FitOptions::default())?;
    /// assert!((warp.apply(&sources[4]) - targets[4]).norm() < 1e-14);
    /// # Ok(())
    /// # }
    /// ```
    pub fn apply(&self, point: &Point<f64, D>) -> Point<f64, M> {
        let mut value = [Point::origin()];
        self.evaluate::<0>(core::slice::from_ref(point), (&mut value, &mut [], &mut []));
        value[0]
    }

    /// The Jacobian ∂fᵢ/∂xⱼ (row i, column j). At a centre of −r, where the kernel has a cusp, its
    /// own term is omitted.
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use tactile_tps::{FitOptions, ThinPlateSpline};
    /// # fn main() -> Result<(), tactile_tps::TpsError> {
    /// let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.4,
    ///     0.6]].map(Point2::from);
    /// let targets = sources.map(|p| Point2::new(p.x + 0.1 * p.y * p.y, p.y));
    /// let warp = ThinPlateSpline::fit(&sources, &targets, &FitOptions::default())?;
    /// let (x, h) = (Point2::new(0.5, 0.5), nalgebra::Vector2::new(1e-5, 0.0));
    /// let difference = (warp.apply(&(x + h)) - warp.apply(&(x - h))) / 2e-5;
    /// assert!((warp.jacobian(&x).column(0) - difference).norm() < 1e-9);
    /// # Ok(())
    /// # }
    /// ```
    pub fn jacobian(&self, point: &Point<f64, D>) -> SMatrix<f64, M, D> {
        let mut jacobian = [SMatrix::zeros()];
        self.evaluate::<1>(
            core::slice::from_ref(point),
            (&mut [], &mut jacobian, &mut []),
        );
        jacobian[0]
    }

    /// The Hessian of each output. At a centre where the kernel has no Hessian, its own term is
    /// omitted.
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use tactile_tps::{FitOptions, ThinPlateSpline};
    /// # fn main() -> Result<(), tactile_tps::TpsError> {
    /// let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.4,
    ///     0.6]].map(Point2::from);
    /// let targets = sources.map(|p| Point2::new(p.x + 0.1 * p.y * p.y, p.y));
    /// let warp = ThinPlateSpline::fit(&sources, &targets, &FitOptions::default())?;
    /// let (x, h) = (Point2::<f64>::new(0.5, 0.5), nalgebra::Vector2::new(0.0, 1e-5));
    /// let difference = (warp.jacobian(&(x + h)) - warp.jacobian(&(x - h))) / 2e-5;
    /// // ∂²fₓ/∂x∂y.
    /// assert!((warp.hessian(&x)[0][(0, 1)] - difference[(0, 0)]).abs() < 1e-8);
    /// # Ok(())
    /// # }
    /// ```
    pub fn hessian(&self, point: &Point<f64, D>) -> [SMatrix<f64, D, D>; M] {
        let mut hessian = [[SMatrix::zeros(); M]];
        self.evaluate::<2>(
            core::slice::from_ref(point),
            (&mut [], &mut [], &mut hessian),
        );
        hessian[0]
    }

    /// Writes f at many points into the caller's memory.
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use tactile_tps::{FitOptions, ThinPlateSpline};
    /// # fn main() -> Result<(), tactile_tps::TpsError> {
    /// let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.4,
    ///     0.6]].map(Point2::from);
    /// let targets = sources.map(|p| Point2::new(p.x + 0.1 * p.y * p.y, p.y));
    /// let warp = ThinPlateSpline::fit(&sources, &targets, &FitOptions::default())?;
    /// let queries = [Point2::new(0.5, 0.5), Point2::new(0.1, 0.9)];
    /// let mut values = [Point2::origin(); 2];
    /// warp.apply_into(&queries, &mut values)?;
    /// assert_eq!(values[1], warp.apply(&queries[1]));
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// [`TpsError::Length`] if the slices differ in length.
    pub fn apply_into(
        &self,
        points: &[Point<f64, D>],
        values: &mut [Point<f64, M>],
    ) -> Result<(), TpsError> {
        same_length(points.len(), values.len())?;
        self.evaluate::<0>(points, (values, &mut [], &mut []));
        Ok(())
    }

    /// Writes Jacobians at many points into the caller's memory.
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use tactile_tps::{FitOptions, ThinPlateSpline};
    /// # fn main() -> Result<(), tactile_tps::TpsError> {
    /// let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.4,
    ///     0.6]].map(Point2::from);
    /// let targets = sources.map(|p| Point2::new(p.x + 0.1 * p.y * p.y, p.y));
    /// let warp = ThinPlateSpline::fit(&sources, &targets, &FitOptions::default())?;
    /// let mut jacobians = [nalgebra::Matrix2::zeros(); 5];
    /// warp.jacobian_into(&sources, &mut jacobians)?;
    /// assert_eq!(jacobians[3], warp.jacobian(&sources[3]));
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// [`TpsError::Length`] if the slices differ in length.
    pub fn jacobian_into(
        &self,
        points: &[Point<f64, D>],
        jacobians: &mut [SMatrix<f64, M, D>],
    ) -> Result<(), TpsError> {
        same_length(points.len(), jacobians.len())?;
        self.evaluate::<1>(points, (&mut [], jacobians, &mut []));
        Ok(())
    }

    /// Writes values and Jacobians at many points into the caller's memory, in one pass.
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use tactile_tps::{FitOptions, ThinPlateSpline};
    /// # fn main() -> Result<(), tactile_tps::TpsError> {
    /// let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.4,
    ///     0.6]].map(Point2::from);
    /// let targets = sources.map(|p| Point2::new(p.x + 0.1 * p.y * p.y, p.y));
    /// let warp = ThinPlateSpline::fit(&sources, &targets, &FitOptions::default())?;
    /// let queries = [Point2::new(0.5, 0.5), Point2::new(0.1, 0.9)];
    /// let (mut values, mut jacobians) = ([Point2::origin(); 2], [nalgebra::Matrix2::zeros(); 2]);
    /// warp.apply_and_jacobian_into(&queries, &mut values, &mut jacobians)?;
    /// // The determinant is positive if the warp keeps orientation and does not fold.
    /// assert!(jacobians.iter().all(|j| j.determinant() > 0.5)
    ///     && (values[0] - queries[0]).norm() < 0.1);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// [`TpsError::Length`] if the slices differ in length.
    pub fn apply_and_jacobian_into(
        &self,
        points: &[Point<f64, D>],
        values: &mut [Point<f64, M>],
        jacobians: &mut [SMatrix<f64, M, D>],
    ) -> Result<(), TpsError> {
        same_length(points.len(), values.len())?;
        same_length(points.len(), jacobians.len())?;
        self.evaluate::<1>(points, (values, jacobians, &mut []));
        Ok(())
    }

    /// Values and derivatives up to `ORDER` at each point.
    fn evaluate<const ORDER: usize>(&self, points: &[Point<f64, D>], outputs: Outputs<'_, D, M>) {
        let (centres, weights) = self.columns();
        dispatch(Evaluation::<_, D, M, ORDER> {
            sum: KernelSum {
                kernel: &self.kernel,
                centres,
                weights,
            },
            affine: &self.affine,
            frame: self.frame,
            points,
            outputs,
        });
    }
}

/// Number of queries that a thread takes at a time.
#[cfg(feature = "rayon")]
const THREAD_QUERIES: usize = 8 * BLOCK;

#[cfg(feature = "rayon")]
impl<const D: usize, const M: usize, K: Kernel> Spline<D, M, K> {
    /// Like [`apply_into`](Self::apply_into), on the threads of the current rayon pool.
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use tactile_tps::{FitOptions, ThinPlateSpline};
    /// # fn main() -> Result<(), tactile_tps::TpsError> {
    /// let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.4,
    ///     0.6]].map(Point2::from);
    /// let targets = sources.map(|p| Point2::new(p.x + 0.1 * p.y * p.y, p.y));
    /// let warp = ThinPlateSpline::fit(&sources, &targets, &FitOptions::default())?;
    /// let queries: Vec<_> = (0..1000).map(|i| Point2::new(f64::from(i) / 1000.0, 0.5)).collect();
    /// let mut values = vec![Point2::origin(); 1000];
    /// warp.par_apply_into(&queries, &mut values)?;
    /// assert_eq!(values[999], warp.apply(&queries[999]));
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// [`TpsError::Length`] if the slices differ in length.
    pub fn par_apply_into(
        &self,
        points: &[Point<f64, D>],
        values: &mut [Point<f64, M>],
    ) -> Result<(), TpsError> {
        same_length(points.len(), values.len())?;
        let chunks = points
            .par_chunks(THREAD_QUERIES)
            .zip(values.par_chunks_mut(THREAD_QUERIES));
        chunks.try_for_each(|(points, values)| self.apply_into(points, values))
    }

    /// Like [`apply_and_jacobian_into`](Self::apply_and_jacobian_into), on the threads of the
    /// current rayon pool.
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use tactile_tps::{FitOptions, ThinPlateSpline};
    /// # fn main() -> Result<(), tactile_tps::TpsError> {
    /// let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.4,
    ///     0.6]].map(Point2::from);
    /// let targets = sources.map(|p| Point2::new(p.x + 0.1 * p.y * p.y, p.y));
    /// let warp = ThinPlateSpline::fit(&sources, &targets, &FitOptions::default())?;
    /// let queries: Vec<_> = (0..1000).map(|i| Point2::new(f64::from(i) / 1000.0, 0.5)).collect();
    /// let mut values = vec![Point2::origin(); 1000];
    /// let mut jacobians = vec![nalgebra::Matrix2::zeros(); 1000];
    /// warp.par_apply_and_jacobian_into(&queries, &mut values, &mut jacobians)?;
    /// assert_eq!(jacobians[7], warp.jacobian(&queries[7]));
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// [`TpsError::Length`] if the slices differ in length.
    pub fn par_apply_and_jacobian_into(
        &self,
        points: &[Point<f64, D>],
        values: &mut [Point<f64, M>],
        jacobians: &mut [SMatrix<f64, M, D>],
    ) -> Result<(), TpsError> {
        same_length(points.len(), values.len())?;
        same_length(points.len(), jacobians.len())?;
        let outputs = values
            .par_chunks_mut(THREAD_QUERIES)
            .zip(jacobians.par_chunks_mut(THREAD_QUERIES));
        points.par_chunks(THREAD_QUERIES).zip(outputs).try_for_each(
            |(points, (values, jacobians))| self.apply_and_jacobian_into(points, values, jacobians),
        )
    }
}

/// Decimal digits of a number with this relative error, limited to those of the type.
fn digits(error: f64) -> f64 {
    f64::max(error, UNIT_ROUNDOFF).log10().min(0.0).abs()
}

/// Output slices for values, Jacobians and Hessians of the points. An empty slice is skipped.
type Outputs<'a, const D: usize, const M: usize> = (
    &'a mut [Point<f64, M>],
    &'a mut [SMatrix<f64, M, D>],
    &'a mut [[SMatrix<f64, D, D>; M]],
);

/// Computes values and derivatives at all points, block by block.
struct Evaluation<'a, K, const D: usize, const M: usize, const ORDER: usize> {
    sum: KernelSum<'a, K, D, M>,
    affine: &'a AffinePart<D, M>,
    frame: Frame<D>,
    points: &'a [Point<f64, D>],
    outputs: Outputs<'a, D, M>,
}

impl<K: Kernel, const D: usize, const M: usize, const ORDER: usize> Job
    for Evaluation<'_, K, D, M, ORDER>
{
    type Output = ();

    #[inline(always)]
    fn run<L: Lane>(mut self) {
        let full = self.points.len() / BLOCK * BLOCK;
        for start in (0..full).step_by(BLOCK) {
            self.chunk::<L, BLOCK>(start, BLOCK);
        }
        for start in (full..self.points.len()).step_by(TAIL) {
            self.chunk::<L, TAIL>(start, TAIL.min(self.points.len() - start));
        }
    }
}

impl<K: Kernel, const D: usize, const M: usize, const ORDER: usize> Evaluation<'_, K, D, M, ORDER> {
    /// Evaluates at `used` ≤ `W` points starting at `start`.
    #[inline(always)]
    fn chunk<L: Lane, const W: usize>(&mut self, start: usize, used: usize) {
        let mut x = [[0.0; W]; D];
        for l in 0..W {
            // Lanes after the last point repeat it, so that the loop has a fixed length.
            let inside = self.frame.inside(&self.points[start + l.min(used - 1)]);
            (0..D).for_each(|k| x[k][l] = inside[k]);
        }
        let mut sums = Lanes::<D, M, W>::new();
        self.sum.block::<L, W, ORDER>(&x, &mut sums);
        for l in 0..used {
            let point = core::array::from_fn(|k| x[k][l]);
            self.finish::<L, W>(start + l, &point, &sums, l);
        }
    }

    /// Adds the affine part and converts to the units of the points.
    #[inline(always)]
    fn finish<L: Lane, const W: usize>(
        &mut self,
        at: usize,
        x: &[f64; D],
        sums: &Lanes<D, M, W>,
        l: usize,
    ) {
        let (affine, scale) = (self.affine, (self.frame.scale));
        let (values, jacobians, hessians) = &mut self.outputs;
        if let Some(value) = values.get_mut(at) {
            for m in 0..M {
                let start = L::from_f64(sums.value[m][l]) + L::from_f64(affine.constant[m]);
                let along = |sum: L, k: usize| {
                    L::from_f64(affine.gradient[m][k]).mul_add(L::from_f64(x[k]), sum)
                };
                value[m] = (0..D).fold(start, along).get();
            }
        }
        if let Some(jacobian) = jacobians.get_mut(at).filter(|_| ORDER > 0) {
            for m in 0..M {
                for k in 0..D {
                    let slope = affine.gradient[m][k] + sums.gradient[m][k][l];
                    jacobian[(m, k)] = slope / scale;
                }
            }
        }
        if let Some(hessian) = hessians.get_mut(at).filter(|_| ORDER > 1) {
            for m in 0..M {
                for k in 0..D {
                    // Only one half of the symmetric Hessian was summed.
                    for i in 0..=k {
                        let curve = sums.hessian[m][k][i][l] / scale / scale;
                        (hessian[m][(k, i)], hessian[m][(i, k)]) = (curve, curve);
                    }
                }
            }
        }
    }
}
