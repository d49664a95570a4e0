//! Flat faces: the area of a contact from its own region, and what tells a flat face from a ball.
//!
//! # Area
//! A pixel that the outline cuts shows the share of it that is covered, times the light beside it. With s the frame minus the reference, and P
//! the light of the face just inside the outline, the area is
//!
//! A = h_x h_y Σ s/P over the pixels around the outline + the pixels further inside.
//!
//! Blur moves light across the outline, but takes none away: the sum does not change as long as the outline bends on a scale much larger than the
//! blur. P is the mean over the ring of pixels [`BAND`] to [`BAND`] + [`RING`] pixels inside, near by, so that texture, vignetting
//! and uneven pressure are followed; where the outer and the inner half of that ring differ by more than noise explains, P is extrapolated from both.
//! The error of A is that of noise in both rings of pixels, and a floor for the shape of texture and sampling.
//!
//! # Shape
//! Just inside its outline a flat face is as bright as further inside; under a ball the pressure √(1 − r²/a²) falls to zero there as the
//! square root of the distance. The ratio of the light 3 to 5 pixels inside to that 7 to 9 pixels inside is 1 for the one and some 0.7 for the
//! other, whatever their size ([`FaceReading::edge_ratio`]).
//! Two numbers tell whether the deformation between two loads is the same everywhere. The second moment of the outline over the square of
//! its area does not change as long as the outline keeps its shape; the second moment of the light over that of the area does not change as long
//! as the pressure follows the material, textured or not. Friction, slip and tilt change them.
//!
//! # Strain
//! The lateral stretch between two loads is √(A₂/A₁): of the outline, which needs no texture. Where the face is textured, its material points tell
//! it as well ([`Press::matching`](super::Press::matching) is of surfaces and says nothing here; the match in a
//! [`Measurement`](super::Measurement) is that of the points). The outline's is used, being the more precise of the two; where they differ by more than
//! their errors allow, the face slips or sticks, and a flag says so.
mod area;
mod distance;
mod histogram;
mod material_law;
mod moments;
mod shape;
mod texture;

pub(super) use area::FaceWorkspace;
pub(super) use material_law::caution as material_law_caution;
pub use shape::ShapeProblem;
pub(super) use shape::{check, has_edge, sticks};
pub(super) use texture::{TextureStretch, spots, stretch};

use crate::force::Estimate;

/// Pixels either side of the outline whose light is summed. What blur of 0.8 pixels carries further, 1 %, is missing as much inside, where pixels
/// are counted as whole, as it is outside.
const BAND: u8 = 2;
/// Pixels from there inwards over which the light of the face is averaged: more is quieter, fewer follow a texture more closely.
const RING: u8 = 4;

/// What a frame says of a contact with a flat face.
///
/// ```
/// use tactile_imaging::pipeline::{FaceReading, Object, Pipeline};
/// use tactile_imaging::simulate::{Camera, UniaxialOptions, UniaxialScene};
/// # use tactile_imaging::force::CalibrationPair;
/// let camera = Camera { shape: [300, 300], pixel_size_m: [48e-6; 2], ..Camera::default() };
/// let scene = UniaxialScene::new(UniaxialOptions { camera, ..UniaxialOptions::default() })?;
/// # let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
/// let pipeline = Pipeline::from_pairs(&pairs, camera.pixel_size_m, Object::Block { poisson_ratio: 0.5 })?;
/// let (reference, frame) = (scene.reference(0), scene.frame(2, 0));
/// let mut press = pipeline.press(reference.view())?;
/// press.add_frame(frame.view());
/// let face: FaceReading = press.contact(0)?.and_then(|contact| contact.face).expect("a face");
/// assert!((face.area_m2.value / scene.states()[2].area_m2 - 1.0).abs() < 1e-3);
/// assert!((face.outline_moment / (std::f64::consts::PI / 3.0) - 1.0).abs() < 1e-2, "a square");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct FaceReading {
    /// Area within the outline in square metres.
    pub area_m2: Estimate<f64>,
    /// Light 3 to 5 pixels inside the outline over that 7 to 9 pixels inside: 1 for an even pressure, some 0.7 for a ball's.
    pub edge_ratio: f64,
    /// 2π (m_xx + m_yy)/A² of the outline, m the second moments about its centre: 1 for a disc, π/3 for a square.
    pub outline_moment: f64,
    /// Second moment of the light about the outline's centre over that of the area, both by their sums: 1 for an even pressure, below where it is higher
    /// in the middle.
    pub light_moment: f64,
}
