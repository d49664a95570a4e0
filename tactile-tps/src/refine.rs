//! Solutions of the spline's equations, refined where the condition number is large.

use crate::{
    Kernel,
    equations::{Buffers, Equations, Solution},
    null_space::MAX,
    precise,
    residual::largest,
    reweight::Reweighting,
    system::PRECISE_POINTS,
};

/// Condition number from which plain arithmetic, refined, no longer keeps enough digits.
const PRECISE_CONDITION: f64 = 1e10;
/// For so few points double-double arithmetic costs a few milliseconds, and is used sooner.
const FEW_POINTS: usize = 64;
const FEW_CONDITION: f64 = 1e8;
/// For so few points a step of refinement costs next to nothing, and is taken sooner.
const SMALL_POINTS: usize = 128;
/// Steps of refinement at most.
const STEPS: usize = 4;

impl<K: Kernel, const D: usize> Equations<'_, K, D> {
    /// Solves for the targets in `buffers`, `None` if the kernel is not definite on the centres; `careful` measures the residual and refines from a lower condition number on.
    pub(crate) fn solve<const M: usize>(
        &self,
        buffers: &mut Buffers,
        careful: bool,
    ) -> Option<Solution<M>> {
        let (n, system) = (self.centres.len(), self.system);
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
            solution.residual = Some(self.sampled_residual(&solution.affine, buffers));
        }
        Some(solution)
    }

    /// Solves in double-double arithmetic where that is needed and affordable.
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
            self.centres,
            self.system,
            self.lambda,
            &mut buffers.weights,
        )?;
        let residual = careful.then(|| self.sampled_residual(&affine, buffers));
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

    /// Whether plain arithmetic would leave too few digits, and the points are few enough for double-double arithmetic.
    ///
    /// Points that are nearly flat lose digits in the gradient across, besides those the matrix costs.
    fn needs_precision(&self, careful: bool) -> bool {
        let (n, condition) = (self.centres.len(), self.system.condition(self.lambda));
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
                    .solve(residuals, self.centres.len(), self.lambda, work, spare);
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
}
