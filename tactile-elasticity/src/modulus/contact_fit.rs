//! The fit of a contact law to loads.
//!
//! Each observation (F, x) gives one ln E* = ln F − ln f(x). Their errors are relative, so the
//! problem is linear in logarithms. The common mean is the generalised least-squares mean, with the
//! covariance of forces (which share a calibration), of lengths (which share a pixel size) and of
//! the indenter's size. The modulus E of the sample follows from 1/E* = (1 − ν²)/E + C, with C the
//! compliance of the waveguide or indenter. The interval is transformed by this curve, and has no
//! upper end if it reaches C.

use super::bodies::Bodies;
use super::estimate::{LoadDiagnostics, ModulusEstimate};
use super::kind::EstimatorKind;
use super::load::{LoadSeries, LoadState, validated};
use super::statistics::{CommonMean, CommonTo, Covariance, common_mean, fewest};
use super::warning::Warning;
use crate::contact::Body;
use crate::error::{ElasticityError, Quantity};
use crate::laws::{self, ContactLaw, ContactLength, Limits, Reach};
use tactile_core::{Interval, Source, Uncertain, statistics::quantile_95};

// Start of the search for the consistent share. A ball that is compliant alone may not reach an
// indentation that it shares with the layers below.
const FIRST_SHARE: f64 = 0.5;
// Two shares at which a law that depends on the share differs.
const OTHER_SHARES: [f64; 2] = [0.25, 0.75];
// A change of the share changes ln E* by at most itself over the sample's part: eleven digits of a
// modulus.
const SETTLED_SHARE: f64 = 1e-11;
// If a secant leaves more of the gap than this, the bracket is halved next.
const SLOW: f64 = 0.5;
// Secants take about five steps, bisection forty.
const SHARE_STEPS: usize = 100;
// If a law is not defined, the bracket of shares is halved down to this width.
const SMALLEST_BRACKET: f64 = 1e-9;

/// A law and the loads it is fitted to.
pub(super) struct ContactFit<'a, L: ?Sized> {
    law: &'a L,
    limits: Limits,
    series: &'a LoadSeries,
    measured: Vec<Measured>,
    poisson_ratio: f64,
    other_compliance_per_pa: f64,
    /// ln of the other body's compliance and of the object's size, relative to the stated values:
    /// zero, with their errors.
    log_compliance: Uncertain,
    log_size: Uncertain,
    /// ln of 1 − ν² relative to the stated value: zero, with its error.
    log_lateral: Uncertain,
    /// Whether the law depends on the other body's part of 1/E*.
    feels_share: bool,
}

impl<'a, L: ContactLaw + ?Sized> ContactFit<'a, L> {
    pub(super) fn new(
        law: &'a L,
        series: &'a LoadSeries,
        poisson_ratio: f64,
        other: Body,
    ) -> Result<Self, ElasticityError> {
        let other_compliance_per_pa = other.compliance_per_pa();
        let measured = Measured::all(series)?;
        let differs = |of: &Measured| {
            let [one, other] = OTHER_SHARES.map(|share| law.log_force(of.length, share));
            one != other
        };
        let feels_share = other_compliance_per_pa > 0.0 && measured.iter().any(differs);
        let limits = law.limits();
        let bodies = series.bodies();
        let log = |factor: Uncertain| factor.map(f64::ln, f64::recip);
        let radius_m = || mean_radius(series, &limits).unwrap_or(f64::NAN);
        let nu = bodies.map_or(Uncertain::exact(0.0), Bodies::poisson_ratio);
        let per_ratio = -2.0 * poisson_ratio / (1.0 - poisson_ratio.powi(2));
        Ok(Self {
            law,
            limits,
            series,
            measured,
            poisson_ratio,
            other_compliance_per_pa,
            log_compliance: bodies.map_or(Uncertain::exact(0.0), |bodies| {
                log(bodies.guide_compliance(radius_m()))
            }),
            log_size: bodies.map_or(Uncertain::exact(0.0), |bodies| log(bodies.size())),
            log_lateral: nu.map(|_| 0.0, |_| per_ratio),
            feels_share,
        })
    }

    pub(super) fn estimate(&self, kind: EstimatorKind) -> Result<ModulusEstimate, ElasticityError> {
        let centre = self.consistent(0.0, FIRST_SHARE)?;
        let (modulus_pa, interval_95) = self.answer(&centre)?;
        let diagnostics = self.diagnose(&centre);
        let bounded = interval_95.upper.is_some();
        Ok(ModulusEstimate {
            youngs_modulus_pa: modulus_pa.value,
            standard_error_pa: modulus_pa.standard_error(),
            by_source: modulus_pa,
            interval_95,
            estimator: kind,
            warnings: self.warnings(&diagnostics, &centre, bounded),
            loads: diagnostics,
            fit: centre.mean.fit_statistics(),
        })
    }

    /// The observations within the range of the law, for a given part of the other body in 1/E*,
    /// and the loads outside the range.
    fn observe(&self, share: f64) -> Result<(Vec<Observation>, Vec<usize>), ElasticityError> {
        let mut all = Vec::with_capacity(self.measured.len());
        let mut beyond = Vec::new();
        for (place, measured) in self.measured.iter().enumerate() {
            let log_force = match self.law.log_force(measured.length, share) {
                Reach::At(log_force) => log_force,
                Reach::Beyond => {
                    beyond.push(measured.load);
                    continue;
                }
                Reach::NotMine => continue,
            };
            let slopes = laws::slopes(self.law, measured.length, share, &log_force);
            let Some([slope, size_slope]) = slopes else {
                beyond.push(measured.load);
                continue;
            };
            let of_lengths = measured.log_length * slope + self.log_size * size_slope;
            let mut log_modulus = measured.log_common_force - of_lengths;
            log_modulus.value = measured.log_common_force.value - log_force.value();
            all.push(Observation {
                measured: place,
                log_modulus,
                law_error: log_force.error(),
            });
        }
        match (all.is_empty(), beyond.first()) {
            (false, _) => Ok((all, beyond)),
            (true, Some(&load)) => Err(ElasticityError::BeyondLaw { load }),
            (true, None) => Err(ElasticityError::TooFewLoads {
                expected: 1,
                found: 0,
            }),
        }
    }

    /// The covariance of the ln E*. Radius and depth of one load share the noise of its force.
    fn covariance(&self, all: &[Observation]) -> Covariance {
        let numbers: Vec<_> = all.iter().map(|o| o.log_modulus).collect();
        let force = |i: usize| &self.measured[all[i].measured].force;
        let degrees = (0..all.len()).map(|i| force(i).degrees_of_freedom(Source::Noise));
        let noise = |i: usize| force(i).part(Source::Noise) / force(i).value;
        let bodies = self.series.bodies();
        let adhesion = |i: usize| bodies.map_or(0.0, |b| b.adhesion(force(i).value));
        Covariance::of(&numbers, all.iter().map(|o| self.measured[o.measured].load))
            .with(Source::Noise, CommonTo::Load, fewest(degrees), noise)
            .with_model_errors(Source::Adhesion, adhesion)
            .with_model_errors(Source::Law, |i| all[i].law_error)
    }

    /// E of the sample at a given ln E*. `None` if the other body accounts for the whole
    /// compliance.
    fn sample_modulus(&self, log_reduced: f64) -> Option<f64> {
        let reduced = log_reduced.exp();
        let left = 1.0 - self.other_compliance_per_pa * reduced;
        (left > 0.0).then(|| (1.0 - self.poisson_ratio.powi(2)) * reduced / left)
    }

    /// ln E* with the errors of the other body's compliance C and of ν in addition to those of the
    /// mean.
    ///
    /// Let p be the sample's part of the compliance, 1 − C E* for a deep body. Then ln E changes by
    /// 1/p per unit of ln E*, by (1 − p)/p per unit of ln C and by 1 per unit of ln(1 − ν²). In
    /// units of ln E*, an error of ln C has the factor 1 − p, and one of ln(1 − ν²) the factor p.
    fn with_bodies(&self, mean: &CommonMean, sample_part: f64) -> Uncertain {
        mean.mean + self.log_compliance * (1.0 - sample_part) + self.log_lateral * sample_part
    }

    /// The sample's part of the compliance at the mean of the contacts.
    fn sample_part(&self, all: &[Observation], share: f64) -> f64 {
        let radius = |o: &Observation| match self.measured[o.measured].length {
            ContactLength::Radius(a) => Some(a),
            ContactLength::Indentation(_) => None,
        };
        let radii = || all.iter().filter_map(radius);
        let count = radii().count() as f64;
        let at_mean = (count > 0.0).then(|| {
            let mean = ContactLength::Radius(radii().sum::<f64>() / count);
            self.law.log_force(mean, share).at()
        });
        let stated = at_mean.flatten().and_then(|law| law.sample_part());
        stated.unwrap_or(1.0 - share)
    }

    /// The other body's part of the compliance at ln E*.
    fn share_at(&self, log_reduced: f64) -> f64 {
        (self.other_compliance_per_pa * log_reduced.exp()).clamp(0.0, 1.0)
    }

    /// The mean for an assumed share of the other body, shifted by `reach` times its 95 % quantile.
    fn mean_at(&self, share: f64, reach: f64) -> Result<Consistent, ElasticityError> {
        let (observations, beyond) = self.observe(share)?;
        let logs: Vec<f64> = observations.iter().map(|o| o.log_modulus.value).collect();
        let mean = common_mean(&logs, &self.covariance(&observations))?;
        let mut log_reduced = mean.mean.value;
        // Without a shift, an infinite error must not become NaN.
        if reach != 0.0 {
            // The assumed share is consistent only if the law depends on it.
            let share = match self.feels_share {
                true => share,
                false => self.share_at(mean.mean.value),
            };
            let part = self.sample_part(&observations, share);
            let log = self.with_bodies(&mean, part).total();
            log_reduced += reach * quantile_95(log.degrees_of_freedom) * log.standard_error;
        }
        Ok(Consistent {
            observations,
            beyond,
            mean,
            log_reduced,
        })
    }

    /// The mean for which the assumed share of the other body equals the resulting share.
    ///
    /// The resulting fraction decreases as the assumed one increases: a larger part of a layer on a
    /// stiff base makes the contact stiffer, so that softer bodies explain it. Their difference has
    /// one zero between 0 and 1. It is found by secants, and by bisection if these leave the
    /// bracket or are slow. A fixed-point iteration would oscillate forever if a thin layer has
    /// most of the compliance. The search starts at the share `from`.
    fn consistent(&self, reach: f64, from: f64) -> Result<Consistent, ElasticityError> {
        if !self.feels_share {
            return self.mean_at(0.0, reach);
        }
        let mut assumed = from;
        let mut found = self.mean_at(assumed, reach)?;
        let (mut low, mut high) = (0.0, 1.0);
        let mut before: Option<[f64; 2]> = None;
        for _ in 0..SHARE_STEPS {
            let gap = self.share_at(found.log_reduced) - assumed;
            if gap.abs() < SETTLED_SHARE {
                break;
            }
            if gap > 0.0 {
                low = assumed;
            } else {
                high = assumed;
            }
            let secant = before.map_or(assumed + gap, |[x, y]| {
                assumed - gap * (assumed - x) / (gap - y)
            });
            let slow = before.is_some_and(|[_, y]| gap.abs() > SLOW * y.abs());
            before = Some([assumed, gap]);
            // Near a share of one, the gap at an end of the interval may have another zero, so fast
            // secants are not interrupted.
            let inside = secant > low && secant < high && secant != assumed;
            let mut next = if inside && !slow {
                secant
            } else {
                0.5 * (low + high)
            };
            // If the law is not defined, the bracket ends there: step back towards a share at which
            // it is.
            let mut moved = self.mean_at(next, reach);
            while moved.is_err() && (next - assumed).abs() > SMALLEST_BRACKET {
                if next < assumed {
                    low = next;
                } else {
                    high = next;
                }
                next = 0.5 * (next + assumed);
                moved = self.mean_at(next, reach);
            }
            (assumed, found) = (next, moved?);
        }
        Ok(found)
    }

    /// E and its interval.
    fn answer(&self, centre: &Consistent) -> Result<(Uncertain, Interval), ElasticityError> {
        let known = centre.mean.has_error();
        let limit = |reach: f64| -> Option<f64> {
            // Near a share of one the law may not be defined.
            let share = self.share_at(centre.log_reduced);
            let from = if share < 1.0 { share } else { FIRST_SHARE };
            self.sample_modulus(self.consistent(reach, from).ok()?.log_reduced)
        };
        let lower = if known {
            limit(-1.0).unwrap_or(f64::INFINITY)
        } else {
            0.0
        };
        let Some(modulus) = self.sample_modulus(centre.log_reduced) else {
            let lower_bound_pa = Some(lower).filter(|bound| *bound > 0.0 && bound.is_finite());
            return Err(ElasticityError::StifferThanResolvable { lower_bound_pa });
        };
        let upper = if known { limit(1.0) } else { None };
        let part = self.sample_part(&centre.observations, self.share_at(centre.log_reduced));
        let log = self.with_bodies(&centre.mean, part);
        let found = log.map(|_| modulus, |_| modulus / part);
        // Errors at rounding level may put an end on the wrong side of the estimate by a rounding
        // error.
        let upper = upper.map(|upper| upper.max(modulus));
        Ok((found, Interval::new(lower.min(modulus), upper)))
    }

    fn diagnose(&self, centre: &Consistent) -> Vec<LoadDiagnostics> {
        let ratio = |state: &LoadState| {
            let [radius, depth] = [state.contact_radius_m, state.indentation_m];
            (self.limits).ratio(radius.map(|e| e.value), depth.map(|e| e.value))
        };
        let mut all: Vec<_> = (self.series.loads().iter())
            .map(|state| LoadDiagnostics {
                contact_ratio: ratio(state),
                ..LoadDiagnostics::default()
            })
            .collect();
        // Observations are in the order of their loads.
        let residuals = &centre.mean.standardized_residuals;
        let mut rest = &residuals[..];
        let load = |o: &Observation| self.measured[o.measured].load;
        for of_load in (centre.observations).chunk_by(|a, b| load(a) == load(b)) {
            let (own, others) = rest.split_at(of_load.len());
            rest = others;
            let log_sum: f64 = of_load.iter().map(|o| o.log_modulus.value).sum();
            let diagnostics = &mut all[load(&of_load[0])];
            diagnostics.used = true;
            diagnostics.youngs_modulus_pa = self.sample_modulus(log_sum / of_load.len() as f64);
            diagnostics.standardized_residual = own
                .iter()
                .copied()
                .max_by(|a, b| a.abs().total_cmp(&b.abs()));
        }
        all
    }

    fn warnings(
        &self,
        diagnostics: &[LoadDiagnostics],
        centre: &Consistent,
        bounded: bool,
    ) -> Vec<Warning> {
        let mut warnings = large_contacts(diagnostics, self.limits.contact_ratio);
        warnings.extend(centre.mean.warnings(bounded));
        if let (Some([thickness_m, limit]), Some(radius_m)) =
            (self.limits.layers, self.limits.radius_m)
        {
            let ratio = |d: &LoadDiagnostics| Some(d.contact_ratio? * radius_m / thickness_m);
            let ratios = diagnostics.iter().map(ratio).enumerate();
            let thin = ratios.filter_map(|(load, ratio)| {
                let ratio = ratio.filter(|ratio| *ratio > limit)?;
                Some(Warning::ThinLayer { load, ratio, limit })
            });
            warnings.extend(thin);
        }
        let unused = centre
            .beyond
            .iter()
            .map(|&load| Warning::OutOfReach { load });
        warnings.extend(unused);
        warnings
    }
}

/// A length of a contact with the force of its load.
struct Measured {
    load: usize,
    force: Uncertain,
    length: ContactLength,
    /// ln F without its noise, and ln of the length.
    log_common_force: Uncertain,
    log_length: Uncertain,
}

impl Measured {
    /// The lengths of all loads, in order. Forces and lengths must be positive.
    fn all(series: &LoadSeries) -> Result<Vec<Self>, ElasticityError> {
        let log = |number: Uncertain| number.map(f64::ln, f64::recip);
        let mut all = Vec::with_capacity(series.loads().len());
        for (load, state) in series.loads().iter().enumerate() {
            let force = validated(state.force_n, Quantity::Force)?;
            let radius = (state.contact_radius_m)
                .map(|a| (a, ContactLength::Radius(a.value), Quantity::ContactRadius));
            let depth = (state.indentation_m).map(|d| {
                (
                    d,
                    ContactLength::Indentation(d.value),
                    Quantity::Indentation,
                )
            });
            for (measured, length, quantity) in radius.into_iter().chain(depth) {
                let measured = validated(measured, quantity)?;
                quantity.positive(measured.value)?;
                Quantity::Force.positive(force.value)?;
                all.push(Self {
                    load,
                    force,
                    length,
                    log_common_force: log(force.without(Source::Noise)),
                    log_length: log(measured),
                });
            }
        }
        Ok(all)
    }
}

/// The mean of the contact radii, either measured or derived by the law.
fn mean_radius(series: &LoadSeries, limits: &Limits) -> Option<f64> {
    let radius = |state: &LoadState| {
        let measured = state.contact_radius_m.map(|a| a.value);
        let depth = state.indentation_m.map(|d| d.value);
        measured.or_else(|| Some(limits.ratio(None, depth)? * limits.radius_m?))
    };
    let radii = || series.loads().iter().filter_map(radius);
    let count = radii().count();
    (count > 0).then(|| radii().sum::<f64>() / count as f64)
}

/// Warnings for loads whose a/R is above the limit of a law.
pub(super) fn large_contacts(loads: &[LoadDiagnostics], limit: f64) -> Vec<Warning> {
    (loads.iter().enumerate())
        .filter_map(|(load, d)| d.contact_ratio.map(|ratio| (load, ratio)))
        .filter(|&(_, ratio)| ratio > limit)
        .map(|(load, ratio)| Warning::LargeContact { load, ratio, limit })
        .collect()
}

/// A mean with a consistent share of compliance.
struct Consistent {
    observations: Vec<Observation>,
    /// Loads with a length outside the range of the law.
    beyond: Vec<usize>,
    mean: CommonMean,
    log_reduced: f64,
}

struct Observation {
    /// Index among the measured lengths.
    measured: usize,
    /// ln E*, without the noise of the force and the errors of the law.
    log_modulus: Uncertain,
    /// Standard error of ln F due to the law.
    law_error: f64,
}
