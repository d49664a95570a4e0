//! The fitted spline: its parts, its report, its energy.

use nalgebra::{Point, SMatrix, SVector};

use crate::{
    Factorization, FitOptions, FitReport, Kernel, R2LogR, Scalar, TpsError, Warp,
    far::{Parts, Terms},
    product::energy,
    refine::{Buffers, Solution},
    sample::Linear,
    sites::{Frame, Sites},
    system::System,
};

/// A thin-plate spline from `D`-space to `M`-space: f(x) = a₀ + A x + Σᵢ wᵢ U(|x − xᵢ|).
///
/// The weights satisfy Σ wᵢ = 0 and Σ wᵢ xᵢᵀ = 0 and minimise Σ weightᵢ |f(xᵢ) − yᵢ|² + λ wᵀKw (Wahba 1990).
#[derive(Clone, Debug)]
pub struct Spline<T: Scalar, const D: usize, const M: usize, K = R2LogR> {
    pub(crate) kernel: K,
    pub(crate) frame: Frame<D>,
    /// Centres in the frame, axis by axis.
    centres: Vec<T>,
    /// Weights in the frame, output by output.
    pub(crate) weights: Vec<T>,
    pub(crate) affine: Linear<T, D, M>,
    pub(crate) terms: Terms,
    report: FitReport,
}

/// A spline that maps space onto itself.
pub type ThinPlateSpline<T, const D: usize, K = R2LogR> = Spline<T, D, D, K>;

/// A solution and what it was found with.
pub(crate) struct Fitted<'a, const D: usize, const M: usize> {
    pub(crate) sites: &'a Sites<D>,
    pub(crate) system: &'a System<D>,
    /// λ in the frame's units.
    pub(crate) lambda: f64,
    /// How much larger the kernel is outside than in the frame.
    pub(crate) unit: f64,
    pub(crate) solution: Solution<M>,
    /// What was taken from the targets.
    pub(crate) origin: [f64; M],
    /// Largest target.
    pub(crate) level: f64,
}

/// Decimal digits of a number with this relative error, at most those of the type.
fn digits<T: Scalar>(error: f64) -> f64 {
    f64::max(error, T::UNIT_ROUNDOFF).log10().min(0.0).abs()
}

impl<T: Scalar, const D: usize, const M: usize, K: Kernel> Spline<T, D, M, K> {
    /// The spline that takes `sources` to `targets`.
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use tactile_tps::{FitOptions, ThinPlateSpline};
    /// # fn main() -> Result<(), tactile_tps::TpsError> {
    /// let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.4, 0.6]].map(Point2::from);
    /// let targets = sources.map(|p| Point2::new(p.x + 0.1 * p.y * p.y, p.y));
    /// let warp = ThinPlateSpline::fit(&sources, &targets, &FitOptions::default())?;
    /// assert!((warp.apply(&sources[4]) - targets[4]).norm() < 1e-14);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// [`TpsError`] for bad input, coinciding points with different targets, or a kernel that is not definite.
    pub fn fit(
        sources: &[Point<T, D>],
        targets: &[Point<T, M>],
        options: &FitOptions<T, K>,
    ) -> Result<Self, TpsError> {
        Factorization::new(sources, options)?.fit(targets)
    }

    /// A spline that is zero everywhere, for a refit to fill.
    pub fn empty(kernel: K) -> Self {
        Self {
            kernel,
            frame: Frame { centre: [0.0; D], scale: 1.0 },
            centres: Vec::new(),
            weights: Vec::new(),
            affine: Linear { constant: [T::zero(); M], gradient: [[T::zero(); D]; M] },
            terms: Terms::NONE,
            report: FitReport {
                points: 0,
                merged: 0,
                ignored: 0,
                rank: 0,
                extents: Vec::new(),
                lambda: 0.0,
                condition: 1.0,
                residual: None,
                refinements: 0,
                iterations: 0,
                converged: true,
                precise: false,
                digits: 0.0,
            },
        }
    }

    /// Takes over a solution, in memory that is already there where it suffices.
    pub(crate) fn assign(&mut self, fitted: &Fitted<'_, D, M>, buffers: &Buffers) {
        let Fitted { sites, system, lambda, unit, solution, origin, level } = fitted;
        self.frame = sites.frame;
        self.centres.clear();
        sites.axes.iter().for_each(|axis| self.centres.extend(axis.iter().map(|&x| T::narrow(x))));
        self.weights.clear();
        self.weights.extend(buffers.weights.iter().map(|&w| T::narrow(w)));
        for k in 0..M {
            self.affine.constant[k] = T::narrow(origin[k] + solution.affine[k][0]);
            self.affine.gradient[k] = system.span.gradient(&solution.affine[k]).map(T::narrow);
        }
        let weight = self.columns().1.map(|w| w.iter().map(|x| x.widen().abs()).sum::<f64>());
        let weight = weight.iter().fold(0.0, |m: f64, &x| m.max(x));
        self.terms = Terms::new::<T, K>(&self.kernel, weight, *level);
        let rounding = self.terms.rounding::<T, K>(&self.kernel, 0.0);
        let report = &mut self.report;
        report.digits = digits::<T>(if *level > 0.0 { rounding / level } else { 0.0 });
        report.points = sites.inputs();
        report.merged = sites.inputs() - sites.len();
        report.ignored = sites.len() - system.active.len();
        report.rank = system.null.q;
        report.extents.clear();
        report.extents.extend_from_slice(&system.span.extents);
        report.lambda = lambda * unit;
        report.condition = solution.condition;
        report.residual = solution.residual;
        report.refinements = solution.refinements;
        report.iterations = solution.iterations;
        report.converged = solution.converged;
        report.precise = solution.precise;
    }

    /// How the fit went.
    pub fn report(&self) -> &FitReport {
        &self.report
    }

    /// Number of distinct centres.
    fn count(&self) -> usize {
        self.centres.len() / D
    }

    /// The distinct centres, in the order of the source points.
    pub fn centres(&self) -> impl ExactSizeIterator<Item = Point<T, D>> + '_ {
        let n = self.count();
        (0..n).map(move |j| {
            let inside = |k: usize| self.centres[k * n + j].widen();
            Point::from(SVector::from_fn(|k, _| {
                T::narrow(inside(k) * self.frame.scale + self.frame.centre[k])
            }))
        })
    }

    /// The weight wᵢ of every centre, in the kernel's own units.
    pub fn weights(&self) -> impl ExactSizeIterator<Item = SVector<f64, M>> + '_ {
        let (n, unit) = (self.count(), self.unit());
        (0..n).map(move |j| SVector::from_fn(|k, _| self.weights[k * n + j].widen() / unit))
    }

    /// The affine part x ↦ A x + a₀ beside the kernel sum, in the points' own units.
    ///
    /// Kernels are scaled to unit size inside; what that leaves of a kernel like r² ln r, a multiple of r², is
    /// affine by the side conditions and is accounted for here.
    pub fn affine(&self) -> (SMatrix<f64, M, D>, SVector<f64, M>) {
        let Frame { centre, scale } = self.frame;
        let linear = SMatrix::from_fn(|i, j| self.affine.gradient[i][j].widen() / scale);
        let kernel = |s: f64| self.kernel.value(s);
        let square = kernel(scale * scale) / self.unit() - kernel(1.0);
        let n = self.count();
        let offset = SVector::from_fn(|i, _| {
            let norm = |j: usize| (0..D).map(|k| self.centres[k * n + j].widen().powi(2)).sum::<f64>();
            let second: f64 = (0..n).map(|j| self.weights[i * n + j].widen() * norm(j)).sum();
            let shift: f64 = (0..D).map(|k| self.affine.gradient[i][k].widen() * (centre[k] / scale)).sum();
            self.affine.constant[i].widen() - shift - square * second
        });
        (linear, offset)
    }

    /// How much larger the kernel is outside than in the frame.
    fn unit(&self) -> f64 {
        self.frame.scale.powi(self.kernel.degree().unwrap_or(0))
    }

    /// Squared distance from the frame's centre, in the frame.
    #[inline(always)]
    pub(crate) fn distance_squared(&self, point: &Point<T, D>) -> f64 {
        self.frame.inside(point).iter().map(|x| x * x).sum()
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
        Parts { kernel: &self.kernel, frame: self.frame, centres, weights, affine: &self.affine }
    }

    /// Decimal digits that a plain sum of the spline's terms keeps at a point: −log₁₀ of the rounding error to expect,
    /// relative to the value or the targets, whichever is larger.
    ///
    /// Below eight (four in `f32`) the spline is evaluated in twice the working precision, so that its own digits are lost
    /// only where those of its weights are. Far from the points the number falls: the terms grow faster than the sum.
    pub fn digits(&self, point: &Point<T, D>) -> f64 {
        let mut size = 0.0;
        self.each::<0>(core::slice::from_ref(point), |_, sample| size = sample.size());
        let rounding = self.terms.rounding::<T, K>(&self.kernel, self.distance_squared(point));
        digits::<T>(rounding / f64::max(size, self.terms.level))
    }

    /// wᵀKw, summed over the outputs, in the kernel's own units; O(n²).
    ///
    /// In the plane with r² ln r, and in space with −r, the integral ∫ |∂²f|² of all second derivatives is 8π times this.
    pub fn bending_energy(&self) -> f64 {
        let n = self.count();
        let axis = |k: usize| self.centres[k * n..(k + 1) * n].iter().map(|x| x.widen()).collect();
        let output = |m: usize| self.weights[m * n..(m + 1) * n].iter().map(|x| x.widen()).collect();
        let centres: [Vec<f64>; D] = core::array::from_fn(axis);
        let weights: [Vec<f64>; M] = core::array::from_fn(output);
        let energy = energy::<K, D, M>(
            &self.kernel,
            centres.each_ref().map(|x| &x[..]),
            weights.each_ref().map(|w| &w[..]),
        );
        energy / self.unit()
    }
}

impl<T: Scalar, const D: usize, K: Kernel> Warp<T, D> for Spline<T, D, D, K> {
    fn apply(&self, point: &Point<T, D>) -> Point<T, D> {
        Spline::apply(self, point)
    }
    fn jacobian(&self, point: &Point<T, D>) -> SMatrix<T, D, D> {
        Spline::jacobian(self, point)
    }
    fn apply_into(&self, points: &[Point<T, D>], images: &mut [Point<T, D>]) -> Result<(), TpsError> {
        Spline::apply_into(self, points, images)
    }
    fn jacobian_into(
        &self,
        points: &[Point<T, D>],
        jacobians: &mut [SMatrix<T, D, D>],
    ) -> Result<(), TpsError> {
        Spline::jacobian_into(self, points, jacobians)
    }
}

impl<T: Scalar, const D: usize, K: Kernel> crate::WarpModel<T, D> for FitOptions<T, K> {
    type Warp = ThinPlateSpline<T, D, K>;

    /// The options' own weights are replaced by `weights` where these are given.
    fn fit(
        &self,
        sources: &[Point<T, D>],
        targets: &[Point<T, D>],
        weights: Option<&[T]>,
    ) -> Result<Self::Warp, TpsError> {
        match weights {
            None => Spline::fit(sources, targets, self),
            Some(weights) => Spline::fit(sources, targets, &self.clone().weights(weights.to_vec())),
        }
    }
}
