//! Slopes of heights on pixels.

use ndarray::{Array2, ArrayView2};

use crate::PixelScalar;

/// Slopes p = ∂z/∂x and q = ∂z/∂y by central differences, one-sided next to missing (NaN) heights
/// or the border of the frame. They are NaN at missing heights, and 0 along an axis without
/// neighbours. Second order inside, first order at borders.
///
/// ```
/// use ndarray::array;
/// let (p, q) = tactile_sfs::slopes(array![[0.0, 1.0, 4.0], [0.0, 1.0, 4.0]].view(), [1.0, 1.0]);
/// assert_eq!((p[[0, 1]], q[[0, 1]]), (2.0, 0.0));
/// ```
pub fn slopes<T: PixelScalar>(
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

/// Slopes at a pixel with a finite height.
pub(crate) fn slopes_at<T: PixelScalar>(
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
    // 0 − 1 wraps to an index that is beyond every array.
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
