//! The cumulative-sum chart for a shift of a mean.

/// Standard scores beyond this count as this: one odd frame is no drift.
const CLIP: f64 = 4.0;

/// A two-sided cumulative-sum chart (E. S. Page, Biometrika 41 (1954) 100–115) of standard scores z:
/// S⁺ ← max(0, S⁺ + z − k), S⁻ ← max(0, S⁻ − z − k), alarm at S > h. It is the likelihood-ratio test of a shift by 2k.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Cusum {
    allowance: f64,
    threshold: f64,
    above: f64,
    below: f64,
}

impl Cusum {
    /// A chart for a shift of `shift` standard deviations with one false alarm in `interval` frames on average, where the mean
    /// is known to `mean_error` standard deviations.
    pub(super) fn new(shift: f64, interval: f64, mean_error: f64) -> Self {
        // Half the shift is optimal. Beyond 2 standard deviations one or two frames show it anyway, and the approximation of the
        // threshold holds no more.
        let allowance = 0.5 * shift.min(2.0);
        Self {
            allowance,
            threshold: threshold((allowance - mean_error).max(0.1 * allowance), interval),
            above: 0.0,
            below: 0.0,
        }
    }

    /// Takes the next score; whether the chart is in alarm. It stays so until the scores return.
    pub(super) fn update(&mut self, score: f64) -> bool {
        let score = score.clamp(-CLIP, CLIP);
        // What a return needs is bounded, so that a long alarm ends when its cause does.
        let most = self.threshold + CLIP;
        self.above = (self.above + score - self.allowance).clamp(0.0, most);
        self.below = (self.below - score - self.allowance).clamp(0.0, most);
        self.above.max(self.below) > self.threshold
    }

    /// Mean number of frames until a shift of `shift` standard deviations is found.
    pub(super) fn delay(&self, shift: f64) -> f64 {
        let drift = shift.min(CLIP) - self.allowance;
        if drift <= 0.0 {
            return f64::INFINITY;
        }
        run_length(drift, self.threshold).max(1.0)
    }
}

/// Siegmund's approximation of the mean run length of a one-sided chart whose sums drift by Δ a frame (D. Siegmund, *Sequential
/// Analysis*, 1985, section 2.6): (e^(−2Δb) + 2Δb − 1)/(2Δ²) with b = h + 1.166.
fn run_length(drift: f64, threshold: f64) -> f64 {
    let b = threshold + 1.166;
    let twice = 2.0 * drift * b;
    ((-twice).exp() + twice - 1.0) / (2.0 * drift * drift)
}

/// The h for which both sides together give one false alarm in `interval` frames: each side in twice as many.
fn threshold(allowance: f64, interval: f64) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    while run_length(-allowance, high) < 2.0 * interval {
        high *= 2.0;
    }
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if run_length(-allowance, middle) < 2.0 * interval {
            low = middle;
        } else {
            high = middle;
        }
    }
    high
}

#[cfg(test)]
mod tests {
    use rand::{SeedableRng, rngs::ChaCha8Rng};
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    /// Mean number of frames between alarms, each followed by a fresh chart.
    fn simulated_interval(shift: f64, interval: f64, frames: usize) -> f64 {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let fresh = Cusum::new(shift, interval, 0.0);
        let (mut chart, mut alarms) = (fresh, 0);
        for _ in 0..frames {
            if chart.update(StandardNormal.sample(&mut rng)) {
                alarms += 1;
                chart = fresh;
            }
        }
        frames as f64 / f64::from(alarms)
    }

    #[test]
    fn false_alarms_come_as_seldom_as_asked() {
        for shift in [0.5, 1.0, 2.0, 20.0] {
            let interval = 2000.0;
            let found = simulated_interval(shift, interval, 2_000_000);
            // Siegmund's approximation is good to some 10 %; 1000 alarms are known to 3 %.
            assert!(
                (0.85..1.35).contains(&(found / interval)),
                "shift {shift}: {found}"
            );
        }
    }

    #[test]
    fn shifts_are_found_after_the_stated_delay() {
        let mut rng = ChaCha8Rng::seed_from_u64(9);
        for shift in [0.7, 1.0, 2.0] {
            let fresh = Cusum::new(shift, 1e5, 0.0);
            let mut total = 0;
            for _ in 0..2000 {
                let mut chart = fresh;
                loop {
                    total += 1;
                    let z: f64 = StandardNormal.sample(&mut rng);
                    if chart.update(z + shift) {
                        break;
                    }
                }
            }
            let found = f64::from(total) / 2000.0;
            assert!(
                (found / fresh.delay(shift) - 1.0).abs() < 0.1,
                "shift {shift}: {found} {}",
                fresh.delay(shift)
            );
        }
    }
}
