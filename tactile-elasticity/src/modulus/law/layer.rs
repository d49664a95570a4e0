//! A sphere on a layer with a rigid base.

use super::{ContactLaw, LogForce, Sphere};
use crate::contact::{Bond, LayerContact, LayerEquation, LayerKernel, LayerSeries, LayerTable};
use crate::error::{ElasticityError, Quantity, positive};
use crate::modulus::EstimatorKind;

/// Which theory of the layer.
///
/// ```
/// use tactile_elasticity::contact::{Bond, HertzContact};
/// use tactile_elasticity::modulus::{BondedLayer, Estimate, LayerTheory, LoadSeries, LoadState, ModulusEstimator};
///
/// // √(Rδ)/h = 0.75: the published series is 15 % low in force, so its modulus is that much too high.
/// let delta = (0.75_f64 * 2e-3).powi(2) / 5e-3;
/// let load = LoadSeries::new([LoadState {
///     indentation_m: Some(Estimate::new(delta, 1e-8)),
///     ..LoadState::new(Estimate::new(1e-2, 1e-5))
/// }]);
/// let modulus = |theory| {
///     BondedLayer::new(5e-3, 2e-3, 0.5, Bond::Bonded, theory)?.estimate(&load).map(|m| m.youngs_modulus_pa)
/// };
/// let ratio = modulus(LayerTheory::PublishedSeries)? / modulus(LayerTheory::IntegralEquation)?;
/// assert!((ratio - 1.0 / 0.85).abs() < 0.02);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum LayerTheory {
    /// The series in χ as published in 2002: wrong beyond its linear term, kept for comparison.
    PublishedSeries,
    /// The true solution's series: χ up to 0.5.
    CorrectedSeries,
    /// The true solution, a/h up to 20.
    #[default]
    IntegralEquation,
}

/// The layer is the sample and the sphere presses it.
#[derive(Debug, Clone, PartialEq)]
pub struct LayerLaw {
    sphere: Sphere,
    radius_m: f64,
    thickness_m: f64,
    bond: Bond,
    theory: LayerTheory,
    series: LayerSeries,
    kernel: LayerKernel,
    table: Option<LayerTable>,
}

impl LayerLaw {
    pub(crate) fn new(
        radius_m: f64,
        thickness_m: f64,
        poisson_ratio: f64,
        bond: Bond,
        theory: LayerTheory,
    ) -> Result<Self, ElasticityError> {
        let radius_m = positive(radius_m, Quantity::Radius)?;
        let thickness_m = positive(thickness_m, Quantity::Thickness)?;
        let kernel = LayerKernel::new(bond, poisson_ratio)?;
        let series = match theory {
            LayerTheory::PublishedSeries => LayerSeries::published(bond, poisson_ratio)?,
            _ => LayerSeries::of_kernel(&kernel, 1.0),
        };
        Ok(Self {
            sphere: Sphere::new(radius_m)?,
            radius_m,
            thickness_m,
            bond,
            theory,
            series,
            kernel,
            table: None,
        })
    }

    /// With the solution tabulated, for many evaluations against a rigid sphere.
    pub(crate) fn tabulated(mut self) -> Self {
        if self.theory == LayerTheory::IntegralEquation {
            self.table = Some(LayerTable::new(&LayerEquation::of_kernel(&self.kernel)));
        }
        self
    }

    fn chi(&self, d: f64) -> f64 {
        (self.radius_m * d).sqrt() / self.thickness_m
    }

    /// ln(F/F_Hertz) at χ and its slope in ln χ.
    fn correction(&self, chi: f64, share: f64) -> Option<(f64, f64)> {
        match (self.theory, &self.table) {
            (LayerTheory::IntegralEquation, Some(table)) if share == 0.0 => table.of_chi(chi),
            (LayerTheory::IntegralEquation, _) => at_chi(
                &LayerEquation::of_kernel(&self.kernel).with_share(1.0 - share),
                chi,
            ),
            (LayerTheory::CorrectedSeries, _) if share > 0.0 => {
                let series = LayerSeries::of_kernel(&self.kernel, 1.0 - share);
                Some((series.force_ratio(chi).ln(), series.log_slope(chi)))
            }
            _ => Some((
                self.series.force_ratio(chi).ln(),
                self.series.log_slope(chi),
            )),
        }
        .filter(|c| c.0.is_finite())
    }
}

impl ContactLaw for LayerLaw {
    fn kind(&self) -> EstimatorKind {
        match self.theory {
            LayerTheory::PublishedSeries => EstimatorKind::LayerPublishedSeries,
            LayerTheory::CorrectedSeries => EstimatorKind::LayerCorrectedSeries,
            LayerTheory::IntegralEquation if self.bond == Bond::Free => {
                EstimatorKind::FreeLayerIntegralEquation
            }
            LayerTheory::IntegralEquation => EstimatorKind::LayerIntegralEquation,
        }
    }

    fn of_contact_radius(&self, a: f64, share: f64) -> Option<LogForce> {
        if self.theory != LayerTheory::IntegralEquation {
            return None;
        }
        let equation = LayerEquation::of_kernel(&self.kernel).with_share(1.0 - share);
        of_radius(&self.sphere, &equation, a, self.thickness_m)
    }

    fn of_indentation(&self, d: f64, share: f64) -> Option<LogForce> {
        let hertz = self.sphere.of_indentation(d, share)?;
        let (value, slope) = self.correction(self.chi(d), share)?;
        Some(corrected(hertz, value, 0.5 * slope, 0.5 * slope))
    }

    fn contact_ratio(&self, contact_radius: Option<f64>, indentation: Option<f64>) -> Option<f64> {
        self.sphere.contact_ratio(contact_radius, indentation)
    }

    fn contact_ratio_limit(&self) -> f64 {
        self.sphere.contact_ratio_limit()
    }

    fn layer_ratio(
        &self,
        contact_radius: Option<f64>,
        indentation: Option<f64>,
    ) -> Option<(f64, f64)> {
        // Where each theory has erred by about 1 % in the force.
        let limit = match self.theory {
            LayerTheory::PublishedSeries => 0.2,
            LayerTheory::CorrectedSeries => 0.5,
            LayerTheory::IntegralEquation => return None,
        };
        let ratio = indentation
            .map(|d| self.chi(d))
            .or_else(|| contact_radius.map(|a| a / self.thickness_m))?;
        Some((ratio, limit))
    }

    fn depends_on_share(&self) -> bool {
        self.theory != LayerTheory::PublishedSeries
    }
}

/// Hertz's ln f with a correction and what it adds to the slopes.
fn corrected(hertz: LogForce, value: f64, slope: f64, size_slope: f64) -> LogForce {
    LogForce {
        value: hertz.value + value,
        slope: hertz.slope + slope,
        size_slope: hertz.size_slope + size_slope,
    }
}

fn of_radius(
    sphere: &Sphere,
    equation: &LayerEquation,
    a: f64,
    thickness: f64,
) -> Option<LogForce> {
    const STEP: f64 = 1e-4;
    let at = |x: f64| {
        equation
            .solve(x)
            .ok()
            .map(|c| c.force_ratio_same_radius.ln())
    };
    let ratio = a / thickness;
    let slope = (at(ratio * STEP.exp())? - at(ratio * (-STEP).exp())?) / (2.0 * STEP);
    Some(corrected(
        sphere.of_contact_radius(a, 0.0)?,
        at(ratio)?,
        slope,
        0.0,
    ))
}

/// ln(F/F_Hertz) at χ and its slope in ln χ, by the secant method on ln(a/h).
fn at_chi(equation: &LayerEquation, chi: f64) -> Option<(f64, f64)> {
    const STEP: f64 = 1e-4;
    let at = |log_a: f64| -> Option<LayerContact> { equation.solve(log_a.exp()).ok() };
    let target = chi.ln();
    let mut x = target;
    let mut slope = 1.0;
    let mut contact = at(x.min(2.9))?;
    for _ in 0..40 {
        let gap = contact.chi.ln() - target;
        if gap.abs() < 1e-13 {
            break;
        }
        let next = x - gap / slope;
        let after = at(next)?;
        if next != x {
            slope = ((after.chi / contact.chi).ln() / (next - x)).clamp(0.1, 2.0);
        }
        (x, contact) = (next, after);
    }
    let (high, low) = (at(x + STEP)?, at(x - STEP)?);
    let derivative = (high.force_ratio / low.force_ratio).ln() / (high.chi / low.chi).ln();
    Some((contact.force_ratio.ln(), derivative))
}
