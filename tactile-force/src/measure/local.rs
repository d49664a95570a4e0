//! Grey levels of a contact turned into pressures by a local curve.

use crate::calibration::{ForceReading, GreyHistogram, LocalCalibration};
use crate::contact::{Contact, Region};
use crate::estimate::{Estimate, Real};
use crate::frame::DifferenceNoise;
use crate::hertz::{LEVELS, PixelVariance};

/// Grey levels from −256 to 256, at which the curve is tabulated.
const TABLE: usize = 513;
const LEAST: f32 = -256.0;

/// Force of a contact, and pascals per grey level of its integrated pixel value.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stress<T> {
    pub(super) reading: ForceReading<T>,
    pub(super) per_grey_pa: T,
}

/// Buffers of the conversion, and its result for the last contact.
#[derive(Clone, Debug, Default)]
pub(super) struct Local {
    histogram: GreyHistogram,
    /// f at whole grey levels.
    table: Vec<f32>,
    converted: Option<Converted>,
}

#[derive(Clone, Debug)]
struct Converted {
    per_grey_pa: f64,
    /// Variance of a pixel's pressure, at even steps of the pressure.
    variance: [f64; LEVELS],
    step: f64,
}

impl Local {
    pub(super) fn clear(&mut self) {
        self.converted = None;
    }

    /// Pascals per grey level over the last contact, if it was converted.
    pub(super) fn per_grey_pa(&self) -> Option<f64> {
        self.converted.as_ref().map(|c| c.per_grey_pa)
    }

    /// The variance of the pixels that the profile is fitted to.
    pub(super) fn variance<'a>(&'a self, noise: &'a DifferenceNoise) -> PixelVariance<'a> {
        match &self.converted {
            Some(c) => PixelVariance::Pressure {
                values: &c.variance,
                step: c.step,
            },
            None => PixelVariance::Grey(noise),
        }
    }

    /// Reads the force off the histogram of the aperture and turns the aperture's differences into pressures.
    pub(super) fn convert<T: Real>(
        &mut self,
        curve: &dyn LocalCalibration,
        region: &mut Region,
        contact: &Contact<T>,
        noise: DifferenceNoise,
        pixel_area_m2: f64,
    ) -> Stress<T> {
        self.table.clear();
        let grey = |k: usize| f64::from(LEAST) + k as f64;
        self.table
            .extend((0..TABLE).map(|k| curve.pressure_pa(grey(k)).value as f32));
        self.histogram.clear(pixel_area_m2);
        let columns = region.columns();
        for run in &region.aperture {
            for d in &mut region.difference[run.span(columns)] {
                self.histogram.add(*d);
                *d = lookup(&self.table, *d);
            }
        }
        let reading = curve.read(&self.histogram, &noise);
        let integral = contact.integrated_pixel_value.value.as_f64();
        let per_grey_pa = reading.force_n.value / (integral * pixel_area_m2);
        self.converted = Some(self.variances(noise, contact.peak.as_f64(), per_grey_pa));
        Stress {
            reading: rounded(reading),
            per_grey_pa: T::nearest(per_grey_pa),
        }
    }

    /// Variance of a pressure, (slope over the noise)² σ², from zero to a fifth beyond the contact's peak.
    fn variances(&self, noise: DifferenceNoise, peak: f64, per_grey_pa: f64) -> Converted {
        let pressure = |grey: f64| f64::from(lookup(&self.table, grey as f32));
        let highest = pressure(1.2 * peak).max(f64::MIN_POSITIVE);
        let step = highest / (LEVELS - 1) as f64;
        let mut grey = 0.0;
        let variance = std::array::from_fn(|k| {
            // Levels rise, and so do the grey levels that they belong to.
            while pressure(grey) < step * k as f64 && grey < 256.0 {
                grey += 0.25;
            }
            let variance = noise.background + noise.gain * grey;
            let sd = variance.sqrt();
            let slope = (pressure(grey + sd) - pressure(grey - sd)) / (2.0 * sd);
            // A curve that is level over the noise has no less than a thousandth of the mean slope.
            slope.max(1e-3 * per_grey_pa).powi(2) * variance
        });
        Converted {
            per_grey_pa,
            variance,
            step,
        }
    }
}

/// Linear interpolation between whole grey levels.
#[inline]
fn lookup(table: &[f32], grey: f32) -> f32 {
    let place = grey.clamp(-255.0, 255.0) - LEAST;
    let below = place as usize;
    let share = place - below as f32;
    table[below] + share * (table[below + 1] - table[below])
}

fn rounded<T: Real>(reading: ForceReading<f64>) -> ForceReading<T> {
    ForceReading {
        force_n: Estimate {
            value: T::nearest(reading.force_n.value),
            standard_error: T::nearest(reading.force_n.standard_error),
        },
        noise_n: T::nearest(reading.noise_n),
        calibration_n: T::nearest(reading.calibration_n),
        degrees_of_freedom: reading.degrees_of_freedom.map(T::nearest),
        out_of_range: reading.out_of_range,
    }
}
