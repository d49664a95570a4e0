//! Errors over all scenes.

use tactile_inclusion::{Identifiable, Inclusion, InclusionEstimate};

/// Bound of a relative error up to which a parameter counts as determined.
const TELLABLE: f64 = 0.3;

pub(crate) fn parameters(inclusion: &Inclusion) -> [Identifiable; 3] {
    [
        inclusion.diameter_m,
        inclusion.depth_m,
        inclusion.youngs_modulus_pa,
    ]
}

#[derive(Default)]
pub(crate) struct Tally {
    /// |error| relative to the bound of each parameter, if the bound is below 30 %.
    ratios: [Vec<f64>; 3],
    /// Relative errors for wide shallow lumps.
    shallow: [Vec<f64>; 3],
    within: [usize; 3],
    told: [usize; 3],
    shapes: usize,
    shapes_within: usize,
    /// Determined parameters whose interval does not contain the true value, and the largest
    /// deviation in standard errors.
    wrong: usize,
    worst: f64,
    /// Parameters whose bound is above 30 %, and how many of them are not determined.
    open: usize,
    left_open: usize,
    findable: usize,
    findable_found: usize,
    plain: usize,
    false_alarms: usize,
    /// Processor time of searches, and of one solution of the model with its derivatives, from
    /// scratch.
    pub(crate) search_seconds: Vec<f64>,
    pub(crate) model_seconds: Vec<f64>,
}

impl Tally {
    pub(crate) fn add(&mut self, lump: [f64; 4], bounds: [f64; 3], estimate: &InclusionEstimate) {
        if bounds[0] < 0.2 {
            self.findable += 1;
            self.findable_found += usize::from(estimate.found);
        }
        let Some(inclusion) = &estimate.inclusion else {
            self.open += bounds.iter().filter(|bound| **bound > TELLABLE).count();
            self.left_open += bounds.iter().filter(|bound| **bound > TELLABLE).count();
            return;
        };
        for (k, told) in parameters(inclusion).iter().enumerate() {
            let estimated = told.estimate();
            let error = (estimated.value / lump[k]).ln().abs();
            if bounds[k] > TELLABLE {
                self.open += 1;
                self.left_open += usize::from(told.value().is_none());
            } else {
                self.ratios[k].push(error / bounds[k]);
            }
            if lump[0] >= 14e-3 && lump[1] <= 4e-3 {
                self.shallow[k].push(error);
            }
            let [low, high] = estimated.interval;
            self.told[k] += 1;
            self.within[k] += usize::from((low..=high).contains(&lump[k]));
            if told.value().is_some() && !(low..=high).contains(&lump[k]) {
                self.wrong += 1;
                self.worst = self.worst.max(error / estimated.relative_error());
            }
        }
    }

    pub(crate) fn add_shape(&mut self, aspect: f64, [low, high]: [f64; 2]) {
        self.shapes += 1;
        // The interval of a ball may be a single point.
        let within = low * (1.0 - 1e-9)..=high * (1.0 + 1e-9);
        self.shapes_within += usize::from(within.contains(&aspect));
    }

    pub(crate) fn add_plain(&mut self, estimate: &InclusionEstimate) {
        self.plain += 1;
        self.false_alarms += usize::from(estimate.found);
    }

    pub(crate) fn print(&mut self) {
        for (k, name) in ["D", "d", "E1"].into_iter().enumerate() {
            println!(
                "{name:>3}: |error| / bound: median {:.2}, 95th centile {:.2} ({}); 95 % \
                 intervals hold {:.1} % ({}); wide and shallow: median error {:.1} % ({})",
                quantile(&mut self.ratios[k], 0.5),
                quantile(&mut self.ratios[k], 0.95),
                self.ratios[k].len(),
                100.0 * self.within[k] as f64 / self.told[k].max(1) as f64,
                self.told[k],
                100.0 * quantile(&mut self.shallow[k], 0.5),
                self.shallow[k].len(),
            );
        }
        println!(
            "95 % intervals of height over width hold {} of {}; told wrong {} times, at most {:.1} \
             standard errors off",
            self.shapes_within, self.shapes, self.wrong, self.worst
        );
        println!(
            "found {} of {} with a bound on D below 20 %; not told {} of {} with a bound above 30 \
             %; false alarms {} of {}",
            self.findable_found,
            self.findable,
            self.left_open,
            self.open,
            self.false_alarms,
            self.plain
        );
        for (seconds, of) in [
            (&mut self.search_seconds, "a search"),
            (&mut self.model_seconds, "the model with its derivatives"),
        ] {
            let [median, most] = [0.5, 1.0].map(|part| quantile(seconds, part));
            println!("{of}: {median:.2} s, at most {most:.2} s");
        }
    }
}

fn quantile(values: &mut [f64], part: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let at = (part * (values.len().max(1) - 1) as f64).round() as usize;
    values.get(at).copied().unwrap_or(f64::NAN)
}
