//! Source points, factored once for any targets.

use core::ops::ControlFlow;
use std::sync::OnceLock;

use nalgebra::Point;

use crate::{
    FitOptions, Kernel, Progress, R2LogR, Scalar, Smoothing, TpsError,
    centres::Centres,
    equations::Buffers,
    iterative::Iterative,
    options::validate_weight_count,
    progress::Watch,
    system::{Setting, System},
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
    pub(crate) centres: Centres<D>,
    pub(crate) system: System<D>,
    /// The same with its spectrum, computed when a λ first needs it.
    pub(crate) spectral: OnceLock<System<D>>,
    pub(crate) weights: Option<Vec<T>>,
    /// Weight of every centre, empty if all weights are one.
    pub(crate) centre_weights: Vec<f64>,
    pub(crate) smoothing: Smoothing<T>,
    rank_tolerance: f64,
    /// The preconditioner, if the solver iterates; the system is then without a factor.
    pub(crate) iterative: Option<Iterative<D>>,
    /// Where iteration stops.
    pub(crate) tolerance: f64,
}

/// Buffers that refits reuse.
///
/// ```
/// # use nalgebra::Point2;
/// # use tactile_tps::{Factorization, FitOptions, Spline, Workspace};
/// # fn main() -> Result<(), tactile_tps::TpsError> {
/// # let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.4, 0.6]].map(Point2::from);
/// let factorization = Factorization::new(&sources, &FitOptions::default())?;
/// let (mut workspace, mut spline) = (Workspace::default(), Spline::default());
/// for step in 1..=3 {
///     // No allocation from the second round on.
///     let targets = sources.map(|p| Point2::new(p.x, p.y * f64::from(step)));
///     factorization.refit_with(&mut workspace, &targets, None, None, &mut spline)?;
///     assert!((spline.apply(&sources[4]) - targets[4]).norm() < 1e-14);
/// }
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug, Default)]
pub struct Workspace<const D: usize> {
    pub(crate) buffers: Buffers,
    pub(crate) system: System<D>,
    pub(crate) iterative: Iterative<D>,
    pub(crate) centre_weights: Vec<f64>,
}

impl<T: Scalar, const D: usize, K: Kernel> Factorization<T, D, K> {
    /// Factors `sources` for the kernel, weights and λ of `options`: O(n³/3) time, O(n²) memory.
    ///
    /// With [`Smoothing::Gcv`] the matrix is decomposed instead, at some thirty times the cost. Thousands of points, or
    /// [`Solver::Iterative`](crate::Solver), are prepared for iteration: O(n²) time, O(n) memory.
    ///
    /// ```
    /// # use nalgebra::Point2;
    /// # use tactile_tps::{Factorization, FitOptions, NegR, TpsError};
    /// # fn main() -> Result<(), tactile_tps::TpsError> {
    /// # let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.4, 0.6]].map(Point2::from);
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
    /// [`TpsError`] for bad input, or a kernel that is not definite on these points.
    pub fn new(sources: &[Point<T, D>], options: &FitOptions<T, K>) -> Result<Self, TpsError> {
        Self::new_watched(sources, options, |_| ControlFlow::Continue(()))
    }

    /// As [`new`](Self::new), reporting the progress of an iterative solver's preparation to `watch`, which may stop it.
    pub(crate) fn new_watched(
        sources: &[Point<T, D>],
        options: &FitOptions<T, K>,
        mut watch: impl FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<Self, TpsError> {
        let this = Self::without_points(options.kernel.clone());
        this.refactored(sources, options, &mut watch)
    }

    /// As [`new`](Self::new), in the memory of this factorisation: for points of the same number nothing is allocated. O(n³/3).
    ///
    /// ```
    /// # use nalgebra::Point2;
    /// # use tactile_tps::{Factorization, FitOptions, Spline, TpsError, Workspace};
    /// # fn main() -> Result<(), TpsError> {
    /// # let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.4, 0.6]].map(Point2::from);
    /// let options = FitOptions::default();
    /// let mut factorization = Factorization::new(&sources, &options)?;
    /// let (mut workspace, mut spline) = (Workspace::default(), Spline::default());
    /// for step in 1..=3 {
    ///     let moved = sources.map(|p| p * f64::from(step));
    ///     factorization = factorization.refactor(&moved, &options)?;
    ///     factorization.refit_with(&mut workspace, &sources, None, None, &mut spline)?;
    ///     assert!((spline.apply(&moved[4]) - sources[4]).norm() < 1e-14);
    /// }
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn refactor(
        self,
        sources: &[Point<T, D>],
        options: &FitOptions<T, K>,
    ) -> Result<Self, TpsError> {
        self.refactored(sources, options, &mut |_| ControlFlow::Continue(()))
    }

    fn refactored(
        self,
        sources: &[Point<T, D>],
        options: &FitOptions<T, K>,
        watch: &mut Watch<'_>,
    ) -> Result<Self, TpsError> {
        let mut this = self.with_points(sources, options)?;
        let lambda = this.inner_lambda(this.smoothing);
        let kept = core::mem::take(&mut this.system);
        let preconditioner = this.iterative.take();
        // Only a factor is made in the memory of the last one: what a spectrum or a preconditioner leaves unwritten must be empty.
        if this.smoothing == Smoothing::Gcv {
            this.decompose();
        } else if options.iterates(this.centres.len()) {
            let (mut iterative, mut system) =
                (preconditioner.unwrap_or_default(), System::default());
            let built = iterative.build(
                &this.setting(),
                &this.centre_weights,
                lambda,
                &mut system,
                watch,
            );
            if built.is_break() {
                return Err(TpsError::Stopped);
            }
            (this.iterative, this.system) = (Some(iterative), system);
        } else {
            let mut system = kept;
            system.factor(&this.setting(), &this.centre_weights, lambda)?;
            this.system = system;
        }
        Ok(this)
    }

    /// No points yet: memory for [`with_points`](Self::with_points).
    pub(crate) fn without_points(kernel: K) -> Self {
        Self {
            kernel,
            centres: Centres::default(),
            system: System::default(),
            spectral: OnceLock::new(),
            weights: None,
            centre_weights: Vec::new(),
            smoothing: Smoothing::None,
            rank_tolerance: 0.0,
            iterative: None,
            tolerance: 0.0,
        }
    }

    /// The distinct centres and the options, without a factor for them.
    pub(crate) fn with_points(
        mut self,
        sources: &[Point<T, D>],
        options: &FitOptions<T, K>,
    ) -> Result<Self, TpsError> {
        if let Some(weights) = &options.weights {
            validate_weight_count(weights, sources.len())?;
            self.weights.get_or_insert_default().clone_from(weights);
        } else {
            self.weights = None;
        }
        self.kernel.clone_from(&options.kernel);
        self.centres.take(sources, self.kernel.degree().is_some())?;
        self.centres
            .weigh(self.weights.as_deref(), &mut self.centre_weights);
        self.spectral = OnceLock::new();
        self.smoothing = options.smoothing;
        self.rank_tolerance = options.rank_tolerance.widen();
        self.tolerance = options.tolerance.widen();
        Ok(self)
    }

    /// Number of source points.
    pub(crate) fn len(&self) -> usize {
        self.centres.inputs()
    }

    /// Decomposes the matrix into eigenvalues and -vectors, so that a refit with any λ costs no more than one with new
    /// targets; some 10 n³ operations, once.
    pub(crate) fn decompose(&self) {
        self.spectral.get_or_init(|| {
            let mut system = System::default();
            system.decompose(&self.setting(), &self.centre_weights);
            system
        });
    }

    pub(crate) fn setting(&self) -> Setting<'_, K, D> {
        Setting {
            kernel: &self.kernel,
            centres: &self.centres,
            rank_tolerance: self.rank_tolerance,
        }
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
        self.centres
            .frame
            .scale
            .powi(self.kernel.degree().unwrap_or(0))
    }
}
