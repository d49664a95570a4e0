//! Source points factored once for any targets: fits, refits and influences.

use core::ops::ControlFlow;

use nalgebra::Point;

use super::{
    buffers::Buffers,
    centres::Centres,
    equations::Equations,
    iterative::{Iterative, Run},
    system::{Setting, System, Watch},
};
use crate::{
    FitOptions, Kernel, Progress, R2LogR, Smoothing, Spline, TpsError,
    error::{finite, same_count, validate_smoothing, validate_weights},
    evaluate::Solution,
    span::{Coefficients, MAX},
};

impl<const D: usize, const M: usize, K: Kernel> Spline<D, M, K> {
    /// Fits the spline that maps `sources` to `targets`.
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
    ///
    /// [`TpsError`] for invalid input, coincident points with different targets, or a kernel that
    /// is not positive definite.
    /// is not definite.
    pub fn fit(
        sources: &[Point<f64, D>],
        targets: &[Point<f64, M>],
        options: &FitOptions<K>,
    ) -> Result<Self, TpsError> {
        Factorization::new(sources, options)?.fit(targets)
    }

    /// Like [`fit`](Self::fit), but reports the progress of an iterative solver to `watch`, which
    /// may stop it.
    ///
    /// A direct solver reports its factored columns. If stopped during an iteration, the fit returns
    /// the best spline so far, with its residual in the report.
    ///
    /// ```
    /// use core::ops::ControlFlow;
    /// use nalgebra::Point2;
    /// use tactile_tps::{FitOptions, Solver, ThinPlateSpline, TpsError};
    /// # fn main() -> Result<(), tactile_tps::TpsError> {
    /// let sources: Vec<Point2<f64>> =
    ///     (0..900).map(|i| Point2::new(f64::from(i % 30), f64::from(i / 30)
    ///         + 0.3 * f64::from(i % 7))).collect();
    /// let targets: Vec<_> = sources.iter().map(|p| Point2::new(p.x.sin(), p.y.cos())).collect();
    /// let options = FitOptions::default().with_solver(Solver::Iterative);
    /// let spline = ThinPlateSpline::fit_watched(&sources, &targets, &options,
    ///     |progress| match progress.residual {
    ///     // Good enough for a first look.
    ///     Some(residual) if residual < 1e-3 => ControlFlow::Break(()),
    ///     _ => ControlFlow::Continue(()),
    /// })?;
    /// assert!(!spline.report.converged() && spline.report.residual < Some(1e-2));
    /// let stopped = ThinPlateSpline::fit_watched(&sources, &targets, &options,
    ///     |_| ControlFlow::Break(()));
    /// assert_eq!(stopped.err(), Some(TpsError::Stopped));
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// Those of [`fit`](Self::fit), and [`TpsError::Stopped`] if `watch` returns `Break` before a
    /// spline exists.
    pub fn fit_watched(
        sources: &[Point<f64, D>],
        targets: &[Point<f64, M>],
        options: &FitOptions<K>,
        mut watch: impl FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<Self, TpsError> {
        Factorization::new_watched(sources, options, &mut watch)?.fit_watched(targets, watch)
    }
}

/// Source points with their factored kernel matrix. Splines to any targets follow in O(n²).
///
/// ```
/// use nalgebra::Point2;
/// use tactile_tps::{Factorization, FitOptions, ThinPlateSpline};
/// # fn main() -> Result<(), tactile_tps::TpsError> {
/// let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.4, 0.6]].map(Point2::from);
/// let factorization = Factorization::new(&sources, &FitOptions::default())?;
/// let targets = sources.map(|p| Point2::new(p.x + 0.1 * p.y * p.y, p.y));
/// let spline: ThinPlateSpline<2> = factorization.fit(&targets)?;
/// assert!((spline.apply(&sources[4]) - targets[4]).norm() < 1e-14);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct Factorization<const D: usize, K = R2LogR> {
    pub(super) kernel: K,
    pub(super) centres: Centres<D>,
    system: System<D>,
    pub(super) weights: Option<Vec<f64>>,
    /// Weight of each centre. Empty if all weights are one.
    pub(super) centre_weights: Vec<f64>,
    smoothing: Smoothing,
    rank_tolerance: f64,
    /// The preconditioner, if the solver iterates. The system then has no factor.
    iterative: Option<Iterative<D>>,
    /// Residual at which the iteration stops.
    tolerance: f64,
}

/// Buffers that refits reuse.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_tps::{Factorization, FitOptions, Spline, SplineWorkspace};
/// # fn main() -> Result<(), tactile_tps::TpsError> {
/// let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.4, 0.6]].map(Point2::from);
/// let factorization = Factorization::new(&sources, &FitOptions::default())?;
/// let (mut workspace, mut spline) = (SplineWorkspace::default(), Spline::default());
/// for step in 1..=3 {
///     // No allocation from the second iteration on.
///     let targets = sources.map(|p| Point2::new(p.x, p.y * f64::from(step)));
///     factorization.refit_with(&mut workspace, &targets, None, None, &mut spline)?;
///     assert!((spline.apply(&sources[4]) - targets[4]).norm() < 1e-14);
/// }
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug, Default)]
pub struct SplineWorkspace<const D: usize> {
    buffers: Buffers,
    system: System<D>,
    iterative: Iterative<D>,
    centre_weights: Vec<f64>,
}

/// Largest λ in the units of the frame. Well below it the spline already equals the affine fit to
/// rounding, whereas an infinite λ would give no system.
const LARGEST_LAMBDA: f64 = 1e200;

/// A system with the parameters of its solution.
struct Task<'a, const D: usize> {
    system: &'a System<D>,
    weights: Option<&'a [f64]>,
    smoothing: Smoothing,
    /// Whether to measure the residual and refine sooner.
    careful: bool,
    /// The preconditioner, if there is no factor.
    iterative: Option<&'a Iterative<D>>,
}

impl<const D: usize, K: Kernel> Factorization<D, K> {
    pub(super) fn setting(&self) -> Setting<'_, K, D> {
        Setting {
            kernel: &self.kernel,
            centres: &self.centres,
            rank_tolerance: self.rank_tolerance,
        }
    }

    /// λ in the units of the frame: the kernel scales with the length to the power of its degree.
    pub(super) fn inner_lambda(&self, smoothing: Smoothing) -> f64 {
        match smoothing {
            Smoothing::Lambda(lambda) => f64::min(lambda / self.unit(), LARGEST_LAMBDA),
            _ => 0.0,
        }
    }

    /// Ratio of the kernel outside to that in the frame.
    pub(super) fn unit(&self) -> f64 {
        let degree = self.kernel.degree().unwrap_or(0);
        self.centres.frame.scale.powi(degree)
    }

    /// Checks that there is one finite target per source.
    pub(super) fn check<const M: usize>(&self, targets: &[Point<f64, M>]) -> Result<(), TpsError> {
        same_count("target points", self.centres.inputs, targets.len())?;
        finite(targets, "target points")
    }
}

impl<const D: usize, K: Kernel> Factorization<D, K> {
    /// Factors `sources` for the kernel, weights and λ of `options`: O(n³/3) time, O(n²) memory.
    ///
    /// With [`Smoothing::Gcv`] the matrix is decomposed instead, at about twenty times the cost.
    /// Thousands of points, or [`Solver::Iterative`](crate::Solver), are prepared for iteration:
    /// O(n²) time, O(n) memory.
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use tactile_tps::{Factorization, FitOptions, NegR, TpsError};
    /// # fn main() -> Result<(), tactile_tps::TpsError> {
    /// let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.4,
    ///     0.6]].map(Point2::from);
    /// let factorization = Factorization::new(&sources, &FitOptions::new(NegR))?;
    /// assert!(factorization.fit(&sources)?.report.points == 5);
    /// let five_weights = FitOptions::new(NegR).with_weights(vec![1.0; 5])?;
    /// let error = Factorization::new(&sources[..4], &five_weights).unwrap_err();
    /// assert_eq!(error, TpsError::Length { input: "weights", expected: 4, found: 5 });
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// [`TpsError`] for invalid input, or a kernel that is not positive definite on these points.
    pub fn new(sources: &[Point<f64, D>], options: &FitOptions<K>) -> Result<Self, TpsError> {
        Self::new_watched(sources, options, &mut |_| ControlFlow::Continue(()))
    }

    /// Like [`new`](Self::new), but reports the progress of an iterative solver's preparation to
    /// `watch`, which may stop it.
    pub(crate) fn new_watched(
        sources: &[Point<f64, D>],
        options: &FitOptions<K>,
        watch: &mut Watch<'_>,
    ) -> Result<Self, TpsError> {
        const { assert!(D >= 1 && D < MAX, "splines have one to three dimensions") };
        if let Some(weights) = &options.weights {
            same_count("weights", sources.len(), weights.len())?;
        }
        let kernel = options.kernel.clone();
        let mut centres = Centres::default();
        // A kernel with its own length scale would be changed by a rescaling.
        centres.take(sources, kernel.degree().is_some())?;
        let mut centre_weights = Vec::new();
        centres.weigh(options.weights.as_deref(), &mut centre_weights);
        let mut this = Self {
            kernel,
            centres,
            system: System::default(),
            weights: options.weights.clone(),
            centre_weights,
            smoothing: options.smoothing,
            rank_tolerance: options.rank_tolerance,
            iterative: None,
            tolerance: options.tolerance,
        };
        let iterates = options.iterates(this.centres.len());
        let (mut system, mut iterative) = (System::default(), Iterative::default());
        let (smoothing, weights) = (this.smoothing, &this.centre_weights);
        let built = this.build(
            smoothing,
            weights,
            iterates,
            &mut system,
            &mut iterative,
            watch,
        );
        built?;
        this.iterative = iterates.then_some(iterative);
        this.system = system;
        Ok(this)
    }

    /// Number of source points.
    fn len(&self) -> usize {
        self.centres.inputs
    }

    /// The spline to these targets, with the weights and smoothing of the factorisation.
    ///
    /// It measures the residual, and refines the solution if the condition number is large.
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use tactile_tps::{Factorization, FitOptions};
    /// # fn main() -> Result<(), tactile_tps::TpsError> {
    /// let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.4,
    ///     0.6]].map(Point2::from);
    /// let factorization = Factorization::new(&sources, &FitOptions::default())?;
    /// // Any number of outputs is possible: here a height.
    /// let heights = sources.map(|p| nalgebra::Point1::new(p.x * p.y));
    /// let surface = factorization.fit(&heights)?;
    /// assert!((surface.apply(&sources[3]) - heights[3]).norm() < 1e-14);
    /// assert!(surface.report.residual < Some(1e-14));
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// [`TpsError`] for invalid targets.
    pub fn fit<const M: usize>(
        &self,
        targets: &[Point<f64, M>],
    ) -> Result<Spline<D, M, K>, TpsError> {
        self.fit_watched(targets, |_| ControlFlow::Continue(()))
    }

    /// Like [`fit`](Self::fit), but reports the progress of an iterative solver to `watch`.
    pub(crate) fn fit_watched<const M: usize>(
        &self,
        targets: &[Point<f64, M>],
        mut watch: impl FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<Spline<D, M, K>, TpsError> {
        let mut spline = Spline::zero(self.kernel.clone());
        let task = Task {
            careful: true,
            ..self.own_task()
        };
        self.finish(
            &task,
            &mut Buffers::default(),
            targets,
            &mut spline,
            &mut watch,
        )?;
        Ok(spline)
    }

    /// A quick fit with the parameters of the factorisation.
    fn own_task(&self) -> Task<'_, D> {
        Task {
            system: &self.system,
            weights: self.weights.as_deref(),
            smoothing: self.smoothing,
            careful: false,
            iterative: self.iterative.as_ref(),
        }
    }

    /// Fits new targets, weights and smoothing for the same sources. `None` stands for the weights
    /// of the factorisation.
    ///
    /// The result is written to an existing spline. Nothing is allocated once workspace and spline
    /// have grown, except by a new cross-validation.
    ///
    /// Unlike [`fit`](Self::fit), it measures no residual and refines only if the condition number
    /// exceeds 10⁸. The same weights and λ cost two triangular solves. Positive weights do not
    /// change an interpolating spline, and cost the same. Other weights or another λ cost a
    /// factorisation, or a new preconditioner for an iterative solver.
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use tactile_tps::{Factorization, FitOptions, Smoothing, Spline, SplineWorkspace};
    /// # fn main() -> Result<(), tactile_tps::TpsError> {
    /// let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.4,
    ///     0.6]].map(Point2::from);
    /// let targets = sources.map(|p| Point2::new(p.x + 0.1 * p.y * p.y, p.y));
    /// let factorization = Factorization::new(&sources,
    ///     &FitOptions::default().with_smoothing(Smoothing::Lambda(0.01))?)?;
    /// let (mut workspace, mut spline) = (SplineWorkspace::default(), Spline::default());
    /// let mut miss = |weight: f64| {
    ///     let weights = [1.0, 1.0, 1.0, 1.0, weight];
    ///     factorization
    ///         .refit_with(&mut workspace, &targets, Some(&weights), None, &mut spline)
    ///         .map(|()| (spline.apply(&sources[4]) - targets[4]).norm())
    /// };
    /// // With a higher weight, the spline passes closer to the point.
    /// assert!(miss(100.0)? < 0.1 * miss(1.0)?);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// [`TpsError`] for invalid targets, weights or smoothing. The spline is then unchanged.
    pub fn refit_with<const M: usize>(
        &self,
        workspace: &mut SplineWorkspace<D>,
        targets: &[Point<f64, M>],
        weights: Option<&[f64]>,
        smoothing: Option<Smoothing>,
        spline: &mut Spline<D, M, K>,
    ) -> Result<(), TpsError> {
        let smoothing = smoothing.unwrap_or(self.smoothing);
        validate_smoothing(&smoothing)?;
        if let Some(weights) = weights {
            validate_weights(weights, self.len())?;
        }
        let SplineWorkspace {
            buffers,
            system,
            iterative,
            centre_weights,
        } = workspace;
        let weights = weights.or(self.weights.as_deref());
        self.centres.weigh(weights, centre_weights);
        let gcv = smoothing == Smoothing::Gcv;
        let task = if self.serves(smoothing, centre_weights) {
            Task {
                weights,
                smoothing,
                ..self.own_task()
            }
        } else {
            let iterates = !gcv && self.iterative.is_some();
            let watch = &mut |_: &Progress| ControlFlow::Continue(());
            self.build(
                smoothing,
                centre_weights,
                iterates,
                system,
                iterative,
                watch,
            )?;
            Task {
                system,
                weights,
                smoothing,
                careful: false,
                iterative: iterates.then_some(&*iterative),
            }
        };
        // Without a callback nothing stops the fit.
        self.finish(&task, buffers, targets, spline, &mut |_| {
            ControlFlow::Continue(())
        })
    }

    /// Whether the existing system can be used for a refit.
    ///
    /// An interpolating spline depends on its weights only through which of them are positive.
    fn serves(&self, smoothing: Smoothing, centre_weights: &[f64]) -> bool {
        if smoothing == self.smoothing && centre_weights == self.centre_weights {
            return true;
        }
        let interpolates =
            |smoothing| smoothing != Smoothing::Gcv && self.inner_lambda(smoothing) == 0.0;
        interpolates(smoothing)
            && interpolates(self.smoothing)
            && !centre_weights.contains(&0.0)
            && !self.centre_weights.contains(&0.0)
    }

    /// Computes a new factor, spectrum or preconditioner.
    fn build(
        &self,
        smoothing: Smoothing,
        centre_weights: &[f64],
        iterates: bool,
        system: &mut System<D>,
        iterative: &mut Iterative<D>,
        watch: &mut Watch<'_>,
    ) -> Result<(), TpsError> {
        let (setting, lambda) = (self.setting(), self.inner_lambda(smoothing));
        if smoothing == Smoothing::Gcv {
            system.decompose(&setting, centre_weights);
        } else if iterates {
            let built = iterative.build(&setting, centre_weights, lambda, system, watch);
            if built.is_break() {
                return Err(TpsError::Stopped);
            }
        } else {
            system.factor(&setting, centre_weights, lambda, watch)?;
        }
        Ok(())
    }

    /// Solves and fills the spline, reporting the progress of an iteration to `watch`.
    fn finish<const M: usize>(
        &self,
        task: &Task<'_, D>,
        buffers: &mut Buffers,
        targets: &[Point<f64, M>],
        spline: &mut Spline<D, M, K>,
        watch: &mut Watch<'_>,
    ) -> Result<(), TpsError> {
        let (system, centres) = (task.system, &self.centres);
        let gcv = task.smoothing == Smoothing::Gcv;
        let mut lambda = self.inner_lambda(task.smoothing);
        self.check(targets)?;
        // An interpolant cannot have two values at one point; smoothing uses their mean.
        if lambda == 0.0 && !gcv {
            centres.agree(targets, task.weights)?;
        }
        // Targets far from zero lose digits. Differences from the first target are exact if the
        // targets are close to it.
        let origin: [f64; M] = core::array::from_fn(|k| targets[0][k]);
        centres.gather(targets, task.weights, &origin, buffers);
        if gcv {
            let (needed, found) = (system.affine.q, system.active.len());
            // Affine functions alone reproduce all targets, so no residual is left for validation.
            if found <= needed {
                return Err(TpsError::TooFewForValidation { needed, found });
            }
            let Buffers {
                targets,
                work,
                spare,
                ..
            } = buffers;
            lambda = system.cross_validate::<M>(targets, work, spare);
        }
        let report = &mut spline.report;
        report.points = centres.inputs;
        report.merged = centres.inputs - centres.len();
        report.ignored = centres.len() - system.active.len();
        report.rank = system.affine.q;
        report.extents.clear();
        report.extents.extend_from_slice(&system.span.extents);
        report.lambda = lambda * self.unit();
        let affine: [Coefficients; M] = match task.iterative {
            Some(iterative) => Run {
                kernel: &self.kernel,
                system,
                iterative,
                tolerance: self.tolerance,
            }
            .solve(buffers, report, watch),
            None => Equations {
                kernel: &self.kernel,
                centres,
                system,
                lambda,
            }
            .solve(buffers, report, task.careful),
        };
        let numbers = targets.iter().flat_map(|t| t.iter());
        let mut constant = core::array::from_fn(|k| origin[k] + affine[k][0]);
        let mut gradient = affine.map(|a| system.span.gradient(&a));
        if M == D && system.span.directions < D {
            self.keep_across(system, &mut constant, &mut gradient);
        }
        let solution = Solution {
            frame: centres.frame,
            axes: &centres.axes,
            weights: &buffers.weights,
            constant,
            gradient,
            level: numbers.fold(0.0, |m, x| f64::max(m, x.abs())),
        };
        spline.assign(&self.kernel, &solution);
        Ok(())
    }

    /// Adds N (x − x₀) to a map of space, which makes it the identity along the directions that the
    /// points do not span. x₀ is one of the points.
    fn keep_across<const M: usize>(
        &self,
        system: &System<D>,
        constant: &mut [f64; M],
        gradient: &mut [[f64; D]; M],
    ) {
        let Centres { frame, axes, .. } = &self.centres;
        let across = system.span.across();
        for (m, row) in across.iter().enumerate().take(M) {
            for k in 0..D {
                let slope = row[k] * frame.scale;
                gradient[m][k] += slope;
                constant[m] -= slope * axes[k][system.active[0]];
            }
        }
    }
}
