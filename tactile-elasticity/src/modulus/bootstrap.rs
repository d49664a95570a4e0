//! The spread of a result over seeded repetitions of the experiment (parametric bootstrap).

use super::{Estimate, LoadSeries, LoadState, ModulusEstimator};
use crate::error::ElasticityError;
use crate::scalar::{narrow, widen};
use nalgebra::RealField;
use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};
use rand_distr::StandardNormal;

/// A parametric bootstrap: number of repetitions and seed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Bootstrap {
    /// Repetitions.
    pub replicates: usize,
    /// Seed; the same seed gives the same bits.
    pub seed: u64,
}

/// Mean, spread and quantiles of the repetitions.
///
/// ```
/// use tactile_elasticity::modulus::Bootstrap;
///
/// // An experiment that fails in one of six repetitions.
/// let summary = Bootstrap { replicates: 2000, seed: 1 }.run(|normal| Some(normal()).filter(|x| *x < 0.97))?;
/// assert!(summary.failed > 250 && summary.failed < 420);
/// assert!(summary.interval_95[0] < summary.mean && summary.interval_95[1].is_infinite());
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct BootstrapSummary {
    /// Mean of the repetitions that had an answer.
    pub mean: f64,
    /// Their standard deviation: the standard error.
    pub standard_error: f64,
    /// Their 2.5 and 97.5 % quantiles; those without an answer count as infinite.
    pub interval_95: [f64; 2],
    /// Repetitions without an answer.
    pub failed: usize,
}

impl Default for Bootstrap {
    /// A thousand repetitions from seed 1.
    fn default() -> Self {
        Self {
            replicates: 1000,
            seed: 1,
        }
    }
}

impl Bootstrap {
    /// Repeats `experiment`, which draws its standard normal errors from what it is given.
    ///
    /// # Errors
    /// [`ElasticityError::TooFewLoads`] where fewer than two repetitions have an answer.
    ///
    /// ```
    /// use tactile_elasticity::modulus::Bootstrap;
    /// let spread = Bootstrap { replicates: 4000, seed: 5 }.run(|normal| Some(3.0 + 0.1 * normal()))?;
    /// assert!((spread.standard_error - 0.1f64).abs() < 0.005 && spread.failed == 0);
    /// # Ok::<(), tactile_elasticity::ElasticityError>(())
    /// ```
    pub fn run(
        &self,
        mut experiment: impl FnMut(&mut dyn FnMut() -> f64) -> Option<f64>,
    ) -> Result<BootstrapSummary, ElasticityError> {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        let mut normal = || rng.sample::<f64, _>(StandardNormal);
        let mut all: Vec<f64> = (0..self.replicates)
            .map(|_| experiment(&mut normal).unwrap_or(f64::INFINITY))
            .collect();
        all.sort_by(f64::total_cmp);
        let good = all.partition_point(|x| x.is_finite());
        if good < 2 {
            return Err(ElasticityError::TooFewLoads {
                expected: 2,
                found: good,
            });
        }
        let mean = all[..good].iter().sum::<f64>() / good as f64;
        let squares: f64 = all[..good].iter().map(|x| (x - mean).powi(2)).sum();
        let quantile = |p: f64| all[((all.len() - 1) as f64 * p).round() as usize];
        Ok(BootstrapSummary {
            mean,
            standard_error: (squares / (good - 1) as f64).sqrt(),
            interval_95: [quantile(0.025), quantile(0.975)],
            failed: all.len() - good,
        })
    }

    /// Repeats an estimate with every measured quantity redrawn from its standard error, and all forces scaled by one common
    /// factor with the error that the loads share. Covariances are not redrawn.
    ///
    /// # Errors
    /// As [`run`](Self::run).
    pub fn modulus<T: RealField + Copy>(
        &self,
        estimator: &dyn ModulusEstimator<T>,
        series: &LoadSeries<T>,
    ) -> Result<BootstrapSummary, ElasticityError> {
        let scale_error = widen(series.shared_errors().force_scale);
        self.run(|normal| {
            let scale: T = narrow(1.0 + scale_error * normal());
            let redrawn = series.loads().iter();
            let redrawn: Vec<_> = redrawn.map(|l| redraw(l, scale, normal)).collect();
            estimator
                .estimate(&series.with_loads(redrawn))
                .ok()
                .map(|m| widen(m.youngs_modulus_pa))
        })
    }
}

fn redraw<T: RealField + Copy>(
    load: &LoadState<T>,
    scale: T,
    normal: &mut dyn FnMut() -> f64,
) -> LoadState<T> {
    let mut draw = |e: Estimate<T>, factor: T| Estimate {
        value: (e.value + e.standard_error * narrow(normal())) * factor,
        ..e
    };
    LoadState {
        force_n: draw(load.force_n, scale),
        contact_radius_m: load.contact_radius_m.map(|e| draw(e, T::one())),
        contact_area_m2: load.contact_area_m2.map(|e| draw(e, T::one())),
        indentation_m: load.indentation_m.map(|e| draw(e, T::one())),
        mean_strain: load.mean_strain.map(|e| draw(e, T::one())),
    }
}
