//! The single pass over a frame, the reference it is compared with, and the noise of both.

use ndarray::{Array2, ArrayView2, Axis, AxisDescription, Slice, Zip};
use tactile_core::{BoundingBox, Estimate};

use crate::error::ForceError;
use crate::flat_field::{FlatField, LONGEST_SIDE};
use crate::noise::NoiseModel;
use crate::outline_box::{Pair, Tiled, tighten};
use crate::tiles::{TileSum, Tiles, scan};

/// The sum of the signed difference d = frame − reference over a whole frame, exact in integers,
/// and the box where the difference is large.
///
/// Differences keep their sign, because clamping negative ones to zero would turn noise into force.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct FrameStatistics {
    /// Number of rows.
    pub rows: usize,
    /// Number of columns.
    pub columns: usize,
    /// Σ d.
    pub sum: i64,
    /// Number of pixels with the value 255.
    pub saturated: usize,
    /// Box around all pixels with |d| above the threshold. `None` if there are none.
    pub bounding_box: Option<BoundingBox>,
}

/// A frame of the unpressed sensor with its noise and sums. It is prepared once and compared with
/// many frames.
///
/// ```
/// use ndarray::Array2;
/// use tactile_force::ReferenceFrame;
///
/// let frames = [20_u8, 21, 22].map(|grey| Array2::from_elem((40, 50), grey));
/// let reference = ReferenceFrame::from_frames(&frames.each_ref().map(|f| f.view()))?;
/// assert_eq!(reference.image()[[0, 0]], 21);
/// // Each pixel changed by one grey level from frame to frame.
/// assert!((reference.noise().read_variance - 1.0).abs() < 1e-9);
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Debug)]
pub struct ReferenceFrame {
    image: Array2<u8>,
    /// The mean of several frames, not rounded. `None` for a single frame.
    mean: Option<Array2<f32>>,
    frames: usize,
    noise: NoiseModel,
    flat: Option<FlatField>,
    /// Σ of the image.
    sum: i64,
    tiles: Tiles,
    /// Positions, pixels and sums of all tiles, used for frames equal to the reference.
    blank: Vec<TileSum>,
    /// Row and column of the pixels that are hot or dead, in ascending order.
    defects: Vec<(usize, usize)>,
    /// Relative change of the light over the squared distance from the middle of the frame.
    vignetting: Option<(f64, [f64; 2])>,
}

/// A pixel is hot or dead if it differs from all but one of its neighbours by this number of
/// standard deviations and of grey levels.
const DEFECT_SD: f64 = 10.0;
const DEFECT_GREY: f64 = 10.0;

/// Number of tiles that show the vignetting: enough for six coefficients to a thousandth, and a
/// twentieth of the tiles of a large frame.
const VIGNETTING_TILES: usize = 1500;

/// Largest share of defects. More of them are a texture of the sensor.
const MOST_DEFECTS: f64 = 1e-3;

/// Rows and columns of the two to four pixels beside a pixel.
pub(crate) fn neighbours(
    (row, column): (usize, usize),
    (rows, columns): (usize, usize),
) -> impl Iterator<Item = (usize, usize)> {
    [
        row.checked_sub(1).map(|r| (r, column)),
        (row + 1 < rows).then_some((row + 1, column)),
        column.checked_sub(1).map(|c| (row, c)),
        (column + 1 < columns).then_some((row, column + 1)),
    ]
    .into_iter()
    .flatten()
}

/// The hot and dead pixels of an image in standard layout.
fn defects_of(image: &Array2<u8>, sd: f64) -> Vec<(usize, usize)> {
    let (rows, columns) = image.dim();
    let limit = (DEFECT_SD * sd).clamp(DEFECT_GREY, 255.0) as u8;
    let pixels = image.as_slice().unwrap_or_default();
    let most = (MOST_DEFECTS * pixels.len() as f64) as usize;
    let mut found = Vec::new();
    for (row, line) in pixels.chunks(columns).enumerate() {
        let far = |a: u8, b: u8| a.abs_diff(b) > limit;
        // Most rows have no step of this size, which vector instructions find out.
        let steps = line.iter().zip(line.iter().skip(1));
        let largest = steps.fold(0, |largest, (a, b)| a.abs_diff(*b).max(largest));
        if largest <= limit {
            continue;
        }
        for column in 1..columns {
            if !far(line[column], line[column - 1]) {
                continue;
            }
            for column in [column - 1, column] {
                let near = neighbours((row, column), (rows, columns))
                    .filter(|&(r, c)| !far(line[column], pixels[r * columns + c]));
                if near.count() <= 1 && found.last() != Some(&(row, column)) {
                    found.push((row, column));
                }
            }
        }
        if found.len() > most {
            return Vec::new();
        }
    }
    found
}

/// Buffers of the pass.
#[derive(Clone, Debug, Default)]
pub(crate) struct PassWorkspace {
    /// Σ (frame − reference) for each tile.
    pub tiles: Tiles,
    /// A copy of frames that are not in standard layout.
    copy: Vec<u8>,
    /// The eight rows in progress.
    band: Vec<u8>,
}

impl ReferenceFrame {
    /// Creates a reference from one frame. Its noise is estimated from its second differences in
    /// both directions.
    ///
    /// # Errors
    /// An error for an empty image, or a side longer than 16384 pixels.
    pub fn new(image: ArrayView2<'_, u8>) -> Result<Self, ForceError> {
        Self::from_frames(&[image])
    }

    /// Creates a reference from the mean of several frames of the unpressed sensor. The noise of
    /// the mean decreases with their number, and the noise of a frame is measured from the changes
    /// of each pixel, independently of the texture of the image.
    ///
    /// # Errors
    /// An error for no frame, an empty frame, a side longer than 16384 pixels, or frames that
    /// differ in size.
    pub fn from_frames(frames: &[ArrayView2<'_, u8>]) -> Result<Self, ForceError> {
        let size = common_size(frames)?;
        let mean = (frames.len() > 1).then(|| mean_of(frames, size));
        // Rounded to the nearest integer, halves upwards. This is exact; the standard library's
        // rounding is a function call per pixel.
        let image = match &mean {
            None => frames[0].as_standard_layout().into_owned(),
            Some(mean) => mean.mapv(|m| (f64::from(m) + 0.5) as u8),
        };
        let noise = match &mean {
            None => NoiseModel::of_frame(frames[0]),
            Some(mean) => NoiseModel::of_repeats(frames, mean.view()),
        };
        let mut tiles = Tiles::default();
        let pixels = image.as_slice().unwrap_or_default();
        scan(pixels, size, &mut tiles, &mut Vec::new());
        let sum = tiles.total();
        if let Some(mean) = &mean {
            sum_means(mean.view(), &mut tiles);
        }
        let blank = (0..tiles.sums.len()).map(|k| tiles.blank(k, size));
        let mean_grey = sum as f64 / image.len() as f64;
        let mut reference = Self {
            mean,
            frames: frames.len(),
            noise,
            flat: None,
            sum,
            blank: blank.collect(),
            tiles,
            defects: defects_of(&image, noise.variance(mean_grey).sqrt()),
            vignetting: None,
            image,
        };
        let step = reference.tiles.sums.len().div_ceil(VIGNETTING_TILES).max(1);
        let flat = reference.fitted(step);
        reference.vignetting = flat.and_then(|flat| flat.by_distance());
        Ok(reference)
    }

    /// The quadratic through the brightness of one tile in `step`. `None` for a reference that is too
    /// dark.
    fn fitted(&self, step: usize) -> Option<FlatField> {
        let tiles = (0..self.tiles.sums.len()).step_by(step);
        let tiles = tiles.map(|k| self.tile_sum(&self.tiles, k));
        let flat = FlatField::fit(self.image.dim(), tiles, self.own_variance());
        flat.filter(|_| self.mean_grey() >= 1.0)
    }

    /// Corrects all differences for vignetting: divides them by the local brightness of the
    /// reference, relative to the centre of the frame and smoothed to a quadratic. A calibration is
    /// then valid for any position of the contact.
    ///
    /// This is correct if stray light and signal come through the same lens.
    ///
    /// # Errors
    /// An error if the reference is too dark to reveal vignetting: its mean is below one grey
    /// level.
    ///
    /// ```
    /// use ndarray::Array2;
    /// use tactile_force::ReferenceFrame;
    ///
    /// let even = ReferenceFrame::new(Array2::from_elem((80, 120), 40_u8).view())?;
    /// assert!(even.with_flat_field().is_ok());
    /// // A black reference reveals no vignetting.
    /// assert!(ReferenceFrame::new(Array2::zeros((80, 120)).view())?.with_flat_field().is_err());
    /// # Ok::<(), tactile_force::ForceError>(())
    /// ```
    pub fn with_flat_field(mut self) -> Result<Self, ForceError> {
        let mean = self.mean_grey();
        let too_dark = ForceError::ReferenceTooDark {
            mean,
            required: 1.0,
        };
        self.flat = Some(self.fitted(1).ok_or(too_dark)?);
        self.vignetting = None;
        Ok(self)
    }

    /// How far the light at a place differs from that in the middle of the frame because of the
    /// distance, as vignetting does: relative, from a quadratic through the reference. Zero with a
    /// [flat field](Self::with_flat_field), which corrects it, and if the light falls along one
    /// direction and rises along the other, which no lens does. O(tiles).
    ///
    /// ```
    /// use ndarray::Array2;
    /// use tactile_force::ReferenceFrame;
    ///
    /// // A tenth less light at 50 pixels from the middle.
    /// let image = Array2::from_shape_fn((81, 101), |(y, x)| {
    ///     let [x, y] = [x as f64 - 50.0, y as f64 - 40.0];
    ///     (200.0 * (1.0 - 0.1 * (x * x + y * y) / 2500.0)) as u8
    /// });
    /// let reference = ReferenceFrame::new(image.view())?;
    /// let far = reference.vignetting_at([80.0, 40.0]);
    /// assert!((far - 0.1 * 0.36).abs() < 2e-3);
    /// assert_eq!(reference.vignetting_at([50.0, 40.0]), 0.0);
    /// # Ok::<(), tactile_force::ForceError>(())
    /// ```
    #[must_use]
    pub fn vignetting_at(&self, [x, y]: [f64; 2]) -> f64 {
        self.vignetting.map_or(0.0, |(per_square_px, middle)| {
            per_square_px * ((x - middle[0]).powi(2) + (y - middle[1]).powi(2))
        })
    }

    /// The correction for vignetting. `None` if it was not requested.
    pub(crate) fn flat_field(&self) -> Option<FlatField> {
        self.flat
    }

    /// The image. For several frames it is the rounded mean.
    pub fn image(&self) -> ArrayView2<'_, u8> {
        self.image.view()
    }

    /// Noise of one pixel of one frame.
    pub fn noise(&self) -> NoiseModel {
        self.noise
    }

    /// Difference of the light in a frame without contact from that in the reference, in grey
    /// levels: the mean over the block of 8 × 8 pixels where it is largest. The last blocks end at
    /// the edge of the frame.
    ///
    /// `None` for a difference of up to 4 grey levels, which may be noise, and for images that
    /// differ in size. A larger difference means that the light has changed, or that frame and
    /// reference were swapped. O(pixels).
    ///
    /// ```
    /// use ndarray::Array2;
    /// use tactile_force::ReferenceFrame;
    ///
    /// let at_rest = Array2::from_elem((40, 50), 90_u8);
    /// let reference = ReferenceFrame::new(at_rest.view())?;
    /// let mut frame = Array2::from_elem((40, 50), 88_u8);
    /// assert_eq!(reference.background_shift(frame.view()), None);
    /// frame.slice_mut(ndarray::s![8..24, 16..32]).fill(20);
    /// assert_eq!(reference.background_shift(frame.view()), Some(-70.0));
    /// // A band of two columns at the right edge, in a block of eight.
    /// let mut frame = at_rest;
    /// frame.slice_mut(ndarray::s![.., 48..]).fill(50);
    /// assert_eq!(reference.background_shift(frame.view()), Some(-10.0));
    /// # Ok::<(), tactile_force::ForceError>(())
    /// ```
    #[must_use]
    pub fn background_shift(&self, frame: ArrayView2<'_, u8>) -> Option<f64> {
        let reference = self.image();
        if frame.dim() != reference.dim() || frame.is_empty() {
            return None;
        }
        // Smaller than measurable contacts, and large enough to average noise.
        let side = |length: usize| length.min(8);
        let (height, width) = (side(frame.nrows()), side(frame.ncols()));
        let starts = |length: usize| {
            (0..length)
                .step_by(8)
                .map(move |s| s.min(length - side(length)))
        };
        let blocks =
            starts(frame.nrows()).flat_map(|row| starts(frame.ncols()).map(move |c| [row, c]));
        let shift = blocks
            .map(|[row, column]| {
                let sides = [row..row + height, column..column + width].map(Slice::from);
                let part = |along: AxisDescription| sides[along.axis.index()];
                let (block, reference) =
                    (frame.slice_each_axis(part), reference.slice_each_axis(part));
                let both = block.iter().zip(reference);
                let sum: i32 = both.map(|(&f, &r)| i32::from(f) - i32::from(r)).sum();
                f64::from(sum) / block.len() as f64
            })
            .max_by(|a, b| a.abs().total_cmp(&b.abs()))?;
        (shift.abs() > 4.0).then_some(shift)
    }

    /// The shift of frame minus reference outside the box of a contact, in grey levels, from about
    /// 24 rows, with its standard error.
    ///
    /// It is the smaller of the median and the mean of the differences within three standard
    /// deviations of it, and zero if their signs differ: asymmetric noise moves the median, and the
    /// surroundings of a contact move the mean. Integer grey levels are treated as distributed
    /// uniformly over their width, so that a change of a fraction of a level is detected. `None` for
    /// fewer than 100 pixels and for images that differ in size. O(examined rows).
    ///
    /// ```
    /// use ndarray::Array2;
    /// use tactile_force::{BoundingBox, ReferenceFrame};
    ///
    /// let reference = ReferenceFrame::new(Array2::from_elem((40, 50), 90).view())?;
    /// // A fifth of the pixels is two levels darker, the others one.
    /// let mut frame =
    ///     Array2::from_shape_fn((40, 50), |(r, c)| if (r + c) % 5 == 0 { 88 } else { 89 });
    /// frame.slice_mut(ndarray::s![8..24, 16..32]).fill(20);
    /// let contact = BoundingBox { row_start: 8, row_end: 24, column_start: 16, column_end: 32 };
    /// let shift = reference.shift_outside(frame.view(), contact).expect("a frame");
    /// assert!((shift.value + 1.12).abs() < 0.02 && shift.standard_error < 0.03);
    /// // Noise that raises many pixels a little and lowers few pixels much is no shift.
    /// let noise = |r: usize, c: usize| if (r + c) % 3 == 0 { 88 } else { 91 };
    /// let frame = Array2::from_shape_fn((40, 50), |(r, c)| noise(r, c));
    /// let shift = reference.shift_outside(frame.view(), contact).expect("a frame");
    /// assert!(shift.value.abs() < 2.0 * shift.standard_error);
    /// let whole = BoundingBox::whole(frame.dim());
    /// assert_eq!(reference.shift_outside(frame.view(), whole), None);
    /// # Ok::<(), tactile_force::ForceError>(())
    /// ```
    #[must_use]
    pub fn shift_outside(
        &self,
        frame: ArrayView2<'_, u8>,
        contact: BoundingBox,
    ) -> Option<Estimate> {
        let reference = self.image();
        if frame.dim() != reference.dim() {
            return None;
        }
        // Two histograms in turn: most pixels change by the same amount, and a count that was just
        // written is not yet ready to be read.
        let mut counts = [[0_usize; 511]; 2];
        let mut total = 0;
        // Steps between the means of the rows show noise that the pixels of a row share.
        let (mut previous, mut steps, mut squares) = (None, 0.0, 0.0);
        let (rows, columns) = frame.dim();
        for row in (0..rows).step_by(rows / 24 + 1) {
            let is_beside = (contact.row_start..contact.row_end).contains(&row);
            let spans = if is_beside {
                [0..contact.column_start, contact.column_end..columns]
            } else {
                [0..columns, 0..0]
            };
            let (mut sum, mut length) = (0_i64, 0);
            for span in spans {
                length += span.len();
                let [frame, reference] = [frame, reference].map(|image| {
                    let row = image.index_axis_move(Axis(0), row);
                    row.slice_axis_move(Axis(0), Slice::from(span.clone()))
                });
                let mut turn = 0;
                Zip::from(frame).and(reference).for_each(|&f, &r| {
                    counts[turn][usize::from(255 + u16::from(f) - u16::from(r))] += 1;
                    sum += i64::from(f) - i64::from(r);
                    turn = 1 - turn;
                });
            }
            total += length;
            if length > 0 {
                let mean = sum as f64 / length as f64;
                if let Some(before) = previous.replace(mean) {
                    steps += 1.0;
                    squares += (mean - before).powi(2);
                }
            }
        }
        if total < 100 {
            return None;
        }
        let [mut counts, odd] = counts;
        counts
            .iter_mut()
            .zip(odd)
            .for_each(|(sum, odd)| *sum += odd);
        let quantile = |share: f64| {
            let wanted = share * total as f64;
            let mut below = 0.0;
            for (index, count) in counts.iter().enumerate() {
                let count = *count as f64;
                if count > 0.0 && below + count >= wanted {
                    return index as f64 - 255.5 + (wanted - below) / count;
                }
                below += count;
            }
            255.0
        };
        // The quartiles of a normal variable are 1.349 standard deviations apart. Noise below one
        // level still moves a pixel to the next.
        let sd = ((quantile(0.75) - quantile(0.25)) / 1.349).max(1.0);
        let middle = quantile(0.5);
        let near = (counts.iter().enumerate())
            .map(|(index, count)| (index as f64 - 255.0, *count as f64))
            .filter(|(shift, _)| (shift - middle).abs() <= 3.0 * sd);
        let sums = near.fold([0.0; 3], |[n, sum, squares], (shift, count)| {
            [
                n + count,
                sum + count * shift,
                squares + count * shift * shift,
            ]
        });
        let [pixels, mean, square] = [sums[0], sums[1] / sums[0], sums[2] / sums[0]];
        // The median of normal values has 1.253 times the error of their mean.
        let of_pixels = 1.253 * ((square - mean * mean).max(0.0) / pixels).sqrt();
        // A step has twice the variance of a row.
        let of_rows = (0.5 * squares / f64::max(steps, 1.0) / (steps + 1.0)).sqrt();
        let shift = match mean * middle > 0.0 {
            true => mean.abs().min(middle.abs()).copysign(mean),
            false => 0.0,
        };
        Some(Estimate::new(shift, of_pixels.max(of_rows)))
    }

    /// Compares a frame with the reference, exactly and in one pass over both. The frame must have
    /// the size of the reference. O(pixels).
    pub(crate) fn compare_with(
        &self,
        workspace: &mut PassWorkspace,
        frame: ArrayView2<'_, u8>,
        threshold: u8,
    ) -> FrameStatistics {
        let PassWorkspace { tiles, copy, band } = workspace;
        let pixels = frame.to_slice().unwrap_or_else(|| {
            copy.clear();
            copy.extend(frame.iter());
            copy
        });
        let saturated = scan(pixels, frame.dim(), tiles, band);
        let sum = tiles.total() - self.sum;
        let image = self.image.as_slice().unwrap_or_default();
        let pair = Pair {
            frame: Tiled {
                image: pixels,
                tiles,
            },
            reference: Tiled {
                image,
                tiles: &self.tiles,
            },
            size: frame.dim(),
        };
        let bounding_box = pair
            .tiles_above(threshold)
            .map(|b| tighten(b, [pixels, image], frame.ncols(), threshold));
        tiles
            .sums
            .iter_mut()
            .zip(&self.tiles.sums)
            .for_each(|(f, r)| *f -= r);
        FrameStatistics {
            rows: frame.nrows(),
            columns: frame.ncols(),
            sum,
            saturated,
            bounding_box,
        }
    }

    /// Row and column of the hot and dead pixels in a box. O(defects).
    pub(crate) fn defects_in(
        &self,
        place: BoundingBox,
    ) -> impl Iterator<Item = (usize, usize)> + '_ {
        let rows = place.row_start..place.row_end;
        let columns = place.column_start..place.column_end;
        let defects = self.defects.iter().copied();
        defects.filter(move |(r, c)| rows.contains(r) && columns.contains(c))
    }

    /// The image before rounding.
    pub(crate) fn levels(&self) -> Levels<'_> {
        match &self.mean {
            None => Levels::Whole(self.image.view()),
            Some(mean) => Levels::Fine(mean.view()),
        }
    }

    /// Mean grey level of the image.
    ///
    /// ```
    /// use ndarray::Array2;
    /// use tactile_force::ReferenceFrame;
    /// let reference = ReferenceFrame::new(Array2::from_elem((40, 60), 7).view())?;
    /// assert_eq!(reference.mean_grey(), 7.0);
    /// # Ok::<(), tactile_force::ForceError>(())
    /// ```
    #[must_use]
    pub fn mean_grey(&self) -> f64 {
        self.sum as f64 / self.image.len() as f64
    }

    /// Variance of one pixel's difference frame − reference outside contacts.
    pub(crate) fn difference_variance(&self) -> f64 {
        // The variance of one frame plus that of the mean, which is 1/n of it.
        self.own_variance() * (self.frames as f64 + 1.0)
    }

    /// Variance of one pixel of the reference.
    fn own_variance(&self) -> f64 {
        self.noise.variance(self.mean_grey()) / self.frames as f64
    }

    /// All tiles of the last pass. `None` if there was none, or if its frame had another size.
    pub(crate) fn tile_sums<'a>(
        &'a self,
        passed: &'a Tiles,
    ) -> Option<impl Iterator<Item = TileSum> + Clone + 'a> {
        let same = (passed.rows, passed.columns) == (self.tiles.rows, self.tiles.columns);
        let both = self.blank.iter().zip(&passed.sums);
        same.then(|| {
            both.map(|(blank, sum)| TileSum {
                difference: f64::from(*sum),
                ..*blank
            })
        })
    }

    /// One tile of the last pass.
    #[inline]
    pub(crate) fn tile_sum(&self, passed: &Tiles, tile: usize) -> TileSum {
        TileSum {
            difference: f64::from(passed.sums[tile]),
            ..self.blank[tile]
        }
    }

    pub(crate) fn check(&self, frame: ArrayView2<'_, u8>) -> Result<(), ForceError> {
        let (expected, found) = (self.image.dim(), frame.dim());
        if expected == found {
            Ok(())
        } else {
            Err(ForceError::SizeMismatch { expected, found })
        }
    }
}

/// The grey levels of a reference: a single frame, or the mean of several.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Levels<'a> {
    Whole(ArrayView2<'a, u8>),
    Fine(ArrayView2<'a, f32>),
}

/// The common size of all frames.
fn common_size(frames: &[ArrayView2<'_, u8>]) -> Result<(usize, usize), ForceError> {
    let size = frames.first().map_or((0, 0), |f| f.dim());
    let (rows, columns) = size;
    if rows == 0 || columns == 0 {
        return Err(ForceError::EmptyImage { rows, columns });
    }
    if rows.max(columns) > LONGEST_SIDE {
        return Err(ForceError::ImageTooLarge {
            found: rows.max(columns),
            limit: LONGEST_SIDE,
        });
    }
    match frames.iter().find(|f| f.dim() != size) {
        Some(other) => Err(ForceError::SizeMismatch {
            expected: size,
            found: other.dim(),
        }),
        None => Ok(size),
    }
}

/// The mean of the frames, pixel by pixel.
fn mean_of(frames: &[ArrayView2<'_, u8>], size: (usize, usize)) -> Array2<f32> {
    let n = frames.len() as f64;
    Array2::from_shape_fn(size, |at| {
        let total: u32 = frames.iter().map(|f| u32::from(f[at])).sum();
        (f64::from(total) / n) as f32
    })
}

/// The sums of the tiles from the mean of several frames, which is not rounded.
fn sum_means(mean: ArrayView2<'_, f32>, tiles: &mut Tiles) {
    for tile in 0..tiles.sums.len() {
        let pixels = tiles.pixels(tile, mean.dim()).of(mean);
        let sum: f64 = pixels.iter().map(|m| f64::from(*m)).sum();
        // Rounded after the summation: an error of at most half a grey level in a sum of 256
        // pixels.
        tiles.sums[tile] = sum.round() as i32;
    }
}

#[cfg(test)]
#[path = "frame_tests.rs"]
mod tests;
