//! The fitted spline: its parts, its report, its energy.

use core::ops::ControlFlow;

use nalgebra::Point;

use crate::{
    Factorization, FitOptions, FitReport, Kernel, Progress, R2LogR, Scalar, TpsError,
    centres::{Centres, Frame},
    equations::{Buffers, Solution},
    far::Terms,
    product::energy,
    sample::Linear,
    system::System,
};

/// A thin-plate spline from `D`-space to `M`-space: f(x) = a₀ + A x + Σᵢ wᵢ U(|x − xᵢ|).
///
/// [`Default`] is the spline that is zero everywhere. The weights satisfy Σ wᵢ = 0 and Σ wᵢ xᵢᵀ = 0 and minimise Σ weightᵢ |f(xᵢ) − yᵢ|² + λ wᵀKw (Wahba 1990).
#[derive(Clone, Debug)]
pub struct Spline<T: Scalar, const D: usize, const M: usize, K = R2LogR> {
    pub(crate) kernel: K,
    pub(crate) frame: Frame<D>,
    /// Centres in the frame, axis by axis.
    pub(crate) centres: Vec<T>,
    /// Weights in the frame, output by output.
    pub(crate) weights: Vec<T>,
    pub(crate) affine: Linear<T, D, M>,
    pub(crate) terms: Terms,
    /// How the fit went.
    pub report: FitReport,
}

impl<T: Scalar, const D: usize, const M: usize, K: Kernel + Default> Default
    for Spline<T, D, M, K>
{
    /// A spline that is zero everywhere, to be filled by [`Factorization::refit_with`].
    fn default() -> Self {
        Self::zero(K::default())
    }
}

/// A spline that maps space onto itself.
///
/// ```
/// # use nalgebra::Point3;
/// # use tactile_tps::{FitOptions, NegR, ThinPlateSpline};
/// # fn main() -> Result<(), tactile_tps::TpsError> {
/// let sources = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.3, 0.4, 0.2]].map(Point3::from);
/// let targets = sources.map(|p| p * 2.0);
/// let warp: ThinPlateSpline<f64, 3, NegR> = ThinPlateSpline::fit(&sources, &targets, &FitOptions::new(NegR))?;
/// assert!((warp.jacobian(&Point3::new(0.5, 0.5, 0.5)) - nalgebra::Matrix3::identity() * 2.0).norm() < 1e-13);
/// # Ok(())
/// # }
/// ```
pub type ThinPlateSpline<T, const D: usize, K = R2LogR> = Spline<T, D, D, K>;

/// A solution and what it was found with.
pub(crate) struct Fitted<'a, const D: usize, const M: usize> {
    pub(crate) centres: &'a Centres<D>,
    pub(crate) system: &'a System<D>,
    /// λ in the frame's units.
    pub(crate) lambda: f64,
    /// How much larger the kernel is outside than in the frame.
    pub(crate) unit: f64,
    pub(crate) solution: Solution<M>,
    /// The offset subtracted from the targets.
    pub(crate) origin: [f64; M],
    /// Largest target.
    pub(crate) level: f64,
}

/// Decimal digits of a number with this relative error, at most those of the type.
fn digits<T: Scalar>(error: f64) -> f64 {
    f64::max(error, T::UNIT_ROUNDOFF).log10().min(0.0).abs()
}

impl<T: Scalar, const D: usize, const M: usize, K: Kernel> Spline<T, D, M, K> {
    /// Fits the spline that takes `sources` to `targets`.
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
    /// [`TpsError`] for invalid input, coinciding points with different targets, or a kernel that is not definite.
    pub fn fit(
        sources: &[Point<T, D>],
        targets: &[Point<T, M>],
        options: &FitOptions<T, K>,
    ) -> Result<Self, TpsError> {
        Factorization::new(sources, options)?.fit(targets)
    }

    /// As [`fit`](Self::fit), reporting the progress of an iterative solver to `watch`, which may stop it; a direct solver does
    /// not report. Stopped while it iterates, the spline is the best so far and its report says how good it is.
    ///
    /// ```
    /// use core::ops::ControlFlow;
    /// use nalgebra::Point2;
    /// use tactile_tps::{FitOptions, Solver, ThinPlateSpline, TpsError};
    /// # fn main() -> Result<(), tactile_tps::TpsError> {
    /// let sources: Vec<Point2<f64>> =
    ///     (0..900).map(|i| Point2::new(f64::from(i % 30), f64::from(i / 30) + 0.3 * f64::from(i % 7))).collect();
    /// let targets: Vec<_> = sources.iter().map(|p| Point2::new(p.x.sin(), p.y.cos())).collect();
    /// let options = FitOptions::default().with_solver(Solver::Iterative);
    /// let spline = ThinPlateSpline::fit_watched(&sources, &targets, &options, |progress| match progress.residual {
    ///     // Good enough for a first look.
    ///     Some(residual) if residual < 1e-3 => ControlFlow::Break(()),
    ///     _ => ControlFlow::Continue(()),
    /// })?;
    /// assert!(!spline.report.converged && spline.report.residual < Some(1e-2));
    /// let stopped = ThinPlateSpline::fit_watched(&sources, &targets, &options, |_| ControlFlow::Break(()));
    /// assert_eq!(stopped.err(), Some(TpsError::Stopped));
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// Those of [`fit`](Self::fit), and [`TpsError::Stopped`] if `watch` returns `Break` before there is a spline.
    pub fn fit_watched(
        sources: &[Point<T, D>],
        targets: &[Point<T, M>],
        options: &FitOptions<T, K>,
        mut watch: impl FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<Self, TpsError> {
        Factorization::new_watched(sources, options, &mut watch)?.fit_watched(targets, watch)
    }

    /// A spline that is zero everywhere, to be filled by a fit.
    pub(crate) fn zero(kernel: K) -> Self {
        Self {
            kernel,
            frame: Frame {
                centre: [0.0; D],
                scale: 1.0,
            },
            centres: Vec::new(),
            weights: Vec::new(),
            affine: Linear {
                constant: [T::zero(); M],
                gradient: [[T::zero(); D]; M],
            },
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

    /// Takes over a solution, reusing memory where it suffices.
    pub(crate) fn assign(&mut self, fitted: &Fitted<'_, D, M>, buffers: &Buffers) {
        let Fitted {
            centres,
            system,
            solution,
            origin,
            level,
            ..
        } = fitted;
        self.frame = centres.frame;
        self.centres.clear();
        centres
            .axes
            .iter()
            .for_each(|axis| self.centres.extend(axis.iter().map(|&x| T::narrow(x))));
        self.weights.clear();
        self.weights
            .extend(buffers.weights.iter().map(|&w| T::narrow(w)));
        for k in 0..M {
            self.affine.constant[k] = T::narrow(origin[k] + solution.affine[k][0]);
            self.affine.gradient[k] = system.span.gradient(&solution.affine[k]).map(T::narrow);
        }
        let weight = self
            .columns()
            .1
            .map(|w| w.iter().map(|x| x.widen().abs()).sum::<f64>());
        let weight = weight.iter().fold(0.0, |m: f64, &x| m.max(x));
        self.terms = Terms::new::<T, K>(&self.kernel, weight, *level);
        self.record(fitted);
    }

    /// Writes a solution's numbers into the report.
    fn record(&mut self, fitted: &Fitted<'_, D, M>) {
        let Fitted {
            centres,
            system,
            lambda,
            unit,
            solution,
            level,
            ..
        } = fitted;
        let rounding = self.terms.rounding::<T, K>(&self.kernel, 0.0);
        let report = &mut self.report;
        report.digits = digits::<T>(if *level > 0.0 { rounding / level } else { 0.0 });
        report.points = centres.inputs();
        report.merged = centres.inputs() - centres.len();
        report.ignored = centres.len() - system.active.len();
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

    /// Squared distance from the frame's centre, in the frame.
    #[inline(always)]
    pub(crate) fn distance_squared(&self, point: &Point<T, D>) -> f64 {
        self.frame.inside(point).iter().map(|x| x * x).sum()
    }

    /// Decimal digits that a plain sum of the spline's terms keeps at a point: −log₁₀ of the rounding error to expect,
    /// relative to the value or the targets, whichever is larger.
    ///
    /// Below eight (four in `f32`) the spline is evaluated in twice the working precision, so that its own digits are lost
    /// only where those of its weights are. Far from the points the number falls: the terms grow faster than the sum.
    ///
    /// ```
    /// # use nalgebra::Point2;
    /// # use tactile_tps::{FitOptions, ThinPlateSpline};
    /// # fn main() -> Result<(), tactile_tps::TpsError> {
    /// # let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.4, 0.6]].map(Point2::from);
    /// # let targets = sources.map(|p| Point2::new(p.x + 0.1 * p.y * p.y, p.y));
    /// let warp = ThinPlateSpline::fit(&sources, &targets, &FitOptions::default())?;
    /// let near = warp.digits(&Point2::new(0.5, 0.5));
    /// let far = warp.digits(&Point2::new(1e6, 1e6));
    /// assert!(near > 14.0 && far < near);
    /// # Ok(())
    /// # }
    /// ```
    pub fn digits(&self, point: &Point<T, D>) -> f64 {
        let mut size = 0.0;
        self.each::<0>(core::slice::from_ref(point), |_, sample| {
            size = sample.size()
        });
        let rounding = self
            .terms
            .rounding::<T, K>(&self.kernel, self.distance_squared(point));
        digits::<T>(rounding / f64::max(size, self.terms.level))
    }

    /// wᵀKw, summed over the outputs, in the kernel's own units; O(n²).
    ///
    /// In the plane with r² ln r, and in space with −r, the integral ∫ |∂²f|² of all second derivatives is 8π times this.
    ///
    /// ```
    /// # use nalgebra::Point2;
    /// # use tactile_tps::{FitOptions, ThinPlateSpline};
    /// # fn main() -> Result<(), tactile_tps::TpsError> {
    /// # let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.4, 0.6]].map(Point2::from);
    /// # let targets = sources.map(|p| Point2::new(p.x + 0.1 * p.y * p.y, p.y));
    /// let warp = ThinPlateSpline::fit(&sources, &targets, &FitOptions::default())?;
    /// let straight = ThinPlateSpline::fit(&sources, &sources, &FitOptions::default())?;
    /// assert!(warp.bending_energy() > 1e-4 && straight.bending_energy() < 1e-25);
    /// # Ok(())
    /// # }
    /// ```
    pub fn bending_energy(&self) -> f64 {
        let n = self.count();
        let axis = |k: usize| {
            self.centres[k * n..(k + 1) * n]
                .iter()
                .map(|x| x.widen())
                .collect()
        };
        let output = |m: usize| {
            self.weights[m * n..(m + 1) * n]
                .iter()
                .map(|x| x.widen())
                .collect()
        };
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
