//! From one image to heights: the trait and its implementations.

mod depth_table;
mod eikonal;
mod tsai_shah;

use std::ops::Deref;

pub use depth_table::DepthTable;
pub use eikonal::{BoundaryCondition, Eikonal, EikonalBranch};
pub(crate) use eikonal::{EikonalBuffers, ProfileBuffers};
pub use tsai_shah::TsaiShah;

use crate::{
    Domain, Frame, Image, Lighting, PixelFlags, PixelScalar, SfsError, Surface, SurfaceWorkspace,
};

/// A method of computing a surface from one image.
///
/// The trait is object-safe: `Box<dyn SurfaceReconstruction<f32>>` allows a choice at run time.
/// Only [`reconstruct`](Self::reconstruct) has to be implemented.
///
/// ```
/// use ndarray::Array2;
/// use tactile_sfs::{BoundaryCondition, Domain, Eikonal, Image, Lighting, SurfaceReconstruction};
///
/// // A cone of slope 1: n·s = 1/√2 everywhere.
/// let (size, radius) = (41, 15.0_f64);
/// let distance = |r: usize, c: usize| (r as f64 - 20.0).hypot(c as f64 - 20.0);
/// let mask = Array2::from_shape_fn((size, size), |(r, c)| distance(r, c) < radius);
/// let image = Array2::from_elem((size, size), 0.5_f64.sqrt());
/// let method = Eikonal::new(Lighting::default()).with_boundary(BoundaryCondition::Height(0.0))?;
/// let surface = method.reconstruct(
///     Image::new(image.view(), Domain::default().with_mask(mask.view()))
/// )?;
/// assert!((surface.heights[[20, 20]] - radius).abs() < 1.5);
/// # Ok::<(), tactile_sfs::SfsError>(())
/// ```
pub trait SurfaceReconstruction<T: PixelScalar>: Send + Sync {
    /// Reconstructs from an image: real intensities, or the grey levels of an 8-bit camera.
    ///
    /// # Errors
    /// Those of the method: mostly different shapes, an empty mask, or invalid options.
    fn reconstruct(&self, image: Image<'_, '_, T>) -> Result<Surface<T>, SfsError>;

    /// Like [`reconstruct`](Self::reconstruct), but into `surface`: its arrays and the buffers of
    /// `workspace` are reused. The methods of this crate do not allocate after the first frame of a
    /// stream.
    ///
    /// ```
    /// use ndarray::array;
    /// use tactile_sfs::{
    ///     DepthTable, Domain, Frame, Image, Surface, SurfaceReconstruction, SurfaceWorkspace,
    /// };
    /// let table = DepthTable::new(&[(0.0, 0.0), (200.0, 1e-3)])?;
    /// let (image, domain) = (array![[0_u8, 50, 100]], Domain::new([1e-4, 1e-4])?);
    /// let once = table.reconstruct(Image::new(image.view(), domain))?;
    /// assert_eq!(once.heights, array![[0.0, 0.25e-3, 0.5e-3]]);
    /// let (mut workspace, mut surface) = (SurfaceWorkspace::default(), Surface::default());
    /// table.reconstruct_with(
    ///     &mut workspace,
    ///     Image::new(Frame::Bytes(image.view()), domain),
    ///     &mut surface,
    /// )?;
    /// assert_eq!(surface, once);
    /// # Ok::<(), tactile_sfs::SfsError>(())
    /// ```
    ///
    /// # Errors
    /// Those of [`reconstruct`](Self::reconstruct).
    fn reconstruct_with(
        &self,
        workspace: &mut SurfaceWorkspace<T>,
        image: Image<'_, '_, T>,
        surface: &mut Surface<T>,
    ) -> Result<(), SfsError> {
        let _ = workspace;
        *surface = self.reconstruct(image)?;
        Ok(())
    }
}

/// Implements the trait for boxed, shared and borrowed methods.
impl<T: PixelScalar, P: Deref<Target: SurfaceReconstruction<T>> + Send + Sync>
    SurfaceReconstruction<T> for P
{
    fn reconstruct(&self, image: Image<'_, '_, T>) -> Result<Surface<T>, SfsError> {
        (**self).reconstruct(image)
    }

    fn reconstruct_with(
        &self,
        workspace: &mut SurfaceWorkspace<T>,
        image: Image<'_, '_, T>,
        surface: &mut Surface<T>,
    ) -> Result<(), SfsError> {
        (**self).reconstruct_with(workspace, image, surface)
    }
}

/// The image of a box as reflectance, and the fields of the iteration.
#[derive(Debug, Default)]
pub(crate) struct FieldBuffers<T> {
    /// Reflectance in [0, 1]. NaN outside the mask and at pixels that are not finite.
    reflectance: Vec<T>,
    /// Heights, their variances and their next values.
    heights: Vec<T>,
    variance: Vec<T>,
    next_heights: Vec<T>,
    /// Heights to be written to the surface.
    written: Vec<f64>,
}

impl<T: PixelScalar> FieldBuffers<T> {
    /// Loads the reflectance and flags saturated, dark and non-finite pixels.
    ///
    /// # Errors
    /// [`SfsError::EmptyMask`] if no pixel of the mask is finite.
    fn load(
        &mut self,
        frame: &Frame<'_, T>,
        domain: &Domain<'_, T>,
        lighting: &Lighting<T>,
        surface: &mut Surface<T>,
    ) -> Result<(), SfsError> {
        self.reflectance.clear();
        let mut usable = false;
        for (row, column) in surface.bounding_box.pixels() {
            if !domain.contains(row, column) {
                self.reflectance.push(T::nan());
                continue;
            }
            let value = lighting.reflectance(frame.at(row, column));
            surface.flags[[row, column]] =
                PixelFlags::of_reflectance(value, T::min_positive_value());
            usable |= value.is_finite();
            // The cosine of a lit normal lies between 0 and 1. The flags record that the value was
            // clamped.
            let clamped = value.max(T::zero()).min(T::one());
            self.reflectance
                .push(if value.is_finite() { clamped } else { T::nan() });
        }
        if usable {
            Ok(())
        } else {
            Err(SfsError::EmptyMask)
        }
    }
}
