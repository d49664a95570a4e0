//! The two float types the crate computes in.

use std::sync::Arc;

use num_traits::{Float, FromPrimitive, NumAssign};
use rustfft::num_complex::Complex;
use rustfft::{Fft, FftPlanner};

pub(crate) use sealed::LineFft;

struct Planned<T>(Arc<dyn Fft<T>>);

macro_rules! scalar {
    ($t:ty) => {
        impl LineFft<$t> for Planned<$t> {
            fn process(&self, lines: &mut [Complex<$t>], scratch: &mut [Complex<$t>]) {
                self.0.process_with_scratch(lines, scratch);
            }
            fn scratch_len(&self) -> usize {
                self.0.get_inplace_scratch_len()
            }
        }
        impl sealed::Sealed for $t {
            fn plan_fft(length: usize, inverse: bool) -> Box<dyn LineFft<$t>> {
                let mut planner = FftPlanner::<$t>::new();
                Box::new(Planned(if inverse {
                    planner.plan_fft_inverse(length)
                } else {
                    planner.plan_fft_forward(length)
                }))
            }
        }
        impl Scalar for $t {}
    };
}

scalar!(f32);
scalar!(f64);

pub(crate) mod sealed {
    use num_traits::{Float, FromPrimitive};
    use rustfft::num_complex::Complex;

    /// A complex Fourier transform of one length, whatever the library behind it.
    pub trait LineFft<T>: Send + Sync {
        /// Transforms `lines`, a whole number of lines, in place. `scratch` is at least [`Self::scratch_len`] long.
        fn process(&self, lines: &mut [Complex<T>], scratch: &mut [Complex<T>]);
        /// Scratch needed by [`Self::process`].
        fn scratch_len(&self) -> usize;
    }

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

        fn plan_fft(length: usize, inverse: bool) -> Box<dyn LineFft<Self>>;
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
