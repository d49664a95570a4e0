//! A gel that is lit in colours: from a frame to gradients, contact and depth.
//!
//! The colour of a pixel, less that of the untouched gel, depends on the surface's normal and on
//! the place in the image. A polynomial of third degree in the three colour differences, whose
//! coefficients change linearly over the image, gives the normal's components n_x and n_y. Presses
//! of one ball determine it: inside the contact circle n = (x − x₀, y − y₀)/R. Over presses left
//! out in turn it was as good as polynomials of higher degree, with fewer numbers to determine.

use ndarray::{Array2, ArrayView3, Zip};
use tactile_core::{Requirement, vectorised};

use tactile_core::BoundingBox;
use tactile_sfs::{CosinePoisson, Domain, SlopeIntegrator};

use crate::GelError;
use crate::contacts::contact;
use crate::error::same_shape;
use crate::gradients::{Blurred, TERMS, normals};

/// The numbers that a calibration of [`GelSensor`] finds, as a file keeps them.
///
/// ```
/// use tactile_gel::{GelModel, GelSensor};
/// let model = GelModel::new(5e-5, [vec![0.0; 60], vec![0.0; 60]]);
/// let flat = ndarray::Array3::from_elem((40, 60, 3), 90);
/// let sensor = GelSensor::new(model, flat.view())?;
/// assert!(sensor.read(flat.view())?.depth_m.iter().all(|z| *z == 0.0));
/// # Ok::<(), tactile_gel::GelError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct GelModel {
    /// Size of a pixel on the gel in metres.
    pub pixel_size_m: f64,
    /// Coefficients of n_x and n_y, 60 each. They belong to the 20 monomials of the differences in
    /// 50 grey levels, then to those times x, then times y, with x and y from −1 to 1.
    pub coefficients: [Vec<f64>; 2],
    /// Standard error of n_x and n_y, from presses left out in turn.
    pub normal_standard_error: f64,
    /// Standard error of a depth in metres, from presses left out in turn.
    pub depth_standard_error_m: f64,
}

impl GelModel {
    /// A model without errors.
    pub fn new(pixel_size_m: f64, coefficients: [Vec<f64>; 2]) -> Self {
        Self {
            pixel_size_m,
            coefficients,
            normal_standard_error: 0.0,
            depth_standard_error_m: 0.0,
        }
    }
}

/// Surfaces from the colours of a gel that is lit from several sides.
///
/// Reads 8-bit frames of three channels. A shift of all levels of a channel between frames is
/// taken off by the median over the frame's border. [`calibrate`](Self::calibrate) makes one from
/// presses of a ball. O(pixels) a frame, and O(n log n) for the n pixels of the contact's box.
#[derive(Clone, Debug, PartialEq)]
pub struct GelSensor {
    pub(crate) model: GelModel,
    pub(crate) reference: Blurred,
}

/// What one frame shows.
///
/// Gradients are those of the gel's surface, inside the contact and around it: ∂z/∂x and ∂z/∂y
/// with z the depth in metres, x the column, y the row.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct GelFrame {
    /// Gradients along x and y.
    pub gradient: [Array2<f32>; 2],
    /// Standard errors of the gradients.
    pub gradient_error: [Array2<f32>; 2],
    /// Pixels where something touches.
    pub contact: Array2<bool>,
    /// Depth in metres, 0 where nothing touches.
    pub depth_m: Array2<f64>,
    /// Standard error of a depth inside the contact, in metres.
    pub depth_standard_error_m: f64,
}

impl GelFrame {
    /// How far the gel's face has moved, in metres, and where it is touched, for blocks of this
    /// many pixels a side. Incomplete blocks at the right and at the bottom are left out.
    ///
    /// The gradients of the whole face are integrated, also those of the free gel around a contact.
    /// The median along the border is taken as its rest.
    ///
    /// # Errors
    /// Those of [`CosinePoisson`], and [`GelError::EmptyImage`] for a block of no pixel or larger
    /// than the frame.
    pub fn displacement_m(
        &self,
        block: usize,
        pixel_size_m: f64,
    ) -> Result<(Array2<f64>, Array2<bool>), GelError> {
        let [rows, columns] =
            [self.contact.nrows(), self.contact.ncols()].map(|n| n.checked_div(block).unwrap_or(0));
        if rows == 0 || columns == 0 {
            return Err(GelError::EmptyImage { rows, columns });
        }
        let share = 1.0 / (block * block) as f64;
        let mean = |gradient: &Array2<f32>| {
            let blocks = gradient.exact_chunks((block, block));
            let means = blocks.into_iter().map(|b| f64::from(b.sum()) * share);
            Array2::from_shape_fn((rows, columns), {
                let means: Vec<f64> = means.collect();
                move |(row, column)| means[row * columns + column]
            })
        };
        let [p, q] = self.gradient.each_ref().map(mean);
        let domain = Domain::new([block as f64 * pixel_size_m; 2])?;
        let mut moved = CosinePoisson
            .integrate(p.view(), q.view(), &domain)?
            .heights;
        let edge = |(row, column): (usize, usize)| {
            row == 0 || column == 0 || row + 1 == rows || column + 1 == columns
        };
        let around = moved.indexed_iter().filter(|(at, _)| edge(*at));
        let mut around: Vec<f64> = around.map(|(_, z)| *z).collect();
        let middle = around.len() / 2;
        // The median is not moved by a contact that reaches the border, as a mean would be.
        let rest = *around.select_nth_unstable_by(middle, f64::total_cmp).1;
        moved -= rest;
        let blocks: Vec<bool> = self
            .contact
            .exact_chunks((block, block))
            .into_iter()
            .map(|b| 2 * b.iter().filter(|touched| **touched).count() > block * block)
            .collect();
        let touched = Array2::from_shape_fn((rows, columns), |(r, c)| blocks[r * columns + c]);
        Ok((moved, touched))
    }
}

/// Largest sine of a slope. A steeper one is read as 76°: beyond it light hardly changes, and the
/// slope itself has no end.
const STEEPEST: f32 = 0.97;

impl GelSensor {
    /// A sensor from its model and its frame without contact, `[row, column, channel]`.
    ///
    /// # Errors
    /// [`GelError::EmptyImage`], [`GelError::ShapeMismatch`] unless there are three channels and 60
    /// coefficients, [`GelError::InvalidOption`] for a pixel size that is not positive, a
    /// coefficient that is not finite or a negative error.
    pub fn new(model: GelModel, reference: ArrayView3<'_, u8>) -> Result<Self, GelError> {
        Requirement::Positive.check("pixel size", model.pixel_size_m)?;
        Requirement::NonNegative.check("normal error", model.normal_standard_error)?;
        Requirement::NonNegative.check("depth error", model.depth_standard_error_m)?;
        for component in &model.coefficients {
            same_shape("coefficients", (1, TERMS), (1, component.len()))?;
            for value in component {
                Requirement::Finite.check("coefficient", *value)?;
            }
        }
        let reference = Blurred::of(colour_image(reference)?);
        Ok(Self { model, reference })
    }

    /// The numbers of the calibration.
    pub fn model(&self) -> &GelModel {
        &self.model
    }

    /// Rows and columns of its frames.
    pub fn shape(&self) -> (usize, usize) {
        self.reference.dim()
    }

    /// Gradients, contact and depth of a frame of the reference's size.
    ///
    /// # Errors
    /// [`GelError::ShapeMismatch`].
    pub fn read(&self, frame: ArrayView3<'_, u8>) -> Result<GelFrame, GelError> {
        let frame = colour_image(frame)?;
        let (rows, columns, _) = frame.dim();
        same_shape("frame", self.reference.dim(), (rows, columns))?;
        self.read_blurred(&Blurred::of(frame))
    }

    pub(crate) fn read_blurred(&self, frame: &Blurred) -> Result<GelFrame, GelError> {
        let normals = normals(frame, &self.reference, &self.model.coefficients);
        let touched = contact(&normals);
        let [mut p, mut q] = normals;
        let mut errors = [Array2::zeros(p.dim()), Array2::zeros(p.dim())];
        let sd = self.model.normal_standard_error as f32;
        let [error_p, error_q] = &mut errors;
        // Arrays that were made here are slices.
        let all = [&mut p, &mut q, error_p, error_q].map(|array| array.as_slice_mut());
        if let [Some(p), Some(q), Some(error_p), Some(error_q)] = all {
            slopes([p, q], [error_p, error_q], sd);
        }
        let depth_m = self.depth([&p, &q], &touched)?;
        Ok(GelFrame {
            gradient: [p, q],
            gradient_error: errors,
            contact: touched,
            depth_m,
            depth_standard_error_m: self.model.depth_standard_error_m,
        })
    }

    /// Integrates the slopes of the contact with none around it, and counts from around it.
    fn depth(
        &self,
        slopes: [&Array2<f32>; 2],
        touched: &Array2<bool>,
    ) -> Result<Array2<f64>, GelError> {
        let mut depth = Array2::zeros(touched.dim());
        let Some(area) = BoundingBox::of_mask(touched.view()) else {
            return Ok(depth);
        };
        // Room around the contact for slopes that do not add up to none around a loop.
        let area = area.grown(16, touched.dim());
        let inside = area.of(touched.view());
        let [p, q] = slopes.map(|slope| {
            let mut slope = area.of(slope.view()).mapv(f64::from);
            slope.zip_mut_with(&inside, |slope, inside| {
                // The free gel's slopes are left out: its sag around the contact is not the
                // object's depth.
                *slope *= f64::from(u8::from(*inside))
            });
            slope
        });
        let domain = Domain::new([self.model.pixel_size_m; 2])?;
        let heights = CosinePoisson
            .integrate(p.view(), q.view(), &domain)?
            .heights;
        let around = heights.iter().zip(&inside).filter(|(_, inside)| !**inside);
        let (sum, count) = around.fold((0.0, 0_usize), |(sum, n), (z, _)| (sum + z, n + 1));
        // Integration leaves the height open to a constant. Around the contact the depth is 0.
        let zero = sum / count.max(1) as f64;
        let mut to = area.of_mut(depth.view_mut());
        Zip::from(&mut to)
            .and(&heights)
            .and(&inside)
            .for_each(|to, z, inside| {
                if *inside {
                    // A touched place cannot lie above the free face.
                    *to = (z - zero).max(0.0);
                }
            });
        Ok(depth)
    }
}

/// Turns normals into slopes, and gives the standard errors of both for one of the normals.
fn slopes(normals: [&mut [f32]; 2], errors: [&mut [f32]; 2], sd: f32) {
    let [p, q] = normals;
    let (q, [error_p, error_q]) = (&mut q[..p.len()], errors.map(|e| &mut e[..p.len()]));
    vectorised(
        #[inline(always)]
        || {
            for k in 0..p.len() {
                let (nx, ny) = (p[k], q[k]);
                let sine = (nx * nx + ny * ny).sqrt();
                // Both components shrink alike, so that the direction of the slope is kept.
                let cut = STEEPEST / sine.max(STEEPEST);
                let (x, y) = (nx * cut, ny * cut);
                let up2 = 1.0 - x * x - y * y;
                let (up, [xx, xy, yy]) = (up2.sqrt(), [x * x, x * y, y * y].map(|v| v / up2));
                // The derivative of n/n_z by n is (1 + n nᵀ/n_z²)/n_z.
                error_p[k] = sd / up * ((1.0 + xx).powi(2) + xy * xy).sqrt();
                error_q[k] = sd / up * ((1.0 + yy).powi(2) + xy * xy).sqrt();
                // Outward normals of the gel rise where depth falls.
                (p[k], q[k]) = (-x / up, -y / up);
            }
        },
    );
}

/// Refuses images without pixels or with other than three channels.
pub(crate) fn colour_image(image: ArrayView3<'_, u8>) -> Result<ArrayView3<'_, u8>, GelError> {
    let (rows, columns, channels) = image.dim();
    if rows == 0 || columns == 0 {
        return Err(GelError::EmptyImage { rows, columns });
    }
    same_shape("channels", (1, 3), (1, channels))?;
    Ok(image)
}
