//! A gel sensor of either kind.

use crate::colour::ColourSensor;
use crate::darkness::DarkSensor;
use crate::{BallPress, CalibrationReport, GelError, GelFrame, GelImage, GelModel};

/// A gel sensor: a gel lit in colours, or a gel that darkens where it is pressed.
///
/// It reads 8-bit frames, of three channels or of grey levels. [`calibrate`](Self::calibrate)
/// creates a sensor from presses of a ball, [`new`](Self::new) from its parameters.
///
/// ```
/// use ndarray::{Array2, s};
/// use tactile_gel::{DarkModel, GelSensor};
/// // A hundred grey levels of darkening are half a millimetre of depth.
/// let model = DarkModel::new(1e-4, vec![[0.0, 0.0], [100.0, 5e-4]]);
/// let reference = Array2::from_elem((64, 64), 200_u8);
/// let sensor = GelSensor::new(model, &reference)?;
/// let mut frame = reference.clone();
/// frame.slice_mut(s![10..30, 10..30]).fill(140);
/// frame.slice_mut(s![38..58, 38..58]).fill(120);
/// let found = sensor.read(&frame)?;
/// let depth = |k: usize| found.contacts[k].depth_below_far_m.value;
/// assert!((depth(0) - 3e-4).abs() < 1e-12 && (depth(1) - 4e-4).abs() < 1e-12);
/// # Ok::<(), tactile_gel::GelError>(())
/// ```
#[derive(Clone)]
pub struct GelSensor {
    kind: Kind,
    model: GelModel,
}

#[derive(Clone)]
enum Kind {
    Colour(ColourSensor),
    Dark(DarkSensor),
}

impl core::fmt::Debug for GelSensor {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("GelSensor")
            .field("model", &self.model)
            .field("shape", &self.shape())
            .finish_non_exhaustive()
    }
}

impl GelSensor {
    /// Creates a sensor from its parameters and its frame without contact.
    ///
    /// # Errors
    /// [`GelError::EmptyImage`], [`GelError::WrongImage`] for grey levels of a gel lit in colours
    /// and the reverse, [`GelError::ShapeMismatch`] unless there are three channels and 60
    /// coefficients, [`GelError::Surface`] for a table that does not increase,
    /// [`GelError::InvalidOption`] for a pixel size or threshold that is not positive, a coefficient
    /// that is not finite or a negative error.
    pub fn new<'a>(
        model: impl Into<GelModel>,
        reference: impl Into<GelImage<'a>>,
    ) -> Result<Self, GelError> {
        let (model, reference) = (model.into(), reference.into());
        model.check()?;
        let kind = match (&model, reference) {
            (GelModel::Colour(model), GelImage::Colour(reference)) => {
                Kind::Colour(ColourSensor::new(model.clone(), reference)?)
            }
            (GelModel::Dark(model), GelImage::Grey(reference)) => {
                Kind::Dark(DarkSensor::new(model.clone(), reference)?)
            }
            (GelModel::Colour(_), _) => return Err(GelError::WrongImage { colours: true }),
            (GelModel::Dark(_), _) => return Err(GelError::WrongImage { colours: false }),
        };
        Ok(Self { kind, model })
    }

    /// Calibrates a sensor from its frame without contact and at least three presses of balls: of a
    /// gel lit in colours if the reference has colours, otherwise of a gel that darkens.
    ///
    /// **Colours.** Circles and polynomial are determined alternately until no circle changes by a
    /// tenth of a pixel. The polynomial follows from the circles by ridge regression, and the
    /// circles from the contacts in its normals. Without drawn circles, the start is the region of
    /// large colour differences.
    ///
    /// A circle drawn by hand may be off by several pixels. The median offset between drawn and
    /// found circles is the user's convention for the edge of a contact, and is kept. Apart from
    /// this offset, the found circles are used. A drawn circle is wrong if it is off by more than
    /// three times the median misfit and more than a tenth of the ball's radius.
    ///
    /// **Darkness.** The depth z = c₁ d + c₂ d² of the darkness d is fitted to the caps of the
    /// balls, z = δ + √(R² − r²) − R, over the pixels with at least 0.6 of the largest darkness of
    /// their press, or inside the drawn circle. The depths δ of the presses are fitted with the
    /// table. The balls determine the shape; that no darkness is no depth is assumed.
    ///
    /// Errors come from leaving out one press at a time. They are the 68.3 % quantile of the
    /// differences to the ball. The common error of all slopes comes from the scatter of the
    /// presses, by Student's distribution for few presses.
    ///
    /// # Errors
    /// [`GelError::TooFewPresses`], [`GelError::ShapeMismatch`], [`GelError::WrongImage`],
    /// [`GelError::InvalidOption`] for lengths that are not positive, [`GelError::OtherFrames`] if
    /// most presses do not come from the sensor of the reference, [`GelError::NoSolution`].
    pub fn calibrate<'a>(
        reference: impl Into<GelImage<'a>>,
        pixel_size_m: f64,
        presses: &[BallPress<'_>],
    ) -> Result<(Self, CalibrationReport), GelError> {
        match reference.into() {
            GelImage::Colour(reference) => {
                let (sensor, report) = ColourSensor::calibrate(reference, pixel_size_m, presses)?;
                let model = sensor.model.clone().into();
                let kind = Kind::Colour(sensor);
                Ok((Self { kind, model }, report))
            }
            GelImage::Grey(reference) => {
                let (sensor, report) = DarkSensor::calibrate(reference, pixel_size_m, presses)?;
                let model = sensor.model.clone().into();
                let kind = Kind::Dark(sensor);
                Ok((Self { kind, model }, report))
            }
        }
    }

    /// The parameters.
    pub fn model(&self) -> &GelModel {
        &self.model
    }

    /// Size of a pixel on the gel in metres.
    pub fn pixel_size_m(&self) -> f64 {
        self.model.pixel_size_m()
    }

    /// The frame without contact.
    pub fn reference(&self) -> GelImage<'_> {
        match &self.kind {
            Kind::Colour(sensor) => sensor.reference().into(),
            Kind::Dark(sensor) => sensor.reference().into(),
        }
    }

    /// Whether dots are printed on a gel lit in colours: at least twelve dark patches of one size in
    /// the frame without contact. They are not taken for slopes, and [`GelMarkers`] follows them.
    ///
    /// [`GelMarkers`]: crate::GelMarkers
    pub fn has_dots(&self) -> bool {
        match &self.kind {
            Kind::Colour(sensor) => sensor.has_dots,
            Kind::Dark(_) => false,
        }
    }

    /// Number of rows and columns of its frames.
    pub fn shape(&self) -> (usize, usize) {
        self.reference().dim()
    }

    /// Gradients, face and contacts of a frame of the reference's size.
    ///
    /// A frame that does not come from this sensor has [`doubts`](GelFrame::doubts). If they
    /// [reject](crate::FrameDoubt::refuses) it, it has no contacts and its face is NaN.
    ///
    /// # Errors
    /// [`GelError::ShapeMismatch`], [`GelError::WrongImage`].
    pub fn read<'a>(&self, frame: impl Into<GelImage<'a>>) -> Result<GelFrame, GelError> {
        match (&self.kind, frame.into()) {
            (Kind::Colour(sensor), GelImage::Colour(frame)) => sensor.read(frame),
            (Kind::Dark(sensor), GelImage::Grey(frame)) => sensor.read(frame),
            (Kind::Colour(_), _) => Err(GelError::WrongImage { colours: true }),
            (Kind::Dark(_), _) => Err(GelError::WrongImage { colours: false }),
        }
    }
}
