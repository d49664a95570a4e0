//! The first stage: one frame to contact, force, centroid and radius.
mod bend;
mod light;
mod reading;

pub use light::LightContact;
pub use reading::{ContactReading, FrameContact};

use crate::force::{
    Estimate, ForceError, ForceWorkspace, LensGeometry, LocalCalibration, Polarity, ReferenceFrame,
};
use ndarray::{Array2, ArrayView2};
use std::sync::Arc;

/// One frame to contact and force.
///
/// ```
/// use ndarray::ArrayView2;
/// use tactile_imaging::force::{Estimate, ForceError, ForceWorkspace, Polarity, ReferenceFrame};
/// use tactile_imaging::pipeline::{ContactStage, FrameContact, LightContact, Object, Pipeline};
/// # use tactile_imaging::force::CalibrationPair;
/// # let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
/// # let hertz = |peak: f64| ndarray::Array2::from_shape_fn((64, 64), |(r, c)| {
/// #     let d = ((r as f64 - 32.0).hypot(c as f64 - 32.0) / 20.0).min(1.0);
/// #     10 + (peak * (1.0 - d * d).sqrt()).round() as u8
/// # });
/// /// The contact by its light, the force by a gauge.
/// struct Gauged(LightContact);
/// impl ContactStage for Gauged {
///     fn measure(
///         &self, workspace: &mut ForceWorkspace, frame: ArrayView2<'_, u8>, reference: &ReferenceFrame,
///         gauge: Option<Estimate>, contact: &mut FrameContact,
///     ) -> Result<(), ForceError> {
///         self.0.measure(workspace, frame, reference, gauge, contact)?;
///         if let Some(reading) = &mut contact.reading {
///             reading.force_n = gauge;
///         }
///         Ok(())
///     }
///     fn polarity(&self) -> Polarity { self.0.polarity() }
///     fn pixel_size_m(&self) -> [f64; 2] { self.0.pixel_size_m() }
/// }
/// let (reference, frame) = (hertz(0.0), hertz(120.0));
/// let stage = Gauged(LightContact::from_pairs(&pairs, [50e-6; 2])?);
/// // Neither a lens nor a local curve: coordinates stand as they are, shading is taken from the light.
/// assert!(stage.lens().is_none() && stage.pressure_curve().is_none());
/// let pipeline = Pipeline::new(stage, Object::sphere(3e-3))?;
/// let mut press = pipeline.press(reference.view())?;
/// press.add_gauged_frame(frame.view(), Some(Estimate::new(0.98, 1e-3)));
/// assert_eq!(press.contact(0)?.and_then(|c| c.force_n).map(|f| f.value), Some(0.98));
/// # Ok::<(), tactile_imaging::pipeline::PipelineError>(())
/// ```
pub trait ContactStage: Send + Sync {
    /// Measures `frame` against `reference`. `gauge` is a gauge's reading of the force, if there was one.
    ///
    /// # Errors
    /// [`ForceError`], such as a frame of another size or a saturated contact.
    fn measure(
        &self,
        workspace: &mut ForceWorkspace,
        frame: ArrayView2<'_, u8>,
        reference: &ReferenceFrame,
        gauge: Option<Estimate>,
        contact: &mut FrameContact,
    ) -> Result<(), ForceError>;

    /// Whether contact makes the frame brighter or darker.
    fn polarity(&self) -> Polarity;

    /// The size of a pixel in metres, x and y; that at the centre of distortion where there is a [`lens`](Self::lens).
    fn pixel_size_m(&self) -> [f64; 2];

    /// The lens that distorts, if there is one: control points are undistorted by it.
    fn lens(&self) -> Option<&LensGeometry> {
        None
    }

    /// The local curve from grey level to pressure, if there is one: shading is taken from pressures instead of light.
    fn pressure_curve(&self) -> Option<&dyn LocalCalibration> {
        None
    }

    /// The stage to take for objects that are known to have a flat face, if it saves work that only a ball's contact needs, such as the fit of its
    /// profile. The contact radius is then taken from the face's area.
    ///
    /// ```
    /// use tactile_imaging::pipeline::{ContactStage, LightContact};
    /// let light = LightContact::gauged([50e-6; 2], &Default::default())?;
    /// assert!(light.for_flat_faces().is_some(), "without the fit of Hertz's profile");
    /// # Ok::<(), tactile_imaging::pipeline::PipelineError>(())
    /// ```
    fn for_flat_faces(&self) -> Option<Arc<dyn ContactStage>> {
        None
    }
}

/// A stage behind a pointer is one.
macro_rules! forward {
    ($pointer:ident) => {
        impl<C: ContactStage + ?Sized> ContactStage for $pointer<C> {
            fn measure(
                &self,
                workspace: &mut ForceWorkspace,
                frame: ArrayView2<'_, u8>,
                reference: &ReferenceFrame,
                gauge: Option<Estimate>,
                contact: &mut FrameContact,
            ) -> Result<(), ForceError> {
                (**self).measure(workspace, frame, reference, gauge, contact)
            }

            fn polarity(&self) -> Polarity {
                (**self).polarity()
            }

            fn pixel_size_m(&self) -> [f64; 2] {
                (**self).pixel_size_m()
            }

            fn lens(&self) -> Option<&LensGeometry> {
                (**self).lens()
            }

            fn pressure_curve(&self) -> Option<&dyn LocalCalibration> {
                (**self).pressure_curve()
            }

            fn for_flat_faces(&self) -> Option<Arc<dyn ContactStage>> {
                (**self).for_flat_faces()
            }
        }
    };
}
forward!(Box);
forward!(Arc);

/// Gives an array a shape, keeping its memory where it is large enough.
pub(crate) fn resize<T: Clone + Default>(array: &mut Array2<T>, shape: (usize, usize)) {
    if array.dim() != shape {
        let (mut memory, _) = std::mem::take(array).into_raw_vec_and_offset();
        memory.clear();
        memory.resize(shape.0 * shape.1, T::default());
        if let Ok(resized) = Array2::from_shape_vec(shape, memory) {
            *array = resized;
        }
    }
}
