//! Residuals of the spline's equations and iterative refinement.

use crate::{
    Kernel,
    evaluate::{BLOCK, Sum},
    iterative::Vectors,
    null_space::MAX,
    precise,
    product::Subtract,
    reweight::Reweighting,
    simd::dispatch,
    sites::Sites,
    system::System,
};

/// Points up to which twice the working precision is affordable.
pub(crate) const PRECISE_POINTS: usize = 400;
/// Condition number from which plain arithmetic, refined, no longer keeps enough digits.
const PRECISE_CONDITION: f64 = 1e10;
/// For so few points twice the working precision costs a few milliseconds, and is used sooner.
const FEW_POINTS: usize = 64;
const FEW_CONDITION: f64 = 1e8;
/// For so few points a step of refinement costs nothing to speak of, and is taken sooner.
const SMALL_POINTS: usize = 128;
/// Steps of refinement at most.
const STEPS: usize = 4;

/// A spline's equations: everything but the targets.
pub(crate) struct Equations<'a, K, const D: usize> {
    pub(crate) kernel: &'a K,
    pub(crate) sites: &'a Sites<D>,
    pub(crate) system: &'a System<D>,
    /// λ in the frame's units.
    pub(crate) lambda: f64,
}

/// Memory of a solve.
#[derive(Clone, Debug, Default)]
pub(crate) struct Buffers {
    /// Targets at the sites, output by output; the caller fills it.
    pub(crate) targets: Vec<f64>,
    /// Weights at the sites, output by output: the answer.
    pub(crate) weights: Vec<f64>,
    residuals: Vec<f64>,
    /// λW⁻¹ − λ̄I at the sites, for a refit with other weights.
    pub(crate) excess: Vec<f64>,
    pub(crate) work: Vec<f64>,
    pub(crate) spare: Vec<f64>,
    /// Memory of an iterative solve.
    pub(crate) vectors: Vectors,
}

/// What a solve found beside the weights.
pub(crate) struct Solution<const M: usize> {
    pub(crate) affine: [[f64; MAX]; M],
    /// Largest residual relative to the largest target, where it was measured.
    pub(crate) residual: Option<f64>,
    pub(crate) refinements: usize,
    /// Steps of conjugate gradients.
    pub(crate) iterations: usize,
    /// Condition number of the matrix, or a bound.
    pub(crate) condition: f64,
    pub(crate) precise: bool,
    /// Whether an iteration got where it was to go.
    pub(crate) converged: bool,
}

impl<const M: usize> Solution<M> {
    /// A direct one.
    pub(crate) fn new(affine: [[f64; MAX]; M], condition: f64) -> Self {
        Self {
            affine,
            residual: None,
            refinements: 0,
            iterations: 0,
            condition,
            precise: false,
            converged: true,
        }
    }
}

impl<K: Kernel, const D: usize> Equations<'_, K, D> {
    /// Solves for the targets in `buffers`, `None` if the kernel is not definite on the sites; `careful` measures the residual and refines from a lower condition number on.
    pub(crate) fn solve<const M: usize>(
        &self,
        buffers: &mut Buffers,
        careful: bool,
    ) -> Option<Solution<M>> {
        let (n, system) = (self.sites.len(), self.system);
        if let Some(solution) = self.solve_precisely(buffers, careful) {
            return Some(solution);
        }
        if system.indefinite {
            return None;
        }
        buffers.weights.clone_from(&buffers.targets);
        let affine = system.solve(
            &mut buffers.weights,
            n,
            self.lambda,
            &mut buffers.work,
            &mut buffers.spare,
        );
        let mut solution = Solution::new(affine, system.condition(self.lambda));
        let threshold = match careful {
            true if n <= SMALL_POINTS => 10.0 * n as f64,
            true => 1e6,
            false => 1e8,
        };
        if solution.condition > threshold {
            self.refine(buffers, &mut solution);
        }
        if careful && solution.refinements == 0 {
            solution.residual = Some(self.sampled(&solution.affine, buffers));
        }
        Some(solution)
    }

    /// In twice the working precision, where that is needed and can be had.
    fn solve_precisely<const M: usize>(
        &self,
        buffers: &mut Buffers,
        careful: bool,
    ) -> Option<Solution<M>> {
        if !(self.system.indefinite || self.needs_precision(careful)) {
            return None;
        }
        buffers.weights.clone_from(&buffers.targets);
        let affine = precise::solve(
            self.kernel,
            self.sites,
            self.system,
            self.lambda,
            &mut buffers.weights,
        )?;
        let residual = careful.then(|| self.sampled(&affine, buffers));
        let solution = Solution::new(affine, self.system.condition(self.lambda));
        Some(Solution {
            residual,
            precise: true,
            ..solution
        })
    }

    /// Solves with other weights by the spectrum of the system; `None` if that takes too many steps.
    pub(crate) fn resolve<const M: usize>(
        &self,
        buffers: &mut Buffers,
        reweighting: &Reweighting<'_>,
    ) -> Option<Solution<M>> {
        let Buffers {
            targets,
            weights,
            residuals,
            excess,
            work,
            spare,
            ..
        } = buffers;
        weights.clone_from(targets);
        let memory = [residuals, work, spare];
        let (affine, iterations) = self.system.resolve(weights, reweighting, excess, memory)?;
        Some(Solution {
            iterations,
            ..Solution::new(affine, reweighting.condition)
        })
    }

    /// Whether plain arithmetic would leave too few digits, and the points are few enough to do something about it.
    ///
    /// Points that are nearly flat lose digits in the gradient across, besides those the matrix costs.
    fn needs_precision(&self, careful: bool) -> bool {
        let (n, condition) = (self.sites.len(), self.system.condition(self.lambda));
        let span = &self.system.span;
        let stretch = 1.0
            / span.extents[..span.directions]
                .last()
                .copied()
                .unwrap_or(1.0);
        (n <= PRECISE_POINTS && condition > PRECISE_CONDITION)
            || (careful && n <= FEW_POINTS && condition * stretch > FEW_CONDITION)
    }

    fn refine<const M: usize>(&self, buffers: &mut Buffers, solution: &mut Solution<M>) {
        let mut last = f64::INFINITY;
        for _ in 0..STEPS {
            let residual = self.residual(&solution.affine, buffers);
            solution.residual = Some(residual);
            let Buffers {
                weights,
                residuals,
                work,
                spare,
                ..
            } = buffers;
            let affine: [[f64; MAX]; M] =
                self.system
                    .solve(residuals, self.sites.len(), self.lambda, work, spare);
            let step = largest(residuals) / largest(weights).max(f64::MIN_POSITIVE);
            // A step that is no shorter than half the last is rounding.
            if step.is_nan() || step > 0.5 * last {
                return;
            }
            weights
                .iter_mut()
                .zip(residuals.iter())
                .for_each(|(w, r)| *w += r);
            solution
                .affine
                .iter_mut()
                .flatten()
                .zip(affine.iter().flatten())
                .for_each(|(a, d)| *a += d);
            solution.refinements += 1;
            if step < 1e-8 {
                return;
            }
            last = step;
        }
    }

    /// y − K w − λ W⁻¹ w − P a at the sites, and its largest entry relative to the largest target.
    fn residual<const M: usize>(&self, affine: &[[f64; MAX]; M], buffers: &mut Buffers) -> f64 {
        let n = self.sites.len();
        let Buffers {
            targets,
            weights,
            residuals,
            ..
        } = buffers;
        residuals.clone_from(targets);
        let sum = self.sum::<M>(weights);
        dispatch(Subtract {
            places: sum.centres,
            sum,
            residuals,
        });
        let mut size = 0.0;
        for (i, &site) in self.system.active.iter().enumerate() {
            for m in 0..M {
                let residual = &mut residuals[m * n + site];
                *residual -= self.rest(&affine[m], &weights[m * n..], i);
                size = f64::max(size, residual.abs());
            }
        }
        relative(size, targets)
    }

    /// The largest residual at up to one block of sites, spread evenly.
    fn sampled<const M: usize>(&self, affine: &[[f64; MAX]; M], buffers: &mut Buffers) -> f64 {
        let (n, active) = (self.sites.len(), &self.system.active);
        let count = active.len().min(BLOCK);
        let pick = |i: usize| i * active.len() / count;
        let Buffers {
            targets,
            weights,
            residuals,
            ..
        } = buffers;
        residuals.clear();
        residuals.resize(M * count, 0.0);
        let mut places = [[0.0; BLOCK]; D];
        for (k, axis) in places.iter_mut().enumerate() {
            (0..count).for_each(|i| axis[i] = self.sites.axes[k][active[pick(i)]]);
        }
        let sum = self.sum::<M>(weights);
        dispatch(Subtract {
            sum,
            places: places.each_ref().map(|axis| &axis[..count]),
            residuals,
        });
        let mut size = 0.0;
        for i in 0..count {
            for m in 0..M {
                let known = targets[m * n + active[pick(i)]]
                    - self.rest(&affine[m], &weights[m * n..], pick(i));
                size = f64::max(size, (known + residuals[m * count + i]).abs());
            }
        }
        relative(size, targets)
    }

    /// λ W⁻¹ w + P a at an active site.
    fn rest(&self, affine: &[f64; MAX], weights: &[f64], i: usize) -> f64 {
        let (site, scale) = (
            self.system.active[i],
            self.system.scales.get(i).copied().unwrap_or(1.0),
        );
        let smooth = self.lambda * (weights[site] / scale / scale);
        smooth
            + self
                .system
                .span
                .polynomial(affine, |k| self.sites.axes[k][site])
    }

    fn sum<'b, const M: usize>(&'b self, weights: &'b [f64]) -> Sum<'b, f64, K, D, M> {
        let n = self.sites.len();
        Sum {
            kernel: self.kernel,
            centres: core::array::from_fn(|k| &self.sites.axes[k][..]),
            weights: core::array::from_fn(|m| &weights[m * n..(m + 1) * n]),
        }
    }
}

/// The size relative to the largest target.
pub(crate) fn relative(size: f64, targets: &[f64]) -> f64 {
    let target = largest(targets);
    if target > 0.0 { size / target } else { size }
}

/// Largest magnitude.
pub(crate) fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |m, x| f64::max(m, x.abs()))
}
