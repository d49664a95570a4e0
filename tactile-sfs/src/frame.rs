//! Image input: floats, or the bytes of an 8-bit camera read in place.

use ndarray::{ArrayView2, ArrayView3};

use crate::PixelScalar;

/// An image as the reconstructions take it: real intensities or 8-bit grey levels (0 … 255, not
/// rescaled).
///
/// ```
/// use ndarray::array;
/// use tactile_sfs::Frame;
/// let bytes = array![[0_u8, 128, 255]];
/// let frame = Frame::<f32>::Bytes(bytes.view()); // read in place, not rescaled
/// assert!(matches!(frame, Frame::Bytes(view) if view[[0, 2]] == 255));
/// let real = array![[0.0_f32, 0.5]];
/// assert!(matches!(real.view().into(), Frame::Real(view) if view[[0, 1]] == 0.5_f32));
/// ```
#[derive(Clone, Copy, Debug)]
pub enum Frame<'a, T> {
    /// Intensities in the unit of [`Lighting`](crate::Lighting).
    Real(ArrayView2<'a, T>),
    /// Grey levels of an 8-bit camera.
    Bytes(ArrayView2<'a, u8>),
    /// Levels of an 8-bit colour camera, `[row, column, channel]`. Methods of one channel read the
    /// mean of the channels.
    Colour(ArrayView3<'a, u8>),
}

impl<'a, T: PixelScalar> From<ArrayView2<'a, T>> for Frame<'a, T> {
    fn from(view: ArrayView2<'a, T>) -> Self {
        Frame::Real(view)
    }
}

impl<'a, T: PixelScalar> From<ArrayView2<'a, u8>> for Frame<'a, T> {
    fn from(view: ArrayView2<'a, u8>) -> Self {
        Frame::Bytes(view)
    }
}

impl<'a, T: PixelScalar> From<ArrayView3<'a, u8>> for Frame<'a, T> {
    fn from(view: ArrayView3<'a, u8>) -> Self {
        Frame::Colour(view)
    }
}

impl<T: PixelScalar> Frame<'_, T> {
    /// Rows and columns.
    ///
    /// ```
    /// use ndarray::array;
    /// use tactile_sfs::Frame;
    /// let bytes = array![[0_u8, 128, 255]];
    /// let frame = Frame::<f64>::from(bytes.view());
    /// assert_eq!((frame.dim(), frame.at(0, 1)), ((1, 3), 128.0));
    /// ```
    pub fn dim(&self) -> (usize, usize) {
        match self {
            Frame::Real(view) => view.dim(),
            Frame::Bytes(view) => view.dim(),
            Frame::Colour(view) => (view.dim().0, view.dim().1),
        }
    }

    /// Intensity of one pixel of the image.
    ///
    /// # Panics
    /// If the pixel lies outside the image.
    #[inline]
    pub fn at(&self, row: usize, column: usize) -> T {
        match self {
            Frame::Real(view) => view[[row, column]],
            Frame::Bytes(view) => T::of(f64::from(view[[row, column]])),
            Frame::Colour(view) => {
                let channels = view.dim().2;
                let sum: f64 = (0..channels)
                    .map(|k| f64::from(view[[row, column, k]]))
                    .sum();
                T::of(sum / channels as f64)
            }
        }
    }
}
