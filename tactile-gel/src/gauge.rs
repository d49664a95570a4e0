//! Forces calibrated with a gauge alone, from its readings under a set of frames.
//!
//! Neither the layer nor its modulus needs to be known. The volume V displaced by the face is the
//! integral of its displacement over the contacts. For bodies of one shape on one gel the force
//! follows F = c Vᵐ. The exponent m is 3/5 for a ball on a half-space by Hertz's law, and 1 for a
//! flat punch. Exponent and factor come from a line through ln V and ln F.

use tactile_core::{Estimate, Requirement};

use crate::{GelError, GelFrame};

/// Minimum number of readings: the line has two parameters, and its scatter needs several more.
const LEAST_READINGS: usize = 4;
/// Factor outside the range of readings above which forces are extrapolated too far.
const BEYOND: f64 = 1.5;

/// Normal forces from the volume of the contacts by a fitted line, for bodies of the shape used for
/// the fit.
///
/// ```
/// # use ndarray::Array2;
/// # use tactile_gel::GelError;
/// use tactile_gel::GaugeForce;
/// // Volumes in cubic metres and gauge readings in newtons.
/// let readings = [(1e-10, 0.1), (2e-10, 0.155), (4e-10, 0.228), (8e-10, 0.352), (16e-10, 0.528)];
/// let law = GaugeForce::of_volumes(&readings)?;
/// assert!((law.exponent() - 0.6).abs() < 0.01);
/// let force = law.at_volume(5e-10);
/// assert!((force.value - 0.1 * 5_f64.powf(0.6)).abs() < 2.0 * force.standard_error);
/// # Ok::<(), GelError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(try_from = "GaugeNumbers", into = "GaugeNumbers")
)]
pub struct GaugeForce {
    /// Means of ln V and ln F, and the slope.
    mean: [f64; 2],
    exponent: f64,
    /// Sum of squares of ln V about its mean, and residual variance of ln F.
    spread: f64,
    variance: f64,
    count: f64,
    range: [f64; 2],
}

impl GaugeForce {
    /// Fits the line to frames and gauge readings in newtons. O(n) for n frames.
    ///
    /// # Errors
    /// [`GelError::NoContact`] for a frame without contact, [`GelError::SeveralContacts`] for a
    /// frame with several, whose force is shared, and the errors of
    /// [`of_volumes`](Self::of_volumes).
    pub fn fit(readings: &[(&GelFrame, f64)]) -> Result<Self, GelError> {
        let volumes = readings
            .iter()
            .map(|(frame, force)| match frame.volumes_m3()[..] {
                [volume] => Ok((volume, *force)),
                [] => Err(GelError::NoContact),
                _ => Err(GelError::SeveralContacts),
            });
        Self::of_volumes(&volumes.collect::<Result<Vec<_>, GelError>>()?)
    }

    /// Fits the line to volumes in cubic metres and readings in newtons.
    ///
    /// # Errors
    /// [`GelError::TooFewPresses`] for fewer than four, [`GelError::InvalidOption`] for a value
    /// that is not positive, [`GelError::NoSolution`] if all volumes are equal or the force does
    /// not increase with the volume.
    pub fn of_volumes(readings: &[(f64, f64)]) -> Result<Self, GelError> {
        if readings.len() < LEAST_READINGS {
            return Err(GelError::TooFewPresses {
                needed: LEAST_READINGS,
                available: readings.len(),
            });
        }
        for (volume, force) in readings {
            Requirement::Positive.check("volume", *volume)?;
            Requirement::Positive.check("gauge reading", *force)?;
        }
        let count = readings.len() as f64;
        let logs = readings.iter().map(|(v, f)| [v.ln(), f.ln()]);
        let mean = [0, 1].map(|k: usize| logs.clone().map(|log| log[k]).sum::<f64>() / count);
        let about = logs.clone().map(|[v, f]| [v - mean[0], f - mean[1]]);
        let spread: f64 = about.clone().map(|[v, _]| v * v).sum();
        let exponent = about.clone().map(|[v, f]| v * f).sum::<f64>() / spread;
        if spread.is_nan() || exponent.is_nan() || exponent <= 0.0 {
            return Err(GelError::NoSolution);
        }
        let left: f64 = about.map(|[v, f]| (f - exponent * v).powi(2)).sum();
        let volumes = readings.iter().map(|(volume, _)| *volume);
        Ok(Self {
            mean,
            exponent,
            spread,
            variance: left / (count - 2.0),
            count,
            range: [
                volumes.clone().fold(f64::INFINITY, f64::min),
                volumes.fold(0.0, f64::max),
            ],
        })
    }

    /// Relative standard deviation of the readings about the line.
    pub fn scatter(&self) -> f64 {
        self.variance.sqrt()
    }

    /// The exponent m.
    pub fn exponent(&self) -> f64 {
        self.exponent
    }

    /// The normal force of each contact in newtons, for a body of that shape.
    pub fn forces(&self, frame: &GelFrame) -> Vec<Estimate> {
        let volumes = frame.volumes_m3().into_iter();
        volumes.map(|volume| self.at_volume(volume)).collect()
    }

    /// The force in newtons under a volume in cubic metres.
    ///
    /// The error applies to one more reading: the scatter of the readings plus the error of the
    /// line. It is infinite for volumes outside the range of the readings by more than half.
    pub fn at_volume(&self, volume_m3: f64) -> Estimate {
        let away = volume_m3.ln() - self.mean[0];
        let force = (self.mean[1] + self.exponent * away).exp();
        let share = self.variance * (1.0 + 1.0 / self.count + away * away / self.spread);
        let [low, high] = self.range;
        let seen = (low / BEYOND..=high * BEYOND).contains(&volume_m3);
        let error = if seen {
            force * share.sqrt()
        } else {
            f64::INFINITY
        };
        Estimate::new(force, error).with_degrees_of_freedom(self.count - 2.0)
    }
}

impl GelFrame {
    /// The volume in cubic metres displaced by each contact, below the level of the gel far away.
    pub fn volumes_m3(&self) -> Vec<f64> {
        let mut sums = vec![(0.0, 0.0); self.contacts.len()];
        for (depth, label) in self.depth_m.iter().zip(&self.labels) {
            let contact = usize::from(*label).checked_sub(1);
            if let Some((depths, pixels)) = contact.and_then(|k| sums.get_mut(k)) {
                *depths += depth.max(0.0);
                *pixels += 1.0;
            }
        }
        let each = sums.iter().zip(&self.contacts);
        each.map(|((depths, pixels), contact)| {
            depths * contact.area_m2.value / f64::max(*pixels, 1.0)
        })
        .collect()
    }
}

/// The parameters of a [`GaugeForce`] in the file format.
#[cfg(feature = "serde")]
#[derive(serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct GaugeNumbers {
    mean_log_volume_m3: f64,
    mean_log_force_n: f64,
    exponent: f64,
    log_volume_spread: f64,
    log_force_variance: f64,
    readings: f64,
    volumes_m3: [f64; 2],
}

#[cfg(feature = "serde")]
impl From<GaugeForce> for GaugeNumbers {
    fn from(law: GaugeForce) -> Self {
        Self {
            mean_log_volume_m3: law.mean[0],
            mean_log_force_n: law.mean[1],
            exponent: law.exponent,
            log_volume_spread: law.spread,
            log_force_variance: law.variance,
            readings: law.count,
            volumes_m3: law.range,
        }
    }
}

#[cfg(feature = "serde")]
impl TryFrom<GaugeNumbers> for GaugeForce {
    type Error = tactile_core::InvalidOption;

    fn try_from(of: GaugeNumbers) -> Result<Self, Self::Error> {
        Requirement::Finite.check("mean_log_volume_m3", of.mean_log_volume_m3)?;
        Requirement::Finite.check("mean_log_force_n", of.mean_log_force_n)?;
        Requirement::Positive.check("exponent", of.exponent)?;
        Requirement::Positive.check("log_volume_spread", of.log_volume_spread)?;
        Requirement::NonNegative.check("log_force_variance", of.log_force_variance)?;
        // The line has two fitted parameters.
        Requirement::Positive.check("readings - 2", of.readings - 2.0)?;
        for volume in of.volumes_m3 {
            Requirement::Positive.check("volumes_m3", volume)?;
        }
        Ok(Self {
            mean: [of.mean_log_volume_m3, of.mean_log_force_n],
            exponent: of.exponent,
            spread: of.log_volume_spread,
            variance: of.log_force_variance,
            count: of.readings,
            range: of.volumes_m3,
        })
    }
}
