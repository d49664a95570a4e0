//! Sensors that darken with depth: contact by a threshold, depth by a table.
//!
//! Such a sensor measures shape, not force. The force must come from a gauge.
use super::contact::{ContactReading, ContactStage, FrameContact};
use super::error::PipelineError;
use crate::force::{Estimate, ForceError, Polarity, ReferenceFrame};
use crate::gel::DarkGel;
use crate::sfs::DepthTable;
use ndarray::ArrayView2;

/// The contact is the largest connected region that is darker than the reference by more than a
/// threshold.
///
/// ```
/// use ndarray::Array2;
/// use tactile_imaging::pipeline::{ContactStage, DarkContact, Object, Pipeline, SurfaceInput};
/// // A hundred grey levels of darkening are half a millimetre of depth.
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
    gel: DarkGel,
}

impl DarkContact {
    /// Darkening that counts as contact. It is above the noise of an 8-bit camera.
    pub const DEFAULT_THRESHOLD_GREY: f64 = 3.0;

    /// Creates the stage from a table of (darkness in grey levels, depth in metres), interpreted by
    /// [`depth_table`](Self::depth_table).
    ///
    /// # Errors
    /// [`PipelineError::DepthTable`], and [`PipelineError::Setting`] for sizes that are not positive.
    pub fn new(table: &[(f64, f64)], pixel_size_m: [f64; 2]) -> Result<Self, PipelineError> {
        let table = Self::depth_table(table)?;
        Ok(Self {
            pixel_size_m,
            gel: DarkGel::new(table, Self::DEFAULT_THRESHOLD_GREY, pixel_size_m)?,
        })
    }

    /// The gel, which also measures the other contacts.
    pub fn gel(&self) -> &DarkGel {
        &self.gel
    }

    /// The table as a reconstruction, with zero depth outside the contact.
    ///
    /// No darkness means no depth. A table with the entry (0, 0) is used unchanged. In other
    /// tables, depths are counted from a contact circle that was first visible at some darkness. If
    /// the table determines its zero, it is [zeroed](DepthTable::zeroed), otherwise it is used
    /// unchanged. Negative entries and entries at or below the contact threshold are dropped.
    ///
    /// ```
    /// use tactile_imaging::pipeline::DarkContact;
    /// // One level is 30 µm deep, and depth was counted from the first three visible levels.
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
        let found = self.gel.read(frame, image);
        let found = found.map_err(ForceError::custom)?;
        let background_step_grey = Some(found.background_step_grey);
        let Some(patch) = found.contacts.first() else {
            return Ok(FrameContact {
                background_step_grey,
                ..FrameContact::default()
            });
        };
        let mask = found.labels.mapv(|label| label == 1);
        let pixels = mask.iter().zip(frame).filter(|(inside, _)| **inside);
        let (count, black) = pixels.fold((0.0, 0.0), |(count, black), (_, level)| {
            (count + 1.0, black + f64::from(u8::from(*level == 0)))
        });
        let [hx, hy] = self.pixel_size_m;
        let pixel = (hx * hy).sqrt();
        let radius_px = (count / std::f64::consts::PI).sqrt();
        // Specks of noise are also regions, so other contacts are not counted.
        let reading = ContactReading {
            saturated_share: black / count,
            indentation_m: Some(patch.depth_m),
            centroid_px: patch.centroid_px,
            area_m2: patch.area_m2,
            peak_grey: patch.darkness_grey,
            out_of_calibration: patch.beyond_table,
            touches_edge: patch.touches_border,
            ..ContactReading::new(None, Estimate::new(radius_px * pixel, 0.5 * pixel))
        };
        Ok(FrameContact {
            background_step_grey,
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

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array2;

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
}
