//! A number with its standard error, and the scalar all of the crate is generic over.

use std::fmt::{self, Debug, Display};
use std::ops::Mul;

use num_traits::{Float, FromPrimitive};

/// The scalar of results and calibrations: `f32` or `f64`.
///
/// Sums over 8-bit frames are exact integers and fits run in `f64`, so `f32` results are `f64` results rounded once.
///
/// ```
/// use tactile_force::{Estimate, Real};
///
/// /// Half the width of a 95 % interval of a normal error.
/// fn half_width<T: Real>(estimate: Estimate<T>) -> T {
///     estimate.standard_error * T::from(1.96).unwrap_or_else(T::nan)
/// }
/// assert_eq!(half_width(Estimate { value: 1.2, standard_error: 0.5 }), 0.98);
/// ```
pub trait Real:
    Float + FromPrimitive + Debug + Display + Default + Send + Sync + 'static + convert::Convert
{
}

impl<T> Real for T where T: Float + FromPrimitive + Debug + Display + Default + Send + Sync + 'static
{}

mod convert {
    use num_traits::{Float, FromPrimitive};

    /// Conversions from and to `f64`, in which all fits run.
    pub trait Convert: Float + FromPrimitive {
        /// The nearest value to an `f64`.
        fn nearest(value: f64) -> Self {
            Self::from_f64(value).unwrap_or_else(Self::nan)
        }

        /// The value as an `f64`.
        fn as_f64(self) -> f64 {
            self.to_f64().unwrap_or(f64::NAN)
        }
    }

    impl<T: Float + FromPrimitive> Convert for T {}
}

/// A value and its standard error (one standard deviation), both in the unit the field's name states.
///
/// ```
/// use tactile_force::Estimate;
/// let force_n = Estimate { value: 1.2, standard_error: 0.003 };
/// assert_eq!(format!("{force_n} N"), "1.2 ± 0.003 N");
/// // In another unit: pixels of a quarter of a metre.
/// let metres = Estimate { value: 400.0_f64, standard_error: 8.0 } * 0.25;
/// assert_eq!(metres, Estimate { value: 100.0, standard_error: 2.0 });
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Estimate<T> {
    /// The value.
    pub value: T,
    /// One standard deviation of its error.
    pub standard_error: T,
}

impl<T: Real> Estimate<T> {
    pub(crate) fn nearest(value: f64, variance: f64) -> Self {
        Self {
            value: T::nearest(value),
            standard_error: T::nearest(variance.max(0.0).sqrt()),
        }
    }
}

impl<T: Real> Mul<T> for Estimate<T> {
    type Output = Self;

    /// The value and its error in another unit.
    fn mul(self, factor: T) -> Self {
        Self {
            value: self.value * factor,
            standard_error: self.standard_error * factor.abs(),
        }
    }
}

impl<T: Display> Display for Estimate<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        Display::fmt(&self.value, f)?;
        f.write_str(" ± ")?;
        Display::fmt(&self.standard_error, f)
    }
}
