//! A gel lit in colours: from a frame to gradients, face and contacts.
//!
//! The colour of a pixel, minus that of the untouched gel, depends on the normal of the surface and
//! on the position in the image. A third-degree polynomial in the three colour differences, with
//! coefficients that vary linearly over the image, gives the components n_x and n_y of the normal.
//! Presses of one ball determine it: inside the contact circle n = (x − x₀, y − y₀)/R. In
//! leave-one-out tests it was as accurate as polynomials of higher degree, with fewer parameters.

use std::sync::Arc;

use ndarray::{Array2, Array3, ArrayView3};
use tactile_core::{Requirement, vectorised};

use crate::GelError;
use crate::contacts::{Cells, Patch, block_means, patches};
use crate::dots::{are_printed, without_dots};
use crate::error::same_shape;
use crate::face::{self, GelFrame, SurfaceCheck};
use crate::frame_check::{Blocks, FrameDoubt, light};
use crate::gradients::{Blurred, TERMS, normals};
use crate::model::ColourModel;
use crate::plane::Plane;
use crate::rest::Tails;

/// Largest sine of a slope. A steeper one is limited to 76°, because light hardly changes beyond it
/// and the tangent diverges.
const STEEPEST: f32 = 0.97;

/// Minimum noise in grey levels of the difference of two 8-bit frames, from rounding alone.
const LEAST_NOISE_GREY: f64 = 0.41;
/// Fraction of a pixel's noise in the smoothed pressure. The blurs by frame, cells and smoothing
/// add up to a variance of 9.25 px², which reduces noise by √(4π · 9.25).
const SMOOTHED: f64 = 0.093;
/// Padding of the pressure grid, as a fraction of its size. Periodic copies of a contact decay with
/// the square of the distance.
const ROOM: f64 = 0.2;

/// A sensor of a gel lit in colours. Changes of exposure and of the level of a channel between
/// frames are corrected with the border of the frame. O(n log n) for the n pixels of a frame.
#[derive(Clone)]
pub(crate) struct ColourSensor {
    pub(crate) model: ColourModel,
    untouched: Arc<Array3<u8>>,
    /// Whether dots are printed on the gel.
    pub(crate) has_dots: bool,
    pub(crate) reference: Arc<Blurred>,
    blocks: Arc<Blocks>,
    pub(crate) plane: Arc<Plane>,
    check: Arc<SurfaceCheck>,
    tails: Arc<Tails>,
}

impl ColourSensor {
    pub(crate) fn new(model: ColourModel, reference: ArrayView3<'_, u8>) -> Result<Self, GelError> {
        Requirement::Positive.check("pixel size", model.pixel_size_m)?;
        Requirement::NonNegative.check("normal error", model.normal_standard_error)?;
        Requirement::NonNegative.check("depth error", model.depth_standard_error_m)?;
        Requirement::NonNegative.check("slope error", model.slope_standard_error)?;
        for component in &model.coefficients {
            same_shape("coefficients", (1, TERMS), (1, component.len()))?;
            for value in component {
                Requirement::Finite.check("coefficient", *value)?;
            }
        }
        Ok(Self::of_checked(model, colour_image(reference)?))
    }

    pub(crate) fn of_checked(model: ColourModel, reference: ArrayView3<'_, u8>) -> Self {
        let (rows, columns, _) = reference.dim();
        let has_dots = are_printed(reference);
        let blurred = blurred(reference, has_dots);
        Self {
            has_dots,
            untouched: Arc::new(reference.to_owned()),
            blocks: Arc::new(Blocks::of(&blurred)),
            plane: Arc::new(Plane::new((rows / 2, columns / 2), ROOM, None)),
            check: Arc::new(SurfaceCheck::new((rows, columns))),
            tails: Arc::new(Tails::new()),
            model,
            reference: Arc::new(blurred),
        }
    }

    /// The same sensor with other parameters.
    pub(crate) fn with_model(&self, model: ColourModel) -> Self {
        Self {
            model,
            ..self.clone()
        }
    }

    /// The frame without contact.
    pub(crate) fn reference(&self) -> ArrayView3<'_, u8> {
        self.untouched.view()
    }

    pub(crate) fn shape(&self) -> (usize, usize) {
        self.reference.dim()
    }

    pub(crate) fn read(&self, frame: ArrayView3<'_, u8>) -> Result<GelFrame, GelError> {
        let frame = colour_image(frame)?;
        let (rows, columns, _) = frame.dim();
        same_shape("frame", self.reference.dim(), (rows, columns))?;
        let (frame, doubts) = self.checked(frame);
        if doubts.iter().any(FrameDoubt::refuses) {
            return Ok(GelFrame::refused((rows, columns), doubts));
        }
        self.read_blurred(&frame, doubts)
    }

    /// A frame corrected to the exposure of the reference, with doubts about its origin.
    pub(crate) fn checked(&self, frame: ArrayView3<'_, u8>) -> (Blurred, Vec<FrameDoubt>) {
        let frame = blurred(frame, self.has_dots);
        let light = light(&Blocks::of(&frame), &self.blocks);
        (frame.divided_by(light.gain), light.doubts)
    }

    pub(crate) fn read_blurred(
        &self,
        frame: &Blurred,
        mut doubts: Vec<FrameDoubt>,
    ) -> Result<GelFrame, GelError> {
        let slopes = self.slopes(frame);
        let cells = self.cells(&slopes);
        if self.check.no_surface(&cells, self.noise_floor()) {
            doubts.push(FrameDoubt::NoSurface);
        }
        let found = patches(&cells, self.shape(), self.noise_floor());
        face::frame((&self.model, &self.tails), slopes, &cells, found, doubts)
    }

    /// The contact regions of a frame.
    pub(crate) fn patches(&self, frame: &Blurred) -> Vec<Patch> {
        patches(
            &self.cells(&self.slopes(frame)),
            self.shape(),
            self.noise_floor(),
        )
    }

    /// Slopes of the depth at each pixel.
    fn slopes(&self, frame: &Blurred) -> [Array2<f32>; 2] {
        let [mut p, mut q] = normals(frame, &self.reference, &self.model.coefficients);
        // Arrays created here are contiguous.
        if let (Some(p), Some(q)) = (p.as_slice_mut(), q.as_slice_mut()) {
            slopes(p, q);
        }
        [p, q]
    }

    /// Slopes and pressure on cells of 2 × 2 pixels.
    fn cells(&self, slopes: &[Array2<f32>; 2]) -> Cells {
        let [p, q] = slopes.each_ref().map(|slope| block_means(slope.view(), 2));
        Cells {
            pressure: self.plane.pressure(p.view(), q.view()),
            slopes: [p, q],
        }
    }

    /// The minimum noise of the smoothed pressure, from the rounding of levels.
    fn noise_floor(&self) -> f32 {
        let linear = self.model.coefficients.iter().flat_map(|c| &c[1..4]);
        let square: f64 = linear.map(|c| c * c).sum();
        (LEAST_NOISE_GREY * SMOOTHED / 50.0 * (0.5 * square).sqrt()) as f32
    }
}

fn blurred(frame: ArrayView3<'_, u8>, has_dots: bool) -> Blurred {
    match has_dots {
        true => Blurred::of(without_dots(frame).view()),
        false => Blurred::of(frame),
    }
}

/// Converts normals into slopes of the depth.
fn slopes(p: &mut [f32], q: &mut [f32]) {
    vectorised(
        #[inline(always)]
        || {
            for (p, q) in p.iter_mut().zip(q.iter_mut()) {
                let sine = (*p * *p + *q * *q).sqrt();
                // Both components are reduced by the same factor, which preserves the direction of
                // the slope.
                let cut = STEEPEST / sine.max(STEEPEST);
                let (x, y) = (*p * cut, *q * cut);
                // The outward normals of the gel point up where the depth decreases.
                let up = -(1.0 - x * x - y * y).sqrt();
                (*p, *q) = (x / up, y / up);
            }
        },
    );
}

/// Rejects images without pixels or with a number of channels other than three.
pub(crate) fn colour_image(image: ArrayView3<'_, u8>) -> Result<ArrayView3<'_, u8>, GelError> {
    let (rows, columns, channels) = image.dim();
    if rows == 0 || columns == 0 {
        return Err(GelError::EmptyImage { rows, columns });
    }
    same_shape("channels", (1, 3), (1, channels))?;
    Ok(image)
}
