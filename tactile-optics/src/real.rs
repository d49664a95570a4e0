//! Constants of the scalar in use, range checks, and differences computed without cancellation.

use num_traits::{Float, NumCast};

use crate::OpticsError;

/// A constant in the scalar in use; NaN where it does not fit.
pub(crate) fn real<T: Float>(value: f64) -> T {
    <T as NumCast>::from(value).unwrap_or_else(T::nan)
}

/// As `f64`, for error messages.
pub(crate) fn as_f64<T: Float>(value: T) -> f64 {
    value.to_f64().unwrap_or(f64::NAN)
}

/// `found` if it lies in `minimum..=maximum`.
pub(crate) fn within<T: Float>(
    quantity: &'static str,
    found: T,
    minimum: f64,
    maximum: f64,
) -> Result<T, OpticsError> {
    let value = as_f64(found);
    if value >= minimum && value <= maximum {
        Ok(found)
    } else {
        Err(OpticsError::OutOfRange {
            quantity,
            minimum,
            maximum,
            found: value,
        })
    }
}

/// A refractive index: positive and finite.
pub(crate) fn index<T: Float>(n: T) -> Result<T, OpticsError> {
    within("refractive index", n, f64::MIN_POSITIVE, f64::MAX)
}

/// a·b − c·d with one rounding of each product removed (Kahan): the error is below 1.5 ulp of the result
/// (C.-P. Jeannerod, N. Louvet, J.-M. Muller, Math. Comp. 82 (2013) 2245–2264).
pub(crate) fn difference_of_products<T: Float>(a: T, b: T, c: T, d: T) -> T {
    let cd = c * d;
    let error = (-c).mul_add(d, cd);
    a.mul_add(b, -cd) + error
}

/// 2a² − b² for b in [a, 2a], with its sign right on the numbers as they stand.
///
/// Both squares split exactly into a rounded part and its error (fused multiply–add). The rounded parts lie within a
/// factor of two of each other wherever the sign is in doubt, so their difference is exact; the errors' difference is
/// kept as a rounded sum and its remainder.
pub(crate) fn twice_square_minus_square<T: Float>(a: T, b: T) -> T {
    let twice = a + a;
    let (p, q) = (twice * a, b * b);
    let (p_error, q_error) = (twice.mul_add(a, -p), b.mul_add(b, -q));
    let low = p_error - q_error;
    // Remainder of that subtraction (Knuth's two-sum).
    let back = low - p_error;
    let rest = (p_error - (low - back)) - (q_error + back);
    ((p - q) + low) + rest
}
