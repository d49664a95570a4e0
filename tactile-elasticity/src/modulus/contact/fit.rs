//! Observations to their common mean, and the mean to the sample's modulus.

use super::{ContactEstimator, Evidence};
use crate::error::{ElasticityError, Quantity, positive};
use crate::modulus::covariance::Covariance;
use crate::modulus::estimate::{
    EstimatorKind, FitStatistics, LoadDiagnostics, ModulusEstimate, ModulusEstimator,
};
use crate::modulus::law::{ContactLaw, LogForce};
use crate::modulus::load::{LoadState, validated};
use crate::modulus::series::LoadSeries;
use crate::modulus::source::{LogErrors, total};
use crate::modulus::statistics::{CommonMean, common_mean, fewest};
use crate::modulus::warning::Warning;
use tactile_core::{Estimate, Interval, statistics::quantile_95};

impl<L: ContactLaw> ContactEstimator<L> {
    fn observe(
        &self,
        loads: &[LoadState],
        share: f64,
    ) -> Result<Vec<Observation>, ElasticityError> {
        let mut all = Vec::new();
        for (load, state) in loads.iter().enumerate() {
            let force = validated(state.force_n, Quantity::Force)?;
            let mut push = |length: Option<Estimate>,
                            wanted: bool,
                            quantity,
                            law: &dyn Fn(f64) -> Option<LogForce>,
                            model_error: f64| {
                let Some(length) = length.filter(|_| wanted) else {
                    return Ok(());
                };
                let length = validated(length, quantity)?;
                positive(length.value, quantity)?;
                positive(force.value, Quantity::Force)?;
                if let Some(log_force) = law(length.value) {
                    let log_modulus = force.value.ln() - log_force.value;
                    all.push(Observation {
                        load,
                        force,
                        length,
                        contact_radius: (quantity == Quantity::ContactRadius)
                            .then_some(length.value),
                        log_force,
                        log_modulus,
                        model_error,
                    });
                }
                Ok(())
            };
            let (radius, depth) = (
                self.evidence != Evidence::Indentation,
                self.evidence != Evidence::ContactRadius,
            );
            push(
                state.contact_radius_m,
                radius,
                Quantity::ContactRadius,
                &|a| self.law.of_contact_radius(a, share),
                self.law
                    .model_error(state.contact_radius_m.map(|a| a.value), None),
            )?;
            push(
                state.indentation_m,
                depth,
                Quantity::Indentation,
                &|d| self.law.of_indentation(d, share),
                self.law
                    .model_error(None, state.indentation_m.map(|d| d.value)),
            )?;
        }
        if all.is_empty() {
            return Err(ElasticityError::TooFewLoads {
                expected: 1,
                found: 0,
            });
        }
        Ok(all)
    }

    /// Covariances of the ln E*, with their degrees of freedom: of forces, of lengths, of what all have in common.
    fn sources(&self, all: &[Observation], series: &LoadSeries) -> [LogErrors; 3] {
        let shared = series.shared_errors();
        let none = Covariance::none(all.iter().map(|o| o.load));
        let forces = match series.force_covariance() {
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
            .with_own(|i| all[i].log_force.slope * all[i].length.relative_error());
        let common = none
            .with_shared(|i| all[i].log_force.slope * shared.length_scale)
            .with_shared(|i| all[i].log_force.size_slope * shared.size)
            .with_model_errors(|i| all[i].model_error);
        [
            (
                forces,
                fewest(all.iter().map(|o| o.force.degrees_of_freedom)),
            ),
            (
                lengths,
                fewest(all.iter().map(|o| o.length.degrees_of_freedom)),
            ),
            (common, None),
        ]
    }

    /// E of the sample at a given ln E*; None where the other body leaves no compliance.
    fn sample_modulus(&self, log_reduced: f64) -> Option<f64> {
        let reduced = log_reduced.exp();
        let left = 1.0 - self.other_compliance_per_pa * reduced;
        (left > 0.0).then(|| (1.0 - self.poisson_ratio.powi(2)) * reduced / left)
    }

    /// Standard error of ln E*: that of the mean, and what the errors of the other body's compliance C and of ν add to it.
    ///
    /// With p the sample's part of the compliance, 1 − C E* on a deep body, ln E moves by 1/p of ln F, by 1 − 1/p of ln C and by
    /// 2ν/(1 − ν²) of ν: beside ln E* an error of ln C counts 1 − p times, one of ν p·2ν/(1 − ν²) times.
    fn standard_error(&self, series: &LoadSeries, mean: &CommonMean, sample_part: f64) -> f64 {
        let shared = series.shared_errors();
        let nu_slope = 2.0 * self.poisson_ratio / (1.0 - self.poisson_ratio.powi(2));
        let of_other_body = (1.0 - sample_part) * shared.other_body;
        let of_poisson_ratio = sample_part * nu_slope * shared.poisson_ratio;
        mean.standard_error
            .hypot(of_other_body.hypot(of_poisson_ratio))
    }

    /// The sample's part of the compliance under the mean of the contacts.
    fn sample_part(&self, all: &[Observation], share: f64) -> f64 {
        let radii = || all.iter().filter_map(|o| o.contact_radius);
        let count = radii().count() as f64;
        let mean = (count > 0.0).then(|| radii().sum::<f64>() / count);
        self.law.sample_part(mean, share)
    }

    /// The mean at a given share of the other body.
    fn mean(
        &self,
        series: &LoadSeries,
        share: f64,
    ) -> Result<(Vec<Observation>, CommonMean), ElasticityError> {
        let all = self.observe(series.loads(), share)?;
        let logs: Vec<f64> = all.iter().map(|o| o.log_modulus).collect();
        let sources = self.sources(&all, series);
        let mut mean = common_mean(&logs, &total(&sources))?;
        mean.degrees = mean.degrees_from(&sources);
        Ok((all, mean))
    }

    /// The mean at the share that belongs to the modulus it gives, `reach` standard errors away.
    ///
    /// The share moves ln E* by less than it is moved itself, so that the plain iteration converges.
    fn consistent(&self, series: &LoadSeries, reach: f64) -> Result<Consistent, ElasticityError> {
        let share_at =
            |log_reduced: f64| (self.other_compliance_per_pa * log_reduced.exp()).clamp(0.0, 1.0);
        let mut share = self.law.first_share();
        for _ in 0..60 {
            let (observations, mean) = self.mean(series, share)?;
            let steps = if reach == 0.0 {
                0.0
            } else {
                let part = self.sample_part(&observations, share);
                reach * quantile_95(mean.degrees) * self.standard_error(series, &mean, part)
            };
            let log_reduced = mean.mean + steps;
            let next = share_at(log_reduced);
            if !self.law.depends_on_share() || (next - share).abs() < 1e-10 {
                return Ok(Consistent {
                    observations,
                    mean,
                    log_reduced,
                });
            }
            share = next;
        }
        let (observations, mean) = self.mean(series, share)?;
        let log_reduced = mean.mean;
        Ok(Consistent {
            observations,
            mean,
            log_reduced,
        })
    }

    fn answer(
        &self,
        series: &LoadSeries,
        centre: &Consistent,
    ) -> Result<(f64, f64, Interval), ElasticityError> {
        let known = centre.mean.standard_error.is_finite();
        let limit = |reach: f64| -> Option<f64> {
            self.sample_modulus(self.consistent(series, reach).ok()?.log_reduced)
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
        let share = (self.other_compliance_per_pa * centre.log_reduced.exp()).clamp(0.0, 1.0);
        let part = self.sample_part(&centre.observations, share);
        let error = modulus / part * self.standard_error(series, &centre.mean, part);
        Ok((modulus, error, Interval::new(lower, upper)))
    }

    fn diagnose(
        &self,
        loads: &[LoadState],
        all: &[Observation],
        mean: &CommonMean,
    ) -> Vec<LoadDiagnostics> {
        // Observations come in the order of their loads.
        let mut observed = all.iter().zip(&mean.standardized_residuals).peekable();
        (0..loads.len())
            .map(|i| {
                let value = |e: Option<Estimate>| e.map(|e| e.value);
                let ratio = self.law.contact_ratio(
                    value(loads[i].contact_radius_m),
                    value(loads[i].indentation_m),
                );
                let mut count = 0;
                let mut log_sum = 0.0;
                let mut worst: Option<f64> = None;
                while let Some((observation, &residual)) = observed.next_if(|(o, _)| o.load == i) {
                    count += 1;
                    log_sum += observation.log_modulus;
                    worst = Some(worst.map_or(residual, |w| {
                        if residual.abs() >= w.abs() {
                            residual
                        } else {
                            w
                        }
                    }));
                }
                let alone = (count > 0).then(|| log_sum / f64::from(count));
                LoadDiagnostics {
                    used: count > 0,
                    contact_ratio: ratio,
                    youngs_modulus_pa: alone.and_then(|log| self.sample_modulus(log)),
                    standardized_residual: worst,
                }
            })
            .collect()
    }

    fn layer_warnings(&self, loads: &[LoadState]) -> Vec<Warning> {
        let value = |e: Option<Estimate>| e.map(|e| e.value);
        (loads.iter().enumerate())
            .filter_map(|(i, l)| {
                Some((
                    i,
                    self.law
                        .layer_ratio(value(l.contact_radius_m), value(l.indentation_m))?,
                ))
            })
            .filter(|(_, (ratio, limit))| ratio > limit)
            .map(|(load, (ratio, limit))| Warning::ThinLayer {
                load,
                ratio: ratio,
                limit: limit,
            })
            .collect()
    }

    fn warn(&self, loads: &[LoadDiagnostics], mean: &CommonMean, bounded: bool) -> Vec<Warning> {
        let limit = self.law.contact_ratio_limit();
        let mut warnings: Vec<Warning> = (loads.iter().enumerate())
            .filter_map(|(load, d)| d.contact_ratio.map(|ratio| (load, ratio)))
            .filter(|&(_, ratio)| ratio > limit)
            .map(|(load, ratio)| Warning::LargeContact {
                load,
                ratio,
                limit: limit,
            })
            .collect();
        warnings.extend(mean.excess.map(|x| Warning::ExcessScatter {
            reduced_chi_squared: x,
        }));
        if mean.standard_error.is_infinite() {
            warnings.push(Warning::NoErrorEstimate);
        } else if !bounded {
            warnings.push(Warning::UnboundedAbove);
        }
        warnings
    }
}

/// A mean whose share of compliance is its own.
struct Consistent {
    observations: Vec<Observation>,
    mean: CommonMean,
    log_reduced: f64,
}

struct Observation {
    load: usize,
    force: Estimate,
    length: Estimate,
    /// The length, where it is a contact radius.
    contact_radius: Option<f64>,
    log_force: LogForce,
    log_modulus: f64,
    /// Standard error of ln F that is the law's.
    model_error: f64,
}

impl<L: ContactLaw> ModulusEstimator for ContactEstimator<L> {
    fn estimate(&self, series: &LoadSeries) -> Result<ModulusEstimate, ElasticityError> {
        let loads = series.loads();
        let centre = self.consistent(&series, 0.0)?;
        let (modulus, error, interval_95) = self.answer(&series, &centre)?;
        let Consistent {
            observations: all,
            mean,
            ..
        } = &centre;
        let diagnostics = self.diagnose(loads, all, mean);
        let mut warnings = self.warn(&diagnostics, mean, interval_95.upper.is_some());
        warnings.extend(self.layer_warnings(loads));
        Ok(ModulusEstimate {
            youngs_modulus_pa: modulus,
            standard_error_pa: error,
            interval_95,
            estimator: self.law.kind(),
            loads: diagnostics,
            fit: FitStatistics::new(
                all.len(),
                1,
                mean.chi_squared,
                mean.minus_two_log_likelihood,
            ),
            warnings,
        })
    }

    fn kind(&self) -> EstimatorKind {
        self.law.kind()
    }

    fn needs_strain(&self) -> bool {
        false
    }
}
