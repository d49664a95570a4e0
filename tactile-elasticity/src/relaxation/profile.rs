//! The likelihood as a function of the time constant, and the intervals that it gives.

use super::StandardLinearSolid;
use super::fit::{Form, Line, Series};
use crate::golden_section::golden_section;
use tactile_core::{Interval, statistics::quantile_95};

/// Time constants tried, from a tenth of the shortest interval to ten times the whole, in logarithmic steps.
const STEPS: usize = 200;

/// χ² as a function of the time constant alone, the other parameters fitted.
pub(super) struct Profile<'a> {
    series: &'a Series,
    shortest_s: f64,
    longest_s: f64,
}

impl<'a> Profile<'a> {
    pub(super) fn new(series: &'a Series) -> Self {
        let times = &series.times_s;
        let steps = times.windows(2).map(|pair| pair[1] - pair[0]);
        let first = times[0];
        let shortest = (steps.chain([first])).filter(|step| *step > 0.0);
        Self {
            series,
            shortest_s: 0.1 * shortest.fold(f64::INFINITY, f64::min),
            longest_s: 10.0 * times[times.len() - 1],
        }
    }

    fn at(&self, log_time: f64) -> Option<Line> {
        self.series.solid(log_time.exp())
    }

    fn chi_squared(&self, log_time: f64) -> f64 {
        self.at(log_time)
            .map_or(f64::INFINITY, |line| line.chi_squared)
    }

    /// The best time constant, and the parameters there: the least of the steps, refined by golden sections.
    pub(super) fn best(&self) -> Option<(f64, Line)> {
        let (low, high) = (self.shortest_s.ln(), self.longest_s.ln());
        let step = (high - low) / STEPS as f64;
        let on_grid = |k: usize| low + k as f64 * step;
        let least = (0..=STEPS)
            .map(on_grid)
            .min_by(|x, y| self.chi_squared(*x).total_cmp(&self.chi_squared(*y)))?;
        // Each section leaves 0.62 of the last: 40 leave 1e-8 of a step.
        let middle = golden_section((least - step).max(low), (least + step).min(high), 40, |x| {
            self.chi_squared(x)
        });
        let refined = match self.chi_squared(middle) < self.chi_squared(least) {
            true => middle,
            false => least,
        };
        Some((refined.exp(), self.at(refined)?))
    }

    /// Where χ² has risen by `room` on one side of the best; None where it does not before the last time constant tried.
    fn limit(&self, best: f64, end: f64, allowed: f64) -> Option<f64> {
        let step = (end - best) / STEPS as f64;
        let outside = (1..=STEPS)
            .map(|k| best + k as f64 * step)
            .find(|x| self.chi_squared(*x) > allowed)?;
        let (mut inside, mut outside) = (outside - step, outside);
        // Bisection to a millionth of a step.
        for _ in 0..20 {
            let middle = 0.5 * (inside + outside);
            match self.chi_squared(middle) > allowed {
                true => outside = middle,
                false => inside = middle,
            }
        }
        Some(inside)
    }

    /// The solid with its intervals; None where the longest time constant tried still fits.
    ///
    /// At a fixed τ the fit is linear, so that a combination q of its parameters may lie within √(Δ − χ²(τ) + χ²_min) of its
    /// standard errors: the interval of q is the union over all τ within theirs.
    pub(super) fn solid(
        &self,
        excess: f64,
        count: f64,
        scale_error: f64,
    ) -> Option<StandardLinearSolid> {
        let (time_constant_s, best) = self.best()?;
        let learnt = (excess > 1.0).then_some(count - 3.0);
        let room = excess * quantile_95(learnt).powi(2);
        let allowed = best.chi_squared + room;
        let centre = time_constant_s.ln();
        let upper = self.limit(centre, self.longest_s.ln(), allowed)?;
        let lower = self.limit(centre, self.shortest_s.ln(), allowed);
        let from = lower.unwrap_or(self.shortest_s.ln());
        let mut fresh = Range::default();
        let mut settled = Range::default();
        let mut relaxation = Range::default();
        for k in 0..=STEPS {
            let log_time = from + (upper - from) * k as f64 / STEPS as f64;
            let Some(line) = self.at(log_time) else {
                continue;
            };
            let reach = (allowed - line.chi_squared).max(0.0).sqrt();
            fresh.include(line.combination(1.0, 1.0), reach);
            settled.include(line.combination(1.0, 0.0), reach);
            relaxation.include(self.relaxation_time(log_time.exp(), &line), reach);
        }
        let (first, last) = (best.a + best.b, best.a);
        let widened = |value: f64, range: Range| {
            let common = quantile_95(None) * scale_error;
            let factor = |limit: f64| (limit / value).ln().abs().hypot(common).exp();
            Interval::new(
                value / factor(range.lower.max(0.0)),
                Some(value * factor(range.upper)).filter(|limit| limit.is_finite()),
            )
        };
        let ([instantaneous_pa, equilibrium_pa], [instantaneous, equilibrium]) =
            match self.series.form {
                Form::Relaxation => ([first, last], [fresh, settled]),
                Form::Creep => (
                    [1.0 / first, 1.0 / last],
                    [fresh.inverse(), settled.inverse()],
                ),
            };
        let (time_constant, _) = self.relaxation_time(time_constant_s, &best);
        Some(StandardLinearSolid {
            instantaneous_pa,
            instantaneous_95_pa: widened(instantaneous_pa, instantaneous),
            equilibrium_pa,
            equilibrium_95_pa: widened(equilibrium_pa, equilibrium),
            time_constant_s: time_constant,
            time_constant_95_s: Interval::new(
                lower.map_or(0.0, |_| relaxation.lower.max(0.0)),
                Some(relaxation.upper),
            ),
        })
    }

    /// The time constant of relaxation with its standard error at a fixed time constant of the fit: the same, or of creep that times E∞/E₀.
    fn relaxation_time(&self, time_constant_s: f64, line: &Line) -> (f64, f64) {
        match self.series.form {
            Form::Relaxation => (time_constant_s, 0.0),
            Form::Creep => {
                let ratio = 1.0 + line.b / line.a;
                let (_, error) = line.combination(-line.b / (line.a * line.a), 1.0 / line.a);
                (time_constant_s * ratio, time_constant_s * error)
            }
        }
    }
}

/// The union of intervals.
#[derive(Clone, Copy, Debug)]
struct Range {
    lower: f64,
    upper: f64,
}

impl Default for Range {
    fn default() -> Self {
        Self {
            lower: f64::INFINITY,
            upper: f64::NEG_INFINITY,
        }
    }
}

impl Range {
    fn include(&mut self, (value, error): (f64, f64), reach: f64) {
        self.lower = self.lower.min(value - reach * error);
        self.upper = self.upper.max(value + reach * error);
    }

    /// The interval of one over what is positive.
    fn inverse(self) -> Self {
        let below = |limit: f64| {
            if limit > 0.0 {
                1.0 / limit
            } else {
                f64::INFINITY
            }
        };
        Self {
            lower: 1.0 / self.upper,
            upper: below(self.lower),
        }
    }
}
