//! Calibrated conversion of intensity to depth, by a table measured on a known indenter.
//!
//! The signal of each pixel (a grey level, or its difference from a reference image) is converted
//! by a calibrated table with linear interpolation. Pixels are independent of their neighbours, so
//! that errors do not accumulate. The method needs a calibration and even illumination.
//!
//! A table calibrated on a ball counts depth from the contact circle. At that circle the signal
//! crosses a threshold, and its radius is often rounded to a pixel. The surface is already indented
//! there. With a cap of radius R and a contact radius a, an error of one pixel h in a changes every
//! depth by h a/√(R² − a²). The signal has a zero of its own: a frame that equals its reference.
//! Depth is a smooth function of the signal, so [`DepthTable::zeroed`] determines the depth at zero
//! signal from the table.

use nalgebra::{Matrix3, Vector3};
use tactile_core::Requirement;

use crate::{
    Frame, Image, PixelFlags, PixelScalar, SfsError, Surface, SurfaceReconstruction,
    SurfaceWorkspace,
};

/// Depth from a calibration table of (signal, depth) pairs.
///
/// Depth is 0 if the signal does not exceed the contact threshold. Signals above the last entry get
/// the last depth and the flag `OUT_OF_RANGE`. Cost: O(pixels of the mask's box).
///
/// ```
/// use ndarray::array;
/// use tactile_sfs::{DepthTable, Domain, Image, SurfaceReconstruction};
/// let table = DepthTable::new(&[(0.0, 0.0), (10.0, 1e-3), (20.0, 1.5e-3)])?;
/// let surface = table.reconstruct(
///     Image::new(array![[0.0, 5.0, 15.0]].view(), Domain::new([1e-4, 1e-4])?)
/// )?;
/// assert_eq!(surface.heights, array![[0.0, 0.5e-3, 1.25e-3]]);
/// # Ok::<(), tactile_sfs::SfsError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct DepthTable<T> {
    entries: Vec<(T, T)>,
    contact_threshold: T,
}

impl<T: PixelScalar> DepthTable<T> {
    /// A table of (signal, depth) pairs. Both must increase, but depths may repeat.
    ///
    /// # Errors
    /// [`SfsError::TableTooShort`] for fewer than two entries, [`SfsError::TableNotIncreasing`] for
    /// values that are out of order or NaN.
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
            contact_threshold: T::zero(),
        })
    }

    /// Sets the threshold of contact: signals up to `threshold` have depth 0.
    ///
    /// ```
    /// use ndarray::array;
    /// use tactile_sfs::{DepthTable, Domain, Image, SurfaceReconstruction};
    /// let table = DepthTable::new(&[(0.0, 0.0), (10.0, 1e-3)])?
    ///     .with_contact_threshold(2.0)?; // the noise of the camera
    /// let depth = table
    ///     .reconstruct(Image::new(array![[1.5, 5.0]].view(), Domain::new([1e-4, 1e-4])?))?
    ///     .heights;
    /// assert_eq!(depth, array![[0.0, 0.5e-3]]); // 1.5 is below the threshold
    /// # Ok::<(), tactile_sfs::SfsError>(())
    /// ```
    ///
    /// # Errors
    /// [`SfsError::InvalidOption`] for a threshold that is negative or not finite.
    pub fn with_contact_threshold(self, threshold: T) -> Result<Self, SfsError> {
        Requirement::NonNegative.check("contact threshold", threshold.as_f64())?;
        Ok(Self {
            contact_threshold: threshold,
            ..self
        })
    }

    /// Depth of a signal, and whether the signal lies within the table.
    pub fn depth(&self, signal: T) -> (T, bool) {
        let entries = &self.entries;
        let (first, last) = (entries[0], entries[entries.len() - 1]);
        // There is no extrapolation: the table is constant beyond its ends.
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
    fn reconstruct(&self, image: Image<'_, '_, T>) -> Result<Surface<T>, SfsError> {
        Surface::made_by(|workspace, surface| self.reconstruct_with(workspace, image, surface))
    }

    fn reconstruct_with(
        &self,
        _workspace: &mut SurfaceWorkspace<T>,
        image: Image<'_, '_, T>,
        surface: &mut Surface<T>,
    ) -> Result<(), SfsError> {
        let Image { values, domain } = image;
        let area = surface.enter(values.dim(), &domain)?;
        // The table at every level of 8-bit frames: a look-up takes a fifth of the time of an
        // interpolation.
        let levels = matches!(values, Frame::Bytes(_))
            .then(|| core::array::from_fn::<_, 256, _>(|level| self.pixel(T::of(level as f64))));
        for (row, column) in area.pixels() {
            if !domain.contains(row, column) {
                continue;
            }
            if let Some(known) = domain.known(row, column) {
                surface.set(row, column, known);
                continue;
            }
            let (height, flags) = match (&values, &levels) {
                (Frame::Bytes(bytes), Some(levels)) => levels[usize::from(bytes[[row, column]])],
                _ => self.pixel(values.at(row, column)),
            };
            surface.set(row, column, height);
            surface.flags[[row, column]] = flags;
        }
        surface.finish(&domain);
        Ok(())
    }
}

impl<T: PixelScalar> DepthTable<T> {
    /// The table shifted by a constant depth, so that zero signal has zero depth.
    ///
    /// A parabola d = c₀ + c₁ s + c₂ s² is fitted by least squares to the entries (s, d) above the
    /// threshold of contact. These entries become d − c₀ (or 0 if that is negative), and the
    /// entries at or below the threshold are replaced by (0, 0). The signals must be differences
    /// from a reference. Set the threshold first
    /// ([`with_contact_threshold`](Self::with_contact_threshold)), to a tenth of the largest signal
    /// or less, because the parabola is extrapolated from there to zero. Depth must be a smooth
    /// function of the signal in that range. If the light is proportional to the power 0.8 or 1.2
    /// of the depth, the zero is wrong by 3 or 4 % of the range. The table does not reveal this.
    /// O(entries).
    ///
    /// ```
    /// use tactile_sfs::DepthTable;
    /// // A level is 30 µm of depth. The calibration counted depth from the rim, at three levels.
    /// let entries: Vec<_> = (3..60).map(|s| (f64::from(s), 30e-6 * f64::from(s - 3))).collect();
    /// let table = DepthTable::new(&entries)?.with_contact_threshold(3.0)?;
    /// assert!((table.depth(40.0).0 - 1.11e-3).abs() < 1e-12);
    /// assert!((table.zeroed()?.depth(40.0).0 - 1.20e-3).abs() < 1e-12);
    /// # Ok::<(), tactile_sfs::SfsError>(())
    /// ```
    ///
    /// # Errors
    /// [`SfsError::TableZero`] for fewer than four entries above the threshold, or if the root mean
    /// square residual of the parabola exceeds 1 % of the range of the entries.
    pub fn zeroed(mut self) -> Result<Self, SfsError> {
        let kept: Vec<(f64, f64)> = self
            .entries
            .iter()
            .filter(|(signal, _)| *signal > self.contact_threshold)
            .map(|(signal, depth)| (signal.as_f64(), depth.as_f64()))
            .collect();
        let zero = depth_at_zero(&kept)?;
        // A depth below that of zero signal would be noise of the fit.
        let moved = |&(s, d): &(f64, f64)| (T::of(s), T::of((d - zero).max(0.0)));
        self.entries = vec![(T::zero(), T::zero())];
        self.entries.extend(kept.iter().map(moved));
        Ok(self)
    }
}

/// Depth of the fitted parabola at signal zero. The signals of entries increase, so that the range
/// is positive for two or more entries.
fn depth_at_zero(entries: &[(f64, f64)]) -> Result<f64, SfsError> {
    let unfit = |misfit| SfsError::TableZero {
        entries: entries.len(),
        misfit,
    };
    let (Some(first), Some(last)) = (entries.first(), entries.last()) else {
        return Err(unfit(0.0));
    };
    // One more than the number of points that determine a parabola.
    if entries.len() < 4 {
        return Err(unfit(0.0));
    }
    // With signals and depths scaled by their largest values, the condition of the normal equations
    // depends only on the shape of the table.
    let (scale, range) = (last.0, last.1 - first.1);
    let row = |signal: f64| {
        let x = signal / scale;
        Vector3::new(1.0, x, x * x)
    };
    let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
    // Depths are counted from the first entry, which removes their common offset from the sums.
    for &(signal, depth) in entries {
        normal += row(signal) * row(signal).transpose();
        right += row(signal) * (depth - first.1);
    }
    let fitted = normal.cholesky().ok_or_else(|| unfit(0.0))?.solve(&right);
    let square =
        |&(signal, depth): &(f64, f64)| (depth - first.1 - row(signal).dot(&fitted)).powi(2);
    let mean_square = entries.iter().map(square).sum::<f64>() / entries.len() as f64;
    let misfit = mean_square.sqrt();
    // The one measured table available has 0.008. Light that decays exponentially to a seventh has
    // 0.019, and its zero would be wrong by a twentieth of the range.
    if misfit > 0.01 * range {
        return Err(unfit(misfit / range));
    }
    Ok(first.1 + fitted[0])
}
