//! How well the surroundings of each point fit: the evidence that its part of the set is not somewhere else.
//!
//! The odds of single pairs presume that the warp has found its place. Where a part of a set lies one point aside, its pairs agree with
//! each other and are wrong together; what tells is that they fit little better than strewn points would. The gain of a surrounding is
//! how much likelier Gaussian noise of its own residuals makes a target than the mean density ρ of the targets,
//!
//! `T = −ln [ρ (2πe s²)^{D/2}]`, `s²` the mean squared residual of the point's neighbours along an axis.

use super::cells::Cells;
use std::f64::consts::{E, TAU};

/// Neighbours a point, for every dimension.
const NEIGHBOURS: usize = 4;
/// Neighbours that the whole set's noise counts for beside a surrounding's own residuals.
const PRESUMED: f64 = 2.0;
/// Probability that a surrounding is in its place: the logistic function of `BASE + WHOLE·min(g, 1) + PART·min(T, 2)` with the gain g of the
/// whole answer. Fitted to bent, cropped, turned and stretched sets with noise and outliers (`--example confidence`, tuning seeds).
const BASE: f64 = 1.8;
const WHOLE: f64 = 6.0;
const PART: f64 = 0.6;
/// Gains beyond these say no more.
const MOST_WHOLE: f64 = 1.0;
const MOST_PART: f64 = 2.0;

/// Shares of right pairs at confidences of the two models before them (odds of single pairs, surroundings): what they leave out, ambiguity of
/// several points at once, makes unlikely pairs less and undecided ones more often right than told. Tenths of the tuning seeds
/// (`--example confidence -- 0 20`, read off before this correction); at higher confidences they are right to two points.
const SHARES: [(f64, f64); 9] = [
    (0.0, 0.0),
    (0.075, 0.035),
    (0.142, 0.085),
    (0.246, 0.223),
    (0.350, 0.399),
    (0.454, 0.521),
    (0.549, 0.581),
    (0.650, 0.687),
    (0.749, 0.749),
];

/// Memory of the surroundings.
#[derive(Clone, Debug, Default)]
pub(crate) struct Locality<const D: usize> {
    cells: Cells<D>,
    near: Vec<(f64, usize)>,
    /// Squared residual of each point that has a partner.
    squares: Vec<f64>,
    paired: Vec<[f64; D]>,
    /// Mean squared residual of every surrounding.
    around: Vec<f64>,
}

impl<const D: usize> Locality<D> {
    /// Multiplies the confidence of every pair by the probability that its surrounding is in its place, and turns the product into the share
    /// of right pairs.
    pub(crate) fn weigh(
        &mut self,
        (warped, targets): (&[[f64; D]], &[[f64; D]]),
        (noise, volume): (f64, f64),
        gain: f64,
        assignment: &[Option<usize>],
        confidence: &mut [f64],
    ) {
        let whole = BASE + WHOLE * gain.min(MOST_WHOLE);
        if gain >= MOST_WHOLE {
            let sure = logistic(whole + PART * MOST_PART);
            let pairs = assignment.iter().zip(confidence);
            pairs
                .filter(|(partner, _)| partner.is_some())
                .for_each(|(_, c)| *c = share_right(*c * sure));
            return;
        }
        let spacing = self.take((warped, targets), volume, assignment);
        let density = targets.len() as f64 / volume;
        let pairs = assignment.iter().zip(warped).zip(confidence);
        for ((_, w), confidence) in pairs.filter(|((partner, _), _)| partner.is_some()) {
            let (count, squares) = self.around(w, spacing);
            let total = squares + PRESUMED * D as f64 * noise;
            let own = total / (D as f64 * (count + PRESUMED));
            let part = -(density * (TAU * E * own).powf(0.5 * D as f64)).ln();
            let sure = logistic(whole + PART * part.min(MOST_PART));
            *confidence = share_right(*confidence * sure);
        }
    }

    /// Mean squared residual of the surrounding that fits worst, over the median of all surroundings.
    pub(crate) fn contrast(
        &mut self,
        (warped, targets): (&[[f64; D]], &[[f64; D]]),
        volume: f64,
        assignment: &[Option<usize>],
    ) -> f64 {
        let spacing = self.take((warped, targets), volume, assignment);
        let mut around = std::mem::take(&mut self.around);
        around.clear();
        for i in 0..self.paired.len() {
            let place = self.paired[i];
            let (count, squares) = self.around(&place, spacing);
            around.push(squares / count.max(1.0));
        }
        let worst = around.iter().copied().fold(0.0, f64::max);
        let middle = around.len() / 2;
        let contrast = if around.is_empty() {
            1.0
        } else {
            let median = *around.select_nth_unstable_by(middle, f64::total_cmp).1;
            if median > 0.0 { worst / median } else { 1.0 }
        };
        self.around = around;
        contrast
    }

    /// Takes the pairs and their residuals; the typical distance of the targets.
    fn take(
        &mut self,
        (warped, targets): (&[[f64; D]], &[[f64; D]]),
        volume: f64,
        assignment: &[Option<usize>],
    ) -> f64 {
        self.squares.clear();
        self.paired.clear();
        for (w, partner) in warped.iter().zip(assignment) {
            let Some(j) = *partner else { continue };
            self.paired.push(*w);
            self.squares
                .push((0..D).map(|k| (targets[j][k] - w[k]).powi(2)).sum());
        }
        let density = targets.len() as f64 / volume;
        let spacing = density.recip().powf(1.0 / D as f64);
        self.cells.build(&self.paired, spacing);
        spacing
    }

    /// The nearest points with partners about `place`: how many, and the sum of their squared residuals.
    fn around(&mut self, place: &[f64; D], spacing: f64) -> (f64, f64) {
        let wanted = NEIGHBOURS * D + 1;
        let mut radius = 1.5 * spacing;
        // Twice as far until there are enough; a point far from all others makes do with fewer.
        for _ in 0..3 {
            self.near.clear();
            let near = &mut self.near;
            self.cells
                .within(place, radius, |row, square| near.push((square, row)));
            self.near
                .sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            self.near.dedup();
            if self.near.len() >= wanted {
                break;
            }
            radius *= 2.0;
        }
        self.near.truncate(wanted);
        let squares = self.near.iter().map(|&(_, row)| self.squares[row]).sum();
        (self.near.len() as f64, squares)
    }
}

fn logistic(x: f64) -> f64 {
    1.0 / (1.0 + (-x).exp())
}

/// The share of right pairs among those of one confidence, linear between [`SHARES`]; the confidence itself above them.
fn share_right(confidence: f64) -> f64 {
    let Some(after) = SHARES.iter().position(|&(c, _)| c > confidence) else {
        return confidence;
    };
    let [(c0, s0), (c1, s1)] = [SHARES[after.max(1) - 1], SHARES[after]];
    s0 + (s1 - s0) * (confidence - c0) / (c1 - c0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A grid whose residuals are 0.05 but for its last two columns, where they are `aside`.
    fn contrast(aside: f64) -> f64 {
        let warped: Vec<[f64; 2]> = (0..100)
            .map(|i| [f64::from(i % 10), f64::from(i / 10)])
            .collect();
        let residual = |w: &[f64; 2]| if w[0] > 7.5 { aside } else { 0.05 };
        let targets: Vec<[f64; 2]> = warped.iter().map(|w| [w[0] + residual(w), w[1]]).collect();
        let assignment: Vec<Option<usize>> = (0..100).map(Some).collect();
        Locality::default().contrast((&warped, &targets), 100.0, &assignment)
    }

    #[test]
    fn shares_are_monotone_and_those_of_sure_pairs_unchanged() {
        let confidences = (0..=1000).map(|k| f64::from(k) / 1000.0);
        let shares: Vec<f64> = confidences.clone().map(share_right).collect();
        assert!(shares.windows(2).all(|pair| pair[0] < pair[1]));
        assert_eq!((shares[0], shares[1000]), (0.0, 1.0));
        for (confidence, share) in confidences.zip(shares) {
            assert!((confidence - share).abs() < 0.08);
            assert!(confidence < 0.749 || share == confidence);
        }
    }

    #[test]
    fn a_part_with_larger_residuals_stands_out() {
        // Equal residuals: but for rounding all surroundings are alike.
        assert!((contrast(0.05) - 1.0).abs() < 1e-6);
        // Four times the squares, in corner surroundings that lie half in the part or more.
        assert!(contrast(0.1) > 2.0);
    }
}
