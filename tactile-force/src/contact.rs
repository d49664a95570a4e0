//! Contact detection against the noise, and the sums over a contact.
//!
//! A frame is first tested in one pass. A contact is suspected if a pixel, or
//! a tile of 8 × 32 pixels, differs from the reference by more than its noise permits at the stated
//! false-alarm rate *per frame*. Only there a mask is computed: smoothing if the contact is faint,
//! threshold, selection of the largest component, filling of its holes. Sums run over the mask
//! extended by a margin (the *aperture*) with signed differences, so that the edge, where the
//! signal is below the noise, is not cut off.

use ndarray::{ArrayView2, Axis, Slice};
use tactile_core::{BoundingBox, Estimate, Polarity, Requirement};

use crate::drift::{self, DriftCorrection, FitWorkspace, IlluminationDrift, RootOfPixels};
use crate::error::ForceError;
use crate::frame::{FrameStatistics, PassWorkspace, ReferenceFrame};
use crate::noise::DifferenceNoise;
use crate::region::{Extent, NoiseWorkspace, Region, Sums, gain, greatest};
use crate::runs::Run;
use crate::tiles::{TILE_COLUMNS, Tiles};

/// Pixels by which the mask is extended to the aperture that is summed. Beyond 4 pixels the blurred
/// edge of a sharp lens is below the noise, and a wider margin only adds noise to the force.
const MARGIN_PX: usize = 4;

/// One contact. Its mask is in the workspace.
///
/// ```
/// use ndarray::Array2;
/// use tactile_force::{Contact, ForceMeter, ReferenceFrame};
///
/// let mut frame = Array2::from_elem((64, 64), 12_u8);
/// let reference = ReferenceFrame::new(frame.view())?;
/// frame.slice_mut(ndarray::s![20..40, 20..40]).fill(90);
/// frame[[30, 30]] = 255;
/// let meter = ForceMeter::new([20e-6; 2], &Default::default())?;
/// let contact: Contact = meter
///     .detect_with(&mut Default::default(), frame.view(), &reference)?
///     .expect("contact");
/// assert_eq!((contact.area_px, contact.peak, contact.touches_edge), (400, 243.0, false));
/// assert_eq!(contact.saturated_px, 1);
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct Contact {
    /// Box around the mask.
    pub bounding_box: BoundingBox,
    /// Number of pixels in the mask.
    pub area_px: usize,
    /// Radius of the circle with the area of the mask, √(area/π), in pixels.
    pub equivalent_radius_px: f64,
    /// Σ d over the aperture, positive for a contact of either polarity.
    pub integrated_pixel_value: Estimate,
    /// Intensity centroid [x, y] in pixels, equations (7) and (8).
    pub centroid_px: [Estimate; 2],
    /// Largest difference inside the mask.
    pub peak: f64,
    /// Number of pixels in the aperture.
    pub aperture_px: usize,
    /// Saturated pixels in the mask (255 if brighter, 0 if darker).
    pub saturated_px: usize,
    /// Number of other contact regions in the frame's region, each at least a hundredth as large as
    /// this one. They are not part of it.
    pub other_contacts: usize,
    /// Whether the aperture reaches the edge of the frame, so that part of the contact may be
    /// missing.
    pub touches_edge: bool,
}

/// The result of detection in one frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Detection {
    /// Sums over the whole frame.
    pub statistics: FrameStatistics,
    /// The correction of illumination and stray light.
    pub drift: IlluminationDrift,
    /// The noise from which the errors are computed. `None` without contact.
    pub noise: Option<DifferenceNoise>,
    /// The contact. `None` if there is none.
    pub contact: Option<Contact>,
}

/// Options of contact detection.
///
/// ```
/// use tactile_force::{ContactOptions, DriftCorrection, ForceError, Polarity};
///
/// let options = ContactOptions::default()
///     .with_polarity(Polarity::Brighter)
///     .with_drift(DriftCorrection::None)
///     .with_saturation_limit(0.05)?
///     .with_false_alarm_rate(1e-6)?;
/// assert_ne!(options, ContactOptions::default());
/// assert!(options.with_false_alarm_rate(0.0).is_err());
/// # Ok::<(), ForceError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ContactOptions {
    pub(crate) polarity: Polarity,
    #[cfg_attr(feature = "serde", serde(deserialize_with = "read::false_alarm_rate"))]
    false_alarm_rate: f64,
    drift: DriftCorrection,
    #[cfg_attr(feature = "serde", serde(deserialize_with = "read::saturation_limit"))]
    saturation_limit: f64,
}

impl Default for ContactOptions {
    /// Brighter contact, one false alarm in a thousand frames, drift correction if the frame
    /// reveals the drift, and at most 1 % of the contact saturated.
    fn default() -> Self {
        Self {
            polarity: Polarity::Brighter,
            false_alarm_rate: 1e-3,
            drift: DriftCorrection::Automatic,
            saturation_limit: 0.01,
        }
    }
}

impl ContactOptions {
    /// Sets whether a contact is brighter or darker than the reference.
    pub fn with_polarity(mut self, polarity: Polarity) -> Self {
        self.polarity = polarity;
        self
    }

    /// Sets the probability that a frame without contact is mistaken for one with contact.
    ///
    /// # Errors
    /// An error for a rate that is not between zero and one.
    pub fn with_false_alarm_rate(mut self, rate: f64) -> Result<Self, ForceError> {
        self.false_alarm_rate = Requirement::OpenUnitInterval.check("false_alarm_rate", rate)?;
        Ok(self)
    }

    /// Sets which change of illumination or stray light is corrected.
    pub fn with_drift(mut self, correction: DriftCorrection) -> Self {
        self.drift = correction;
        self
    }

    /// Sets the maximum fraction of saturated pixels above which the force of a contact is
    /// rejected.
    ///
    /// # Errors
    /// An error for a fraction outside zero to one.
    pub fn with_saturation_limit(mut self, share: f64) -> Result<Self, ForceError> {
        self.saturation_limit = Requirement::UnitInterval.check("saturation_limit", share)?;
        Ok(self)
    }
}

/// Values read from a file are validated like values set in code.
#[cfg(feature = "serde")]
mod read {
    use serde::{Deserialize, Deserializer, de::Error};

    use super::ContactOptions;

    pub(super) fn false_alarm_rate<'de, D: Deserializer<'de>>(d: D) -> Result<f64, D::Error> {
        let options = ContactOptions::default().with_false_alarm_rate(f64::deserialize(d)?);
        options
            .map(|o| o.false_alarm_rate)
            .map_err(D::Error::custom)
    }

    pub(super) fn saturation_limit<'de, D: Deserializer<'de>>(d: D) -> Result<f64, D::Error> {
        let options = ContactOptions::default().with_saturation_limit(f64::deserialize(d)?);
        options
            .map(|o| o.saturation_limit)
            .map_err(D::Error::custom)
    }
}

/// Buffers that detection reuses from frame to frame.
#[derive(Clone, Debug, Default)]
pub(crate) struct DetectorWorkspace {
    pass: PassWorkspace,
    pub(crate) region: Region,
    noise: NoiseWorkspace,
    /// Sums over the columns of a region.
    columns: Vec<f64>,
    drift: FitWorkspace,
}

/// Components with fewer pixels are noise.
const MINIMUM_AREA_PX: usize = 4;

/// A contact whose peak is below this number of standard deviations of the noise is faint. It is
/// judged again by the scatter of the frame, which exceeds the noise of a reference that is a mean
/// of frames in 8 bits, and contains rows or columns that differ.
const FAINT: f64 = 20.0;

/// Finds the contact in frames of one sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ContactDetector {
    pub(crate) options: ContactOptions,
}

impl ContactDetector {
    /// The statistics of the frame and its contact. The contact is `None` if there is none.
    ///
    /// # Errors
    /// An error if the size of the frame differs from that of the reference, or if too much of the
    /// contact is saturated.
    pub(crate) fn detect_with(
        &self,
        workspace: &mut DetectorWorkspace,
        frame: ArrayView2<'_, u8>,
        reference: &ReferenceFrame,
    ) -> Result<Detection, ForceError> {
        reference.check(frame)?;
        workspace.region.place = None;
        let mut sd = reference.difference_variance().sqrt();
        // Half of the false alarms are assigned to single pixels (of either sign), half to tiles.
        let pixel_limit =
            (quantile(0.25 * self.options.false_alarm_rate, frame.len()) * sd).min(255.0);
        let statistics = reference.compare_with(&mut workspace.pass, frame, pixel_limit as u8);
        let drift = self.drift(workspace, reference, frame.dim(), sd);
        let none = Detection {
            statistics,
            drift,
            noise: None,
            contact: None,
        };
        // Sessions allocate nothing after their first frames.
        workspace.columns.clear();
        workspace.columns.reserve(workspace.pass.tiles.sums.len());
        let pass = &workspace.pass;
        let mut suspect = self.suspect(pass, reference, &statistics, &drift, sd, pixel_limit);
        let (extent, peak) = loop {
            // Frames without contact end here, after one pass.
            let Some(bounds) = suspect else {
                workspace.region.place = None;
                return Ok(none);
            };
            let region = &mut workspace.region;
            let Some(extent) = self.segment(region, frame, reference, &drift, bounds, sd) else {
                workspace.region.place = None;
                return Ok(none);
            };
            let peak = peak(region);
            let seen = match f64::from(peak) < FAINT * sd {
                true => {
                    let sizes = &mut workspace.columns;
                    scatter(reference, &workspace.pass.tiles, &drift, sizes)
                }
                false => 0.0,
            };
            if seen <= sd {
                break (extent, peak);
            }
            sd = seen;
            suspect = self.bright_tiles(&workspace.pass.tiles, reference, frame.dim(), &drift, sd);
        };
        let noise = self.noise(workspace, reference, &drift, peak, sd);
        let saturated = if self.options.polarity.sign() > 0 && statistics.saturated == 0 {
            0
        } else {
            self.saturated(&workspace.region, frame, reference, extent.area)?
        };
        let contact = summarise(
            &workspace.region,
            &Sums::over(&workspace.region, &mut workspace.columns),
            extent,
            peak,
            saturated,
            frame.dim(),
            &noise,
        );
        Ok(Detection {
            statistics,
            drift,
            noise: Some(noise),
            contact: Some(contact),
        })
    }

    fn drift(
        &self,
        workspace: &mut DetectorWorkspace,
        reference: &ReferenceFrame,
        size: (usize, usize),
        sd: f64,
    ) -> IlluminationDrift {
        match reference.tile_sums(&workspace.pass.tiles) {
            Some(tiles) if self.options.drift != DriftCorrection::None => {
                let sign = f64::from(self.options.polarity.sign());
                drift::fit(
                    self.options.drift,
                    size,
                    tiles,
                    sd,
                    sign,
                    &mut workspace.drift,
                )
            }
            _ => IlluminationDrift::default(),
        }
    }

    /// Computes the mask in a region around the suspect pixels. The region grows while the aperture
    /// reaches its border.
    fn segment(
        &self,
        region: &mut Region,
        frame: ArrayView2<'_, u8>,
        reference: &ReferenceFrame,
        drift: &IlluminationDrift,
        suspect: BoundingBox,
        sd: f64,
    ) -> Option<Extent> {
        let sign = self.options.polarity.sign() as f32;
        let mut place = suspect.grown(TILE_COLUMNS, frame.dim());
        loop {
            let signal = region.load(frame, reference, place, drift, sign);
            // The number of trials is that of the region's pixels, because the whole frame was
            // tested before.
            let z = quantile(self.options.false_alarm_rate, region.difference.len());
            let width = smoothing_width(z * sd, f64::from(signal));
            let limit = z * sd / width as f64;
            let extent = region.segment(width, limit as f32, MINIMUM_AREA_PX);
            if extent.area < MINIMUM_AREA_PX {
                return None;
            }
            region.finish(MARGIN_PX);
            let needed = region
                .bounds(&region.mask)?
                .grown(MARGIN_PX + 1, frame.dim());
            // The mask and its margin are inside the region, so its border has cut nothing off.
            if needed.union(place) == place {
                return Some(extent);
            }
            place = needed.union(place).grown(TILE_COLUMNS, frame.dim());
        }
    }

    fn noise(
        &self,
        workspace: &mut DetectorWorkspace,
        reference: &ReferenceFrame,
        drift: &IlluminationDrift,
        peak: f32,
        sd: f64,
    ) -> DifferenceNoise {
        let DetectorWorkspace { region, noise, .. } = workspace;
        let (x, y) = region
            .bounds(&region.mask)
            .map_or((0.0, 0.0), |b| b.centre());
        // Flattening divides signal and noise equally.
        let (light, uncertain) = reference
            .flat_field()
            .map_or((1.0, 0.0), |f| (f.at(x, y), f.variance_at(x, y)));
        let flat_field = uncertain / (light * light);
        let background = sd * sd / (light * light);
        let [common, scale] = drift.variances(x, y);
        DifferenceNoise {
            background,
            gain: gain(region, noise, background, peak),
            common: common / (light * light),
            scale,
            flat_field,
        }
    }

    /// Number of saturated pixels in the mask. An error if their fraction exceeds the limit.
    fn saturated(
        &self,
        region: &Region,
        frame: ArrayView2<'_, u8>,
        reference: &ReferenceFrame,
        area: usize,
    ) -> Result<usize, ForceError> {
        let place = region.place.unwrap_or(BoundingBox::whole(frame.dim()));
        let frame = place.of(frame);
        let full = if self.options.polarity.sign() > 0 {
            u8::MAX
        } else {
            0
        };
        let in_run = |run: &Run| {
            let row = frame.row(run.row as usize);
            let row = row.slice_axis(Axis(0), Slice::from(run.start as usize..run.end as usize));
            row.iter().filter(|p| **p == full).count()
        };
        let saturated: usize = region.mask.iter().map(in_run).sum();
        // Hot and dead pixels were replaced by their neighbours.
        let defects = reference.defects_in(place).filter(|&(row, column)| {
            let at = (row - place.row_start, column - place.column_start);
            frame[at] == full && region.pixels[at.0 * place.columns() + at.1] == 1
        });
        let saturated = saturated - defects.count().min(saturated);
        let (share, limit) = (
            saturated as f64 / area as f64,
            self.options.saturation_limit,
        );
        if share > limit {
            Err(ForceError::SaturatedContact { share, limit })
        } else {
            Ok(saturated)
        }
    }
}

/// Computes the contact of a region.
fn summarise(
    region: &Region,
    sums: &Sums,
    extent: Extent,
    peak: f32,
    saturated_px: usize,
    size: (usize, usize),
    noise: &DifferenceNoise,
) -> Contact {
    let place = region.place.unwrap_or(BoundingBox::whole(size));
    let local = sums.centroid();
    let origin = [place.column_start as f64, place.row_start as f64];
    let centroid =
        |k: usize| Estimate::from_variance(origin[k] + local[k], sums.centroid_variance(k, noise));
    let aperture = region.bounds(&region.aperture).unwrap_or(place);
    Contact {
        bounding_box: region.bounds(&region.mask).unwrap_or(place),
        area_px: extent.area,
        equivalent_radius_px: (extent.area as f64 / std::f64::consts::PI).sqrt(),
        integrated_pixel_value: Estimate::from_variance(sums.sum(), sums.variance(noise)),
        centroid_px: [centroid(0), centroid(1)],
        peak: f64::from(peak),
        aperture_px: region.aperture.iter().map(Run::len).sum(),
        saturated_px,
        other_contacts: extent.others,
        touches_edge: aperture.row_start == 0
            || aperture.column_start == 0
            || aperture.row_end == size.0
            || aperture.column_end == size.1,
    }
}

/// Largest difference in the mask.
fn peak(region: &Region) -> f32 {
    let columns = region.columns();
    region
        .mask
        .iter()
        .map(|run| greatest(&region.difference[run.span(columns)]))
        .fold(0.0, f32::max)
}

/// The narrowest odd box for which the threshold of its mean, limit/width, is at most a tenth of
/// the signal.
fn smoothing_width(limit: f64, signal: f64) -> usize {
    let width = (10.0 * limit / signal.max(1.0)).ceil().clamp(1.0, 31.0) as usize;
    width | 1
}

impl ContactDetector {
    /// Box around all tiles whose sum exceeds its noise, and all pixels that exceed theirs.
    fn suspect(
        &self,
        pass: &PassWorkspace,
        reference: &ReferenceFrame,
        statistics: &FrameStatistics,
        drift: &IlluminationDrift,
        sd: f64,
        pixel_limit: f64,
    ) -> Option<BoundingBox> {
        let size = (statistics.rows, statistics.columns);
        let bright = self.bright_tiles(&pass.tiles, reference, size, drift, sd);
        // Pixels were compared with their limit before the drift was known. This is valid while the
        // drift is well below the limit.
        let pixels = statistics
            .bounding_box
            .filter(|_| drift.greatest_grey(size, reference.mean_grey()) < 0.3 * pixel_limit);
        bright.into_iter().chain(pixels).reduce(BoundingBox::union)
    }

    /// Box around all tiles whose sum exceeds its noise.
    fn bright_tiles(
        &self,
        tiles: &Tiles,
        reference: &ReferenceFrame,
        size: (usize, usize),
        drift: &IlluminationDrift,
        sd: f64,
    ) -> Option<BoundingBox> {
        // The sum of n pixels has √n times the noise of one.
        let z = quantile(0.5 * self.options.false_alarm_rate, tiles.sums.len()) * sd;
        let sign = self.options.polarity.sign();
        let mut root = RootOfPixels::default();
        let mut stands_out = |k: usize| {
            let tile = reference.tile_sum(tiles, k);
            f64::from(sign) * drift.residual(&tile) > z * root.of(tile.pixels)
        };
        // The last tile of a band is the smallest. If all sums of a band are below the noise of
        // that tile, the band has no bright tile.
        let below_noise = |band: usize| {
            drift.is_zero() && {
                let last = reference.tile_sum(tiles, (band + 1) * tiles.columns - 1);
                f64::from(tiles.greatest(band, sign)) <= z * last.pixels.sqrt()
            }
        };
        let of_band = |band: usize| band * tiles.columns..(band + 1) * tiles.columns;
        (0..tiles.rows)
            .filter(|&band| !below_noise(band))
            .flat_map(of_band)
            .filter(|&k| stands_out(k))
            .map(|k| tiles.pixels(k, size))
            .reduce(BoundingBox::union)
    }
}

/// Standard deviation of the noise per pixel from the sums of the tiles, if it exceeds that by
/// chance. Zero if the tiles are too few. A contact on up to two thirds of the tiles does not reach
/// the third that determines it.
fn scatter(
    reference: &ReferenceFrame,
    tiles: &Tiles,
    drift: &IlluminationDrift,
    sizes: &mut Vec<f64>,
) -> f64 {
    // Fewer tiles determine the third to a quarter of itself, with four standard errors to itself.
    const FEWEST: usize = 32;
    let Some(sums) = reference.tile_sums(tiles) else {
        return 0.0;
    };
    sizes.clear();
    sizes.extend(sums.map(|tile| drift.residual(&tile).abs() / tile.pixels.sqrt()));
    if sizes.len() < FEWEST {
        return 0.0;
    }
    let (third, count) = (sizes.len() / 3, sizes.len() as f64);
    let (_, size, _) = sizes.select_nth_unstable_by(third, f64::total_cmp);
    let by_chance = 1.0 + 4.0 * 1.3 / count.sqrt();
    *size / drift::THIRD / by_chance
}

/// The z with P(N > z) = rate / trials for a standard normal N: among `trials` values, the
/// probability that any exceeds z is at most `rate`.
fn quantile(rate: f64, trials: usize) -> f64 {
    let tail = rate / trials.max(1) as f64;
    // The start is above the quantile. Newton's method on the logarithm of the tail, which is
    // concave, decreases from there to the quantile.
    let mut z = (-2.0 * tail.ln()).sqrt();
    for _ in 0..60 {
        let upper = 0.5 * libm::erfc(z * std::f64::consts::FRAC_1_SQRT_2);
        let density = (-0.5 * z * z).exp() / std::f64::consts::TAU.sqrt();
        let step = upper * (upper / tail).ln() / density;
        z += step;
        if step.abs() <= f64::EPSILON * z.abs() {
            break;
        }
    }
    z
}
