//! Flat faces: the area of a contact from its own region, and the differences between a flat face
//! and a ball.
//!
//! # Area
//! A pixel cut by the outline has the light beside it times its covered fraction. With s the frame
//! minus the reference, and P the light of the face just inside the outline, the area is
//!
//! A = h_x h_y Σ s/P over the pixels around the outline + the pixels further inside.
//!
//! Blur moves light across the outline, but removes none. The sum is unchanged if the outline bends
//! on a scale much larger than the blur. P is the mean over a ring of nearby pixels, so it follows
//! texture, vignetting and uneven pressure. If the outer and the inner half of the ring differ by
//! more than the noise, P is extrapolated from both. The error of A comes from noise in both rings
//! of pixels, plus a minimum for texture and sampling.
//!
//! # Shape
//! Just inside its outline a flat face is as bright as further inside. Under a ball the pressure
//! √(1 − r²/a²) falls to zero there with the square root of the distance. The ratio of the light 3
//! to 5 pixels inside to that 7 to 9 pixels inside is 1 for a flat face and about 0.7 for a ball of
//! any size ([`FaceReading::edge_ratio`]).
//!
//! Two numbers reveal whether the deformation between two loads is uniform. The second moment of
//! the outline, divided by the square of its area, is constant if the outline keeps its shape. The
//! ratio of the second moments of light and area is constant if the pressure follows the material.
//! Friction, slip and tilt change both.
//!
//! # Stretch
//! The lateral stretch between two loads is √(A₂/A₁), from the outline.

mod area;

use tactile_core::Estimate;

/// The contact of a flat face in one frame.
///
/// ```
/// use ndarray::Array2;
/// use tactile_force::{BoundingBox, FaceReading, Polarity};
///
/// // A uniform square of 60 × 60 pixels, with its outline between pixels.
/// let reference = Array2::from_elem((120, 120), 20_u8);
/// let mut frame = reference.clone();
/// frame.slice_mut(ndarray::s![30..90, 30..90]).fill(120);
/// let region = BoundingBox { row_start: 28, row_end: 92, column_start: 28, column_end: 92 };
/// let mask = region.of(frame.view()).mapv(|level| level > 60);
/// let images = [frame.view(), reference.view()];
/// let face = FaceReading::measure(images, region, mask.view(), Polarity::Brighter, [50e-6; 2])
///     .expect("a face");
/// assert!((face.area_m2.value / 9e-6 - 1.0).abs() < 1e-9);
/// assert!(face.has_edge() && !face.sticks());
/// // A square: (a²/12 + a²/12) 2π/a².
/// assert!((face.outline_moment - std::f64::consts::PI / 3.0).abs() < 1e-3);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct FaceReading {
    /// Area within the outline in square metres.
    pub area_m2: Estimate,
    /// Light 3 to 5 pixels inside the outline relative to that 7 to 9 pixels inside: 1 for a
    /// uniform pressure, about 0.7 for a ball's.
    pub edge_ratio: f64,
    /// 2π (m_xx + m_yy)/A² of the outline, m the second moments about its centre: 1 for a disc, π/3
    /// for a square.
    pub outline_moment: f64,
    /// Second moment of the light about the centre of the outline relative to that of the area,
    /// each normalised: 1 for a uniform pressure, less if it is higher in the middle.
    pub light_moment: f64,
}

impl FaceReading {
    /// A uniformly pressed face of this area and shape.
    ///
    /// ```
    /// use tactile_force::{Estimate, FaceReading};
    /// let disc = FaceReading::new(Estimate::new(1e-5, 1e-8), 1.0);
    /// assert!(disc.has_edge() && disc.light_moment == 1.0);
    /// ```
    #[must_use]
    pub const fn new(area_m2: Estimate, outline_moment: f64) -> Self {
        Self {
            area_m2,
            edge_ratio: 1.0,
            outline_moment,
            light_moment: 1.0,
        }
    }

    /// Whether the outline is an edge, as for a flat face, rather than a ball's: an edge ratio of
    /// at least 0.85. A uniform pressure has 1, reduced by texture to 0.9 at least; balls have 0.65
    /// to 0.75.
    #[must_use]
    pub fn has_edge(&self) -> bool {
        self.edge_ratio >= 0.85
    }

    /// Whether the pressure rises towards the outline, as under a stiff punch on a soft layer or if
    /// the face sticks to the sensor: an edge ratio above 1.18.
    #[must_use]
    pub fn sticks(&self) -> bool {
        self.edge_ratio > 1.18
    }

    /// Checks that the face is under uniaxial load, compared with a first load: its area changes by
    /// less than a quarter, and outline and pressure keep their shapes.
    ///
    /// # Errors
    /// [`ShapeProblem::Grows`], [`ShapeProblem::OutlineChanges`] or
    /// [`ShapeProblem::PressureChanges`].
    ///
    /// ```
    /// use tactile_force::{Estimate, FaceReading, ShapeProblem};
    /// let face = |area_m2| FaceReading::new(Estimate::new(area_m2, 1e-9), 1.0);
    /// assert_eq!(face(1.05e-5).check_against(&face(1e-5)), Ok(()));
    /// let grown = face(2e-5).check_against(&face(1e-5));
    /// assert_eq!(grown, Err(ShapeProblem::Grows { growth: 1.0 }));
    /// ```
    pub fn check_against(&self, first: &Self) -> Result<(), ShapeProblem> {
        let growth = self.area_m2.value / first.area_m2.value - 1.0;
        // A compression of a quarter at a Poisson ratio of ½.
        if growth.abs() > 0.25 {
            return Err(ShapeProblem::Grows { growth });
        }
        // The area is accurate to 1e-4. If a face grows on one side only, or only at its corners,
        // the moment of the outline changes by a third of the growth.
        let change = self.outline_moment / first.outline_moment - 1.0;
        if change.abs() > 4e-3 {
            return Err(ShapeProblem::OutlineChanges { change });
        }
        // Noise changes the light's moment by 1e-3.
        let change = self.light_moment / first.light_moment - 1.0;
        if change.abs() > 1e-2 {
            return Err(ShapeProblem::PressureChanges { change });
        }
        Ok(())
    }
}

/// Why a contact is not that of one flat face under uniaxial load.
///
/// ```
/// use tactile_force::ShapeProblem;
/// let problem = ShapeProblem::NoEdge { edge_ratio: 0.7 };
/// assert!(problem.to_string().contains("shape = \"sphere\""), "the shape to state");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(rename_all = "snake_case")
)]
#[non_exhaustive]
pub enum ShapeProblem {
    /// The pressure falls to zero at the outline, as under a ball.
    #[error(
        "the pressure falls towards the outline (to {edge_ratio:.2} times that further inside), as \
         under a ball: give shape = \"sphere\" with its radius_m"
    )]
    NoEdge {
        /// Light just inside the outline, relative to the light further inside.
        edge_ratio: f64,
    },
    /// The pressure rises towards the outline.
    #[error(
        "the pressure rises towards the outline (to {edge_ratio:.2} times that further inside), as \
         under a stiff punch or a face that sticks: give shape = \"flat_punch\", or press with less \
         friction"
    )]
    RaisedEdge {
        /// Light just inside the outline, relative to the light further inside.
        edge_ratio: f64,
    },
    /// The edge of the frame cuts the contact.
    #[error(
        "the frame's edge cuts the contact: move the object, or give its shape and size if it is a \
         ball"
    )]
    Cut,
    /// There is more than one contact.
    #[error(
        "there are {} contacts: press one face at a time, or give the shape if the others are not \
         the object's",
        .others + 1
    )]
    Several {
        /// Number of contacts besides the largest.
        others: usize,
    },
    /// The contact is too small or too irregular to have an interior.
    #[error(
        "the contact is too small to separate its outline from its inside: about 20 pixels across \
         are needed"
    )]
    TooSmall,
    /// The contact grows more than the face of a compressed specimen.
    #[error(
        "the contact has grown by {:.0} % since the first load, more than a compressed face can: \
         the object is round; give its shape",
        100.0 * .growth
    )]
    Grows {
        /// Relative growth of the area since the first load.
        growth: f64,
    },
    /// The outline changes its shape from load to load.
    #[error(
        "the outline changes its shape ({:+.1} % in second moment since the first load): the load \
         is not uniaxial; give the object's shape",
        100.0 * .change
    )]
    OutlineChanges {
        /// Relative change of the second moment of the outline since the first load.
        change: f64,
    },
    /// The pressure changes its distribution from load to load.
    #[error(
        "the pressure changes its distribution ({:+.1} % in second moment since the first load): \
         friction, tilt or an object of another shape",
        100.0 * .change
    )]
    PressureChanges {
        /// Relative change of the second moment of the light since the first load.
        change: f64,
    },
}
