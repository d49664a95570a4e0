//! Calibrated intensity → depth: a table read off one known indenter.
//!
//! Each pixel's signal (its grey level, or its darkening or brightening against a reference image) is looked up in a
//! calibrated table, linearly between the entries. No neighbour is involved, so nothing accumulates; the price is a
//! calibration and even illumination.

use ndarray::Array2;

use crate::domain::same_shape;
use crate::error::{Input, non_negative};
use crate::{Domain, Frame, PixelFlags, Scalar, SfsError, Surface, SurfaceReconstruction, Workspace};

/// What is looked up in a [`DepthTable`].
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

/// Depth from a calibration table of (signal, depth) pairs.
///
/// Depth is 0 where the signal does not exceed the contact threshold, so that nothing is where nothing touches.
/// Signals beyond the last entry get the last depth and the flag `OUT_OF_RANGE`. Cost: O(pixels).
///
/// ```
/// use ndarray::array;
/// use tactile_sfs::{DepthTable, Domain, SurfaceReconstruction};
/// let table = DepthTable::new(&[(0.0, 0.0), (10.0, 1e-3), (20.0, 1.5e-3)])?;
/// let surface = table.reconstruct(array![[0.0, 5.0, 15.0]].view(), &Domain::new([1e-4, 1e-4])?)?;
/// assert_eq!(surface.heights, array![[0.0, 0.5e-3, 1.25e-3]]);
/// # Ok::<(), tactile_sfs::SfsError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct DepthTable<T> {
    entries: Vec<(T, T)>,
    signal: Signal<T>,
    contact_threshold: T,
}

impl<T: Scalar> DepthTable<T> {
    /// A table of (signal, depth) pairs, both increasing (depths may repeat).
    ///
    /// # Errors
    /// [`SfsError::TableTooShort`] below two entries, [`SfsError::TableNotIncreasing`] for values out of order or NaN.
    pub fn new(entries: &[(T, T)]) -> Result<Self, SfsError> {
        if entries.len() < 2 {
            return Err(SfsError::TableTooShort { found: entries.len() });
        }
        for (index, &(signal, depth)) in entries.iter().enumerate() {
            let finite = signal.is_finite() && depth.is_finite();
            let ordered = index == 0 || (signal > entries[index - 1].0 && depth >= entries[index - 1].1);
            if !(finite && ordered) {
                return Err(SfsError::TableNotIncreasing { index });
            }
        }
        let entries = entries.to_vec();
        Ok(Self { entries, signal: Signal::Intensity, contact_threshold: T::zero() })
    }

    /// What is looked up; the intensity itself by default.
    pub fn with_signal(self, signal: Signal<T>) -> Self {
        Self { signal, ..self }
    }

    /// Signals up to `threshold` mean no contact: depth 0.
    ///
    /// # Errors
    /// [`SfsError::InvalidOption`] unless finite and not negative.
    pub fn with_contact_threshold(self, threshold: T) -> Result<Self, SfsError> {
        non_negative("contact threshold", threshold.as_f64())?;
        Ok(Self { contact_threshold: threshold, ..self })
    }

    /// What is looked up.
    pub fn signal(&self) -> &Signal<T> {
        &self.signal
    }

    /// The (signal, depth) pairs.
    pub fn entries(&self) -> &[(T, T)] {
        &self.entries
    }

    /// Depth of a signal and whether the signal lies within the table.
    pub fn depth(&self, signal: T) -> (T, bool) {
        let entries = &self.entries;
        let (first, last) = (entries[0], entries[entries.len() - 1]);
        if signal <= first.0 {
            return (first.1, signal == first.0);
        }
        if signal >= last.0 {
            return (last.1, signal == last.0);
        }
        let upper = entries.partition_point(|entry| entry.0 <= signal);
        let ((s0, d0), (s1, d1)) = (entries[upper - 1], entries[upper]);
        (d0 + (d1 - d0) * (signal - s0) / (s1 - s0), true)
    }

    pub(super) fn check_reference(&self, (rows, columns): (usize, usize)) -> Result<(), SfsError> {
        match &self.signal {
            Signal::Intensity => Ok(()),
            Signal::Darkening(reference) | Signal::Brightening(reference) => {
                same_shape(Input::Reference, [rows, columns], reference.dim())
            }
        }
    }

    pub(super) fn signal_at(&self, frame: &Frame<'_, T>, row: usize, column: usize) -> T {
        let intensity = frame.at(row, column);
        match &self.signal {
            Signal::Intensity => intensity,
            Signal::Darkening(reference) => reference[[row, column]] - intensity,
            Signal::Brightening(reference) => intensity - reference[[row, column]],
        }
    }

    fn pixel(&self, signal: T) -> (T, PixelFlags) {
        if !signal.is_finite() {
            (T::nan(), PixelFlags::NON_FINITE)
        } else if signal <= self.contact_threshold {
            (T::zero(), PixelFlags::NONE)
        } else {
            let (depth, inside) = self.depth(signal);
            (depth, if inside { PixelFlags::NONE } else { PixelFlags::OUT_OF_RANGE })
        }
    }
}

impl<T: Scalar> SurfaceReconstruction<T> for DepthTable<T> {
    fn reconstruct_with(
        &self,
        _workspace: &mut Workspace<T>,
        frame: Frame<'_, T>,
        domain: &Domain<'_, T>,
        surface: &mut Surface<T>,
    ) -> Result<(), SfsError> {
        let (rows, columns) = frame.dim();
        let area = domain.validate(rows, columns)?;
        self.check_reference((rows, columns))?;
        surface.prepare(rows, columns, area);
        for row in area.top..area.top + area.rows {
            for column in area.left..area.left + area.columns {
                if !domain.contains(row, column) {
                    continue;
                }
                let (depth, flags) = self.pixel(self.signal_at(&frame, row, column));
                surface.set(row, column, domain.known(row, column).unwrap_or(depth));
                surface.flags[[row, column]] = flags;
            }
        }
        surface.finish(domain);
        Ok(())
    }
}
