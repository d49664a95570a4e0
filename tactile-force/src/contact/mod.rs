//! Where the object touches: detection against the noise, the mask, and what is summed over it.
//!
//! A frame is first judged by the one pass over it ([`FrameStatistics`]): contact is suspected where one pixel, or one tile of
//! 8 × 32 pixels, differs from the reference by more than its noise allows at the stated false-alarm rate *per frame*.
//! Only there the mask is made: smooth if the contact is faint, threshold, keep the largest component, fill its holes.
//! Sums run over the mask grown by a margin (the *aperture*), with the sign of every difference kept, so that the rim,
//! where the signal drowns in the noise, is not cut off.

mod detector;
mod noise;
mod region;
mod runs;
mod summary;
mod suspect;
mod threshold;

pub use detector::{ContactDetector, DetectorWorkspace};

pub(crate) use region::Region;

use crate::{
    BoundingBox, DifferenceNoise, Drift, DriftCorrection, Estimate, ForceError, FrameStatistics,
    Real, error::Requirement,
};

/// Whether pressing makes the image brighter (light leaks out) or darker (light is blocked).
///
/// ```
/// use ndarray::Array2;
/// use tactile_force::{ContactDetector, ContactOptions, Detection, Polarity, ReferenceFrame};
///
/// let mut frame = Array2::from_elem((64, 64), 120_u8);
/// let reference = ReferenceFrame::new(frame.view())?;
/// frame.slice_mut(ndarray::s![20..40, 20..40]).fill(60);
/// let options = ContactOptions { polarity: Polarity::Darker, ..ContactOptions::default() };
/// let found: Detection<f64> =
///     ContactDetector::new(options)?.detect_with(&mut Default::default(), frame.view(), &reference)?;
/// assert_eq!(found.contact.map(|c| c.integrated_pixel_value.value), Some(400.0 * 60.0));
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Polarity {
    /// Contact is brighter than the reference.
    #[default]
    Brighter,
    /// Contact is darker than the reference.
    Darker,
}

impl Polarity {
    pub(crate) fn sign(self) -> i32 {
        match self {
            Self::Brighter => 1,
            Self::Darker => -1,
        }
    }
}

/// How a contact is found.
///
/// ```
/// use tactile_force::{ContactDetector, ContactOptions};
///
/// let options = ContactOptions { false_alarm_rate: 1e-6, margin_px: 6, ..ContactOptions::default() };
/// assert_eq!(ContactDetector::new(options)?.options().margin_px, 6);
/// assert!(ContactDetector::new(ContactOptions { false_alarm_rate: 0.0, ..options }).is_err());
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ContactOptions {
    /// Sign of the signal.
    pub polarity: Polarity,
    /// Probability that a frame without contact is taken for one with contact; default 0.001.
    pub false_alarm_rate: f64,
    /// Width of the smoothing box in pixels, odd; `None` picks the narrowest that puts the threshold below a tenth of
    /// the contact's signal (1, no smoothing, for all but faint contacts).
    pub smoothing_px: Option<usize>,
    /// By how many pixels the mask is grown to the aperture; default 4.
    pub margin_px: usize,
    /// Components smaller than this are noise; default 4.
    pub minimum_area_px: usize,
    /// Which change of the light is corrected; default none.
    pub drift: DriftCorrection,
    /// The share of saturated pixels of the contact beyond which its force is refused; default 0.01.
    pub saturation_limit: f64,
}

impl Default for ContactOptions {
    fn default() -> Self {
        Self {
            polarity: Polarity::Brighter,
            false_alarm_rate: 1e-3,
            smoothing_px: None,
            margin_px: 4,
            minimum_area_px: 4,
            drift: DriftCorrection::None,
            saturation_limit: 0.01,
        }
    }
}

impl ContactOptions {
    pub(crate) fn validate(&self) -> Result<(), ForceError> {
        Requirement::OpenUnitInterval.check("false_alarm_rate", self.false_alarm_rate)?;
        Requirement::UnitInterval.check("saturation_limit", self.saturation_limit)?;
        Requirement::AtLeastOne.check("minimum_area_px", self.minimum_area_px as f64)?;
        self.smoothing_px
            .map_or(Ok(()), |w| Requirement::Odd.check("smoothing_px", w as f64))
    }
}

/// One contact. Its mask stays in the workspace.
///
/// ```
/// use ndarray::Array2;
/// use tactile_force::{ContactDetector, ContactOptions, Detection, ReferenceFrame};
///
/// let mut frame = Array2::from_elem((64, 64), 12_u8);
/// let reference = ReferenceFrame::new(frame.view())?;
/// frame.slice_mut(ndarray::s![20..40, 20..40]).fill(90);
/// frame[[30, 30]] = 255;
/// let found: Detection<f64> = ContactDetector::new(ContactOptions::default())?
///     .detect_with(&mut Default::default(), frame.view(), &reference)?;
/// let contact = found.contact.expect("contact");
/// assert_eq!((contact.area_px, contact.peak, contact.touches_edge), (400, 243.0, false));
/// assert_eq!(contact.saturated_share(), 1.0 / 400.0);
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Contact<T> {
    /// Box around the mask.
    pub bounding_box: BoundingBox,
    /// Number of pixels of the mask.
    pub area_px: usize,
    /// Radius of the circle of the mask's area, √(area/π), in pixels.
    pub equivalent_radius_px: T,
    /// Σ d over the aperture, positive for contact of either polarity.
    pub integrated_pixel_value: Estimate<T>,
    /// Intensity centroid [x, y] in pixels, equations (7) and (8).
    pub centroid_px: [Estimate<T>; 2],
    /// Greatest difference inside the mask.
    pub peak: T,
    /// Number of pixels of the aperture.
    pub aperture_px: usize,
    /// Saturated pixels of the mask (255 if brighter, 0 if darker).
    pub saturated_px: usize,
    /// Other patches of contact in the frame's region, each at least a hundredth of this one; they are not part of it.
    pub other_contacts: usize,
    /// The aperture reaches the edge of the frame: part of the contact may be missing.
    pub touches_edge: bool,
}

/// What detection says of a frame.
///
/// ```
/// use ndarray::Array2;
/// use tactile_force::{ContactDetector, ContactOptions, Detection, ReferenceFrame};
///
/// let quiet = Array2::from_elem((64, 64), 12_u8);
/// let reference = ReferenceFrame::new(quiet.view())?;
/// let found: Detection<f64> = ContactDetector::new(ContactOptions::default())?
///     .detect_with(&mut Default::default(), quiet.view(), &reference)?;
/// assert!(found.contact.is_none() && found.noise.is_none());
/// assert_eq!(found.statistics.sum, 0);
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Detection<T> {
    /// Sums over the whole frame.
    pub statistics: FrameStatistics,
    /// The correction of lamps and background.
    pub drift: Drift,
    /// The noise that the errors are computed from; `None` without contact.
    pub noise: Option<DifferenceNoise>,
    /// The contact, if there is one.
    pub contact: Option<Contact<T>>,
}

impl<T: Real> Contact<T> {
    /// Share of the mask that is saturated.
    pub fn saturated_share(&self) -> T {
        T::nearest(self.saturated_px as f64 / self.area_px as f64)
    }
}
