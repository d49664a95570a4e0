//! Conjugate gradients with the V-cycle as preconditioner.

use super::MaskedBuffers;
use crate::{Report, Scalar, StopReason, Workspace};

/// Steps without a new least residual after which rounding is taken to have won.
const PATIENCE: usize = 20;

/// When to stop.
pub(super) struct Limits {
    /// Residual relative to the right-hand side.
    pub(super) tolerance: f64,
    pub(super) iterations: usize,
}

/// Solves A z = residual from z = known heights or 0.
pub(super) fn conjugate_gradients<T: Scalar>(
    buffers: &mut MaskedBuffers<T>,
    workspace: &mut Workspace<T>,
    limits: &Limits,
    report: &mut Report<T>,
) {
    report.stop = StopReason::Converged;
    if let Some(mut steps) = Steps::start(buffers) {
        report.stop = steps.run(buffers, workspace, limits, report);
    }
}

/// What one step leaves to the next.
struct Steps {
    /// Norm of the right-hand side, the unit the preconditioner sees residuals in.
    unit: f64,
    /// residual · preconditioned residual of the last step.
    last: f64,
}

impl Steps {
    /// `None` if there is nothing to do.
    fn start<T: Scalar>(buffers: &mut MaskedBuffers<T>) -> Option<Self> {
        let MaskedBuffers {
            hierarchy,
            residual,
            direction,
            image,
            ..
        } = buffers;
        for vector in [&mut *direction, &mut *image] {
            vector.clear();
            vector.resize(residual.len(), 0.0);
        }
        let unit = dot(residual, residual).sqrt();
        for (to, from) in hierarchy.levels[0].rhs.iter_mut().zip(residual.iter()) {
            *to = (from / unit) as f32;
        }
        (unit > 0.0).then_some(Self {
            unit,
            last: f64::INFINITY,
        })
    }

    /// Steps until one of the limits is met.
    fn run<T: Scalar>(
        &mut self,
        buffers: &mut MaskedBuffers<T>,
        workspace: &mut Workspace<T>,
        limits: &Limits,
        report: &mut Report<T>,
    ) -> StopReason {
        let (mut best, mut waited) = (f64::INFINITY, 0);
        for iteration in 1..=limits.iterations {
            let Some(relative) = self.next(buffers) else {
                return StopReason::Stagnated;
            };
            report.iterations = iteration;
            report.residual = T::of(relative);
            if relative <= limits.tolerance {
                return StopReason::Converged;
            }
            waited = if relative < best { 0 } else { waited + 1 };
            best = best.min(relative);
            if waited >= PATIENCE {
                return StopReason::Stagnated;
            }
            if let Some(stop) = workspace.report(iteration, limits.iterations, report.residual) {
                return stop;
            }
        }
        StopReason::IterationLimit
    }

    /// One step; the relative residual after it, `None` where rounding allows no further one.
    fn next<T: Scalar>(&mut self, buffers: &mut MaskedBuffers<T>) -> Option<f64> {
        let MaskedBuffers {
            hierarchy,
            system,
            z,
            residual,
            direction,
            image,
            ..
        } = buffers;
        hierarchy.cycle();
        let level = &mut hierarchy.levels[0];
        let new = dot(residual, &level.x);
        let curvature = system.turn(new / self.last, &level.x, direction, image);
        if !(curvature > 0.0 && new.is_finite()) {
            return None;
        }
        self.last = new;
        let step = new / curvature;
        let mut sum = 0.0;
        let (w, per_unit) = (level.width, self.unit.recip());
        let lines = z
            .chunks_exact_mut(w)
            .zip(residual.chunks_exact_mut(w))
            .zip(level.rhs.chunks_exact_mut(w));
        for (((z, residual), rhs), (d, a)) in
            lines.zip(direction.chunks_exact(w).zip(image.chunks_exact(w)))
        {
            for i in 0..w {
                z[i] += step * d[i];
                residual[i] -= step * a[i];
                rhs[i] = (residual[i] * per_unit) as f32;
            }
            sum += dot(residual, residual);
        }
        Some(sum.sqrt() * per_unit)
    }
}

/// Scalar product in four interleaved sums.
pub(super) fn dot<A: Copy + Into<f64>>(a: &[f64], b: &[A]) -> f64 {
    let mut sums = [0.0; 4];
    let (a, b) = (a.chunks_exact(4), b.chunks_exact(4));
    let rest = a
        .remainder()
        .iter()
        .zip(b.remainder())
        .map(|(&a, &b)| a * b.into())
        .sum::<f64>();
    for (a, b) in a.zip(b) {
        for k in 0..4 {
            sums[k] += a[k] * b[k].into();
        }
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest
}
