//! What the fits under one assumption about the face say.

use super::covariance::Observed;
use super::estimate::{
    Estimated, Inclusion, InclusionEstimate, InclusionWarning, TWO_SIDED_95, Told,
};
use super::fit::{Fit, Problem};
use super::parameters::Coordinate;
use super::score::Score;
use crate::fem::Interface;

/// Least fall of χ² for an inclusion to count as found.
const LEAST_FALL: f64 = 20.0;
/// Least probability for that.
const LEAST_PROBABILITY: f64 = 0.99;
/// Fall of the objective without which an inclusion is not that probable, 2 ln(p / (1 − p)): the parameters it adds are
/// known better afterwards than before, which lowers the evidence further.
pub(super) const LEAST_GAIN: f64 = 9.2;
/// Least contrast either way, E₁/E₀ or E₀/E₁: an inclusion nearer to the tissue explains no more than what
/// its mesh differs by from a plain block's (a contrast of 1.02 to 1.04 in plain blocks by CalculiX).
const LEAST_CONTRAST: f64 = 1.2;
/// Standard deviations by which χ² may exceed its mean: above, 1 chance in 1000, a fit counts as poor.
const POOR: f64 = 3.1;

/// Whether a fit leaves more than the errors explain.
pub(super) fn is_poor(misfit: f64, observed: &Observed) -> bool {
    let freedom = observed.values.len() as f64;
    misfit > freedom + POOR * (2.0 * freedom).sqrt()
}

/// ln E₀, zero, ln H and ν, the first of the coordinates.
pub(super) const BLOCK_COORDINATES: usize = 4;
/// The coordinates after them.
const LUMP: [Coordinate; 3] = [
    Coordinate::Diameter,
    Coordinate::Depth,
    Coordinate::LumpModulus,
];

/// The best fits under one assumption about the face.
pub(super) struct Hypothesis {
    pub(super) problem: Problem,
    pub(super) interface: Interface,
    pub(super) plain: Fit,
    /// What inclusions promise, where none was fitted.
    pub(super) score: Option<Score>,
    pub(super) lump: Option<Fit>,
}

impl Hypothesis {
    pub(super) fn evidence(&self) -> f64 {
        let lump = self
            .lump
            .as_ref()
            .map_or(f64::NEG_INFINITY, |fit| fit.evidence);
        self.plain.evidence.max(lump)
    }

    /// Log evidence with an inclusion: that of the grid where none was fitted.
    fn evidence_with(&self) -> f64 {
        match (&self.lump, &self.score) {
            (Some(fit), _) => fit.evidence,
            (None, Some(score)) => self.plain.evidence + score.log_odds,
            (None, None) => f64::NEG_INFINITY,
        }
    }

    /// Logarithm of the odds that there is an inclusion, whichever way the face touches.
    fn log_odds(&self, rival: Option<&Self>) -> f64 {
        let both = || [self].into_iter().chain(rival);
        let with = both().map(Self::evidence_with);
        let without = both().map(|one| one.plain.evidence);
        with.fold(f64::NEG_INFINITY, f64::max) - without.fold(f64::NEG_INFINITY, f64::max)
    }

    /// The fit with an inclusion, where it counts as found at these odds.
    fn found(&self, log_odds: f64) -> Option<&Fit> {
        self.lump.as_ref().filter(|fit| {
            let modulus = |coordinate| fit.parameters.get(coordinate);
            let contrast = modulus(Coordinate::LumpModulus) - modulus(Coordinate::BlockModulus);
            probability(log_odds) > LEAST_PROBABILITY
                && self.plain.misfit - fit.misfit > LEAST_FALL
                && contrast.abs() > LEAST_CONTRAST.ln()
        })
    }

    /// Interval of a coordinate's logarithm by the standard error, widened by a factor.
    fn interval(fit: &Fit, index: usize, coordinate: Coordinate, widened: f64) -> [f64; 2] {
        let reach = TWO_SIDED_95 * widened * fit.covariance[(index, index)].sqrt();
        let at = fit.parameters.get(coordinate);
        [at - reach, at + reach]
    }

    /// Ends of the 95 % intervals of ln D, ln d and ln E₁, errors widened by a factor.
    fn intervals(&self, fit: &Fit, widened: f64) -> [[f64; 2]; 3] {
        let profile = self.problem.profile(fit);
        core::array::from_fn(|k| {
            let index = BLOCK_COORDINATES + k;
            let Some(profile) = &profile else {
                return Self::interval(fit, index, LUMP[k], widened);
            };
            let [down, up] = profile.reach(index, TWO_SIDED_95 * widened);
            let at = fit.parameters.get(LUMP[k]);
            [at - down, at + up]
        })
    }

    /// The answer; `rival` explains the frames about as well, `is_unsolved` that one could not be solved which may have.
    pub(super) fn estimate(
        self,
        observed: &Observed,
        rival: Option<&Self>,
        is_unsolved: bool,
    ) -> InclusionEstimate {
        let log_odds = self.log_odds(rival);
        let found = self.found(log_odds);
        let chosen = found.unwrap_or(&self.plain);
        let misfit = chosen.misfit / observed.values.len() as f64;
        let is_poor = is_poor(chosen.misfit, observed);
        let widened = if is_poor { misfit.sqrt() } else { 1.0 };
        let mut warnings = Vec::new();
        if is_poor {
            warnings.push(InclusionWarning::PoorFit { excess: misfit });
        }
        if observed.frames == 1 {
            warnings.push(InclusionWarning::OneFrame);
        }
        if !chosen.converged {
            warnings.push(InclusionWarning::NotConverged);
        }
        if rival.is_some() || is_unsolved {
            warnings.push(InclusionWarning::UncertainInterface);
        }
        let is_at_boundary = chosen.parameters.is_at_boundary();
        if is_at_boundary {
            warnings.push(InclusionWarning::AtBoundary);
        }
        let is_reliable = chosen.converged && !is_poor && !is_unsolved && !is_at_boundary;
        let inclusion = found.map(|fit| {
            let mut intervals = self.intervals(fit, widened);
            if let Some((rival, fit)) = rival.and_then(|rival| Some((rival, rival.lump.as_ref()?)))
            {
                let others = rival.intervals(fit, widened);
                intervals = core::array::from_fn(|k| hull(intervals[k], others[k]));
            }
            let told = |k: usize| {
                let at = fit.parameters.get(LUMP[k]);
                Told::new(Estimated::within(at, intervals[k]), is_reliable)
            };
            Inclusion {
                diameter_m: told(0),
                depth_m: told(1),
                youngs_modulus_pa: told(2),
                correlation: correlation(fit),
            }
        });
        let modulus = |fit| Self::interval(fit, 0, Coordinate::BlockModulus, widened);
        let block = match rival {
            Some(rival) if found.is_some() => hull(
                modulus(chosen),
                modulus(rival.lump.as_ref().unwrap_or(&rival.plain)),
            ),
            Some(rival) => hull(modulus(chosen), modulus(&rival.plain)),
            None => modulus(chosen),
        };
        let rings = observed.radii_m.len();
        let split = |values: &[f64]| -> Vec<Vec<f64>> {
            let pressures = values[..observed.frames * rings].chunks(rings);
            pressures.map(<[f64]>::to_vec).collect()
        };
        InclusionEstimate {
            probability: probability(log_odds),
            found: found.is_some(),
            block_modulus_pa: Estimated::within(
                chosen.parameters.get(Coordinate::BlockModulus),
                block,
            ),
            inclusion,
            interface: self.interface,
            misfit,
            warnings,
            radii_m: observed.radii_m.clone(),
            fitted_pa: split(&chosen.predicted),
            plain_pa: split(&self.plain.predicted),
        }
    }
}

fn probability(log_odds: f64) -> f64 {
    1.0 / (1.0 + (-log_odds).exp())
}

/// The least interval that holds two.
fn hull(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0].min(b[0]), a[1].max(b[1])]
}

/// Correlations of ln D, ln d and ln E₁.
fn correlation(fit: &Fit) -> [[f64; 3]; 3] {
    let c = &fit.covariance;
    let at = |k: usize| BLOCK_COORDINATES + k;
    core::array::from_fn(|i| {
        core::array::from_fn(|k| {
            let variances = c[(at(i), at(i))] * c[(at(k), at(k))];
            c[(at(i), at(k))] / variances.sqrt()
        })
    })
}
