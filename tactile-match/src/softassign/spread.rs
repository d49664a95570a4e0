//! Signs that a part of a set lies one point aside: residuals that the noise of the others does not explain, and soft partners that spread
//! farther than noise makes them.

use super::anneal::Annealer;
use super::schedule::Slack;

/// Squared residuals beyond so many variances are not the noise's: one in a thousand Gaussian ones is, in the plane and in space.
const TAIL: f64 = 16.0;
/// The spread that noise explains is that of targets which twice its variance hides.
const HIDDEN: f64 = 2.0;
/// Sinkhorn sweeps of the targets with themselves.
const SWEEPS: usize = 5;

impl<const D: usize> Annealer<D> {
    /// Share of the matched points of the last step whose distance from the leave-one-out prediction is larger than `least` and than
    /// Gaussian noise explains, whose variance the median of all squared distances gives. Where a part of a set lies one point aside, its
    /// points have such residuals, though the root mean square of all is small.
    pub(crate) fn tail(&mut self, least: f64) -> f64 {
        self.sums.clear();
        let moments = &self.soft.moments;
        let spread = &moments.by_precision().spread;
        let rows = moments.plain().weight.iter().zip(spread);
        let matched = rows.filter(|&(&weight, _)| weight > 0.5);
        self.sums
            .extend(matched.map(|(weight, spread)| spread / weight));
        if self.sums.is_empty() {
            return 0.0;
        }
        let middle = self.sums.len() / 2;
        let median = *self.sums.select_nth_unstable_by(middle, f64::total_cmp).1;
        let limit = (TAIL * median / median_of_chi_squared(D)).max(least * least);
        let beyond = self.sums.iter().filter(|&&square| square > limit);
        beyond.count() as f64 / self.sums.len() as f64
    }

    /// How far soft partners spread, relative to the temperature as in [`State::ambiguity`](super::schedule::State::ambiguity), where every
    /// target is the partner of a point in its very place, seen through noise of twice this variance: of 120 noisy scenes that were matched
    /// right none spread as far, of four with a part aside three did (`--example peer_cases`). Leaves the soft matches of the targets behind.
    pub(crate) fn spread_of(&mut self, targets: &[[f64; D]], variance: f64, slack: Slack) -> f64 {
        self.assign(targets, HIDDEN * variance, slack, SWEEPS, 1.0);
        let moments = self.soft.moments.by_squared_precision();
        let rows = moments.weight.iter().zip(&moments.shift);
        let within = rows.zip(&moments.spread).map(|((weight, shift), spread)| {
            spread - weight * shift.iter().map(|s| s * s).sum::<f64>()
        });
        let total: f64 = moments.weight.iter().sum();
        within.sum::<f64>() / (D as f64 * total.max(1e-9) * variance)
    }
}

/// Median of the sum of `dimension` squared standard normal deviates, by the approximation of Wilson and Hilferty (to 1 % from 2 on).
fn median_of_chi_squared(dimension: usize) -> f64 {
    let n = dimension as f64;
    n * (1.0 - 2.0 / (9.0 * n)).powi(3)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Spread on a square grid of spacing 1 under noise of this standard deviation.
    fn spread(sigma: f64) -> f64 {
        let targets: Vec<[f64; 2]> = (0..144)
            .map(|i| [f64::from(i % 12), f64::from(i / 12)])
            .collect();
        let mut annealer = Annealer::default();
        annealer.soft.set_targets(&targets, &[]);
        annealer.volume = 144.0;
        let slack = Slack {
            share: 1e-6,
            model: 1.0,
            target: 1.0,
        };
        annealer.spread_of(&targets, sigma * sigma, slack)
    }

    /// Against the two nearest terms: a target keeps `1/(1 + 4q)` of its weight, its four neighbours share the rest, `q = exp(−1/4σ²)`, so that
    /// the spread is `4q/(1 + 4q)/2σ²`.
    #[test]
    fn the_spread_is_that_of_the_nearest_neighbours() {
        for sigma in [0.15, 0.2, 0.25] {
            let q = (-0.25_f64 / (sigma * sigma)).exp();
            let expected = 4.0 * q / (1.0 + 4.0 * q) / (2.0 * sigma * sigma);
            // An eleventh of the neighbours is beyond the edge; those across a diagonal have q² each.
            let found = spread(sigma);
            assert!(
                found < 1.05 * expected && found > 0.85 * expected,
                "{sigma}: {found} {expected}"
            );
        }
    }

    #[test]
    fn what_noise_hides_altogether_spreads_as_far_as_the_noise() {
        // Of a Gaussian of twice the variance over many targets the spread is two.
        let found = spread(1.0);
        assert!((1.6..2.1).contains(&found), "{found}");
    }
}
