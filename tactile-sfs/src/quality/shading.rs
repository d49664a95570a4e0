//! Slopes of a surface, its shading, and how far that is from the image: a check that needs no truth.

use ndarray::{Array2, ArrayView2};

use super::ErrorSummary;
use crate::domain::same_shape;
use crate::{Frame, Lighting, Scalar, SfsError};

/// Slopes p = ∂z/∂x and q = ∂z/∂y: central differences, one-sided next to missing (NaN) heights or the frame's border,
/// NaN where the height is missing and 0 along an axis without neighbours. Second order inside, first at borders.
///
/// ```
/// use ndarray::array;
/// let (p, q) = tactile_sfs::slopes(array![[0.0, 1.0, 4.0], [0.0, 1.0, 4.0]].view(), [1.0, 1.0]);
/// assert_eq!((p[[0, 1]], q[[0, 1]]), (2.0, 0.0));
/// ```
pub fn slopes<T: Scalar>(
    heights: ArrayView2<'_, T>,
    pixel_size_m: [T; 2],
) -> (Array2<T>, Array2<T>) {
    let (mut p, mut q) = (Array2::zeros(heights.dim()), Array2::zeros(heights.dim()));
    for ((row, column), &z) in heights.indexed_iter() {
        let [slope_x, slope_y] = if z.is_finite() {
            slopes_at(heights, [row, column], pixel_size_m)
        } else {
            [T::nan(); 2]
        };
        (p[[row, column]], q[[row, column]]) = (slope_x, slope_y);
    }
    (p, q)
}

/// Slopes at a pixel whose height is finite.
pub(crate) fn slopes_at<T: Scalar>(
    z: ArrayView2<'_, T>,
    [row, column]: [usize; 2],
    step: [T; 2],
) -> [T; 2] {
    let here = z[[row, column]];
    let get = |r: usize, c: usize| z.get([r, c]).copied().filter(|z| z.is_finite());
    let difference = |before: Option<T>, after: Option<T>, step: T| match (before, after) {
        (Some(a), Some(b)) => (b - a) / (step + step),
        (Some(a), None) => (here - a) / step,
        (None, Some(b)) => (b - here) / step,
        (None, None) => T::zero(),
    };
    // Index 0 − 1 wraps to a number no array reaches.
    let x = difference(
        get(row, column.wrapping_sub(1)),
        get(row, column + 1),
        step[0],
    );
    let y = difference(
        get(row.wrapping_sub(1), column),
        get(row + 1, column),
        step[1],
    );
    [x, y]
}

/// Shades a surface; NaN where it has no height.
///
/// ```
/// use ndarray::Array2;
/// use tactile_sfs::{Lighting, render};
/// let image = render(Array2::<f64>::zeros((3, 3)).view(), [1.0, 1.0], &Lighting::default());
/// assert_eq!(image[[1, 1]], 1.0);
/// ```
pub fn render<T: Scalar>(
    heights: ArrayView2<'_, T>,
    pixel_size_m: [T; 2],
    lighting: &Lighting<T>,
) -> Array2<T> {
    Array2::from_shape_fn(heights.dim(), |(row, column)| {
        if !heights[[row, column]].is_finite() {
            return T::nan();
        }
        let [p, q] = slopes_at(heights, [row, column], pixel_size_m);
        lighting.shade(p, q)
    })
}

/// Renders a surface and compares it with the image it was made from: rendered minus observed intensity (NaN where there is no
/// height), and a summary of it in the image's unit.
///
/// A small residual does not prove the surface right (convex and concave look alike), a large one proves it wrong.
///
/// ```
/// use ndarray::Array2;
/// use tactile_sfs::{Frame, Lighting, render, reprojection};
/// let light = Lighting::new([0.3, 0.0, 1.0])?;
/// let bump = Array2::from_shape_fn((9, 9), |(r, c)| -0.05 * ((r as f64 - 4.0).powi(2) + (c as f64 - 4.0).powi(2)));
/// let image = render(bump.view(), [1.0, 1.0], &light);
/// let rms = |z: &Array2<f64>| {
///     Ok::<_, tactile_sfs::SfsError>(reprojection(z.view(), Frame::Real(image.view()), [1.0, 1.0], &light)?.1.rms)
/// };
/// assert!(rms(&bump)? < 1e-12 && rms(&-&bump)? > 0.1); // a hollow shades otherwise under oblique light
/// # Ok::<(), tactile_sfs::SfsError>(())
/// ```
///
/// # Errors
/// [`SfsError::ShapeMismatch`]; [`SfsError::EmptyMask`] if no pixel can be compared.
pub fn reprojection<T: Scalar>(
    heights: ArrayView2<'_, T>,
    frame: Frame<'_, T>,
    pixel_size_m: [T; 2],
    lighting: &Lighting<T>,
) -> Result<(Array2<T>, ErrorSummary), SfsError> {
    let (rows, columns) = heights.dim();
    same_shape("image", [rows, columns], frame.dim())?;
    let mut residual = render(heights, pixel_size_m, lighting);
    for ((row, column), value) in residual.indexed_iter_mut() {
        *value -= frame.at(row, column);
    }
    let error = ErrorSummary::of(
        residual
            .iter()
            .map(|value| value.as_f64())
            .filter(|value| value.is_finite()),
    );
    if error.pixels == 0 {
        Err(SfsError::EmptyMask)
    } else {
        Ok((residual, error))
    }
}
