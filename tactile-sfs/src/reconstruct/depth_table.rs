//! Calibrated intensity → depth: a table read off one known indenter.
//!
//! Each pixel's signal (its grey level, or its darkening or brightening against a reference image) is looked up in a
//! calibrated table, linearly between the entries. No neighbour is involved, so nothing accumulates; the price is a
//! calibration and even illumination.

use ndarray::{ArrayView2, ArrayViewMut2};

use super::signal::Signal;
use crate::error::non_negative;
use crate::{
    BoundingBox, Domain, Frame, PixelFlags, Scalar, SfsError, Surface, SurfaceReconstruction,
    Workspace,
};

/// Depth from a calibration table of (signal, depth) pairs.
///
/// Depth is 0 where the signal does not exceed the contact threshold, so that nothing is where nothing touches.
/// Signals beyond the last entry get the last depth and the flag `OUT_OF_RANGE`. Cost: O(pixels of the mask's box).
///
/// ```
/// use ndarray::array;
/// use tactile_sfs::{DepthTable, Domain, SurfaceReconstruction};
/// let table = DepthTable::new(&[(0.0, 0.0), (10.0, 1e-3), (20.0, 1.5e-3)])?;
/// let surface = table.reconstruct(array![[0.0, 5.0, 15.0]].view().into(), &Domain::new([1e-4, 1e-4])?)?;
/// assert_eq!(surface.heights, array![[0.0, 0.5e-3, 1.25e-3]]);
/// # Ok::<(), tactile_sfs::SfsError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct DepthTable<T> {
    pub(super) entries: Vec<(T, T)>,
    signal: Signal<T>,
    pub(super) contact_threshold: T,
}

impl<T: Scalar> DepthTable<T> {
    /// A table of (signal, depth) pairs, both increasing (depths may repeat).
    ///
    /// # Errors
    /// [`SfsError::TableTooShort`] below two entries, [`SfsError::TableNotIncreasing`] for values out of order or NaN.
    pub fn new(entries: &[(T, T)]) -> Result<Self, SfsError> {
        if entries.len() < 2 {
            return Err(SfsError::TableTooShort {
                found: entries.len(),
            });
        }
        for (index, &(signal, depth)) in entries.iter().enumerate() {
            let finite = signal.is_finite() && depth.is_finite();
            let ordered =
                index == 0 || (signal > entries[index - 1].0 && depth >= entries[index - 1].1);
            if !(finite && ordered) {
                return Err(SfsError::TableNotIncreasing { index });
            }
        }
        let entries = entries.to_vec();
        Ok(Self {
            entries,
            signal: Signal::Intensity,
            contact_threshold: T::zero(),
        })
    }

    /// What is looked up; the intensity itself by default.
    pub fn with_signal(self, signal: Signal<T>) -> Self {
        Self { signal, ..self }
    }

    /// Signals up to `threshold` mean no contact: depth 0.
    ///
    /// ```
    /// use ndarray::array;
    /// use tactile_sfs::{DepthTable, Domain, Signal, SurfaceReconstruction};
    /// let dark = array![[20.0, 20.0]];
    /// let table = DepthTable::new(&[(0.0, 0.0), (10.0, 1e-3)])?
    ///     .with_signal(Signal::Brightening(dark))
    ///     .with_contact_threshold(2.0)?; // the camera's noise
    /// let depth = table.reconstruct(array![[21.5, 25.0]].view().into(), &Domain::new([1e-4, 1e-4])?)?.heights;
    /// assert_eq!(depth, array![[0.0, 0.5e-3]]); // 1.5 above the reference is no contact yet
    /// # Ok::<(), tactile_sfs::SfsError>(())
    /// ```
    ///
    /// # Errors
    /// [`SfsError::Negative`] unless finite and not negative.
    pub fn with_contact_threshold(self, threshold: T) -> Result<Self, SfsError> {
        non_negative("contact threshold", threshold.as_f64())?;
        Ok(Self {
            contact_threshold: threshold,
            ..self
        })
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

    fn pixel(&self, signal: T) -> (T, PixelFlags) {
        if !signal.is_finite() {
            (T::nan(), PixelFlags::NON_FINITE)
        } else if signal <= self.contact_threshold {
            (T::zero(), PixelFlags::NONE)
        } else {
            let (depth, inside) = self.depth(signal);
            (
                depth,
                if inside {
                    PixelFlags::NONE
                } else {
                    PixelFlags::OUT_OF_RANGE
                },
            )
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
        self.signal.check_reference((rows, columns))?;
        surface.prepare_to_overwrite(rows, columns, area);
        match frame {
            Frame::Real(_) => self.look_up(&frame, domain, surface, |signal| self.pixel(signal)),
            Frame::Bytes(_) => {
                let levels = Levels::new(|signal| self.pixel(signal));
                let pixel = |signal: T| levels.get(signal).unwrap_or_else(|| self.pixel(signal));
                self.look_up(&frame, domain, surface, pixel);
            }
        }
        if domain.known_heights.is_some() {
            keep_known(domain, surface);
        }
        Ok(())
    }
}

impl<T: Scalar> DepthTable<T> {
    /// Fills the surface's box, row by row, and counts.
    fn look_up(
        &self,
        frame: &Frame<'_, T>,
        domain: &Domain<'_, T>,
        surface: &mut Surface<T>,
        pixel: impl Fn(T) -> (T, PixelFlags),
    ) {
        let area = surface.bounding_box;
        let Surface {
            heights,
            mask,
            flags,
            report,
            ..
        } = surface;
        for row in area.top..area.top + area.rows {
            let line = BoundingBox {
                top: row,
                rows: 1,
                ..area
            };
            let mut heights = line.view_mut(heights.view_mut());
            let mut mask = line.view_mut(mask.view_mut());
            let mut flags = line.view_mut(flags.view_mut());
            self.signals(frame, line, heights.view_mut());
            for ((height, solved), flag) in heights.iter_mut().zip(&mut mask).zip(&mut flags) {
                (*height, *flag) = pixel(*height);
                *solved = height.is_finite();
            }
            keep_inside(
                domain.mask.map(|wanted| line.view(wanted)),
                &mut heights,
                &mut mask,
                &mut flags,
            );
            report.solved += mask
                .iter()
                .map(|&solved| usize::from(solved))
                .sum::<usize>();
            report.flagged += flags
                .iter()
                .map(|flag| usize::from(!flag.is_empty()))
                .sum::<usize>();
        }
    }

    /// The signals of one line of pixels.
    fn signals(&self, frame: &Frame<'_, T>, line: BoundingBox, mut out: ArrayViewMut2<'_, T>) {
        match frame {
            Frame::Real(image) => out.assign(&line.view(image.view())),
            Frame::Bytes(image) => {
                let real = |&byte: &u8| T::from_u8(byte).unwrap_or_else(T::nan);
                out.zip_mut_with(&line.view(image.view()), |out, byte| *out = real(byte));
            }
        }
        match &self.signal {
            Signal::Intensity => {}
            Signal::Darkening(level) => {
                out.zip_mut_with(&line.view(level.view()), |out, &level| *out = level - *out);
            }
            Signal::Brightening(level) => {
                out.zip_mut_with(&line.view(level.view()), |out, &level| *out -= level);
            }
        }
    }
}

/// Empties the pixels of a line that are not wanted.
fn keep_inside<T: Scalar>(
    wanted: Option<ArrayView2<'_, bool>>,
    heights: &mut ArrayViewMut2<'_, T>,
    mask: &mut ArrayViewMut2<'_, bool>,
    flags: &mut ArrayViewMut2<'_, PixelFlags>,
) {
    let Some(wanted) = wanted else { return };
    for (((height, solved), flag), &wanted) in heights.iter_mut().zip(mask).zip(flags).zip(wanted) {
        if !wanted {
            (*height, *solved, *flag) = (T::nan(), false, PixelFlags::NONE);
        }
    }
}

/// Known heights replace those of the table.
fn keep_known<T: Scalar>(domain: &Domain<'_, T>, surface: &mut Surface<T>) {
    for (row, column) in surface.bounding_box.pixels() {
        if let Some(height) = domain
            .known(row, column)
            .filter(|_| domain.contains(row, column))
        {
            surface.report.solved += usize::from(!surface.mask[[row, column]]);
            surface.set(row, column, height);
        }
    }
}

/// The table at every whole signal of 8-bit frames, −255 to 255.
struct Levels<T>([(T, PixelFlags); 511]);

impl<T: Scalar> Levels<T> {
    fn new(pixel: impl Fn(T) -> (T, PixelFlags)) -> Self {
        Self(core::array::from_fn(|index| {
            pixel(T::of(index as f64 - 255.0))
        }))
    }

    /// What the table has for a signal, if the signal is one of its levels.
    #[inline(always)]
    fn get(&self, signal: T) -> Option<(T, PixelFlags)> {
        let level = signal.to_i32()?;
        let entry = self.0.get(usize::try_from(level + 255).ok()?)?;
        (T::from_i32(level)? == signal).then_some(*entry)
    }
}
