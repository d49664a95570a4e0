//! The image of the mask's bounding box as reflectance, with the flags of its pixels: what the iterative methods start
//! from.

use crate::{Domain, Frame, Lighting, PixelFlags, Scalar, SfsError, Surface};

/// Buffers of the methods that iterate over the bounding box.
#[derive(Debug, Default)]
pub(crate) struct FieldBuffers<T> {
    /// Reflectance in [0, 1]; NaN outside the mask and where the input is not finite.
    pub(super) reflectance: Vec<T>,
    /// Heights, their variances and their next values.
    pub(super) heights: Vec<T>,
    pub(super) variance: Vec<T>,
    pub(super) next_heights: Vec<T>,
    /// Unit normals and their next values.
    pub(super) normals: Vec<[T; 3]>,
    pub(super) next: Vec<[T; 3]>,
}

impl<T: Scalar> FieldBuffers<T> {
    /// Heights 0 with variance 1.
    pub(super) fn reset_heights(&mut self, length: usize) {
        for (vector, value) in [
            (&mut self.heights, T::zero()),
            (&mut self.variance, T::one()),
            (&mut self.next_heights, T::zero()),
        ] {
            vector.clear();
            vector.resize(length, value);
        }
    }

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
