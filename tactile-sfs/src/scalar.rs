//! The two float types the crate computes in.

use num_traits::{Float, FromPrimitive, NumAssign};
use rustfft::num_complex::Complex;

impl sealed::Sealed for f32 {
    fn as_doubles(_: &mut [Complex<Self>]) -> Option<&mut [Complex<f64>]> {
        None
    }
}

impl sealed::Sealed for f64 {
    fn as_doubles(values: &mut [Complex<Self>]) -> Option<&mut [Complex<f64>]> {
        Some(values)
    }
}

impl Scalar for f32 {}
impl Scalar for f64 {}

pub(crate) mod sealed {
    use num_traits::{Float, FromPrimitive};
    use rustfft::num_complex::Complex;

    pub trait Sealed: Float + FromPrimitive {
        /// `value` rounded to this type.
        #[inline]
        fn of(value: f64) -> Self {
            // From f64 every float type can be made, by rounding.
            Self::from_f64(value).unwrap_or_else(Self::nan)
        }

        /// This value as `f64`.
        #[inline]
        fn as_f64(self) -> f64 {
            self.to_f64().unwrap_or(f64::NAN)
        }

        /// The same values where this type is `f64`.
        fn as_doubles(values: &mut [Complex<Self>]) -> Option<&mut [Complex<f64>]>;
    }
}

/// A float the crate computes in: `f32` or `f64`.
///
/// The trait is sealed; its bounds are what generic callers may rely on.
///
/// ```
/// use tactile_sfs::Scalar;
/// /// Metres of a height in pixels, in whatever precision it comes.
/// fn metres<T: Scalar>(height_px: T, pixel_size_m: T) -> T {
///     height_px * pixel_size_m
/// }
/// assert_eq!(metres(4.0_f64, 0.5e-4), 2e-4);
/// assert!((metres(4.0_f32, 0.5e-4) - 2e-4).abs() < 1e-10);
/// ```
pub trait Scalar:
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
    + sealed::Sealed
{
}
