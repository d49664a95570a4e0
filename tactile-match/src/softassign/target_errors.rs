//! Errors of the targets: how precisely each of them was measured.
//!
//! A target j with the standard deviation `sⱼ` lies about the warped point of its partner with the variance `σ² + eⱼ`, `eⱼ = sⱼ² − min s²`: the
//! annealed variance σ² is common to all targets, and what it comes to is what the most precise ones leave. With the relative precision
//! `ρⱼ = σ²/(σ² + eⱼ)` the affinities are `ρⱼ^{d/2} exp(−ρⱼ |yᵢ − tⱼ|²/2σ²)`, the regression's weights are `wᵢ = Σⱼ mᵢⱼ ρⱼ` and its targets the means under
//! `mᵢⱼ ρⱼ`, and the likelihood of the noise is largest at `σ² = Σ mᵢⱼ ρⱼ² |yᵢ − tⱼ|² / d Σ mᵢⱼ ρⱼ`, which is iterated along with the matches.

use super::blocks::LANES;
use super::{AnnealedSoftassign, SoftassignMatch, SoftassignWorkspace};
use crate::{MatchError, Matching};
use nalgebra::Point;
use std::ops::ControlFlow;

/// The excess variances of the targets, and what they are at one temperature.
#[derive(Clone, Debug, Default)]
pub(crate) struct TargetErrors {
    /// `eⱼ` of every target row; empty where all are equal.
    excess: Vec<f64>,
    largest: f64,
    /// Standard deviation of the most precise targets; zero where all are equal.
    least: f64,
    /// `ρⱼ` in the order of the blocks, padded with ones.
    pub(crate) precision: Vec<f32>,
    /// `ρⱼ^{d/2}`, sharpened, in the same order.
    pub(crate) height: Vec<f32>,
}

impl TargetErrors {
    /// Takes the standard deviations of the targets, which say nothing where all are equal or there are none.
    pub(crate) fn set(&mut self, deviations: &[f64]) {
        let least = deviations.iter().copied().fold(f64::MAX, f64::min);
        let largest = deviations.iter().copied().fold(0.0, f64::max);
        self.excess.clear();
        self.least = 0.0;
        self.largest = 0.0;
        if largest > least {
            self.least = least;
            self.largest = (largest - least) * (largest + least);
            let excess = deviations.iter().map(|s| (s - least) * (s + least));
            self.excess.extend(excess);
        }
    }

    /// The lowest temperature: the deviation of the most precise targets. Residuals alone say little about it where few targets are precise,
    /// since the warp passes through those.
    pub(crate) fn floor(&self) -> f64 {
        self.least
    }

    /// Whether targets differ in their errors.
    pub(crate) fn differ(&self) -> bool {
        !self.excess.is_empty()
    }

    /// Largest variance of a target at the temperature `variance`.
    pub(crate) fn widest(&self, variance: f64) -> f64 {
        variance + self.largest
    }

    /// Variance of a target over that of the most precise ones, `1/ρⱼ`.
    pub(crate) fn width(&self, row: usize, variance: f64) -> f64 {
        self.excess.get(row).map_or(1.0, |e| 1.0 + e / variance)
    }

    /// Precisions and heights at a temperature, for targets in this order.
    pub(crate) fn prepare(&mut self, order: &[usize], variance: f64, power: f64) {
        self.precision.clear();
        self.height.clear();
        if !self.differ() {
            return;
        }
        for &j in order {
            let precision = self.width(j, variance).recip();
            self.precision.push(precision as f32);
            self.height.push(precision.powf(power) as f32);
        }
        let padded = order.len().next_multiple_of(LANES);
        self.precision.resize(padded, 1.0);
        self.height.resize(padded, 1.0);
    }

    /// Multiplies values in the order of the blocks by the precisions.
    pub(crate) fn weigh(&self, values: &mut [f64]) {
        let weighed = values.iter_mut().zip(&self.precision);
        weighed.for_each(|(value, &precision)| *value *= f64::from(precision));
    }
}

impl AnnealedSoftassign {
    /// As [`match_points`](crate::PointMatcher::match_points), where the targets were measured with different precision: `deviations[j]` is the
    /// standard deviation of target j along an axis, in the units of the points.
    ///
    /// A precise target counts for more than an uncertain one in the soft matches, in the warp and in its covariances: the pair of target j has
    /// the noise variance `σ² + sⱼ² − min s²`. The σ² of the most precise targets is estimated from the residuals, since it also holds what the
    /// warp does not explain, and is at least `min s²` ([`MatchReport::sigma`](crate::MatchReport)). Equal deviations say nothing that the
    /// residuals do not: they give the answer of [`match_points`](crate::PointMatcher::match_points) to the bit. Where they differ, no point
    /// is put onto its partner exactly.
    ///
    /// ```
    /// use nalgebra::{Point2, Vector2};
    /// use tactile_match::{AnnealedSoftassign, MatchError};
    /// let model: Vec<_> = (0..60).map(|i| Point2::new(f64::from(i % 10) + 0.03 * f64::from(i * i % 7), f64::from(i / 10))).collect();
    /// // Every other point was seen in shadow, with an error of about 0.2 instead of 0.002.
    /// let deviations: Vec<f64> = (0..60).map(|i| if i % 2 == 0 { 0.002 } else { 0.2 }).collect();
    /// let truth = |p: &Point2<f64>| Point2::new(1.05 * p.x, p.y + 0.01 * p.x * p.x);
    /// let target: Vec<_> = model.iter().zip(&deviations).enumerate()
    ///     .map(|(i, (p, s))| truth(p) + Vector2::new((2.1 * i as f64).sin(), (3.7 * i as f64).cos()) * 1.4 * *s).collect();
    /// let matcher = AnnealedSoftassign::default();
    /// let found = matcher.match_with_target_errors(&model, &target, &deviations)?;
    /// let rms = |warped: &[Point2<f64>]| {
    ///     let squares = warped.iter().zip(&model).map(|(w, p)| (w - truth(p)).norm_squared());
    ///     (squares.sum::<f64>() / 60.0).sqrt()
    /// };
    /// assert!(rms(&found.warped) < 0.02);
    /// let wrong = matcher.match_with_target_errors(&model, &target, &deviations[1..]);
    /// assert!(matches!(wrong, Err(MatchError::Shape { what: "deviations of the targets", expected: 60, found: 59 })));
    /// # Ok::<(), MatchError>(())
    /// ```
    ///
    /// # Errors
    /// As [`match_points`](crate::PointMatcher::match_points), [`MatchError::Shape`] where there is not one deviation a target, and
    /// [`MatchError::TargetDeviation`] for one that is not positive and finite.
    pub fn match_with_target_errors<const D: usize>(
        &self,
        model: &[Point<f64, D>],
        target: &[Point<f64, D>],
        deviations: &[f64],
    ) -> Result<Matching<D>, MatchError> {
        let mut workspace = SoftassignWorkspace::default();
        workspace.take(model, target)?;
        workspace.take_deviations(deviations)?;
        self.solve(&mut workspace, &mut |_, _| ControlFlow::Continue(()));
        Ok(SoftassignMatch::of(&workspace).to_matching(model))
    }
}

impl<const D: usize> SoftassignWorkspace<D> {
    fn take_deviations(&mut self, deviations: &[f64]) -> Result<(), MatchError> {
        if deviations.len() != self.target.len() {
            return Err(MatchError::Shape {
                what: "deviations of the targets",
                expected: self.target.len(),
                found: deviations.len(),
            });
        }
        let positive = |s: &f64| *s > 0.0 && s.is_finite();
        let widened = deviations.iter().map(|&s| s);
        if let Some(row) = widened.clone().position(|s| !positive(&s)) {
            let value = deviations[row];
            return Err(MatchError::TargetDeviation { row, value });
        }
        let scale = self.frame.scale;
        self.deviations.extend(widened.map(|s| s / scale));
        Ok(())
    }
}
