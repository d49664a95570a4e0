//! What the fits under one assumption about the face say.

use super::covariance::Observed;
use super::estimate::{
    Estimated, Inclusion, InclusionEstimate, InclusionWarning, TWO_SIDED_95, Told,
};
use super::fit::{Fit, Problem};
use super::parameters::Coordinate;
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

/// The best fits under one assumption about the face.
pub(super) struct Hypothesis {
    pub(super) problem: Problem,
    pub(super) interface: Interface,
    pub(super) plain: Fit,
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

    pub(super) fn estimate(self, observed: &Observed, is_uncertain: bool) -> InclusionEstimate {
        let freedom = observed.values.len() as f64;
        let rings = observed.radii_m.len();
        let split = |values: &[f64]| -> Vec<Vec<f64>> {
            let pressures = values[..observed.frames * rings].chunks(rings);
            pressures.map(<[f64]>::to_vec).collect()
        };
        let gain = self
            .lump
            .as_ref()
            .map_or(f64::NEG_INFINITY, |fit| fit.evidence - self.plain.evidence);
        let fall = (self.lump.as_ref()).map_or(0.0, |fit| self.plain.misfit - fit.misfit);
        let probability = 1.0 / (1.0 + (-gain).exp());
        let contrast = (self.lump.as_ref()).map_or(0.0, |fit| {
            let modulus = |coordinate| fit.parameters.get(coordinate);
            (modulus(Coordinate::LumpModulus) - modulus(Coordinate::BlockModulus)).abs()
        });
        let found =
            probability > LEAST_PROBABILITY && fall > LEAST_FALL && contrast > LEAST_CONTRAST.ln();
        let chosen = match &self.lump {
            Some(lump) if found => lump,
            _ => &self.plain,
        };
        let misfit = chosen.misfit / freedom;
        let is_poor = misfit > 1.0 + POOR * (2.0 / freedom).sqrt();
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
        if is_uncertain {
            warnings.push(InclusionWarning::UncertainInterface);
        }
        if chosen.parameters.is_at_boundary() {
            warnings.push(InclusionWarning::AtBoundary);
        }
        let is_reliable =
            chosen.converged && !is_poor && !is_uncertain && !chosen.parameters.is_at_boundary();
        let error = |index: usize| widened * chosen.covariance[(index, index)].sqrt();
        let logarithm = |coordinate| chosen.parameters.get(coordinate);
        let profile = (found.then(|| self.problem.profile(chosen))).flatten();
        let told = |index, coordinate| {
            let reach = match &profile {
                Some(profile) => profile.reach(index, TWO_SIDED_95 * widened),
                None => [TWO_SIDED_95 * error(index); 2],
            };
            let estimated = Estimated::from_interval(logarithm(coordinate), reach);
            Told::new(estimated, is_reliable)
        };
        let inclusion = found.then(|| Inclusion {
            diameter_m: told(4, Coordinate::Diameter),
            depth_m: told(5, Coordinate::Depth),
            youngs_modulus_pa: told(6, Coordinate::LumpModulus),
            correlation: core::array::from_fn(|i| {
                core::array::from_fn(|k| {
                    let c = &chosen.covariance;
                    c[(4 + i, 4 + k)] / (c[(4 + i, 4 + i)] * c[(4 + k, 4 + k)]).sqrt()
                })
            }),
        });
        InclusionEstimate {
            probability,
            found,
            block_modulus_pa: Estimated::from_logarithm(
                logarithm(Coordinate::BlockModulus),
                error(0),
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
