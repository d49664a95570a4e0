//! The spline between the relaxations, and the result at the end.

use super::{MatchMatrix, NeighbourGraph, Neighbourhood, energy};
use crate::frame::Frame;
use crate::{
    MatchReport, Matching, SoftMatches, StopReason, hard, linear_assignment, unmatched_rows,
};
use nalgebra::{Point, SMatrix, SVector};
use tactile_tps::Smoothing;

/// Soft matches below this weight are left out.
const NEGLIGIBLE: f64 = 1e-4;

/// A match under way, both sets centred and of size one.
pub(super) struct Run<const D: usize> {
    model: Vec<Point<f64, D>>,
    pub(super) target: Vec<Point<f64, D>>,
    pub(super) warped: Vec<Point<f64, D>>,
    pub(super) matches: MatchMatrix,
    pub(super) stop: StopReason,
    energy: Vec<f64>,
    frame: Frame<D>,
}

impl<const D: usize> Run<D> {
    pub(super) fn new(
        model: Vec<Point<f64, D>>,
        target: Vec<Point<f64, D>>,
        frame: Frame<D>,
    ) -> Self {
        let matches = MatchMatrix::zeros(model.len(), target.len());
        Self {
            warped: model.clone(),
            model,
            target,
            matches,
            stop: StopReason::IterationLimit,
            energy: Vec::new(),
            frame,
        }
    }

    /// Keeps the energy (14) of the present match matrix.
    pub(super) fn record_energy(&mut self, neighbourhood: Neighbourhood) {
        let [x, y] =
            [&self.warped, &self.target].map(|points| NeighbourGraph::new(points, neighbourhood));
        self.energy.push(energy(&self.matches, &x, &y));
    }

    /// Mean partner of model point `i` and its weight, one less the slack.
    fn partner(&self, i: usize) -> (SVector<f64, D>, f64) {
        let weights = &self.matches.row(i)[..self.target.len()];
        let mass = weights.iter().fold(0.0, |sum, &w| sum + w);
        let sum = self
            .target
            .iter()
            .zip(weights)
            .fold(SVector::zeros(), |sum, (y, &w)| sum + y.coords * w);
        if mass > 0.0 {
            (sum / mass, mass)
        } else {
            (self.warped[i].coords, mass)
        }
    }

    /// Fits the spline to the mean partners, moves the model, and returns the largest step.
    pub(super) fn fit(&mut self, smoothing: Smoothing<f64>) -> f64 {
        let (means, weights): (Vec<_>, Vec<_>) =
            (0..self.model.len()).map(|i| self.partner(i)).unzip();
        let floor: f64 = 1e-6;
        let kept: Vec<usize> = (0..weights.len()).filter(|&i| weights[i] > floor).collect();
        if kept.is_empty() {
            return 0.0;
        }
        let sources: Vec<_> = kept.iter().map(|&i| self.model[i]).collect();
        let images: Vec<_> = kept.iter().map(|&i| Point::from(means[i])).collect();
        let warp = hard::spline(
            &sources,
            &images,
            Some(kept.iter().map(|&i| weights[i]).collect()),
            smoothing,
        );
        let moved: Vec<_> = self.model.iter().map(|p| warp.apply(p)).collect();
        let step = moved
            .iter()
            .zip(&self.warped)
            .fold(0.0_f64, |m, (a, b)| m.max((a - b).norm()));
        self.warped = moved;
        step
    }

    /// Distinct partners of most probability in sum; none where the slack is likelier.
    fn assignment(&self) -> Vec<Option<usize>> {
        let (rows, columns) = (self.model.len(), self.target.len());
        let costs: Vec<f64> = (0..rows)
            .flat_map(|i| self.matches.row(i)[..columns].iter().map(|&p| -p))
            .collect();
        // Probabilities: finite, and as many as there are pairs.
        let mut assignment =
            linear_assignment(&costs, rows, columns).unwrap_or_else(|_| vec![None; rows]);
        for (i, partner) in assignment.iter_mut().enumerate() {
            let slack = self.matches.slack_of_row(i);
            *partner =
                partner.filter(|&j| self.matches[(i, j)] > 0.0 && self.matches[(i, j)] >= slack);
        }
        assignment
    }

    /// The result, in the units of the caller.
    pub(super) fn finish(self, model: &[Point<f64, D>], target: &[Point<f64, D>]) -> Matching<D> {
        let assignment = self.assignment();
        let positions: Vec<Point<f64, D>> = self
            .warped
            .iter()
            .map(|p| self.frame.leave(p.coords))
            .collect();
        // The spline's values determine it: interpolating them gives it back in the units of the caller.
        let warp = hard::spline(model, &positions, None, Smoothing::None);
        let warped: Vec<_> = model.iter().map(|p| warp.apply(p)).collect();
        let mut soft = SoftMatches::default();
        let (mut confidence, mut covariance) = (Vec::new(), Vec::new());
        for (i, partner) in assignment.iter().enumerate() {
            let row = &self.matches.row(i)[..target.len()];
            // Sinkhorn's normalisation ends with the columns: a row may sum to a little more than one.
            let sum = self
                .matches
                .row(i)
                .iter()
                .fold(0.0, |sum, &p| sum + p)
                .max(1.0);
            let kept = row.iter().copied().enumerate().filter(|p| p.1 > NEGLIGIBLE);
            soft.push_row(kept.map(|(j, p)| (j, p / sum)));
            confidence.push(partner.map_or(self.matches.slack_of_row(i), |j| row[j]) / sum);
            covariance.push(spread(target, row));
        }
        let squares = |(i, j): (usize, usize)| (warped[i] - target[j]).norm_squared();
        let pairs = || {
            assignment
                .iter()
                .enumerate()
                .filter_map(|(i, j)| j.map(|j| (i, j)))
        };
        let count: f64 = pairs().count().max(1) as f64;
        let residual = (pairs().map(squares).fold(0.0, |s, r| s + r) / count).sqrt();
        let (unmatched_model, unmatched_target) = unmatched_rows(&assignment, target.len());
        let report = MatchReport {
            stop: self.stop,
            iterations: self.energy.len(),
            starts: 1,
            residual,
            sigma: residual / ((D as f64).sqrt()),
            doubt: None,
        };
        let energy = self.energy;
        Matching {
            warp,
            warped,
            assignment,
            confidence,
            soft,
            unmatched_model,
            unmatched_target,
            displacement_covariance: covariance,
            energy,
            report,
        }
    }
}

/// Covariance of the partners of one model point.
fn spread<const D: usize>(target: &[Point<f64, D>], row: &[f64]) -> SMatrix<f64, D, D> {
    let mass = row.iter().fold(0.0, |sum, &p| sum + p);
    if mass <= 0.0 {
        return SMatrix::zeros();
    }
    let origin = target[0];
    let mean = target
        .iter()
        .zip(row)
        .fold(SVector::zeros(), |sum, (y, &p)| {
            sum + (y - origin) * (p / mass)
        });
    target
        .iter()
        .zip(row)
        .fold(SMatrix::zeros(), |sum, (y, &p)| {
            let step = y - origin - mean;
            sum + step * step.transpose() * (p / mass)
        })
}
