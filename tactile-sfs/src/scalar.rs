//! The two floating-point types of images and heights.

use num_traits::{Float, FromPrimitive, NumAssign};

/// Floating-point type of an image or a surface: `f32` or `f64`.
///
/// Generic callers may rely on its bounds.
///
/// ```
/// use tactile_sfs::PixelScalar;
/// /// Converts a height in pixels to metres, in either precision.
/// fn metres<T: PixelScalar>(height_px: T, pixel_size_m: f64) -> T {
///     height_px * T::of(pixel_size_m)
/// }
/// assert_eq!(metres(4.0_f64, 0.5e-4), 2e-4);
/// assert!((metres(4.0_f32, 0.5e-4).as_f64() - 2e-4).abs() < 1e-10);
/// ```
pub trait PixelScalar:
    Float
    + FromPrimitive
    + NumAssign
    + Default
    + core::fmt::Debug
    + core::fmt::Display
    + core::iter::Sum
    + Send
    + Sync
    + 'static
{
    /// `value` rounded to this type.
    fn of(value: f64) -> Self;

    /// The value as `f64`.
    fn as_f64(self) -> f64;
}

impl PixelScalar for f32 {
    #[inline]
    fn of(value: f64) -> Self {
        value as Self
    }

    #[inline]
    fn as_f64(self) -> f64 {
        f64::from(self)
    }
}

impl PixelScalar for f64 {
    #[inline]
    fn of(value: f64) -> Self {
        value
    }

    #[inline]
    fn as_f64(self) -> f64 {
        self
    }
}
