//! Moments of floating-point images.

use ndarray::ArrayView2;

use super::double::Double;
use crate::error::{ForceError, Requirement};
use crate::estimate::Real;

/// Moments of an image over its background, and the statistics of its raw pixels.
///
/// Sums are taken with twice the digits of a double, after the background has been subtracted without rounding: a blob of height
/// 10⁻⁵ on a pedestal of 10⁹ keeps all the digits its pixels have.
///
/// ```
/// use ndarray::array;
/// use tactile_force::ImageMoments;
/// let moments = ImageMoments::of(array![[1e9, 1e9 + 1.0], [1e9, 1e9 + 3.0]].view(), 1e9)?;
/// assert_eq!(moments.sum, 4.0);
/// assert_eq!(moments.centroid_px, Some([1.0, 0.75]));
/// assert_eq!(moments.variance, 1.5);
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ImageMoments<T> {
    /// Σ (I − background).
    pub sum: T,
    /// Σ (I − background) (x, y) / sum, in pixels; `None` where the sum is zero.
    pub centroid_px: Option<[T; 2]>,
    /// √(Σ (I − background) |x − centroid|² / sum) over pixel centres, in pixels; `None` where the sum is zero or the second
    /// moment negative, as pixels below the background can make it.
    pub radius_of_gyration_px: Option<T>,
    /// Least raw pixel.
    pub least: T,
    /// Greatest raw pixel.
    pub greatest: T,
    /// Mean of the raw pixels.
    pub mean: T,
    /// Population variance of the raw pixels.
    pub variance: T,
}

/// Second moments below this share of the sum of their sizes are rounding: some thousand terms of 2⁻¹⁰⁴.
const NOTHING: f64 = 1e-28;

impl<T: Real> ImageMoments<T> {
    /// Computes the moments in O(pixels).
    ///
    /// # Errors
    /// An image without pixels, or with a pixel (or background) that is not finite.
    pub fn of(image: ArrayView2<'_, T>, background: T) -> Result<Self, ForceError> {
        let first = checked(&image, background)?;
        let (rows, columns) = image.dim();
        let middle = [0.5 * (columns as f64 - 1.0), 0.5 * (rows as f64 - 1.0)];
        let (mut s, mut raw) = (Sums::default(), [Double::default(); 2]);
        let (mut least, mut greatest) = (T::infinity(), T::neg_infinity());
        for ((row, column), &pixel) in image.indexed_iter() {
            (least, greatest) = (least.min(pixel), greatest.max(pixel));
            let above = Double::difference(pixel.as_f64(), background.as_f64());
            s.add(above, column as f64 - middle[0], row as f64 - middle[1]);
            let shifted = Double::difference(pixel.as_f64(), first);
            raw = [raw[0] + shifted, raw[1] + shifted * shifted];
        }
        let n = Double::from(image.len() as f64);
        let shift = raw[0].over(n);
        let variance = (raw[1].over(n) - shift * shift).value().max(0.0);
        let (centroid, spread) = s.finish(middle);
        Ok(Self {
            sum: T::nearest(s.sum.value()),
            centroid_px: centroid.map(|c| c.map(T::nearest)),
            radius_of_gyration_px: spread.map(T::nearest),
            least,
            greatest,
            mean: T::nearest((shift + first.into()).value()),
            variance: T::nearest(variance),
        })
    }
}

/// The first pixel of an image that has pixels, all finite.
fn checked<T: Real>(image: &ArrayView2<'_, T>, background: T) -> Result<f64, ForceError> {
    let (rows, columns) = image.dim();
    let Some(first) = image.first() else {
        return Err(ForceError::EmptyImage { rows, columns });
    };
    if let Some(((row, column), _)) = image.indexed_iter().find(|(_, p)| !p.is_finite()) {
        return Err(ForceError::NonFinitePixel { row, column });
    }
    Requirement::Finite.check("background", background.as_f64())?;
    Ok(first.as_f64())
}

/// Sums about the image's middle.
#[derive(Default)]
struct Sums {
    sum: Double,
    x: Double,
    y: Double,
    square: Double,
    /// Σ |I| |x|², the size of what may cancel.
    size: Double,
}

impl Sums {
    fn add(&mut self, above: Double, x: f64, y: f64) {
        let square = above * (x * x + y * y).into();
        self.sum = self.sum + above;
        self.x = self.x + above * x.into();
        self.y = self.y + above * y.into();
        self.square = self.square + square;
        self.size = self.size + square.abs();
    }

    /// Centroid and radius of gyration.
    fn finish(&self, middle: [f64; 2]) -> (Option<[f64; 2]>, Option<f64>) {
        if self.sum.value() == 0.0 {
            return (None, None);
        }
        let [x, y] = [self.x.over(self.sum), self.y.over(self.sum)];
        let centroid = Some([
            (x + middle[0].into()).value(),
            (y + middle[1].into()).value(),
        ]);
        let spread = (self.square.over(self.sum) - x * x - y * y).value();
        let rounding =
            NOTHING * (self.size.value() / self.sum.value().abs() + (x * x + y * y).value());
        match spread {
            s if s.abs() <= rounding => (centroid, Some(0.0)),
            s if s < 0.0 => (centroid, None),
            s => (centroid, Some(s.sqrt())),
        }
    }
}
