//! Expectation maximisation: the loop, and the memory it needs.

use super::expectation::{Columns, Posterior, uniform_weight};
use super::global::GlobalStep;
use super::kernel::KernelFactor;
use super::non_rigid::NonRigidStep;
use super::warp::DriftWarp;
use super::{CoherentPointDrift, Motion, Normalization};
use crate::StopReason;
use crate::frame::Frame;
use nalgebra::{Point, SMatrix, SVector};

/// What is left of the kernel's diagonal when its factorisation ends: far below what the ridge `λσ²` lets through.
const KERNEL_TOLERANCE: f64 = 1e-12;

/// Memory of [`CoherentPointDrift`](super::CoherentPointDrift), to be reused: the iterations do not allocate once it has
/// seen the largest sets.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_match::{CoherentPointDrift, DriftWorkspace};
/// let model: Vec<_> = (0..12).map(f64::from).map(|k| Point2::new(k % 4.0 + 0.2 * k.sin(), (k / 4.0).floor())).collect();
/// let target: Vec<_> = model.iter().map(|p| Point2::new(p.x + 0.1 * p.y, p.y + 2.0)).collect();
/// let mut workspace = DriftWorkspace::default();
/// let found = CoherentPointDrift::default().match_with(&mut workspace, &model, &target)?;
/// assert!(found.report.iterations > 1 && found.report.sigma < 0.2); // in the units of the points
/// assert!((found.warp.apply(&model[5]) - found.warped[5]).norm() < 1e-6);
/// # Ok::<(), tactile_match::MatchError>(())
/// ```
#[derive(Clone, Debug)]
pub struct DriftWorkspace<const D: usize> {
    pub(super) model_frame: Frame<D>,
    pub(super) target_frame: Frame<D>,
    pub(super) model: Columns<D>,
    pub(super) target: Columns<D>,
    pub(super) moved: Columns<D>,
    pub(super) posterior: Posterior<D>,
    pub(super) sigma2: f64,
    pub(super) energy: Vec<f64>,
    pub(super) stop: StopReason,
    motion: Motion,
    kernel: KernelFactor,
    non_rigid: NonRigidStep,
    global: GlobalStep<D>,
}

impl<const D: usize> Default for DriftWorkspace<D> {
    fn default() -> Self {
        // Without memory yet.
        let columns = || std::array::from_fn(|_| Vec::new());
        Self {
            model_frame: Frame::default(),
            target_frame: Frame::default(),
            model: columns(),
            target: columns(),
            moved: columns(),
            posterior: Posterior::default(),
            sigma2: 0.0,
            energy: Vec::new(),
            stop: StopReason::default(),
            motion: Motion::NON_RIGID,
            kernel: KernelFactor::default(),
            non_rigid: NonRigidStep::default(),
            global: GlobalStep::default(),
        }
    }
}

impl<const D: usize> DriftWorkspace<D> {
    /// Iterations of the last registration.
    pub(super) fn iterations(&self) -> usize {
        self.energy.len()
    }

    /// Registers `model` to `target`; both have points and finite coordinates.
    pub(super) fn register(
        &mut self,
        options: &CoherentPointDrift,
        model: &[Point<f64, D>],
        target: &[Point<f64, D>],
    ) {
        self.enter_frames(options, model, target);
        self.global.reset();
        self.motion = options.motion;
        if let Motion::NonRigid { beta, rank, .. } = options.motion {
            self.kernel.build(
                &self.model,
                beta,
                rank.unwrap_or(model.len()),
                KERNEL_TOLERANCE,
            );
        }
        self.energy.clear();
        self.sigma2 = self.initial_variance();
        self.stop = StopReason::Exact;
        if self.sigma2 <= 0.0 {
            return; // all points of both sets coincide
        }
        self.stop = StopReason::IterationLimit;
        for _ in 0..options.max_iterations {
            let before = self.sigma2;
            self.iterate(options);
            if (self.sigma2 - before).abs() <= options.tolerance {
                self.stop = StopReason::Converged;
                break;
            }
        }
    }

    fn enter_frames(
        &mut self,
        options: &CoherentPointDrift,
        model: &[Point<f64, D>],
        target: &[Point<f64, D>],
    ) {
        self.model_frame = Frame::of(model);
        self.target_frame = match options.normalization {
            Normalization::Each => Frame::of(target),
            Normalization::Model => self.model_frame,
            Normalization::Off => Frame::default(),
        };
        if options.normalization == Normalization::Off {
            self.model_frame = Frame::default();
        } else if options.motion == Motion::Rigid {
            // Rigid motion knows one unit: that of the larger set, or squares of the other could overflow.
            let scale = self.model_frame.scale.max(self.target_frame.scale);
            (self.model_frame.scale, self.target_frame.scale) = (scale, scale);
        }
        self.model_frame.enter(model, &mut self.model);
        self.target_frame.enter(target, &mut self.target);
        self.moved.clone_from(&self.model);
    }

    /// Mean squared distance of all pairs, per axis.
    fn initial_variance(&self) -> f64 {
        let mut sum = 0.0;
        for (y, x) in self.model.iter().zip(&self.target) {
            let moments = |v: &[f64]| {
                let n = v.len() as f64;
                (
                    v.iter().sum::<f64>() / n,
                    v.iter().map(|c| c * c).sum::<f64>() / n,
                )
            };
            let ((mean_y, square_y), (mean_x, square_x)) = (moments(y), moments(x));
            sum += square_y + square_x - 2.0 * mean_y * mean_x;
        }
        sum / D as f64
    }

    /// One E-step and one M-step.
    fn iterate(&mut self, options: &CoherentPointDrift) {
        let uniform = self.uniform(options);
        self.posterior
            .update(&self.moved, &self.target, self.sigma2, uniform);
        self.energy.push(self.posterior.energy);
        match options.motion {
            Motion::NonRigid { lambda, .. } => {
                let ridge = lambda * self.sigma2;
                self.non_rigid.solve(
                    &self.kernel,
                    &self.posterior,
                    &self.model,
                    ridge,
                    &mut self.moved,
                );
            }
            motion => self
                .global
                .solve(motion, &self.posterior, &self.model, &mut self.moved),
        }
        self.update_variance(options.tolerance);
    }

    /// Weight of the uniform component at the present variance.
    pub(super) fn uniform(&self, options: &CoherentPointDrift) -> f64 {
        uniform_weight::<D>(
            self.sigma2,
            options.outlier_weight,
            self.model[0].len(),
            self.target[0].len(),
        )
    }

    /// `σ² = Σ P_mn |x_n − T(y_m)|² / (D Σ P_mn)`; a tenth of the tolerance where rounding makes it zero or less.
    fn update_variance(&mut self, tolerance: f64) {
        let mass: f64 = self.posterior.model_mass.iter().sum();
        if mass <= f64::MIN_POSITIVE {
            return; // all are outliers: nothing to learn from
        }
        let weighted = |w: &[f64], a: &[f64], b: &[f64]| -> f64 {
            w.iter().zip(a).zip(b).map(|((w, a), b)| w * a * b).sum()
        };
        let mut sum = 0.0;
        for d in 0..D {
            let (x, t) = (&self.target[d], &self.moved[d]);
            let cross: f64 = self.posterior.weighted[d]
                .iter()
                .zip(t)
                .map(|(p, t)| p * t)
                .sum();
            sum += weighted(&self.posterior.target_mass, x, x) - 2.0 * cross
                + weighted(&self.posterior.model_mass, t, t);
        }
        // Coordinates of size one are not known better than ε, and 1/σ² must stay finite.
        let least = f64::EPSILON * f64::EPSILON;
        let variance = sum / (mass * D as f64);
        self.sigma2 = if variance > 0.0 {
            variance
        } else {
            0.1 * tolerance
        }
        .max(least);
    }

    /// The model points where the last registration left them.
    pub(super) fn warped(&self) -> Vec<Point<f64, D>> {
        let at = |m: usize| SVector::from_fn(|d, _| self.moved[d][m]);
        (0..self.moved[0].len())
            .map(|m| self.target_frame.leave(at(m)))
            .collect()
    }

    /// The map the last registration found, for any point.
    pub(super) fn warp(&self) -> DriftWarp<D> {
        let mut warp = DriftWarp {
            model: self.model_frame,
            target: self.target_frame,
            linear: self.global.linear,
            offset: self.global.offset,
            centres: Vec::new(),
            weights: Vec::new(),
            beta: 1.0,
        };
        if let (Motion::NonRigid { beta, .. }, false) = (self.motion, self.energy.is_empty()) {
            (warp.linear, warp.offset, warp.beta) = (SMatrix::identity(), SVector::zeros(), beta);
            let coefficients: Vec<_> = (0..self.kernel.rank())
                .map(|k| self.non_rigid.coefficient(k))
                .collect();
            warp.weights = self
                .kernel
                .pivot_weights(&coefficients)
                .into_iter()
                .map(SVector::from)
                .collect();
            let at = |&m: &usize| SVector::from_fn(|d, _| self.model[d][m]);
            warp.centres = self.kernel.pivots.iter().map(at).collect();
        }
        warp
    }
}
