//! The image of the mask's bounding box as reflectance, with the flags of its pixels: what the iterative methods start
//! from.

use crate::{Domain, Frame, Lighting, PixelFlags, Scalar, SfsError, Surface};

/// Buffers of the methods that iterate over the bounding box.
#[derive(Debug, Default)]
pub(crate) struct FieldBuffers<T> {
    /// Reflectance in [0, 1]; NaN outside the mask and where the input is not finite.
    pub(super) reflectance: Vec<T>,
    /// Heights.
    pub(super) heights: Vec<T>,
    /// Two further fields.
    pub(super) first: Vec<T>,
    pub(super) second: Vec<T>,
    /// Unit normals and their next values.
    pub(super) normals: Vec<[T; 3]>,
    pub(super) next: Vec<[T; 3]>,
}

impl<T: Scalar> FieldBuffers<T> {
    /// Loads the reflectance and flags saturated, dark and non-finite pixels.
    ///
    /// # Errors
    /// [`SfsError::EmptyMask`] if no pixel of the mask is finite.
    pub(super) fn load(
        &mut self,
        frame: &Frame<'_, T>,
        domain: &Domain<'_, T>,
        lighting: &Lighting<T>,
        surface: &mut Surface<T>,
    ) -> Result<(), SfsError> {
        let area = surface.bounding_box;
        self.reflectance.clear();
        let mut usable = false;
        for row in area.top..area.top + area.rows {
            for column in area.left..area.left + area.columns {
                if !domain.contains(row, column) {
                    self.reflectance.push(T::nan());
                    continue;
                }
                let value = lighting.reflectance(frame.at(row, column));
                surface.flags[[row, column]] = if !value.is_finite() {
                    PixelFlags::NON_FINITE
                } else if value > T::one() {
                    PixelFlags::SATURATED
                } else if value <= T::zero() {
                    PixelFlags::DARK
                } else {
                    PixelFlags::NONE
                };
                usable |= value.is_finite();
                let clamped = value.max(T::zero()).min(T::one());
                self.reflectance.push(if value.is_finite() { clamped } else { T::nan() });
            }
        }
        if usable { Ok(()) } else { Err(SfsError::EmptyMask) }
    }
}
