//! Grey levels of a contact turned into pressures by a local curve.

use crate::calibration::{ForceReading, GreyHistogram, LocalCalibration};
use crate::contact::{Contact, Region};
use crate::error::ForceError;
use crate::frame::DifferenceNoise;
use crate::hertz::{LEVELS, PixelVariance};

/// Steps of a grey level at which the curve is tabulated and pixels are counted: rounding to a sixteenth adds 2 % to the smallest
/// variance that a grey level can have, that of rounding to whole ones.
const STEPS: usize = 16;
/// Entries of the table, from −256 grey levels on.
const TABLE: usize = 512 * STEPS + 1;
const LEAST: f32 = -256.0;
/// Pixels whose places in the table are computed at once, by SIMD instructions.
const BLOCK: usize = 64;

/// Force of a contact, and pascals per grey level of its integrated pixel value.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stress {
    pub(super) reading: ForceReading,
    pub(super) per_grey_pa: f64,
}

/// Buffers of the conversion, and its result for the last contact.
#[derive(Clone, Debug, Default)]
pub(super) struct Local {
    histogram: GreyHistogram,
    /// f at every step.
    table: Vec<f32>,
    /// Pixels of the aperture at every step.
    counts: Vec<u32>,
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
    pub(super) fn convert(
        &mut self,
        curve: &dyn LocalCalibration,
        region: &mut Region,
        contact: &Contact,
        noise: DifferenceNoise,
        pixel_area_m2: f64,
    ) -> Result<Stress, ForceError> {
        self.tabulate(curve);
        self.counts.clear();
        self.counts.resize(TABLE, 0);
        let columns = region.columns();
        for run in &region.aperture {
            let differences = &mut region.difference[run.span(columns)];
            for block in differences.chunks_mut(BLOCK) {
                let mut places = [0_u32; BLOCK];
                for (place, d) in places.iter_mut().zip(&*block) {
                    *place = place_of(*d);
                }
                for (d, place) in block.iter_mut().zip(places) {
                    let place = (place as usize).min(TABLE - 1);
                    self.counts[place] += 1;
                    *d = self.table[place];
                }
            }
        }
        self.histogram.clear(pixel_area_m2);
        for (k, count) in self.counts.iter().enumerate().filter(|(_, c)| **c > 0) {
            self.histogram
                .add_many(grey_at(k) as f32, f64::from(*count));
        }
        let reading = curve.read(&self.histogram, &noise)?;
        let integral = contact.integrated_pixel_value.value;
        let per_grey_pa = reading.force_n.value / (integral * pixel_area_m2);
        self.converted = Some(self.variances(noise, contact.peak, per_grey_pa));
        Ok(Stress {
            reading,
            per_grey_pa,
        })
    }

    /// f at every step, linear between whole grey levels as a histogram has it.
    fn tabulate(&mut self, curve: &dyn LocalCalibration) {
        self.table.clear();
        let whole = |grey: usize| curve.value_pa(f64::from(LEAST) + grey as f64);
        let mut below = whole(0);
        for grey in 0..512 {
            let above = whole(grey + 1);
            let step = (above - below) / STEPS as f64;
            self.table
                .extend((0..STEPS).map(|k| (below + step * k as f64) as f32));
            below = above;
        }
        self.table.push(below as f32);
    }

    /// Variance of a pressure, (slope over the noise)² σ², from zero to a fifth beyond the contact's peak.
    fn variances(&self, noise: DifferenceNoise, peak: f64, per_grey_pa: f64) -> Converted {
        let pressure = |grey: f64| {
            let place = (place_of(grey as f32) as usize).min(TABLE - 1);
            f64::from(self.table[place])
        };
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

/// The nearest step of a grey-level difference.
#[inline]
fn place_of(difference: f32) -> u32 {
    ((difference.clamp(-255.0, 255.0) - LEAST) * STEPS as f32 + 0.5) as i32 as u32
}

/// The grey level of a step.
fn grey_at(place: usize) -> f64 {
    f64::from(LEAST) + place as f64 / STEPS as f64
}
