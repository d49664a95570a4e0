//! Frames of a gel: colours or grey levels.

use ndarray::{Array2, Array3, ArrayView2, ArrayView3};

/// An 8-bit frame: `[row, column]` of a gel that darkens, or `[row, column, channel]` of a gel lit
/// in colours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum GelImage<'a> {
    /// Grey levels.
    Grey(ArrayView2<'a, u8>),
    /// Red, green and blue.
    Colour(ArrayView3<'a, u8>),
}

impl GelImage<'_> {
    /// Number of rows and columns.
    pub fn dim(&self) -> (usize, usize) {
        match self {
            Self::Grey(levels) => levels.dim(),
            Self::Colour(levels) => (levels.dim().0, levels.dim().1),
        }
    }
}

impl<'a> From<ArrayView2<'a, u8>> for GelImage<'a> {
    fn from(levels: ArrayView2<'a, u8>) -> Self {
        Self::Grey(levels)
    }
}

impl<'a> From<ArrayView3<'a, u8>> for GelImage<'a> {
    fn from(levels: ArrayView3<'a, u8>) -> Self {
        Self::Colour(levels)
    }
}

impl<'a> From<&'a Array2<u8>> for GelImage<'a> {
    fn from(levels: &'a Array2<u8>) -> Self {
        Self::Grey(levels.view())
    }
}

impl<'a> From<&'a Array3<u8>> for GelImage<'a> {
    fn from(levels: &'a Array3<u8>) -> Self {
        Self::Colour(levels.view())
    }
}
