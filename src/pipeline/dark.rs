//! Sensors that darken with depth: contact by a threshold, depth by a table.
//!
//! Such a sensor measures shape, not force. The force must come from a gauge.
use super::contact::{ContactReading, ContactStage, FrameContact};
use super::error::PipelineError;
use crate::force::{Estimate, ForceError, Polarity, ReferenceFrame};
use crate::gel::{DarkModel, FrameDoubt, GelError, GelFrame, GelSensor};
use crate::sfs::DepthTable;
use ndarray::ArrayView2;
use tactile_core::Requirement;

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
    model: DarkModel,
}

impl DarkContact {
    /// Creates the stage from a table of (darkness in grey levels, depth in metres), interpreted by
    /// [`DarkModel`].
    ///
    /// # Errors
    /// [`PipelineError::DepthTable`], and [`PipelineError::Setting`] for sizes that are not positive.
    pub fn new(table: &[(f64, f64)], pixel_size_m: [f64; 2]) -> Result<Self, PipelineError> {
        for size in pixel_size_m {
            Requirement::Positive.check("pixel size", size)?;
        }
        let [x, y] = pixel_size_m;
        let entries = table.iter().map(|(darkness, depth)| [*darkness, *depth]);
        let model = DarkModel::new((x * y).sqrt(), entries.collect());
        model.depth_table().map_err(PipelineError::DepthTable)?;
        Ok(Self {
            pixel_size_m,
            model,
        })
    }

    /// The table as a reconstruction, with zero depth outside the contact.
    ///
    /// # Errors
    /// [`PipelineError::DepthTable`].
    pub fn depth_table(table: &[(f64, f64)]) -> Result<DepthTable<f64>, PipelineError> {
        let entries = table.iter().map(|(darkness, depth)| [*darkness, *depth]);
        let model = DarkModel::new(1.0, entries.collect());
        model.depth_table().map_err(PipelineError::DepthTable)
    }

    fn read(
        &self,
        frame: ArrayView2<'_, u8>,
        reference: ArrayView2<'_, u8>,
    ) -> Result<GelFrame, GelError> {
        let found = GelSensor::new(self.model.clone(), reference)?.read(frame)?;
        match found.doubts.iter().find(|doubt| doubt.refuses()) {
            Some(doubt) => Err(GelError::OtherFrame(*doubt)),
            None => Ok(found),
        }
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
        let found = self.read(frame, image).map_err(ForceError::custom)?;
        let background_step_grey = Some(found.background_step_grey);
        let Some(contact) = found.contacts.first() else {
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
        let levels = mask.iter().zip(frame).zip(image);
        let darkness = levels.map(|((inside, level), rest)| {
            f64::from(u8::from(*inside)) * (f64::from(*rest) - f64::from(*level))
        });
        let beyond = FrameDoubt::BeyondTable { contact: 0 };
        let [hx, hy] = self.pixel_size_m;
        let pixel = (hx * hy).sqrt();
        let radius_px = (count / std::f64::consts::PI).sqrt();
        // Specks of noise are also regions, so other contacts are not counted.
        let reading = ContactReading {
            saturated_share: black / count,
            indentation_m: Some(contact.depth_below_far_m),
            centroid_px: contact.centroid_px,
            area_m2: contact.area_m2.value,
            peak_grey: found.background_step_grey + darkness.fold(0.0, f64::max),
            out_of_calibration: found.doubts.contains(&beyond),
            touches_edge: contact.touches_border,
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
