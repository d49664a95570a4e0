//! Frame in, contact out.

use ndarray::ArrayView2;

use super::{Aperture, Contact, ContactOptions, component::Components, threshold::quantile};
use crate::frame::{PassWorkspace, TILE_COLUMNS, TILE_ROWS, Tiles};
use crate::{BoundingBox, Estimate, ForceError, FrameStatistics, Real, ReferenceFrame};

/// Finds the contact in frames of one sensor.
///
/// ```
/// use ndarray::Array2;
/// use tactile_force::{ContactDetector, ContactOptions, DetectorWorkspace, ReferenceFrame};
///
/// let reference = ReferenceFrame::new(Array2::from_elem((64, 64), 10).view())?;
/// let mut frame = Array2::from_elem((64, 64), 10);
/// frame.slice_mut(ndarray::s![20..30, 30..44]).fill(90);
/// let detector = ContactDetector::new(ContactOptions::default())?;
/// let mut workspace = DetectorWorkspace::default();
/// let (_, contact) = detector.detect_with::<f64>(&mut workspace, frame.view(), &reference)?;
/// let contact = contact.expect("a bright patch");
/// assert_eq!(contact.area_px, 140);
/// assert_eq!(contact.centroid_px[0].value, 36.5);
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactDetector {
    options: ContactOptions,
}

/// Buffers that detection reuses from frame to frame.
#[derive(Clone, Debug, Default)]
pub struct DetectorWorkspace {
    pub(crate) pass: PassWorkspace,
    pub(crate) aperture: Aperture,
    components: Components,
    smooth: Vec<i32>,
    column_sums: Vec<i32>,
}

impl DetectorWorkspace {
    /// The mask of the last contact found, one row per row of its region, and the region's place in the frame.
    pub fn mask(&self) -> Option<(BoundingBox, ArrayView2<'_, u8>)> {
        let region = self.aperture.region?;
        let view = ArrayView2::from_shape((region.rows(), region.columns()), &self.aperture.mask).ok()?;
        Some((region, view))
    }
}

impl ContactDetector {
    /// A detector with validated options.
    ///
    /// # Errors
    /// An option outside its domain.
    pub fn new(options: ContactOptions) -> Result<Self, ForceError> {
        options.validate()?;
        Ok(Self { options })
    }

    /// The options.
    pub fn options(&self) -> &ContactOptions {
        &self.options
    }

    /// The statistics of the frame and its contact, if there is one.
    ///
    /// # Errors
    /// The frame has not the reference's size, or too much of the contact is saturated.
    pub fn detect_with<T: Real>(
        &self,
        workspace: &mut DetectorWorkspace,
        frame: ArrayView2<'_, u8>,
        reference: &ReferenceFrame,
    ) -> Result<(FrameStatistics, Option<Contact<T>>), ForceError> {
        reference.check(frame)?;
        let sd = reference.difference_variance().sqrt();
        let pixels = frame.len();
        // Half of the false alarms go to single pixels, half to tiles.
        let pixel_limit = quantile(0.25 * self.options.false_alarm_rate, pixels) * sd;
        let statistics = reference.compare_with(&mut workspace.pass, frame, pixel_limit.min(255.0) as u8);
        workspace.aperture.region = None;
        let Some(suspect) = self.suspect(&workspace.pass.tiles, &statistics, sd) else {
            return Ok((statistics, None));
        };
        let region = suspect.grown(TILE_COLUMNS, frame.dim());
        let area = self.segment(workspace, frame, reference, region, sd);
        if area < self.options.minimum_area_px {
            workspace.aperture.region = None;
            return Ok((statistics, None));
        }
        workspace.aperture.grow(self.options.margin_px);
        let contact = self.summarise(&workspace.aperture, area, frame, reference)?;
        Ok((statistics, Some(contact)))
    }

    /// Box around every tile whose sum exceeds its noise, and every pixel that exceeds its own.
    fn suspect(&self, tiles: &Tiles, statistics: &FrameStatistics, sd: f64) -> Option<BoundingBox> {
        let z = quantile(0.5 * self.options.false_alarm_rate, tiles.sums.len());
        let limit = (z * sd * ((TILE_ROWS * TILE_COLUMNS) as f64).sqrt()).ceil() as i32;
        let sign = self.options.polarity.sign();
        let size = (statistics.rows, statistics.columns);
        let bright = tiles
            .sums
            .iter()
            .enumerate()
            .filter(|(_, s)| sign * **s > limit)
            .map(|(at, _)| tiles.pixels(at, size));
        bright.chain(statistics.bounding_box).reduce(BoundingBox::union)
    }

    /// Differences, mask and area inside a region.
    fn segment(
        &self,
        workspace: &mut DetectorWorkspace,
        frame: ArrayView2<'_, u8>,
        reference: &ReferenceFrame,
        region: BoundingBox,
        sd: f64,
    ) -> usize {
        let sign = self.options.polarity.sign() as i16;
        let aperture = &mut workspace.aperture;
        aperture.region = Some(region);
        aperture.difference.clear();
        let image = reference.image();
        let pairs = region.of(frame).into_iter().zip(region.of(image));
        aperture.difference.extend(pairs.map(|(&f, &r)| sign * (i16::from(f) - i16::from(r))));
        let z = quantile(self.options.false_alarm_rate, region.rows() * region.columns());
        let signal = f64::from(*aperture.difference.iter().max().unwrap_or(&0));
        let width = self.options.smoothing_px.unwrap_or_else(|| smoothing_width(z * sd, signal));
        box_sums(
            &aperture.difference,
            region.columns(),
            width,
            &mut workspace.column_sums,
            &mut workspace.smooth,
        );
        let limit = z * sd * width as f64;
        aperture.mask.clear();
        aperture.mask.extend(workspace.smooth.iter().map(|&s| u8::from(f64::from(s) > limit)));
        workspace.components.keep_largest(&mut aperture.mask, region.columns())
    }

    fn summarise<T: Real>(
        &self,
        aperture: &Aperture,
        area: usize,
        frame: ArrayView2<'_, u8>,
        reference: &ReferenceFrame,
    ) -> Result<Contact<T>, ForceError> {
        let region = aperture.region.unwrap_or(BoundingBox {
            row_start: 0,
            row_end: 1,
            column_start: 0,
            column_end: 1,
        });
        let sums = aperture.sums();
        let total = sums.sum as f64;
        let local = [sums.sum_x as f64 / total, sums.sum_y as f64 / total];
        let noise = reference.noise();
        let background = reference.difference_variance();
        let variance = background * sums.count as f64 + noise.gain * total.max(0.0);
        let spread = aperture.spread(local);
        let centroid_variance = |plain: f64, weighted: f64| {
            (background * plain + noise.gain * weighted.max(0.0)) / (total * total)
        };
        let saturated_px = self.saturated(aperture, frame, region);
        let share = saturated_px as f64 / area as f64;
        if share > self.options.saturation_limit {
            return Err(ForceError::SaturatedContact { share, limit: self.options.saturation_limit });
        }
        let peak =
            aperture.difference.iter().zip(&aperture.mask).filter(|(_, m)| **m == 1).map(|(d, _)| *d).max();
        Ok(Contact {
            bounding_box: mask_box(aperture, region),
            area_px: area,
            equivalent_radius_px: T::nearest((area as f64 / std::f64::consts::PI).sqrt()),
            integrated_pixel_value: Estimate::nearest(total, variance),
            centroid_px: [
                Estimate::nearest(
                    region.column_start as f64 + local[0],
                    centroid_variance(spread.xx, spread.xx_d),
                ),
                Estimate::nearest(
                    region.row_start as f64 + local[1],
                    centroid_variance(spread.yy, spread.yy_d),
                ),
            ],
            peak: T::nearest(f64::from(peak.unwrap_or(0))),
            aperture_px: sums.count,
            saturated_px,
            touches_edge: touches_edge(aperture, region, frame.dim()),
        })
    }

    fn saturated(&self, aperture: &Aperture, frame: ArrayView2<'_, u8>, region: BoundingBox) -> usize {
        let full = if self.options.polarity.sign() > 0 { u8::MAX } else { 0 };
        region.of(frame).iter().zip(&aperture.mask).filter(|(f, m)| **m == 1 && **f == full).count()
    }
}

/// The narrowest odd box for which the threshold on its mean, limit/width, is a tenth of the signal or less.
fn smoothing_width(limit: f64, signal: f64) -> usize {
    let width = (10.0 * limit / signal.max(1.0)).ceil().clamp(1.0, 31.0) as usize;
    width | 1
}

/// Sums over a box of odd width centred at every pixel; beyond the region there is nothing to add.
fn box_sums(difference: &[i16], columns: usize, width: usize, scratch: &mut Vec<i32>, sums: &mut Vec<i32>) {
    let (rows, half) = (difference.len() / columns, width / 2);
    scratch.clear();
    scratch.resize(columns, 0);
    sums.clear();
    sums.resize(difference.len(), 0);
    let row = |y: usize| &difference[y * columns..(y + 1) * columns];
    for y in 0..half.min(rows) {
        scratch.iter_mut().zip(row(y)).for_each(|(s, d)| *s += i32::from(*d));
    }
    for y in 0..rows {
        if y + half < rows {
            scratch.iter_mut().zip(row(y + half)).for_each(|(s, d)| *s += i32::from(*d));
        }
        if y > half {
            scratch.iter_mut().zip(row(y - half - 1)).for_each(|(s, d)| *s -= i32::from(*d));
        }
        let mut running: i32 = scratch[..half.min(columns)].iter().sum();
        for x in 0..columns {
            running += scratch.get(x + half).copied().unwrap_or(0);
            if x > half {
                running -= scratch[x - half - 1];
            }
            sums[y * columns + x] = running;
        }
    }
}

/// The tight box around the mask, in frame coordinates.
fn mask_box(aperture: &Aperture, region: BoundingBox) -> BoundingBox {
    let columns = region.columns();
    let mut tight: Option<BoundingBox> = None;
    for (y, row) in aperture.mask.chunks(columns).enumerate() {
        let first = row.iter().position(|m| *m == 1);
        let last = row.iter().rposition(|m| *m == 1);
        if let (Some(first), Some(last)) = (first, last) {
            let here = BoundingBox {
                row_start: region.row_start + y,
                row_end: region.row_start + y + 1,
                column_start: region.column_start + first,
                column_end: region.column_start + last + 1,
            };
            tight = Some(tight.map_or(here, |b| b.union(here)));
        }
    }
    tight.unwrap_or(region)
}

/// Whether the aperture reaches the frame's first or last row or column.
fn touches_edge(aperture: &Aperture, region: BoundingBox, (rows, columns): (usize, usize)) -> bool {
    let width = region.columns();
    let any = |mut at: Box<dyn Iterator<Item = usize>>| at.any(|k| aperture.grown[k] == 1);
    let height = region.rows();
    (region.row_start == 0 && any(Box::new(0..width)))
        || (region.row_end == rows && any(Box::new((height - 1) * width..height * width)))
        || (region.column_start == 0 && any(Box::new((0..height).map(move |y| y * width))))
        || (region.column_end == columns && any(Box::new((0..height).map(move |y| y * width + width - 1))))
}
