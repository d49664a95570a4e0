//! Between the caller's scalar and f64, in which statistics and contact laws are computed.

use nalgebra::RealField;

pub(crate) fn widen<T: RealField + Copy>(x: T) -> f64 {
    nalgebra::convert_unchecked(x)
}

pub(crate) fn narrow<T: RealField + Copy>(x: f64) -> T {
    nalgebra::convert(x)
}
