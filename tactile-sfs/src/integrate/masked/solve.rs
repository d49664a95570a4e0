//! Conjugate gradients with the V-cycle as preconditioner.

use super::MaskedBuffers;
use crate::{Report, Scalar, StopReason, Workspace};

/// Steps without a new least residual after which rounding is taken to have won.
const PATIENCE: usize = 20;

/// Solves A z = residual from z = known heights or 0.
pub(super) fn conjugate_gradients<T: Scalar>(
    buffers: &mut MaskedBuffers<T>,
    workspace: &mut Workspace<T>,
    tolerance: T,
    limit: usize,
    report: &mut Report<T>,
) {
    let MaskedBuffers { hierarchy, z, residual, direction, image, .. } = buffers;
    let length = residual.len();
    for vector in [&mut *direction, &mut *image] {
        vector.clear();
        vector.resize(length, 0.0);
    }
    let start = dot(residual, residual).sqrt();
    report.stop = StopReason::Converged;
    if start == 0.0 {
        return;
    }
    let (mut old, mut best, mut waited) = (1.0, f64::INFINITY, 0);
    for iteration in 1..=limit {
        for (to, &from) in hierarchy.levels[0].rhs.iter_mut().zip(residual.iter()) {
            *to = T::of(from / start);
        }
        hierarchy.cycle();
        let level = &hierarchy.levels[0];
        let new = residual.iter().zip(&level.x).map(|(&r, x)| r * x.as_f64()).sum::<f64>();
        let beta = if iteration == 1 { 0.0 } else { new / old };
        old = new;
        for (d, &x) in direction.iter_mut().zip(&level.x) {
            *d = x.as_f64() + beta * *d;
        }
        level.multiply(direction, image);
        let curvature = dot(direction, image);
        if !(curvature > 0.0 && new.is_finite()) {
            report.stop = StopReason::Stagnated;
            return;
        }
        let alpha = new / curvature;
        for ((z, r), (&d, &a)) in
            z.iter_mut().zip(residual.iter_mut()).zip(direction.iter().zip(image.iter()))
        {
            *z += alpha * d;
            *r -= alpha * a;
        }
        let relative = dot(residual, residual).sqrt() / start;
        report.iterations = iteration;
        report.residual = T::of(relative);
        if relative <= tolerance.as_f64() {
            return;
        }
        waited = if relative < best { 0 } else { waited + 1 };
        best = best.min(relative);
        if waited >= PATIENCE {
            report.stop = StopReason::Stagnated;
            return;
        }
        if let Some(stop) = workspace.report(iteration, limit, report.residual) {
            report.stop = stop;
            return;
        }
    }
    report.stop = StopReason::IterationLimit;
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(&a, &b)| a * b).sum()
}
