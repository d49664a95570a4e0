//! Source points, factored once for any targets.

use nalgebra::Point;

use crate::{
    FitOptions, FitReport, Kernel, R2LogR, Scalar, Smoothing, Spline, TpsError,
    error::Input,
    options::{validate_smoothing, validate_weights},
    refine::{Buffers, Equations, Solution},
    sites::{Sites, finite},
    span::Span,
    spline::Shape,
    system::System,
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
    pub(crate) span: Span<D>,
    pub(crate) system: System,
    weights: Option<Vec<T>>,
    smoothing: Smoothing<T>,
}

/// Memory that refits use again and again.
#[derive(Clone, Debug, Default)]
pub struct Workspace {
    buffers: Buffers,
    system: System,
}

impl Workspace {
    /// An empty workspace; it grows at its first use.
    pub fn new() -> Self {
        Self::default()
    }
}

impl<T: Scalar, const D: usize, K: Kernel> Factorization<T, D, K> {
    /// Factors `sources` for the kernel, weights and λ of `options`: O(n³/3) time, O(n²) memory.
    ///
    /// # Errors
    /// [`TpsError`] for bad input, or a kernel that is not definite on these points.
    pub fn new(sources: &[Point<T, D>], options: &FitOptions<T, K>) -> Result<Self, TpsError> {
        options.validate(sources.len())?;
        let kernel = options.kernel.clone();
        let sites = Sites::new(sources, kernel.degree().is_some())?;
        let span = Span::new(&sites, options.rank_tolerance.widen());
        let (weights, smoothing) = (options.weights.clone(), options.smoothing);
        let mut this = Self { kernel, sites, span, system: System::default(), weights, smoothing };
        let weights = this.site_weights(this.weights.as_deref());
        let lambda = this.inner_lambda(this.smoothing);
        this.system.factor(&this.kernel, &this.sites, &this.span, &weights, lambda)?;
        Ok(this)
    }

    /// Number of source points.
    pub fn len(&self) -> usize {
        self.sites.inputs()
    }

    /// Whether there are no source points; there always are.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The spline to these targets, with the weights and λ of the factorisation.
    ///
    /// # Errors
    /// [`TpsError`] for bad targets.
    pub fn fit<const M: usize>(&self, targets: &[Point<T, M>]) -> Result<Spline<T, D, M, K>, TpsError> {
        let mut spline = Spline::empty(self.kernel.clone());
        let workspace = &mut Workspace::new();
        self.finish(&self.system, self.weights.as_deref(), workspace, targets, &mut spline, true)?;
        Ok(spline)
    }

    /// As [`fit`](Self::fit), into a spline that is already there; allocates nothing once both have grown.
    ///
    /// # Errors
    /// [`TpsError`] for bad targets; the spline is then left as it was.
    pub fn fit_with<const M: usize>(
        &self,
        workspace: &mut Workspace,
        targets: &[Point<T, M>],
        spline: &mut Spline<T, D, M, K>,
    ) -> Result<(), TpsError> {
        self.finish(&self.system, self.weights.as_deref(), workspace, targets, spline, false)
    }

    /// New targets, weights (none: all one) and smoothing for the same sources, into a spline that is already there.
    ///
    /// # Errors
    /// [`TpsError`] for bad targets, weights or smoothing; the spline is then left as it was.
    pub fn refit_with<const M: usize>(
        &self,
        workspace: &mut Workspace,
        targets: &[Point<T, M>],
        weights: Option<&[T]>,
        smoothing: Smoothing<T>,
        spline: &mut Spline<T, D, M, K>,
    ) -> Result<(), TpsError> {
        validate_smoothing(&smoothing)?;
        if let Some(weights) = weights {
            validate_weights(weights, self.len())?;
        }
        let mut system = core::mem::take(&mut workspace.system);
        let site_weights = self.site_weights(weights);
        let lambda = self.inner_lambda(smoothing);
        let done = system
            .factor(&self.kernel, &self.sites, &self.span, &site_weights, lambda)
            .and_then(|()| self.finish(&system, weights, workspace, targets, spline, false));
        workspace.system = system;
        done
    }

    /// λ in the frame's units: the kernel scales as length to its degree.
    fn inner_lambda(&self, smoothing: Smoothing<T>) -> f64 {
        match smoothing {
            Smoothing::Lambda(lambda) => lambda.widen() / self.unit(),
            _ => 0.0,
        }
    }

    /// How much larger the kernel is outside than in the frame.
    pub(crate) fn unit(&self) -> f64 {
        self.sites.frame.scale.powi(self.kernel.degree().unwrap_or(0))
    }

    /// Weight of every site, empty if all are one.
    fn site_weights(&self, weights: Option<&[T]>) -> Vec<f64> {
        if weights.is_none() && self.sites.site_of.is_empty() {
            return Vec::new();
        }
        let mut sums = vec![0.0; self.sites.len()];
        for i in 0..self.len() {
            sums[self.sites.site(i)] += weights.map_or(1.0, |w| w[i].widen());
        }
        sums
    }

    fn finish<const M: usize>(
        &self,
        system: &System,
        weights: Option<&[T]>,
        workspace: &mut Workspace,
        targets: &[Point<T, M>],
        spline: &mut Spline<T, D, M, K>,
        careful: bool,
    ) -> Result<(), TpsError> {
        if targets.len() != self.len() {
            return Err(TpsError::Length {
                input: Input::Targets,
                expected: self.len(),
                found: targets.len(),
            });
        }
        finite(targets, Input::Targets)?;
        let weight = |i: usize| weights.map_or(1.0, |w| w[i].widen());
        if system.lambda == 0.0 {
            self.agree(targets, weight)?;
        }
        let n = self.sites.len();
        let origin: [f64; M] = core::array::from_fn(|k| targets[0][k].widen());
        let buffers = &mut workspace.buffers;
        buffers.targets.clear();
        buffers.targets.resize(n * M, 0.0);
        self.gather(targets, weight, &origin, &mut buffers.targets);
        let equations = Equations { kernel: &self.kernel, sites: &self.sites, span: &self.span, system };
        let solution: Solution<M> =
            equations.solve(buffers, careful).ok_or(TpsError::NotDefinite { column: system.null.q })?;
        spline.assign(self, &buffers.weights, &origin, &solution.affine, self.report(system, &solution));
        Ok(())
    }

    /// Coinciding points must have equal targets where the spline interpolates.
    fn agree<const M: usize>(
        &self,
        targets: &[Point<T, M>],
        weight: impl Fn(usize) -> f64,
    ) -> Result<(), TpsError> {
        for second in 0..self.sites.site_of.len() {
            let first = self.sites.first[self.sites.site(second)];
            if targets[first] != targets[second] && weight(first) > 0.0 && weight(second) > 0.0 {
                return Err(TpsError::Conflict { first, second });
            }
        }
        Ok(())
    }

    /// Values at the sites less `origin`: the targets, or their weighted mean where points coincide.
    fn gather<const M: usize>(
        &self,
        targets: &[Point<T, M>],
        weight: impl Fn(usize) -> f64,
        origin: &[f64; M],
        values: &mut [f64],
    ) {
        for (k, column) in values.chunks_exact_mut(self.sites.len()).enumerate() {
            if self.sites.site_of.is_empty() {
                column.iter_mut().zip(targets).for_each(|(v, t)| *v = t[k].widen() - origin[k]);
                continue;
            }
            let mut totals = vec![0.0; column.len()];
            for (i, target) in targets.iter().enumerate() {
                let site = self.sites.site(i);
                totals[site] += weight(i);
                if weight(i) > 0.0 {
                    column[site] +=
                        (target[k].widen() - origin[k] - column[site]) * (weight(i) / totals[site]);
                }
            }
        }
    }

    fn report<const M: usize>(&self, system: &System, solution: &Solution<M>) -> FitReport {
        FitReport {
            points: self.len(),
            merged: self.len() - self.sites.len(),
            ignored: self.sites.len() - system.active.len(),
            rank: system.null.q,
            extents: self.span.extents.to_vec(),
            lambda: system.lambda * self.unit(),
            condition: system.condition,
            residual: solution.residual,
            refinements: solution.refinements,
            precise: solution.precise,
            digits: 0.0,
        }
    }

    pub(crate) fn shape(&self) -> Shape<'_, D> {
        Shape { sites: &self.sites, span: &self.span }
    }
}
