//! Source points, factored once for any targets.

use core::ops::ControlFlow;
use std::sync::OnceLock;

use nalgebra::Point;

use crate::{
    FitOptions, Kernel, Progress, R2LogR, Scalar, Smoothing, Spline, TpsError,
    iterative::Iterative,
    refine::Buffers,
    sites::Sites,
    system::{Setting, System},
    task::Task,
};

/// Source points with their kernel matrix factored: splines to any targets follow in O(n²).
///
/// ```
/// use nalgebra::Point2;
/// use tactile_tps::{Factorization, FitOptions, ThinPlateSpline};
/// # fn main() -> Result<(), tactile_tps::TpsError> {
/// let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.4, 0.6]].map(Point2::from);
/// let factorization = Factorization::new(&sources, &FitOptions::default())?;
/// let targets = sources.map(|p| Point2::new(p.x + 0.1 * p.y * p.y, p.y));
/// let spline: ThinPlateSpline<f64, 2> = factorization.fit(&targets)?;
/// assert!((spline.apply(&sources[4]) - targets[4]).norm() < 1e-14);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct Factorization<T: Scalar, const D: usize, K = R2LogR> {
    pub(crate) kernel: K,
    pub(crate) sites: Sites<D>,
    pub(crate) system: System<D>,
    /// The same with its spectrum, once a λ needs it.
    pub(crate) spectral: OnceLock<System<D>>,
    pub(crate) weights: Option<Vec<T>>,
    /// Weight of every site, empty if all are one.
    pub(crate) site_weights: Vec<f64>,
    pub(crate) smoothing: Smoothing<T>,
    rank_tolerance: f64,
    /// The preconditioner, if the solver iterates; the system is then without a factor.
    pub(crate) iterative: Option<Iterative<D>>,
    /// Where iteration stops.
    pub(crate) tolerance: f64,
}

/// Memory that refits use again and again.
#[derive(Clone, Debug, Default)]
pub struct Workspace<const D: usize> {
    pub(crate) buffers: Buffers,
    pub(crate) system: System<D>,
    pub(crate) iterative: Iterative<D>,
    pub(crate) site_weights: Vec<f64>,
}

impl<const D: usize> Workspace<D> {
    /// An empty workspace; it grows at its first use.
    pub fn new() -> Self {
        Self::default()
    }
}

impl<T: Scalar, const D: usize, K: Kernel> Factorization<T, D, K> {
    /// Factors `sources` for the kernel, weights and λ of `options`: O(n³/3) time, O(n²) memory.
    ///
    /// With [`Smoothing::Gcv`] the matrix is decomposed instead, at some thirty times the cost. Thousands of points, or
    /// [`Solver::Iterative`](crate::Solver), are prepared for iteration: O(n²) time, O(n) memory.
    ///
    /// # Errors
    /// [`TpsError`] for bad input, or a kernel that is not definite on these points.
    pub fn new(sources: &[Point<T, D>], options: &FitOptions<T, K>) -> Result<Self, TpsError> {
        Self::new_watched(sources, options, |_| ControlFlow::Continue(()))
    }

    /// As [`new`](Self::new), telling `watch` how the preparation for an iteration gets on. A direct solver runs without.
    ///
    /// # Errors
    /// Those of [`new`](Self::new), and [`TpsError::Stopped`] if `watch` breaks off.
    pub fn new_watched(
        sources: &[Point<T, D>],
        options: &FitOptions<T, K>,
        mut watch: impl FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<Self, TpsError> {
        options.validate(sources.len())?;
        let mut this = Self::unfactored(sources, options)?;
        let lambda = this.inner_lambda(this.smoothing);
        let mut system = System::default();
        if this.smoothing == Smoothing::Gcv {
            this.decompose();
        } else if options.iterates(this.sites.len()) {
            let mut iterative = Iterative::default();
            let built = iterative.build(&this.setting(), &this.site_weights, lambda, &mut system, &mut watch);
            if built.is_break() {
                return Err(TpsError::Stopped);
            }
            this.iterative = Some(iterative);
        } else {
            system.factor(&this.setting(), &this.site_weights, lambda)?;
        }
        this.system = system;
        Ok(this)
    }

    /// The sites and what is asked for, without a factor.
    fn unfactored(sources: &[Point<T, D>], options: &FitOptions<T, K>) -> Result<Self, TpsError> {
        let kernel = options.kernel.clone();
        let sites = Sites::new(sources, kernel.degree().is_some())?;
        let mut site_weights = Vec::new();
        sites.weigh(options.weights.as_deref(), &mut site_weights);
        Ok(Self {
            kernel,
            sites,
            system: System::default(),
            spectral: OnceLock::new(),
            weights: options.weights.clone(),
            site_weights,
            smoothing: options.smoothing,
            rank_tolerance: options.rank_tolerance.widen(),
            iterative: None,
            tolerance: options.tolerance.widen(),
        })
    }

    /// Number of source points.
    pub fn len(&self) -> usize {
        self.sites.inputs()
    }

    /// Whether there are no source points; there always are.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Decomposes the matrix into eigenvalues and -vectors, so that a refit with any λ costs no more than one with new
    /// targets; some 10 n³ operations, once.
    ///
    /// Up to 256 points, and for cross-validation, the first refit that can use it does this unasked.
    pub fn decompose(&self) {
        self.spectral.get_or_init(|| {
            let mut system = System::default();
            system.decompose(&self.setting(), &self.site_weights);
            system
        });
    }

    /// The spline to these targets, with the weights and smoothing of the factorisation.
    ///
    /// Measures the residual, and refines the solution where the condition number asks for it.
    ///
    /// # Errors
    /// [`TpsError`] for bad targets.
    pub fn fit<const M: usize>(&self, targets: &[Point<T, M>]) -> Result<Spline<T, D, M, K>, TpsError> {
        self.fit_watched(targets, |_| ControlFlow::Continue(()))
    }

    /// As [`fit`](Self::fit), telling `watch` how an iteration gets on. If `watch` breaks off the spline is the best so far,
    /// and its report says how good it is. A direct solver runs without.
    ///
    /// ```
    /// use core::ops::ControlFlow;
    /// use nalgebra::Point2;
    /// use tactile_tps::{Factorization, FitOptions, Solver};
    /// # fn main() -> Result<(), tactile_tps::TpsError> {
    /// let sources: Vec<Point2<f64>> =
    ///     (0..900).map(|i| Point2::new(f64::from(i % 30), f64::from(i / 30) + 0.3 * f64::from(i % 7))).collect();
    /// let targets: Vec<_> = sources.iter().map(|p| Point2::new(p.x.sin(), p.y.cos())).collect();
    /// let options = FitOptions::default().solver(Solver::Iterative);
    /// let spline = Factorization::new(&sources, &options)?.fit_watched(&targets, |progress| {
    ///     // Good enough for a first look.
    ///     if progress.residual < Some(1e-3) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    /// })?;
    /// assert!(!spline.report().converged && spline.report().residual < Some(1e-2));
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// [`TpsError`] for bad targets.
    pub fn fit_watched<const M: usize>(
        &self,
        targets: &[Point<T, M>],
        mut watch: impl FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<Spline<T, D, M, K>, TpsError> {
        let mut spline = Spline::empty(self.kernel.clone());
        let task = Task { careful: true, ..self.task() };
        self.watched(&task, &mut Buffers::default(), targets, &mut spline, &mut watch)?;
        Ok(spline)
    }

    /// As [`fit`](Self::fit), into a spline that is already there: two triangular solves, and no allocation once
    /// workspace and spline have grown. Refines only where the condition number exceeds 10⁸.
    ///
    /// # Errors
    /// [`TpsError`] for bad targets; the spline is then left as it was.
    pub fn fit_with<const M: usize>(
        &self,
        workspace: &mut Workspace<D>,
        targets: &[Point<T, M>],
        spline: &mut Spline<T, D, M, K>,
    ) -> Result<(), TpsError> {
        self.finish(&self.task(), &mut workspace.buffers, targets, spline).map(drop)
    }

    pub(crate) fn setting(&self) -> Setting<'_, K, D> {
        Setting { kernel: &self.kernel, sites: &self.sites, rank_tolerance: self.rank_tolerance }
    }

    /// λ in the frame's units: the kernel scales as length to its degree.
    pub(crate) fn inner_lambda(&self, smoothing: Smoothing<T>) -> f64 {
        match smoothing {
            Smoothing::Lambda(lambda) => lambda.widen() / self.unit(),
            _ => 0.0,
        }
    }

    /// How much larger the kernel is outside than in the frame.
    pub(crate) fn unit(&self) -> f64 {
        self.sites.frame.scale.powi(self.kernel.degree().unwrap_or(0))
    }
}
