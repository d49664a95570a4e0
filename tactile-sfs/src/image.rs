//! Image input: floating-point values, or the bytes of an 8-bit camera read in place, with their
//! domain.

use ndarray::ArrayView2;

use crate::{Domain, PixelScalar};

/// Input of a reconstruction: the values of the pixels and their domain.
///
/// ```
/// use ndarray::array;
/// use tactile_sfs::{DepthTable, Domain, Image, SurfaceReconstruction};
/// let (bytes, mask) = (array![[0_u8, 50, 100]], array![[true, true, false]]);
/// let domain = Domain::<f64>::new([1e-4, 1e-4])?.with_mask(mask.view());
/// let table = DepthTable::new(&[(0.0, 0.0), (200.0, 1e-3)])?;
/// let heights = table.reconstruct(Image::new(bytes.view(), domain))?.heights;
/// assert!(heights[[0, 1]] == 0.25e-3 && heights[[0, 2]].is_nan());
/// # Ok::<(), tactile_sfs::SfsError>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Image<'v, 'd, T> {
    /// The values of the pixels.
    pub values: Frame<'v, T>,
    /// Pixel size, mask and known heights.
    pub domain: Domain<'d, T>,
}

impl<'v, 'd, T> Image<'v, 'd, T> {
    /// Values on a domain. The reconstruction checks that their shapes agree.
    pub fn new(values: impl Into<Frame<'v, T>>, domain: Domain<'d, T>) -> Self {
        Self {
            values: values.into(),
            domain,
        }
    }
}

/// The values of an image: real intensities or 8-bit grey levels (0 … 255, not rescaled).
///
/// ```
/// use ndarray::array;
/// use tactile_sfs::Frame;
/// let bytes = array![[0_u8, 128, 255]];
/// let frame = Frame::<f32>::Bytes(bytes.view()); // read in place, without rescaling
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
        }
    }
}
