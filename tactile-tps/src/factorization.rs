//! Source points, factored once for any targets.

use std::sync::OnceLock;

use nalgebra::Point;

use crate::{
    FitOptions, Kernel, R2LogR, Scalar, Smoothing, Spline, TpsError,
    error::Input,
    options::{validate_smoothing, validate_weights},
    refine::{Buffers, Equations, Solution},
    reweight::Reweighting,
    sites::{Sites, finite},
    spline::Fitted,
    system::{Setting, System},
};

/// Points up to which a refit with another λ decomposes the matrix unasked: a few milliseconds.
const DECOMPOSE_POINTS: usize = 256;

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
    spectral: OnceLock<System<D>>,
    pub(crate) weights: Option<Vec<T>>,
    /// Weight of every site, empty if all are one.
    pub(crate) site_weights: Vec<f64>,
    pub(crate) smoothing: Smoothing<T>,
    rank_tolerance: f64,
}

/// Memory that refits use again and again.
#[derive(Clone, Debug, Default)]
pub struct Workspace<const D: usize> {
    pub(crate) buffers: Buffers,
    system: System<D>,
    site_weights: Vec<f64>,
}

impl<const D: usize> Workspace<D> {
    /// An empty workspace; it grows at its first use.
    pub fn new() -> Self {
        Self::default()
    }
}

/// One fit: what it is made with.
struct Task<'a, T, const D: usize> {
    system: &'a System<D>,
    weights: Option<&'a [T]>,
    smoothing: Smoothing<T>,
    careful: bool,
    /// Other weights than the system's, to be met by iteration.
    reweighting: Option<Reweighting<'a>>,
}

impl<T: Scalar, const D: usize, K: Kernel> Factorization<T, D, K> {
    /// Factors `sources` for the kernel, weights and λ of `options`: O(n³/3) time, O(n²) memory.
    ///
    /// With [`Smoothing::Gcv`] the matrix is decomposed instead, at some thirty times the cost.
    ///
    /// # Errors
    /// [`TpsError`] for bad input, or a kernel that is not definite on these points.
    pub fn new(sources: &[Point<T, D>], options: &FitOptions<T, K>) -> Result<Self, TpsError> {
        options.validate(sources.len())?;
        let kernel = options.kernel.clone();
        let sites = Sites::new(sources, kernel.degree().is_some())?;
        let mut site_weights = Vec::new();
        weigh(&sites, options.weights.as_deref(), &mut site_weights);
        let mut this = Self {
            kernel,
            sites,
            system: System::default(),
            spectral: OnceLock::new(),
            weights: options.weights.clone(),
            site_weights,
            smoothing: options.smoothing,
            rank_tolerance: options.rank_tolerance.widen(),
        };
        if this.smoothing == Smoothing::Gcv {
            this.decompose();
        } else {
            let (mut system, lambda) = (System::default(), this.inner_lambda(this.smoothing));
            system.factor(&this.setting(), &this.site_weights, lambda)?;
            this.system = system;
        }
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
        let mut spline = Spline::empty(self.kernel.clone());
        let task = Task { careful: true, ..self.task() };
        self.finish(&task, &mut Buffers::default(), targets, &mut spline)?;
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

    /// New targets, weights (`None`: those of the factorisation) and smoothing for the same sources, into a spline that
    /// is already there; allocates nothing once workspace and spline have grown.
    ///
    /// The same weights and λ cost two triangular solves; another λ without weights two products once the matrix is
    /// [decomposed](Self::decompose). Positive weights leave an interpolating spline as it is, and cost the two solves. With
    /// λ > 0, weights near each other, or few that differ, are met by conjugate gradients on the decomposed matrix, to 1e-13
    /// of the targets; weights far apart, or of zero, cost a factorisation without the set-up of the first.
    ///
    /// # Errors
    /// [`TpsError`] for bad targets, weights or smoothing; the spline is then left as it was.
    pub fn refit_with<const M: usize>(
        &self,
        workspace: &mut Workspace<D>,
        targets: &[Point<T, M>],
        weights: Option<&[T]>,
        smoothing: Smoothing<T>,
        spline: &mut Spline<T, D, M, K>,
    ) -> Result<(), TpsError> {
        validate_smoothing(&smoothing)?;
        if let Some(weights) = weights {
            validate_weights(weights, self.len())?;
        }
        if weights.is_none() && smoothing == self.smoothing {
            return self.fit_with(workspace, targets, spline);
        }
        let Workspace { buffers, system, site_weights } = workspace;
        if let Some(weights) = weights {
            weigh(&self.sites, Some(weights), site_weights);
            if let Some(task) = self.cheap(weights, site_weights, smoothing, &mut buffers.excess)
                && self.finish(&task, buffers, targets, spline)?
            {
                return Ok(());
            }
        }
        let own = weights.is_none();
        let gcv = smoothing == Smoothing::Gcv;
        let spectral = own && (gcv || self.decomposes(smoothing));
        if spectral {
            self.decompose();
        } else {
            weigh(&self.sites, weights.or(self.weights.as_deref()), site_weights);
            match gcv {
                true => system.decompose(&self.setting(), site_weights),
                false => system.factor(&self.setting(), site_weights, self.inner_lambda(smoothing))?,
            }
        }
        let system = self.spectral.get().filter(|_| spectral).unwrap_or(system);
        let task = Task {
            system,
            weights: weights.or(self.weights.as_deref()),
            smoothing,
            careful: false,
            reweighting: None,
        };
        self.finish(&task, buffers, targets, spline).map(drop)
    }

    /// A fit with other weights by what is already there, if it can be had.
    ///
    /// An interpolating spline asks only which weights are positive; a smoothing one changes on a diagonal.
    fn cheap<'a>(
        &'a self,
        weights: &'a [T],
        site_weights: &[f64],
        smoothing: Smoothing<T>,
        excess: &mut Vec<f64>,
    ) -> Option<Task<'a, T, D>> {
        if smoothing == Smoothing::Gcv || site_weights.contains(&0.0) {
            return None;
        }
        let task = |system, reweighting| {
            Some(Task { system, weights: Some(weights), smoothing, careful: false, reweighting })
        };
        if self.inner_lambda(smoothing) == 0.0 {
            let same = self.system.lambda == 0.0 && self.system.active.len() == self.sites.len();
            return if same { task(&self.system, None) } else { None };
        }
        if !self.decomposes(smoothing) {
            return None;
        }
        self.decompose();
        let system = self.spectral.get()?;
        let reweighting = system.reweighting(self.inner_lambda(smoothing), site_weights, excess)?;
        task(system, Some(reweighting))
    }

    /// Whether a refit with this smoothing and the factorisation's own weights is to go by the spectrum.
    fn decomposes(&self, smoothing: Smoothing<T>) -> bool {
        let few = self.spectral.get().is_some() || self.sites.len() <= DECOMPOSE_POINTS;
        few && self.site_weights.is_empty() && self.inner_lambda(smoothing) > 0.0
    }

    /// A quick fit with what the factorisation was made with.
    fn task(&self) -> Task<'_, T, D> {
        let gcv = self.smoothing == Smoothing::Gcv;
        let system = self.spectral.get().filter(|_| gcv).unwrap_or(&self.system);
        Task {
            system,
            weights: self.weights.as_deref(),
            smoothing: self.smoothing,
            careful: false,
            reweighting: None,
        }
    }

    fn setting(&self) -> Setting<'_, K, D> {
        Setting { kernel: &self.kernel, sites: &self.sites, rank_tolerance: self.rank_tolerance }
    }

    /// λ in the frame's units: the kernel scales as length to its degree.
    fn inner_lambda(&self, smoothing: Smoothing<T>) -> f64 {
        match smoothing {
            Smoothing::Lambda(lambda) => lambda.widen() / self.unit(),
            _ => 0.0,
        }
    }

    /// How much larger the kernel is outside than in the frame.
    fn unit(&self) -> f64 {
        self.sites.frame.scale.powi(self.kernel.degree().unwrap_or(0))
    }

    /// Solves and fills the spline; `false` if the task was to iterate and that takes too many steps.
    fn finish<const M: usize>(
        &self,
        task: &Task<'_, T, D>,
        buffers: &mut Buffers,
        targets: &[Point<T, M>],
        spline: &mut Spline<T, D, M, K>,
    ) -> Result<bool, TpsError> {
        if targets.len() != self.len() {
            let (expected, found) = (self.len(), targets.len());
            return Err(TpsError::Length { input: Input::Targets, expected, found });
        }
        finite(targets, Input::Targets)?;
        let (system, lambda) = (task.system, self.inner_lambda(task.smoothing));
        let gcv = task.smoothing == Smoothing::Gcv;
        if lambda == 0.0 && !gcv {
            self.agree(targets, task.weights)?;
        }
        let origin: [f64; M] = core::array::from_fn(|k| targets[0][k].widen());
        self.gather(targets, task.weights, &origin, buffers);
        let lambda = if gcv { self.validated::<M>(system, buffers)? } else { lambda };
        let equations = Equations { kernel: &self.kernel, sites: &self.sites, system, lambda };
        let solution: Solution<M> = match &task.reweighting {
            None => equations
                .solve(buffers, task.careful)
                .ok_or(TpsError::NotDefinite { column: system.null.q })?,
            Some(reweighting) => match equations.resolve(buffers, reweighting) {
                Some(solution) => solution,
                None => return Ok(false),
            },
        };
        let level = targets.iter().flat_map(|t| t.iter()).fold(0.0, |m, x| f64::max(m, x.widen().abs()));
        let (sites, unit) = (&self.sites, self.unit());
        spline.assign(&Fitted { sites, system, lambda, unit, solution, origin, level }, buffers);
        Ok(true)
    }

    /// The λ of least generalised cross-validation.
    fn validated<const M: usize>(&self, system: &System<D>, buffers: &mut Buffers) -> Result<f64, TpsError> {
        let (needed, found) = (system.null.q, system.active.len());
        if found <= needed {
            return Err(TpsError::TooFewForValidation { needed, found });
        }
        let Buffers { targets, work, spare, .. } = buffers;
        let lambda = system.cross_validate::<M>(targets, self.sites.len(), work, spare);
        Ok(lambda.unwrap_or(0.0))
    }

    /// Coinciding points must have equal targets where the spline interpolates.
    fn agree<const M: usize>(&self, targets: &[Point<T, M>], weights: Option<&[T]>) -> Result<(), TpsError> {
        let counts = |i: usize| weights.is_none_or(|w| w[i] > T::zero());
        for second in (0..self.sites.site_of.len()).filter(|&i| counts(i)) {
            let site = self.sites.site_of[second];
            let same = |&i: &usize| self.sites.site_of[i] == site && counts(i);
            let first = (self.sites.first[site]..second).find(same).unwrap_or(second);
            if targets[first] != targets[second] {
                return Err(TpsError::Conflict { first, second });
            }
        }
        Ok(())
    }

    /// Values at the sites less `origin`: the targets, or their weighted mean where points coincide.
    fn gather<const M: usize>(
        &self,
        targets: &[Point<T, M>],
        weights: Option<&[T]>,
        origin: &[f64; M],
        buffers: &mut Buffers,
    ) {
        let n = self.sites.len();
        buffers.targets.clear();
        buffers.targets.resize(n * M, 0.0);
        for (k, column) in buffers.targets.chunks_exact_mut(n).enumerate() {
            if self.sites.site_of.is_empty() {
                column.iter_mut().zip(targets).for_each(|(v, t)| *v = t[k].widen() - origin[k]);
                continue;
            }
            let totals = &mut buffers.work;
            totals.clear();
            totals.resize(n, 0.0);
            for (target, (i, &site)) in targets.iter().zip(self.sites.site_of.iter().enumerate()) {
                let weight = weights.map_or(1.0, |w| w[i].widen());
                totals[site] += weight;
                if weight > 0.0 {
                    column[site] += (target[k].widen() - origin[k] - column[site]) * (weight / totals[site]);
                }
            }
        }
    }
}

/// Weight of every site, none if all are one.
fn weigh<T: Scalar, const D: usize>(sites: &Sites<D>, weights: Option<&[T]>, sums: &mut Vec<f64>) {
    sums.clear();
    if weights.is_none() && sites.site_of.is_empty() {
        return;
    }
    sums.resize(sites.len(), 0.0);
    for i in 0..sites.inputs() {
        sums[sites.site(i)] += weights.map_or(1.0, |w| w[i].widen());
    }
}
