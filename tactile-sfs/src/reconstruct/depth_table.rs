//! Calibrated intensity → depth: a table read off one known indenter.
//!
//! Each pixel's signal (its grey level, or its darkening or brightening against a reference image)
//! is looked up in a calibrated table, linearly between the entries. No neighbour is involved, so
//! nothing accumulates. It needs a calibration and even illumination.
//!
//! A table calibrated on a ball counts depth from the contact circle. That circle is where the
//! signal crossed a threshold, often with its radius rounded to a pixel. The surface is already
//! pressed down there: at the rim of a cap of radius R one pixel h of the contact radius a is h
//! a/√(R² − a²) of depth, everywhere. The signal has a zero of its own, the frame that equals its
//! reference. Depth is smooth in the signal, so [`DepthTable::zeroed`] reads off the table how deep
//! its zero lies.

use nalgebra::{Matrix3, Vector3};
use ndarray::Array2;
use tactile_core::Requirement;

use crate::domain::same_shape;
use crate::{
    Domain, Frame, PixelFlags, PixelScalar, SfsError, Surface, SurfaceReconstruction,
    SurfaceWorkspace,
};

/// What is looked up in a [`DepthTable`](crate::DepthTable).
///
/// ```
/// use ndarray::{Array2, array};
/// use tactile_sfs::{DepthTable, Domain, Signal, SurfaceReconstruction};
/// let (reference, image) = (Array2::from_elem((1, 2), 200.0), array![[200.0, 180.0]]);
/// // A millimetre darkens by 40 grey levels.
/// let table = DepthTable::new(&[(0.0, 0.0), (40.0, 1e-3)])?;
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

impl<T: PixelScalar> Signal<T> {
    pub(super) fn check_reference(&self, shape: (usize, usize)) -> Result<(), SfsError> {
        match self {
            Signal::Intensity => Ok(()),
            Signal::Darkening(reference) | Signal::Brightening(reference) => {
                same_shape("reference image", shape, reference.dim())
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

/// Depth from a calibration table of (signal, depth) pairs.
///
/// Depth is 0 where the signal does not exceed the contact threshold, so that nothing is where
/// nothing touches. Signals beyond the last entry get the last depth and the flag `OUT_OF_RANGE`.
/// Cost: O(pixels of the mask's box).
///
/// ```
/// use ndarray::array;
/// use tactile_sfs::{DepthTable, Domain, SurfaceReconstruction};
/// let table = DepthTable::new(&[(0.0, 0.0), (10.0, 1e-3), (20.0, 1.5e-3)])?;
/// let surface = table.reconstruct(
///     array![[0.0, 5.0, 15.0]].view().into(),
///     &Domain::new([1e-4, 1e-4])?,
/// )?;
/// assert_eq!(surface.heights, array![[0.0, 0.5e-3, 1.25e-3]]);
/// # Ok::<(), tactile_sfs::SfsError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct DepthTable<T> {
    entries: Vec<(T, T)>,
    signal: Signal<T>,
    contact_threshold: T,
}

impl<T: PixelScalar> DepthTable<T> {
    /// A table of (signal, depth) pairs, both increasing (depths may repeat).
    ///
    /// # Errors
    /// [`SfsError::TableTooShort`] below two entries, [`SfsError::TableNotIncreasing`] for values
    /// out of order or NaN.
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

    /// What is looked up. The intensity itself by default.
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
    /// let depth = table
    ///     .reconstruct(
    ///         array![[21.5, 25.0]].view().into(),
    ///         &Domain::new([1e-4, 1e-4])?,
    ///     )?
    ///     .heights;
    /// assert_eq!(depth, array![[0.0, 0.5e-3]]); // 1.5 above the reference is no contact yet
    /// # Ok::<(), tactile_sfs::SfsError>(())
    /// ```
    ///
    /// # Errors
    /// [`SfsError::InvalidOption`] unless finite and not negative.
    pub fn with_contact_threshold(self, threshold: T) -> Result<Self, SfsError> {
        Requirement::NonNegative.check("contact threshold", threshold.as_f64())?;
        Ok(Self {
            contact_threshold: threshold,
            ..self
        })
    }

    /// Depth of a signal and whether the signal lies within the table.
    pub fn depth(&self, signal: T) -> (T, bool) {
        let entries = &self.entries;
        let (first, last) = (entries[0], entries[entries.len() - 1]);
        // Nothing is extrapolated: beyond its ends the table is constant.
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

impl<T: PixelScalar> SurfaceReconstruction<T> for DepthTable<T> {
    fn reconstruct(
        &self,
        frame: Frame<'_, T>,
        domain: &Domain<'_, T>,
    ) -> Result<Surface<T>, SfsError> {
        Surface::made_by(|workspace, surface| {
            self.reconstruct_with(workspace, frame, domain, surface)
        })
    }

    fn reconstruct_with(
        &self,
        _workspace: &mut SurfaceWorkspace<T>,
        frame: Frame<'_, T>,
        domain: &Domain<'_, T>,
        surface: &mut Surface<T>,
    ) -> Result<(), SfsError> {
        self.signal.check_reference(frame.dim())?;
        let area = surface.enter(frame.dim(), domain)?;
        // The table at every whole signal of 8-bit frames, −255 to 255: looking it up takes a fifth
        // of the time.
        let levels = matches!(frame, Frame::Bytes(_)).then(|| {
            core::array::from_fn::<_, 511, _>(|index| self.pixel(T::of(index as f64 - 255.0)))
        });
        let of_level = |signal: T| {
            let level = signal.to_i32()?;
            let entry = levels.as_ref()?.get(usize::try_from(level + 255).ok()?)?;
            (T::from_i32(level)? == signal).then_some(*entry)
        };
        for (row, column) in area.pixels() {
            if !domain.contains(row, column) {
                continue;
            }
            if let Some(known) = domain.known(row, column) {
                surface.set(row, column, known);
                continue;
            }
            let signal = self.signal.of_pixel(&frame, row, column);
            let (height, flags) = of_level(signal).unwrap_or_else(|| self.pixel(signal));
            surface.set(row, column, height);
            surface.flags[[row, column]] = flags;
        }
        surface.finish(domain);
        Ok(())
    }
}

impl<T: PixelScalar> DepthTable<T> {
    /// The table moved by a constant depth so that zero signal is zero depth.
    ///
    /// A parabola d = c₀ + c₁ s + c₂ s² is fitted, by least squares, to the entries (s, d) above
    /// the threshold of contact. They become d − c₀ (or 0 where that is negative), and those at or
    /// below it make way for (0, 0). For signals that are counted from a reference
    /// ([`Signal::Darkening`](crate::Signal), `Brightening`). The threshold, to be set before
    /// ([`with_contact_threshold`](Self::with_contact_threshold)), should be a tenth of the largest
    /// signal or less: the parabola is extended from there to zero. Depth must be smooth in the
    /// signal there. Of light that goes as the power 0.8 or 1.2 of the depth the zero is off by 3
    /// or 4 % of the range, which the table does not show. O(entries).
    ///
    /// ```
    /// use tactile_sfs::DepthTable;
    /// // A level is 30 µm deep. The makers counted depth from the contact's rim, at three levels.
    /// let entries: Vec<_> = (3..60).map(|s| (f64::from(s), 30e-6 * f64::from(s - 3))).collect();
    /// let table = DepthTable::new(&entries)?.with_contact_threshold(3.0)?;
    /// assert!((table.depth(40.0).0 - 1.11e-3).abs() < 1e-12);
    /// assert!((table.zeroed()?.depth(40.0).0 - 1.20e-3).abs() < 1e-12);
    /// # Ok::<(), tactile_sfs::SfsError>(())
    /// ```
    ///
    /// # Errors
    /// [`SfsError::TableZero`] for fewer than four entries above the threshold, or where the
    /// parabola misses them by more than 1 % of their range (root mean square).
    pub fn zeroed(mut self) -> Result<Self, SfsError> {
        let kept: Vec<(f64, f64)> = self
            .entries
            .iter()
            .filter(|(signal, _)| *signal > self.contact_threshold)
            .map(|(signal, depth)| (signal.as_f64(), depth.as_f64()))
            .collect();
        let zero = depth_at_zero(&kept)?;
        // A depth below that of no signal would be noise of the fit.
        let moved = |&(s, d): &(f64, f64)| (T::of(s), T::of((d - zero).max(0.0)));
        self.entries = vec![(T::zero(), T::zero())];
        self.entries.extend(kept.iter().map(moved));
        Ok(self)
    }
}

/// Depth of the fitted parabola at signal zero. Entries increase in signal, so the range is
/// positive for two or more.
fn depth_at_zero(entries: &[(f64, f64)]) -> Result<f64, SfsError> {
    let unfit = |misfit| SfsError::TableZero {
        entries: entries.len(),
        misfit,
    };
    let (Some(first), Some(last)) = (entries.first(), entries.last()) else {
        return Err(unfit(0.0));
    };
    // One more than a parabola passes through.
    if entries.len() < 4 {
        return Err(unfit(0.0));
    }
    // Signals and depths in parts of their largest values keep the normal equations' condition that
    // of the table's shape.
    let (scale, range) = (last.0, last.1 - first.1);
    let row = |signal: f64| {
        let x = signal / scale;
        Vector3::new(1.0, x, x * x)
    };
    let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
    // Depths count from the first entry, which removes their common offset from the sums.
    for &(signal, depth) in entries {
        normal += row(signal) * row(signal).transpose();
        right += row(signal) * (depth - first.1);
    }
    let fitted = normal.cholesky().ok_or_else(|| unfit(0.0))?.solve(&right);
    let square =
        |&(signal, depth): &(f64, f64)| (depth - first.1 - row(signal).dot(&fitted)).powi(2);
    let mean_square = entries.iter().map(square).sum::<f64>() / entries.len() as f64;
    let misfit = mean_square.sqrt();
    // The one measured table at hand has 0.008. Light that fades exponentially to a seventh has
    // 0.019, and its zero would be wrong by a twentieth of the range.
    if misfit > 0.01 * range {
        return Err(unfit(misfit / range));
    }
    Ok(first.1 + fitted[0])
}
