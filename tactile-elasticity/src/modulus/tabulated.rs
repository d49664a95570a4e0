//! Young's modulus of a ball from a table of its contacts.

use super::bodies::Bodies;
use super::contact_fit::large_contacts;
use super::estimate::{LoadDiagnostics, ModulusEstimate, ModulusEstimator};
use super::kind::EstimatorKind;
use super::load::{LoadSeries, LoadState, validated};
use super::statistics::{CommonMean, Covariance, common_mean};
use crate::contact::{ContactTable, TabulatedForce, Waveguide};
use crate::error::{ElasticityError, Quantity};
use std::sync::Arc;
use tactile_core::{Interval, Source, Uncertain, statistics::quantile_95};

/// A soft ball on the guide, or the rigid flat, of a [`ContactTable`]. The modulus E is fitted so
/// that the tabulated forces at the measured contact radii agree best with the measured forces, for
/// all loads together.
///
/// ln F(aᵢ, E) = ln Fᵢ is solved for ln E by generalised least squares (Gauss–Newton). The
/// covariance contains the errors of forces and radii, the errors common to all loads, and the
/// error of the table. The interval follows the table, and has no upper end if it leaves the table.
/// Loads outside the table are skipped with a warning. O(n) in the loads; two loads take several
/// microseconds.
///
/// ```
/// use tactile_elasticity::contact::{ContactCurve, ContactTable, Waveguide};
/// use tactile_elasticity::modulus::{
///     Estimate, LoadSeries, LoadState, ModulusEstimator, TabulatedContact,
/// };
///
/// let contact_radius_m: Vec<f64> = (1..=10).map(|k| 0.1e-3 * f64::from(k)).collect();
/// let force_n = contact_radius_m
///     .iter()
///     .map(|a| 4.0 / 3.0 * 80e3 * a.powi(3) / 3e-3)
///     .collect();
/// let curve = ContactCurve {
///     youngs_modulus_pa: 60e3,
///     contact_radius_m,
///     force_n,
/// };
/// let flat = Waveguide::rigid();
/// let table = ContactTable::new(3e-3, 0.5, &flat, vec![curve])?;
///
/// let load = LoadState::new(Estimate::new(5e-3, 1e-5)).with_radius(Estimate::new(0.5e-3, 1e-6));
/// let estimate = TabulatedContact::new(table.clone(), 3e-3, 0.5, &flat)?
///     .estimate(&LoadSeries::new([load]))?;
/// let relative_error: f64 = estimate.youngs_modulus_pa / 67.5e3 - 1.0;
/// assert!(relative_error.abs() < 1e-9);
/// // A ball other than that of the table.
/// assert!(TabulatedContact::new(table, 4e-3, 0.5, &flat).is_err());
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct TabulatedContact {
    table: Arc<ContactTable>,
}

// Standard error of ln F from the finite elements, in addition to that of the interpolation: meshes
// with twice as many elements change F by this (`a_finer_mesh_moves_the_table_little`).
const ELEMENT_ERROR: f64 = 3e-3;

// Minimum sensitivity of ln F to ln E. Below it the ball is rigid compared with the guide.
const LEAST_SENSITIVITY: f64 = 0.01;

impl TabulatedContact {
    /// Creates the estimator for a ball of radius R (m) and Poisson ratio ν on a guide, which must
    /// be those of the table.
    ///
    /// # Errors
    /// [`ElasticityError::TableMismatch`] for any other ball or guide.
    pub fn new(
        table: impl Into<Arc<ContactTable>>,
        radius_m: f64,
        poisson_ratio: f64,
        guide: &Waveguide,
    ) -> Result<Self, ElasticityError> {
        let table = table.into();
        table.check_made_for(radius_m, poisson_ratio, guide)?;
        Ok(Self { table })
    }

    /// The loads that have a contact radius.
    fn contacts(&self, loads: &[LoadState]) -> Result<Vec<Contact>, ElasticityError> {
        let mut contacts = Vec::with_capacity(loads.len());
        for (load, state) in loads.iter().enumerate() {
            let force = validated(state.force_n, Quantity::Force)?;
            let Some(radius) = state.contact_radius_m else {
                continue;
            };
            let radius = validated(radius, Quantity::ContactRadius)?;
            Quantity::ContactRadius.positive(radius.value)?;
            Quantity::Force.positive(force.value)?;
            contacts.push(Contact {
                load,
                force,
                radius,
            });
        }
        Ok(contacts)
    }

    /// The fit to the loads that the table covers at the resulting modulus.
    fn fit_covered(
        &self,
        mut contacts: Vec<Contact>,
        series: &LoadSeries,
    ) -> Result<(Vec<Contact>, Fit), ElasticityError> {
        loop {
            if contacts.is_empty() {
                return Err(ElasticityError::TooFewLoads {
                    expected: 1,
                    found: 0,
                });
            }
            let fit = self.fit(&contacts, series)?;
            let outside = |c: &&Contact| !self.table.covers(c.radius.value, fit.log_modulus);
            let Some(first) = contacts.iter().find(outside) else {
                return Ok((contacts, fit));
            };
            let [smallest, largest] = self.table.contact_ratios(fit.log_modulus);
            let ratio = first.radius.value / self.table.radius_m();
            let limit = if ratio < smallest { smallest } else { largest };
            let (found, limit) = (first.radius.value, limit * self.table.radius_m());
            contacts.retain(|c| self.table.covers(c.radius.value, fit.log_modulus));
            if contacts.is_empty() {
                return Err(Quantity::ContactRadius.beyond(found, limit));
            }
        }
    }

    /// ln E at which the tabulated forces fit best, starting in the middle of the table.
    fn fit(&self, contacts: &[Contact], series: &LoadSeries) -> Result<Fit, ElasticityError> {
        let [lowest, highest] = self.table.log_moduli();
        let mut log_modulus = if lowest.is_finite() {
            0.5 * (lowest + highest)
        } else {
            0.0
        };
        // Newton's method in one unknown on a nearly straight function takes three or four steps,
        // and ten if it bends.
        const STEPS: usize = 30;
        const SETTLED: f64 = 1e-11;
        for step in 0..STEPS {
            let forces: Vec<TabulatedForce> = (contacts.iter())
                .map(|c| self.table.at(c.radius.value, log_modulus))
                .collect();
            let covariance = self.covariance(contacts, &forces, series);
            // The ln E of each load, along its tangent.
            let own: Vec<f64> = (contacts.iter().zip(&forces))
                .map(|(c, f)| log_modulus + (c.force.value.ln() - f.log_force) / sensitivity(f))
                .collect();
            let mean = common_mean(&own, &covariance)?;
            let next = mean.mean.value.clamp(lowest, highest);
            let moved = (next - log_modulus).abs();
            let at_limit = next != mean.mean.value;
            log_modulus = next;
            if moved < SETTLED || step + 1 == STEPS {
                let sensitivity = (mean.weights.iter().zip(&forces))
                    .map(|(w, f)| w * sensitivity(f))
                    .sum();
                return Ok(Fit {
                    log_modulus,
                    mean,
                    own,
                    sensitivity,
                    above: at_limit && next == highest,
                    below: at_limit && next == lowest,
                });
            }
        }
        unreachable!("the last step returns")
    }

    /// The covariance of the ln E of each load.
    fn covariance(
        &self,
        contacts: &[Contact],
        forces: &[TabulatedForce],
        series: &LoadSeries,
    ) -> Covariance {
        let bodies = series.bodies();
        let log = |factor: Uncertain| factor.map(f64::ln, f64::recip);
        let nu = self.table.poisson_ratio();
        let [size, compliance] = match bodies {
            Some(bodies) => {
                let sum: f64 = contacts.iter().map(|c| c.radius.value).sum();
                let guide = bodies.guide_compliance(sum / contacts.len() as f64);
                [bodies.size(), guide].map(log)
            }
            None => [Uncertain::exact(0.0); 2],
        };
        let ratio = bodies.map_or(Uncertain::exact(nu), Bodies::poisson_ratio);
        let lateral = ratio.map(|_| 0.0, |_| -2.0 * nu / (1.0 - nu * nu));
        // F has the dimension E R². The exponent not taken by a belongs to R, and that not taken by
        // E to the moduli of the guide.
        let log_modulus = |(c, f): (&Contact, &TabulatedForce)| {
            let of_force = log(c.force) - log(c.radius) * f.radius_slope;
            let of_bodies = compliance * (1.0 - f.modulus_slope) + lateral * f.modulus_slope
                - size * (2.0 - f.radius_slope);
            (of_force + of_bodies) * sensitivity(f).recip()
        };
        let numbers: Vec<_> = contacts.iter().zip(forces).map(log_modulus).collect();
        // Effect of an error of ln F on ln E.
        let over = |i: usize, of_log_force: f64| of_log_force / sensitivity(&forces[i]);
        let adhesion = |i: usize| bodies.map_or(0.0, |b| b.adhesion(contacts[i].force.value));
        let model = self.table.interpolation_error().hypot(ELEMENT_ERROR);
        Covariance::of(&numbers, contacts.iter().map(|c| c.load))
            .with_model_errors(Source::Adhesion, |i| over(i, adhesion(i)))
            .with_model_errors(Source::Law, |i| over(i, model))
    }

    /// ln E at which the tabulated forces, weighted as in the mean, have changed by `step` in ln F.
    /// `None` outside the moduli of the table.
    fn limit(&self, contacts: &[Contact], fit: &Fit, step: f64) -> Option<f64> {
        let force = |log_modulus: f64| {
            let (mut value, mut slope) = (0.0, 0.0);
            for (c, w) in contacts.iter().zip(&fit.mean.weights) {
                let f = self.table.at(c.radius.value, log_modulus);
                value += w * f.log_force;
                slope += w * sensitivity(&f);
            }
            (value, slope)
        };
        let [lowest, highest] = self.table.log_moduli();
        let target = force(fit.log_modulus).0 + step;
        let mut log_modulus = (fit.log_modulus + step / fit.sensitivity).clamp(lowest, highest);
        for _ in 0..20 {
            let (value, slope) = force(log_modulus);
            let next = log_modulus + (target - value) / slope;
            if (next - log_modulus).abs() < 1e-9 {
                return Some(next);
            }
            // The force increases with E. If the limit requires more, there is no such modulus in
            // the table.
            if next > highest && log_modulus == highest || next < lowest && log_modulus == lowest {
                return None;
            }
            log_modulus = next.clamp(lowest, highest);
        }
        None
    }

    fn diagnose(
        &self,
        loads: &[LoadState],
        contacts: &[Contact],
        fit: &Fit,
    ) -> Vec<LoadDiagnostics> {
        let mut all: Vec<LoadDiagnostics> = (loads.iter())
            .map(|l| LoadDiagnostics {
                contact_ratio: (l.contact_radius_m).map(|a| a.value / self.table.radius_m()),
                ..LoadDiagnostics::default()
            })
            .collect();
        for (k, contact) in contacts.iter().enumerate() {
            let own = &mut all[contact.load];
            own.used = true;
            own.youngs_modulus_pa = Some(fit.own[k].exp());
            own.standardized_residual = Some(fit.mean.standardized_residuals[k]);
        }
        all
    }
}

/// ∂ln F/∂ln E, with a positive lower limit.
fn sensitivity(force: &TabulatedForce) -> f64 {
    force.modulus_slope.max(LEAST_SENSITIVITY)
}

/// A load with a contact radius.
struct Contact {
    load: usize,
    force: Uncertain,
    radius: Uncertain,
}

struct Fit {
    log_modulus: f64,
    mean: CommonMean,
    /// ln E from each load alone.
    own: Vec<f64>,
    /// ∂ln F/∂ln E, weighted like the mean.
    sensitivity: f64,
    /// Whether the best ln E is above or below those of the table.
    above: bool,
    below: bool,
}

impl ModulusEstimator for TabulatedContact {
    fn estimate(&self, series: &LoadSeries) -> Result<ModulusEstimate, ElasticityError> {
        let contacts = self.contacts(series.loads())?;
        let (contacts, fit) = self.fit_covered(contacts, series)?;
        let known = fit.mean.has_error();
        let log = fit.mean.mean.total();
        let reach = quantile_95(log.degrees_of_freedom) * log.standard_error * fit.sensitivity;
        let lower = if known {
            self.limit(&contacts, &fit, -reach)
        } else {
            None
        };
        if fit.above {
            return Err(ElasticityError::StifferThanResolvable {
                lower_bound_pa: lower.map(f64::exp),
            });
        }
        if fit.below {
            return Err(Quantity::YoungsModulus
                .beyond(fit.mean.mean.value.exp(), self.table.log_moduli()[0].exp()));
        }
        let upper = if known {
            self.limit(&contacts, &fit, reach)
        } else {
            None
        };
        let modulus = fit.log_modulus.exp();
        let loads = self.diagnose(series.loads(), &contacts, &fit);
        let limit = self.table.contact_ratios(fit.log_modulus)[1];
        let mut warnings = large_contacts(&loads, limit);
        warnings.extend(fit.mean.warnings(upper.is_some()));
        Ok(ModulusEstimate {
            youngs_modulus_pa: modulus,
            standard_error_pa: modulus * log.standard_error,
            by_source: fit.mean.mean.map(|_| modulus, |_| modulus),
            interval_95: Interval::new(lower.map_or(0.0, f64::exp), upper.map(|u| u.exp())),
            estimator: EstimatorKind::TabulatedContact,
            loads,
            fit: fit.mean.fit_statistics(),
            warnings,
        })
    }

    fn kind(&self) -> EstimatorKind {
        EstimatorKind::TabulatedContact
    }

    fn needs_strain(&self) -> bool {
        false
    }

    fn counts_guide(&self) -> bool {
        true
    }
}
