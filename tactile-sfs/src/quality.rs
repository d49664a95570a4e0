//! Errors of a surface: of its heights against the truth, or of its shading against the image, a
//! check that needs no truth.

use ndarray::{Array2, ArrayView2};

use crate::domain::same_shape;
use crate::{Frame, Lighting, PixelScalar, SfsError};

/// What is fitted before heights are compared.
///
/// ```
/// use ndarray::array;
/// use tactile_sfs::{Alignment, height_error};
/// let (z, truth) = (array![[0.0, 1.0, 2.0]], array![[1.0, 3.0, 5.0]]); // truth = 2 z + 1
/// let rms = |alignment| {
///     Ok::<_, tactile_sfs::SfsError>(
///         height_error(z.view(), truth.view(), None, alignment)?
///             .error
///             .rms,
///     )
/// };
/// assert!((rms(Alignment::None)? - (14.0_f64 / 3.0).sqrt()).abs() < 1e-12);
/// assert!((rms(Alignment::Offset)? - (2.0_f64 / 3.0).sqrt()).abs() < 1e-12);
/// assert!(rms(Alignment::Affine)? < 1e-12);
/// # Ok::<(), tactile_sfs::SfsError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Alignment {
    /// Nothing: absolute heights.
    None,
    /// A constant, by least squares.
    Offset,
    /// Scale and constant, by least squares: scale · z + offset.
    Affine,
}

/// Mean absolute, root mean square and largest error.
///
/// ```
/// use ndarray::array;
/// use tactile_sfs::{Alignment, ErrorSummary, height_error};
/// let (z, truth) = (array![[3.0, 0.0, 4.0, f64::NAN]], array![[0.0, 0.0, 0.0, 0.0]]);
/// let error = height_error(z.view(), truth.view(), None, Alignment::None)?.error;
/// let rms = (25.0_f64 / 3.0).sqrt();
/// assert_eq!(
///     error,
///     ErrorSummary {
///         mean_absolute: 7.0 / 3.0,
///         rms,
///         max: 4.0,
///         pixels: 3
///     }
/// ); // without the missing height
///     
/// # Ok::<(), tactile_sfs::SfsError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ErrorSummary {
    /// Mean of |error|.
    pub mean_absolute: f64,
    /// Root of the mean of error².
    pub rms: f64,
    /// Largest |error|.
    pub max: f64,
    /// Pixels compared.
    pub pixels: usize,
}

impl ErrorSummary {
    fn of(errors: impl Iterator<Item = f64>) -> Self {
        let (mut sum, mut square, mut max, mut pixels) = (0.0, 0.0, 0.0_f64, 0);
        for error in errors {
            sum += error.abs();
            square += error * error;
            max = max.max(error.abs());
            pixels += 1;
        }
        let n = (pixels as f64).max(1.0);
        Self {
            mean_absolute: sum / n,
            rms: (square / n).sqrt(),
            max,
            pixels,
        }
    }
}

/// Error of heights, the alignment that was applied, and what a constant guess would have reached.
///
/// ```
/// use ndarray::array;
/// use tactile_sfs::{Alignment, height_error};
/// let (z, truth) = (array![[0.1, 0.1, 0.2]], array![[1.0, 1.0, 4.0]]);
/// let result = height_error(z.view(), truth.view(), None, Alignment::Offset)?;
/// assert!((result.offset - (2.0 - 0.4 / 3.0_f64)).abs() < 1e-12 && result.scale == 1.0);
/// // The median 1 misses 3 at one pixel of three.
/// assert_eq!((result.range, result.constant_guess), (3.0, 1.0));
/// // This surface is worse than a constant.
/// assert!(result.error.mean_absolute > result.constant_guess);
/// # Ok::<(), tactile_sfs::SfsError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeightError {
    /// Error of scale · z + offset.
    pub error: ErrorSummary,
    /// Scale applied (1 unless affine).
    pub scale: f64,
    /// Offset applied (0 without alignment).
    pub offset: f64,
    /// Mean absolute error of the best constant, the median of the truth: what a method must beat.
    pub constant_guess: f64,
    /// Range of the true heights.
    pub range: f64,
}

/// Compares heights with the truth where both are finite (and the mask is true).
///
/// ```
/// use ndarray::array;
/// use tactile_sfs::{Alignment, height_error};
/// let (z, truth) = (array![[0.0, 1.0, 2.0]], array![[1.0, 3.0, 5.0]]);
/// let result = height_error(z.view(), truth.view(), None, Alignment::Affine)?;
/// assert!((result.scale - 2.0).abs() < 1e-12 && result.error.max < 1e-12);
/// assert!((result.constant_guess - 4.0 / 3.0).abs() < 1e-12);
/// # Ok::<(), tactile_sfs::SfsError>(())
/// ```
///
/// # Errors
/// [`SfsError::ShapeMismatch`]. [`SfsError::EmptyMask`] if no pixel can be compared.
pub fn height_error<T: PixelScalar>(
    heights: ArrayView2<'_, T>,
    truth: ArrayView2<'_, T>,
    mask: Option<ArrayView2<'_, bool>>,
    alignment: Alignment,
) -> Result<HeightError, SfsError> {
    same_shape("true heights", heights.dim(), truth.dim())?;
    if let Some(mask) = mask {
        same_shape("mask", heights.dim(), mask.dim())?;
    }
    let pairs: Vec<(f64, f64)> = heights
        .indexed_iter()
        .filter(|(at, _)| mask.is_none_or(|mask| mask[*at]))
        .map(|(at, z)| (z.as_f64(), truth[at].as_f64()))
        .filter(|(z, t)| z.is_finite() && t.is_finite())
        .collect();
    if pairs.is_empty() {
        return Err(SfsError::EmptyMask);
    }
    let (scale, offset) = align(&pairs, alignment);
    let error = ErrorSummary::of(pairs.iter().map(|(z, t)| scale * z + offset - t));
    let [lowest, median, highest] = order_statistics(pairs.iter().map(|pair| pair.1).collect());
    let constant_guess = pairs
        .iter()
        .map(|pair| (pair.1 - median).abs())
        .sum::<f64>()
        / pairs.len() as f64;
    Ok(HeightError {
        error,
        scale,
        offset,
        constant_guess,
        range: highest - lowest,
    })
}

/// Lowest, median and highest of some values.
fn order_statistics(mut values: Vec<f64>) -> [f64; 3] {
    values.sort_by(f64::total_cmp);
    [
        values[0],
        values[values.len() / 2],
        values[values.len() - 1],
    ]
}

fn align(pairs: &[(f64, f64)], alignment: Alignment) -> (f64, f64) {
    let n = pairs.len() as f64;
    let mean = |of: fn(&(f64, f64)) -> f64| pairs.iter().map(of).sum::<f64>() / n;
    let (z, t) = (mean(|pair| pair.0), mean(|pair| pair.1));
    match alignment {
        Alignment::None => (1.0, 0.0),
        Alignment::Offset => (1.0, t - z),
        Alignment::Affine => {
            let (mut zz, mut zt) = (0.0, 0.0);
            for pair in pairs {
                // About the means: raw second moments of heights far from 0 cancel.
                zz += (pair.0 - z) * (pair.0 - z);
                zt += (pair.0 - z) * (pair.1 - t);
            }
            // A flat surface has no scale.
            let scale = if zz > 0.0 { zt / zz } else { 1.0 };
            (scale, t - scale * z)
        }
    }
}

/// Slopes p = ∂z/∂x and q = ∂z/∂y: central differences, one-sided next to missing (NaN) heights or
/// the frame's border. NaN where the height is missing and 0 along an axis without neighbours.
/// Second order inside, first at borders.
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

/// Slopes at a pixel whose height is finite.
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

/// Shades a surface. NaN where it has no height.
///
/// ```
/// use ndarray::Array2;
/// use tactile_sfs::{Lighting, render};
/// let image = render(Array2::<f64>::zeros((3, 3)).view(), [1.0, 1.0], &Lighting::default());
/// assert_eq!(image[[1, 1]], 1.0);
/// ```
pub fn render<T: PixelScalar>(
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

/// Renders a surface and compares it with the image it was made from. Returns rendered minus
/// observed intensity (NaN where there is no height), and a summary of it in the image's unit.
///
/// A small residual does not prove the surface right (convex and concave look alike), a large one
/// proves it wrong.
///
/// ```
/// use ndarray::Array2;
/// use tactile_sfs::{Frame, Lighting, render, reprojection};
/// let light = Lighting::new([0.3, 0.0, 1.0])?;
/// let square = |r: usize, c: usize| (r as f64 - 4.0).powi(2) + (c as f64 - 4.0).powi(2);
/// let bump = Array2::from_shape_fn((9, 9), |(r, c)| -0.05 * square(r, c));
/// let image = render(bump.view(), [1.0, 1.0], &light);
/// let rms = |z: &Array2<f64>| {
///     let (_, error) = reprojection(z.view(), Frame::Real(image.view()), [1.0, 1.0], &light)?;
///     Ok::<_, tactile_sfs::SfsError>(error.rms)
/// };
/// // A hollow shades otherwise under oblique light.
/// assert!(rms(&bump)? < 1e-12 && rms(&-&bump)? > 0.1);
/// # Ok::<(), tactile_sfs::SfsError>(())
/// ```
///
/// # Errors
/// [`SfsError::ShapeMismatch`]. [`SfsError::EmptyMask`] if no pixel can be compared.
pub fn reprojection<T: PixelScalar>(
    heights: ArrayView2<'_, T>,
    frame: Frame<'_, T>,
    pixel_size_m: [T; 2],
    lighting: &Lighting<T>,
) -> Result<(Array2<T>, ErrorSummary), SfsError> {
    same_shape("image", heights.dim(), frame.dim())?;
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
