//! Detection of the contact in a frame.

use ndarray::{ArrayView2, Axis, Slice};

use super::differences::greatest;
use super::noise;
use super::region::{Extent, Region};
use super::runs::Run;
use super::summary::Sums;
use super::threshold::quantile;
use super::workspace::DetectorWorkspace;
use super::{Contact, ContactOptions, Detection};
use crate::drift::{self, DriftCorrection, IlluminationDrift};
use crate::error::ForceError;
use crate::frame::{DifferenceNoise, ReferenceFrame, TILE_COLUMNS};
use tactile_core::BoundingBox;
use tactile_core::Estimate;

/// Finds the contact in frames of one sensor.
///
/// ```
/// use ndarray::Array2;
/// use tactile_force::{ContactDetector, ContactOptions, DetectorWorkspace, ReferenceFrame};
///
/// let reference = ReferenceFrame::new(Array2::from_elem((64, 64), 10).view())?;
/// let mut frame = Array2::from_elem((64, 64), 10);
/// frame.slice_mut(ndarray::s![20..30, 30..44]).fill(90);
/// let detector = ContactDetector::new(ContactOptions::default());
/// let mut workspace = DetectorWorkspace::default();
/// let found = detector.detect_with(&mut workspace, frame.view(), &reference)?;
/// let contact = found.contact.expect("a bright patch");
/// assert_eq!(contact.area_px, 140);
/// assert_eq!(contact.centroid_px[0].value, 36.5);
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactDetector {
    pub(super) options: ContactOptions,
}

impl ContactDetector {
    /// A detector with these options.
    pub fn new(options: ContactOptions) -> Self {
        Self { options }
    }

    /// The statistics of the frame and its contact, if there is one.
    ///
    /// # Errors
    /// The frame has not the reference's size, or too much of the contact is saturated.
    pub fn detect_with(
        &self,
        workspace: &mut DetectorWorkspace,
        frame: ArrayView2<'_, u8>,
        reference: &ReferenceFrame,
    ) -> Result<Detection, ForceError> {
        reference.check(frame)?;
        workspace.region.place = None;
        let sd = reference.difference_variance().sqrt();
        // Half of the false alarms go to single pixels (either sign), half to tiles.
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
        let Some(suspect) = self.suspect(
            &workspace.pass,
            reference,
            &statistics,
            &drift,
            sd,
            pixel_limit,
        ) else {
            return Ok(none);
        };
        let Some(extent) =
            self.segment(&mut workspace.region, frame, reference, &drift, suspect, sd)
        else {
            workspace.region.place = None;
            return Ok(none);
        };
        let peak = peak(&workspace.region);
        let noise = self.noise(workspace, reference, &drift, peak);
        let saturated = if self.options.polarity.sign() > 0 && statistics.saturated == 0 {
            0
        } else {
            self.saturated(&workspace.region, frame, extent.area)?
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
        if self.options.drift == DriftCorrection::None {
            return IlluminationDrift::none();
        }
        let Some(tiles) = reference.tile_sums(&workspace.pass.tiles) else {
            return IlluminationDrift::none();
        };
        drift::fit(self.options.drift, size, tiles, sd, &mut workspace.drift)
    }

    /// The mask in a region around the suspect pixels, which grows while the aperture meets its border.
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
            let z = quantile(self.options.false_alarm_rate, region.difference.len());
            let width = self
                .options
                .smoothing_px
                .unwrap_or_else(|| smoothing_width(z * sd, f64::from(signal)));
            let limit = z * sd / width as f64;
            let extent = region.segment(width, limit as f32, self.options.minimum_area_px);
            if extent.area < self.options.minimum_area_px {
                return None;
            }
            region.finish(self.options.margin_px);
            let needed = region
                .bounds(&region.mask)?
                .grown(self.options.margin_px + 1, frame.dim());
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
    ) -> DifferenceNoise {
        let DetectorWorkspace { region, noise, .. } = workspace;
        let (x, y) = region
            .bounds(&region.mask)
            .map_or((0.0, 0.0), |b| b.centre());
        // Flattening divides signal and noise alike.
        let (light, uncertain) = reference
            .flat_field()
            .map_or((1.0, 0.0), |f| (f.at(x, y), f.variance_at(x, y)));
        let flat_field = uncertain / (light * light);
        let background = reference.difference_variance() / (light * light);
        let [common, scale] = drift.variances(x, y);
        let gain = match reference.known_gain() {
            Some(gain) => gain / light,
            None => noise::gain(region, noise, background, peak),
        };
        DifferenceNoise {
            background,
            gain,
            common: common / (light * light),
            scale,
            flat_field,
        }
    }

    /// Number of saturated pixels of the mask; an error where their share exceeds the limit.
    fn saturated(
        &self,
        region: &Region,
        frame: ArrayView2<'_, u8>,
        area: usize,
    ) -> Result<usize, ForceError> {
        let frame = region.place.map_or(frame, |place| place.of(frame));
        let full = if self.options.polarity.sign() > 0 {
            u8::MAX
        } else {
            0
        };
        let in_run = |run: &Run| {
            let row = frame.row(run.row as usize);
            let row = row.slice_axis(Axis(0), Slice::from(run.start as usize..run.end as usize));
            match row.to_slice() {
                Some(pixels) => pixels.iter().filter(|p| **p == full).count(),
                None => row.iter().filter(|p| **p == full).count(),
            }
        };
        let saturated = region.mask.iter().map(in_run).sum();
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

/// The contact of a region.
fn summarise(
    region: &Region,
    sums: &Sums,
    extent: Extent,
    peak: f32,
    saturated_px: usize,
    size: (usize, usize),
    noise: &DifferenceNoise,
) -> Contact {
    let whole = BoundingBox {
        row_start: 0,
        row_end: size.0,
        column_start: 0,
        column_end: size.1,
    };
    let place = region.place.unwrap_or(whole);
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
        touches_edge: aperture.grown(1, size) != grown_freely(aperture),
    }
}

/// Greatest difference in the mask.
fn peak(region: &Region) -> f32 {
    let columns = region.columns();
    region
        .mask
        .iter()
        .map(|run| greatest(&region.difference[run.span(columns)]))
        .fold(0.0, f32::max)
}

/// The box one pixel larger on every side, whether or not the frame is; a box at the first row or column cannot be.
fn grown_freely(b: BoundingBox) -> BoundingBox {
    BoundingBox {
        row_start: b.row_start.wrapping_sub(1),
        row_end: b.row_end + 1,
        column_start: b.column_start.wrapping_sub(1),
        column_end: b.column_end + 1,
    }
}

/// The narrowest odd box for which the threshold on its mean, limit/width, is a tenth of the signal or less.
fn smoothing_width(limit: f64, signal: f64) -> usize {
    let width = (10.0 * limit / signal.max(1.0)).ceil().clamp(1.0, 31.0) as usize;
    width | 1
}
