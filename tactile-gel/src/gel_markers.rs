//! Dots of a gel sensor, followed beside its face.

use nalgebra::Point2;

use crate::dots::grey;
use crate::marker_field::{MarkerField, MarkerSlip};
use crate::markers::{Marker, find_markers};
use crate::{GelError, GelFrame, GelImage, GelSensor};

/// The dots of a gel sensor, followed from frame to frame: the sideways motion of the face, for
/// [`GelForce::wrench`](crate::GelForce::wrench), and the slip of the first contact.
///
/// ```
/// use ndarray::{Array2, s};
/// use tactile_gel::{DarkModel, GelMarkers, GelSensor};
/// let dots = |shift: usize| {
///     let near = |v: usize| v % 16 >= 6 && v % 16 < 10;
///     Array2::from_shape_fn((96, 112), |(r, c)| match near(r) && near(c + 16 - shift) {
///         true => 40_u8,
///         false => 200,
///     })
/// };
/// let model = DarkModel::new(1e-4, vec![[0.0, 0.0], [100.0, 5e-4]]);
/// let sensor = GelSensor::new(model, &dots(0))?;
/// let mut markers = GelMarkers::new(&sensor);
/// let frame = dots(2);
/// let slip = markers.follow(&frame, &sensor.read(&frame)?)?;
/// let largest = markers.field().largest_px().expect("42 dots");
/// assert!((largest.value - 2.0).abs() < 0.1);
/// # let _ = slip;
/// # Ok::<(), tactile_gel::GelError>(())
/// ```
#[derive(Clone, Debug)]
pub struct GelMarkers {
    field: MarkerField,
    /// The field of the first frame of the present contact.
    touched: Option<MarkerField>,
}

impl GelMarkers {
    /// The dots of the frame without contact.
    pub fn new(sensor: &GelSensor) -> Self {
        Self {
            field: MarkerField::at_rest(&dots_of(sensor.reference())),
            touched: None,
        }
    }

    /// Follows the dots to the next frame, whose face is `reading`. The result is the slip of the
    /// first contact since it began: `None` without contact, with doubtful pairs, or with fewer than
    /// four dots under the contact.
    ///
    /// # Errors
    /// [`GelError::Markers`] for a frame with too few dots. The dots then stay where they were.
    pub fn follow<'a>(
        &mut self,
        frame: impl Into<GelImage<'a>>,
        reading: &GelFrame,
    ) -> Result<Option<MarkerSlip>, GelError> {
        self.field = self.field.followed(&dots_of(frame.into()))?;
        if reading.contacts.is_empty() {
            self.touched = None;
            return Ok(None);
        }
        // Doubtful pairs show no slip, and no start of a contact.
        if self.field.doubt.is_some() {
            return Ok(None);
        }
        let covers = |place: Point2<f64>| {
            let at = [place.y, place.x].map(|v| v.round().max(0.0) as usize);
            reading.labels.get(at) == Some(&1)
        };
        let start = self.touched.get_or_insert_with(|| self.field.clone());
        Ok(self.field.slip_since(start, covers))
    }

    /// The dots in the last frame.
    pub fn field(&self) -> &MarkerField {
        &self.field
    }
}

fn dots_of(image: GelImage<'_>) -> Vec<Marker> {
    match image {
        GelImage::Grey(levels) => find_markers(levels.mapv(f64::from).view()),
        GelImage::Colour(levels) => find_markers(grey(levels).view()),
    }
}
