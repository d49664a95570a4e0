//! Where the object touches: detection against the noise, the mask, and the sums over it.
//!
//! A frame is first tested by the one pass over it ([`FrameStatistics`]): contact is suspected where one pixel, or one tile of
//! 8 × 32 pixels, differs from the reference by more than its noise allows at the stated false-alarm rate *per frame*.
//! Only there a mask is made: smooth if the contact is faint, threshold, keep the largest component, fill its holes.
//! Sums run over the mask grown by a margin (the *aperture*) with signed differences, so that the edge, where the signal is
//! below the noise, is not cut off.

mod detector;
mod differences;
mod every_nth;
mod noise;
mod options;
mod region;
mod runs;
mod summary;
mod suspect;
mod threshold;
mod workspace;

pub use detector::ContactDetector;
pub use options::ContactOptions;
pub use workspace::DetectorWorkspace;

pub(crate) use region::Region;
pub(crate) use runs::Run;

use crate::drift::IlluminationDrift;
use crate::frame::{DifferenceNoise, FrameStatistics};
use tactile_core::BoundingBox;
use tactile_core::Estimate;

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
/// let found: Detection = ContactDetector::new(ContactOptions::default())
///     .detect_with(&mut Default::default(), frame.view(), &reference)?;
/// let contact = found.contact.expect("contact");
/// assert_eq!((contact.area_px, contact.peak, contact.touches_edge), (400, 243.0, false));
/// assert_eq!(contact.saturated_px, 1);
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Contact {
    /// Box around the mask.
    pub bounding_box: BoundingBox,
    /// Number of pixels of the mask.
    pub area_px: usize,
    /// Radius of the circle of the mask's area, √(area/π), in pixels.
    pub equivalent_radius_px: f64,
    /// Σ d over the aperture, positive for contact of either polarity.
    pub integrated_pixel_value: Estimate,
    /// Intensity centroid [x, y] in pixels, equations (7) and (8).
    pub centroid_px: [Estimate; 2],
    /// Greatest difference inside the mask.
    pub peak: f64,
    /// Number of pixels of the aperture.
    pub aperture_px: usize,
    /// Saturated pixels of the mask (255 if brighter, 0 if darker).
    pub saturated_px: usize,
    /// Other patches of contact in the frame's region, each at least a hundredth of this one; they are not part of it.
    pub other_contacts: usize,
    /// The aperture reaches the edge of the frame: part of the contact may be missing.
    pub touches_edge: bool,
}

/// The result of detection in one frame.
///
/// ```
/// use ndarray::Array2;
/// use tactile_force::{ContactDetector, ContactOptions, Detection, ReferenceFrame};
///
/// let at_rest = Array2::from_elem((64, 64), 12_u8);
/// let reference = ReferenceFrame::new(at_rest.view())?;
/// let found: Detection = ContactDetector::new(ContactOptions::default())
///     .detect_with(&mut Default::default(), at_rest.view(), &reference)?;
/// assert!(found.contact.is_none() && found.noise.is_none());
/// assert_eq!(found.statistics.sum, 0);
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Detection {
    /// Sums over the whole frame.
    pub statistics: FrameStatistics,
    /// The correction of illumination and stray light.
    pub drift: IlluminationDrift,
    /// The noise that the errors are computed from; `None` without contact.
    pub noise: Option<DifferenceNoise>,
    /// The contact, if there is one.
    pub contact: Option<Contact>,
}
