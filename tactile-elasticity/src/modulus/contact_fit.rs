//! The fit of a contact law to loads.
//!
//! Every observation (F, x) gives one ln E* = ln F − ln f(x). Their errors are relative, so that
//! logarithms make the problem linear. The common mean is the generalised least squares one, with
//! the covariance of forces (which share a calibration), of lengths (which share a pixel size) and
//! of the indenter's size carried along. E of the sample follows from 1/E* = (1 − ν²)/E + C, C the
//! compliance of the waveguide or indenter. The interval is carried through that curve, and is open
//! above where it reaches C.

use super::estimate::{LoadDiagnostics, ModulusEstimate};
use super::kind::EstimatorKind;
use super::load::{LoadSeries, LoadState, validated};
use super::statistics::{CommonMean, Covariance, LogErrors, common_mean, fewest, total};
use super::warning::Warning;
use crate::contact::Body;
use crate::error::{ElasticityError, Quantity};
use crate::laws::{self, ContactLaw, ContactLength, Limits, Reach};
use tactile_core::{Estimate, Interval, statistics::quantile_95};

// The share from which the one that belongs to the answer is sought. A ball that yields alone may
// not reach an indentation that it shares with the layers below.
const FIRST_SHARE: f64 = 0.5;
// Two shares at which a law that feels the share differs.
const OTHER_SHARES: [f64; 2] = [0.25, 0.75];
// A share moves ln E* by no more than itself over the sample's part: eleven digits of a modulus.
const SETTLED_SHARE: f64 = 1e-11;
// Secants take some five steps, bisection of every third forty.
const SHARE_STEPS: usize = 100;
// Where a law does not reach, the bracket of shares is halved down to this.
const SMALLEST_BRACKET: f64 = 1e-9;

/// A law and the loads it is fitted to.
pub(super) struct ContactFit<'a, L: ?Sized> {
    law: &'a L,
    limits: Limits,
    series: &'a LoadSeries,
    poisson_ratio: f64,
    other_compliance_per_pa: f64,
    /// Whether the law depends on the other body's part of 1/E*.
    feels_share: bool,
}

impl<'a, L: ContactLaw + ?Sized> ContactFit<'a, L> {
    pub(super) fn new(law: &'a L, series: &'a LoadSeries, poisson_ratio: f64, other: Body) -> Self {
        let other_compliance_per_pa = other.compliance_per_pa();
        let differs = |length: ContactLength| {
            let [one, other] = OTHER_SHARES.map(|share| law.log_force(length, share));
            one != other
        };
        let lengths = series.loads().iter().flat_map(lengths);
        let positive = lengths.filter(|(length, _)| length.metres() > 0.0);
        let feels_share = other_compliance_per_pa > 0.0 && positive.map(|(x, _)| x).any(differs);
        Self {
            law,
            limits: law.limits(),
            series,
            poisson_ratio,
            other_compliance_per_pa,
            feels_share,
        }
    }

    pub(super) fn estimate(&self, kind: EstimatorKind) -> Result<ModulusEstimate, ElasticityError> {
        let centre = self.consistent(0.0)?;
        let (modulus, error, interval_95) = self.answer(&centre)?;
        let diagnostics = self.diagnose(&centre);
        let bounded = interval_95.upper.is_some();
        Ok(ModulusEstimate {
            youngs_modulus_pa: modulus,
            standard_error_pa: error,
            interval_95,
            estimator: kind,
            warnings: self.warnings(&diagnostics, &centre, bounded),
            loads: diagnostics,
            fit: centre.mean.fit_statistics(),
        })
    }

    /// The observations that the law reaches with the other body's part of 1/E* given, and the
    /// loads beyond it.
    fn observe(&self, share: f64) -> Result<(Vec<Observation>, Vec<usize>), ElasticityError> {
        let (mut all, mut beyond) = (Vec::new(), Vec::new());
        for (load, state) in self.series.loads().iter().enumerate() {
            let force = validated(state.force_n, Quantity::Force)?;
            for (length, measured) in lengths(state) {
                let quantity = match length {
                    ContactLength::Radius(_) => Quantity::ContactRadius,
                    ContactLength::Indentation(_) => Quantity::Indentation,
                };
                let measured = validated(measured, quantity)?;
                quantity.positive(measured.value)?;
                Quantity::Force.positive(force.value)?;
                let log_force = match self.law.log_force(length, share) {
                    Reach::At(log_force) => log_force,
                    Reach::Beyond => {
                        beyond.push(load);
                        continue;
                    }
                    Reach::NotMine => continue,
                };
                let Some([slope, size_slope]) = laws::slopes(self.law, length, share, &log_force)
                else {
                    beyond.push(load);
                    continue;
                };
                all.push(Observation {
                    load,
                    force,
                    length,
                    relative_error: measured.relative_error(),
                    degrees_of_freedom: measured.degrees_of_freedom,
                    slope,
                    size_slope,
                    log_modulus: force.value.ln() - log_force.value(),
                    law_error: log_force.error(),
                });
            }
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

    /// Covariances of the ln E* with their degrees of freedom: of forces, of lengths, of errors
    /// that all have in common.
    fn sources(&self, all: &[Observation]) -> [LogErrors; 3] {
        let shared = self.series.shared_errors();
        let none = Covariance::none(all.iter().map(|o| o.load));
        let forces = match self.series.force_covariance() {
            Some(given) => none.clone().with_given(|i, j| {
                let loads = (all[i].load, all[j].load);
                given[loads] / (all[i].force.value * all[j].force.value)
            }),
            None => none
                .clone()
                .with_shared_in_load(|i| all[i].force.relative_error()),
        };
        // The scale of the forces comes from the calibration that their own errors come from.
        let forces = forces.with_shared(|_| shared.force_scale);
        let lengths = none
            .clone()
            .with_own(|i| all[i].slope * all[i].relative_error);
        let common = none
            .with_shared(|i| all[i].slope * shared.length_scale)
            .with_shared(|i| all[i].size_slope * shared.size)
            .with_model_errors(|i| shared.adhesion(all[i].force.value))
            .with_model_errors(|i| all[i].law_error);
        let force_degrees = fewest(all.iter().map(|o| o.force.degrees_of_freedom));
        let length_degrees = fewest(all.iter().map(|o| o.degrees_of_freedom));
        [
            (forces, force_degrees),
            (lengths, length_degrees),
            (common, None),
        ]
    }

    /// E of the sample at a given ln E*. `None` where the other body leaves no compliance.
    fn sample_modulus(&self, log_reduced: f64) -> Option<f64> {
        let reduced = log_reduced.exp();
        let left = 1.0 - self.other_compliance_per_pa * reduced;
        (left > 0.0).then(|| (1.0 - self.poisson_ratio.powi(2)) * reduced / left)
    }

    /// Standard error of ln E*: that of the mean with those of the other body's compliance C and of
    /// ν.
    ///
    /// With p the sample's part of the compliance, 1 − C E* on a deep body, ln E moves by 1/p of ln
    /// F, by 1 − 1/p of ln C and by 2ν/(1 − ν²) of ν. Beside ln E* an error of ln C counts 1 − p
    /// times, one of ν p·2ν/(1 − ν²) times, and one of lengths minus the mean slope of ln F.
    fn standard_error(&self, all: &[Observation], mean: &CommonMean, sample_part: f64) -> f64 {
        let shared = self.series.shared_errors();
        let nu_slope = 2.0 * self.poisson_ratio / (1.0 - self.poisson_ratio.powi(2));
        let of_other_body = (1.0 - sample_part) * shared.other_body;
        let of_poisson_ratio = sample_part * nu_slope * shared.poisson_ratio;
        let slopes = mean.weights.iter().zip(all).map(|(w, o)| w * o.slope);
        let of_lengths = -slopes.sum::<f64>() * shared.length_scale;
        let together = 2.0 * shared.length_with_other_body * of_lengths * of_other_body;
        let apart = mean.standard_error.powi(2) + of_other_body.powi(2) + of_poisson_ratio.powi(2);
        // Of one cause both may cancel, but for rounding.
        (apart + together).max(0.0).sqrt()
    }

    /// The sample's part of the compliance under the mean of the contacts.
    fn sample_part(&self, all: &[Observation], share: f64) -> f64 {
        let radius = |o: &Observation| match o.length {
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

    /// The mean with an assumed share of the other body, moved by `reach` times its 95 % quantile.
    fn mean_at(&self, share: f64, reach: f64) -> Result<Consistent, ElasticityError> {
        let (observations, beyond) = self.observe(share)?;
        let logs: Vec<f64> = observations.iter().map(|o| o.log_modulus).collect();
        let sources = self.sources(&observations);
        let mut mean = common_mean(&logs, &total(&sources))?;
        mean.degrees = mean.degrees_from(&sources);
        let mut log_reduced = mean.mean;
        // Without a step an infinite error must not become NaN.
        if reach != 0.0 {
            // The assumed share is the one that follows only where the law feels it.
            let share = match self.feels_share {
                true => share,
                false => self.share_at(mean.mean),
            };
            let part = self.sample_part(&observations, share);
            let error = self.standard_error(&observations, &mean, part);
            log_reduced += reach * quantile_95(mean.degrees) * error;
        }
        Ok(Consistent {
            observations,
            beyond,
            mean,
            log_reduced,
        })
    }

    /// The mean whose assumed share of the other body is the one that follows from it.
    ///
    /// The share that follows falls while the assumed one rises: the larger the part of a layer on
    /// a stiff base, the stiffer the contact, and the softer the bodies that make it. Their
    /// difference has one zero between 0 and 1. It is sought by secants, and by bisection where
    /// these leave the bracket or are slow. The plain iteration swings for ever where a thin layer
    /// takes most of the compliance.
    fn consistent(&self, reach: f64) -> Result<Consistent, ElasticityError> {
        if !self.feels_share {
            return self.mean_at(0.0, reach);
        }
        let mut assumed = FIRST_SHARE;
        let mut found = self.mean_at(assumed, reach)?;
        let (mut low, mut high) = (0.0, 1.0);
        let mut before: Option<[f64; 2]> = None;
        for step in 1..=SHARE_STEPS {
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
            before = Some([assumed, gap]);
            // Every third step halves the bracket, so that it shrinks whatever the secants do.
            let inside = secant >= low && secant <= high && secant != assumed;
            let mut next = if inside && step % 3 != 0 {
                secant
            } else {
                0.5 * (low + high)
            };
            // Where the law does not reach, the bracket ends: back towards the share at which it
            // does.
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

    /// E, its standard error and its interval.
    fn answer(&self, centre: &Consistent) -> Result<(f64, f64, Interval), ElasticityError> {
        let known = centre.mean.standard_error.is_finite();
        let limit = |reach: f64| -> Option<f64> {
            self.sample_modulus(self.consistent(reach).ok()?.log_reduced)
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
        let error = modulus / part * self.standard_error(&centre.observations, &centre.mean, part);
        // Errors at rounding level may put an end on the wrong side of the estimate by a rounding.
        let upper = upper.map(|upper| upper.max(modulus));
        Ok((modulus, error, Interval::new(lower.min(modulus), upper)))
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
        // Observations come in the order of their loads.
        let residuals = &centre.mean.standardized_residuals;
        let mut rest = &residuals[..];
        for of_load in centre.observations.chunk_by(|a, b| a.load == b.load) {
            let (own, others) = rest.split_at(of_load.len());
            rest = others;
            let log_sum: f64 = of_load.iter().map(|o| o.log_modulus).sum();
            let diagnostics = &mut all[of_load[0].load];
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

/// What was measured of a load's contact.
fn lengths(state: &LoadState) -> impl Iterator<Item = (ContactLength, Estimate)> + use<> {
    let radius = (state.contact_radius_m).map(|a| (ContactLength::Radius(a.value), a));
    let depth = (state.indentation_m).map(|d| (ContactLength::Indentation(d.value), d));
    radius.into_iter().chain(depth)
}

/// Loads whose a/R is beyond the limit of a law.
pub(super) fn large_contacts(loads: &[LoadDiagnostics], limit: f64) -> Vec<Warning> {
    (loads.iter().enumerate())
        .filter_map(|(load, d)| d.contact_ratio.map(|ratio| (load, ratio)))
        .filter(|&(_, ratio)| ratio > limit)
        .map(|(load, ratio)| Warning::LargeContact { load, ratio, limit })
        .collect()
}

/// A mean whose share of compliance is its own.
struct Consistent {
    observations: Vec<Observation>,
    /// Loads with a length that the law does not reach.
    beyond: Vec<usize>,
    mean: CommonMean,
    log_reduced: f64,
}

struct Observation {
    load: usize,
    force: Estimate,
    length: ContactLength,
    /// Of the length.
    relative_error: f64,
    /// Of that error.
    degrees_of_freedom: Option<f64>,
    slope: f64,
    size_slope: f64,
    log_modulus: f64,
    /// Standard error of ln F that is the law's.
    law_error: f64,
}
