//! The signal that a depth table is entered with.

use ndarray::Array2;

use crate::domain::same_shape;
use crate::{Frame, Scalar, SfsError};

/// What is looked up in a [`DepthTable`](crate::DepthTable).
///
/// ```
/// use ndarray::{Array2, array};
/// use tactile_sfs::{DepthTable, Domain, Signal, SurfaceReconstruction};
/// let (reference, image) = (Array2::from_elem((1, 2), 200.0), array![[200.0, 180.0]]);
/// let table = DepthTable::new(&[(0.0, 0.0), (40.0, 1e-3)])?; // a millimetre darkens by 40 grey levels
/// let method = table.with_signal(Signal::Darkening(reference));
/// let depth = method.reconstruct(image.view().into(), &Domain::new([1e-4, 1e-4])?)?.heights;
/// assert_eq!(depth, array![[0.0, 0.5e-3]]);
/// # Ok::<(), tactile_sfs::SfsError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Signal<T> {
    /// The intensity itself.
    Intensity,
    /// Reference minus image: sensors that grow darker with depth.
    Darkening(Array2<T>),
    /// Image minus reference: sensors that grow brighter with depth.
    Brightening(Array2<T>),
}

impl<T: Scalar> Signal<T> {
    pub(super) fn check_reference(&self, (rows, columns): (usize, usize)) -> Result<(), SfsError> {
        match self {
            Signal::Intensity => Ok(()),
            Signal::Darkening(reference) | Signal::Brightening(reference) => {
                same_shape("reference image", [rows, columns], reference.dim())
            }
        }
    }

    pub(super) fn of_pixel(&self, frame: &Frame<'_, T>, row: usize, column: usize) -> T {
        let intensity = frame.at(row, column);
        match self {
            Signal::Intensity => intensity,
            Signal::Darkening(reference) => reference[[row, column]] - intensity,
            Signal::Brightening(reference) => intensity - reference[[row, column]],
        }
    }
}
