//! Sensors that grow darker with depth: contact by a threshold, depth by a table.
//!
//! Such a sensor measures shape, not force: a force must come from a gauge.
use super::contact::{ContactReading, ContactStage, FrameContact};
use super::error::PipelineError;
use crate::core::regions;
use crate::force::{
    BoundingBox, Estimate, ForceError, Polarity, ReferenceFrame, median_shift_outside,
};
use crate::sfs::DepthTable;
use ndarray::{Array2, ArrayView2};

/// Contact is the largest connected patch that is darker than the reference by more than a
/// threshold.
///
/// ```
/// use ndarray::Array2;
/// use tactile_imaging::pipeline::{ContactStage, DarkContact, Object, Pipeline, SurfaceInput};
/// // A hundred grey levels darker is half a millimetre deep.
/// let table = [(0.0, 0.0), (100.0, 0.5e-3)];
/// let contact = DarkContact::new(&table, [0.1e-3; 2])?;
/// assert_eq!(contact.pixel_size_m(), [0.1e-3; 2]);
/// let pipeline = Pipeline::new(contact, Object::sphere(4e-3))?
///     .with_surface(DarkContact::depth_table(&table)?, SurfaceInput::Signal);
/// // A stamp of 20 × 20 pixels, 0.3 mm deep.
/// let reference = Array2::from_elem((64, 64), 200_u8);
/// let mut frame = reference.clone();
/// frame.slice_mut(ndarray::s![20..40, 20..40]).fill(140);
/// let mut press = pipeline.press(reference.view())?;
/// press.add_frame(frame.view());
/// let depth = press.contact(0)?.and_then(|c| c.indentation_m).expect("a depth");
/// assert!((depth.value - 0.3e-3).abs() < 1e-9);
/// assert!((press.surface(0)?.surface.heights[[10, 10]] - 0.3e-3).abs() < 1e-9);
/// # Ok::<(), tactile_imaging::pipeline::PipelineError>(())
/// ```
#[derive(Clone, Debug)]
pub struct DarkContact {
    pixel_size_m: [f64; 2],
    threshold_grey: f64,
    table: DepthTable<f64>,
}

impl DarkContact {
    /// Darkening that counts as contact: above the noise of an 8-bit camera.
    pub const DEFAULT_THRESHOLD_GREY: f64 = 3.0;

    /// With a table of (darkness in grey levels, depth in metres), read as by
    /// [`depth_table`](Self::depth_table).
    ///
    /// # Errors
    /// [`PipelineError::DepthTable`].
    pub fn new(table: &[(f64, f64)], pixel_size_m: [f64; 2]) -> Result<Self, PipelineError> {
        let depth_table = Self::depth_table(table)?;
        Ok(Self {
            pixel_size_m,
            threshold_grey: Self::DEFAULT_THRESHOLD_GREY,
            table: depth_table,
        })
    }

    /// The table as a reconstruction, zero where there is no contact.
    ///
    /// No darkness is no depth. A table with the entry (0, 0) is read as it stands. Another counts
    /// its depths from a contact circle that was found at some darkness, and it is
    /// [zeroed](DepthTable::zeroed) where it determines its zero. Where it does not it is read as
    /// it stands. Entries at or below the threshold of contact and negative ones are left out.
    ///
    /// ```
    /// use tactile_imaging::pipeline::DarkContact;
    /// // A level is 30 µm deep, and depth was counted from where three levels were seen.
    /// let mut table: Vec<_> = (3..60).map(|s| (f64::from(s), 30e-6 * f64::from(s - 3))).collect();
    /// assert!((DarkContact::depth_table(&table)?.depth(10.0).0 - 0.30e-3).abs() < 1e-12);
    /// table.insert(0, (0.0, 0.0));
    /// assert!((DarkContact::depth_table(&table)?.depth(10.0).0 - 0.21e-3).abs() < 1e-12);
    /// # Ok::<(), tactile_imaging::pipeline::PipelineError>(())
    /// ```
    ///
    /// # Errors
    /// [`PipelineError::DepthTable`].
    pub fn depth_table(table: &[(f64, f64)]) -> Result<DepthTable<f64>, PipelineError> {
        let kept: Vec<_> = table
            .iter()
            .copied()
            .filter(|(d, z)| *d >= 0.0 && *z >= 0.0)
            .collect();
        let stands = DepthTable::new(&kept)
            .and_then(|t| t.with_contact_threshold(Self::DEFAULT_THRESHOLD_GREY))
            .map_err(PipelineError::DepthTable)?;
        if kept.contains(&(0.0, 0.0)) {
            return Ok(stands);
        }
        Ok(stands.clone().zeroed().unwrap_or(stands))
    }
}

impl ContactStage for DarkContact {
    fn measure(
        &self,
        frame: ArrayView2<'_, u8>,
        reference: &ReferenceFrame,
    ) -> Result<FrameContact, ForceError> {
        let image = reference.image();
        if frame.dim() != image.dim() {
            return Err(ForceError::SizeMismatch {
                expected: image.dim(),
                found: frame.dim(),
            });
        }
        let step_grey =
            light_step_grey(frame, image).filter(|step| step.abs() > self.threshold_grey);
        let step_grey = step_grey.unwrap_or(0.0);
        let darkness = |at: [usize; 2]| f64::from(image[at]) - f64::from(frame[at]) + step_grey;
        let patch = largest_patch(frame.dim(), |at| darkness(at) > self.threshold_grey);
        if patch.is_empty() {
            return Ok(FrameContact {
                background_step_grey: Some(step_grey),
                ..FrameContact::default()
            });
        }
        let mut mask = Array2::from_elem(frame.dim(), false);
        for &at in &patch {
            mask[at] = true;
        }
        let peak = patch.iter().map(|&at| darkness(at)).fold(0.0, f64::max);
        let saturated = patch.iter().filter(|&&at| frame[at] == 0).count();
        let saturated_share = saturated as f64 / patch.len() as f64;
        let reading = ContactReading {
            saturated_share,
            ..self.reading(&patch, frame.dim(), peak)
        };
        Ok(FrameContact {
            background_step_grey: Some(step_grey),
            ..FrameContact::new(reading, mask.view())
        })
    }

    fn polarity(&self) -> Polarity {
        Polarity::Darker
    }

    fn pixel_size_m(&self) -> [f64; 2] {
        self.pixel_size_m
    }
}

impl DarkContact {
    fn reading(
        &self,
        patch: &[[usize; 2]],
        (rows, columns): (usize, usize),
        peak: f64,
    ) -> ContactReading {
        let n = patch.len() as f64;
        let mean = |axis: usize| patch.iter().map(|p| p[axis] as f64).sum::<f64>() / n;
        // An outline uncertain by half a pixel, pixel by pixel, moves the centroid of a disc by
        // 1/√(2 a) of that.
        let radius_px = (n / std::f64::consts::PI).sqrt();
        let centroid_error = 0.5 / (2.0 * radius_px).sqrt();
        let [hx, hy] = self.pixel_size_m;
        let pixel = (hx * hy).sqrt();
        let (depth, in_table) = self.table.depth(peak);
        let (step, _) = self.table.depth(peak - 1.0);
        let at_edge = |&[row, column]: &[usize; 2]| {
            row == 0 || column == 0 || row + 1 == rows || column + 1 == columns
        };
        // Specks of noise are patches too: other contacts are not counted.
        ContactReading {
            indentation_m: Some(Estimate::new(depth, (depth - step).abs())),
            centroid_px: [mean(1), mean(0)].map(|value| Estimate::new(value, centroid_error)),
            area_m2: n * hx * hy,
            peak_grey: peak,
            out_of_calibration: !in_table,
            touches_edge: patch.iter().any(at_edge),
            ..ContactReading::new(None, Estimate::new(radius_px * pixel, 0.5 * pixel))
        }
    }
}

/// By how many grey levels all of the frame differs from the reference: the median of the
/// difference along the frame's border. `None` where that is a contact's which reaches most of the
/// border.
///
/// Half of the border is background unless the contact is larger than the frame. A step below the
/// threshold of a contact is no light: a gel darkens as much beside a contact, and its table of
/// depths was taken with that.
fn light_step_grey(frame: ArrayView2<'_, u8>, reference: ArrayView2<'_, u8>) -> Option<f64> {
    let (rows, columns) = frame.dim();
    // A sixteenth of the frame on each side.
    let (high, wide) = (rows.div_ceil(16), columns.div_ceil(16));
    let middle = BoundingBox {
        row_start: high,
        row_end: rows.saturating_sub(high),
        column_start: wide,
        column_end: columns.saturating_sub(wide),
    };
    let step = median_shift_outside(frame, reference, middle)?;
    Some(step.value)
}

/// The largest set of pixels `[row, column]` inside, connected by their sides. Empty where no pixel
/// is inside. O(pixels).
fn largest_patch(
    (rows, columns): (usize, usize),
    inside: impl Fn([usize; 2]) -> bool,
) -> Vec<[usize; 2]> {
    let place = |at: usize| [at / columns, at % columns];
    let mut open: Vec<bool> = (0..rows * columns).map(|at| inside(place(at))).collect();
    let larger = |first: Vec<usize>, other: Vec<usize>| match other.len() > first.len() {
        true => other,
        false => first,
    };
    let largest = regions(&mut open, columns).reduce(larger);
    largest.into_iter().flatten().map(place).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_that_changes_everywhere_is_no_contact() {
        let reference = ReferenceFrame::new(Array2::from_elem((64, 80), 120_u8).view()).unwrap();
        let stage = DarkContact::new(&[(0.0, 0.0), (100.0, 1e-3)], [1e-4; 2]).unwrap();
        for step in [-20_i16, -4, 0, 4, 20] {
            let level = |darker: i16| (120 + step - darker) as u8;
            let mut frame = Array2::from_elem((64, 80), level(0));
            let contact = |frame: &Array2<u8>| stage.measure(frame.view(), &reference).unwrap();
            assert!(contact(&frame).reading.is_none(), "{step}");
            for ((row, column), pixel) in frame.indexed_iter_mut() {
                if (20..40).contains(&row) && (30..60).contains(&column) {
                    *pixel = level(50);
                }
            }
            let depth = contact(&frame)
                .reading
                .and_then(|r| r.indentation_m)
                .unwrap();
            assert!((depth.value - 0.5e-3).abs() < 1e-12, "{step}: {depth}");
        }
    }

    #[test]
    fn the_largest_patch_wins_and_diagonals_do_not_connect() {
        let image = ndarray::array![[1, 0, 0, 1], [0, 1, 1, 1], [0, 0, 0, 0], [1, 1, 0, 0]];
        let patch = largest_patch(image.dim(), |at| image[at] == 1);
        assert_eq!(patch.len(), 4);
        assert!(patch.contains(&[0, 3]) && patch.contains(&[1, 1]));
        assert!(largest_patch((3, 3), |_| false).is_empty());
    }
}
