//! The zero of a depth table: no signal is no depth.
//!
//! A table calibrated on a ball counts depth from the contact circle, and that circle is where the signal crossed a
//! threshold, often with its radius rounded to a pixel. The surface is already pressed down there: at the rim of a cap of
//! radius R one pixel h of the contact radius a is h a/√(R² − a²) of depth, everywhere. The signal has a zero of its own,
//! the frame that equals its reference. Depth is smooth in the signal, so the table itself says how deep its zero lies.

use nalgebra::{Matrix3, Vector3};

use super::depth_table::DepthTable;
use crate::{Scalar, SfsError};

/// Fewest entries above the threshold: one more than a parabola passes through.
const FEWEST: usize = 4;

/// Largest root mean square of a table's distance to its parabola, in parts of the depths' range. The one measured table at
/// hand has 0.008. Light that fades exponentially to a seventh has 0.019, and its zero would be read wrong by a twentieth of the
/// range.
const LARGEST_MISFIT: f64 = 0.01;

impl<T: Scalar> DepthTable<T> {
    /// The table moved by a constant depth so that zero signal is zero depth.
    ///
    /// A parabola d = c₀ + c₁ s + c₂ s² is fitted, by least squares, to the entries (s, d) above the threshold of contact;
    /// they become d − c₀ (or 0 where that is negative), and those at or below it make way for (0, 0). For signals that
    /// are counted from a reference ([`Signal::Darkening`](crate::Signal), `Brightening`). The threshold, to be set
    /// before ([`with_contact_threshold`](Self::with_contact_threshold)), should be a tenth of the largest signal or less: the
    /// parabola is extended from there to zero. Depth must be smooth in the signal there: of light that goes as the power 0.8 or
    /// 1.2 of the depth the zero is off by 3 or 4 % of the range, which the table does not show. O(entries).
    ///
    /// ```
    /// use tactile_sfs::DepthTable;
    /// // A level is 30 µm deep; the makers counted depth from where they saw the contact, at three levels.
    /// let entries: Vec<_> = (3..60).map(|s| (f64::from(s), 30e-6 * f64::from(s - 3))).collect();
    /// let table = DepthTable::new(&entries)?.with_contact_threshold(3.0)?;
    /// assert!((table.depth(40.0).0 - 1.11e-3).abs() < 1e-12);
    /// assert!((table.zeroed()?.depth(40.0).0 - 1.20e-3).abs() < 1e-12);
    /// # Ok::<(), tactile_sfs::SfsError>(())
    /// ```
    ///
    /// # Errors
    /// [`SfsError::TableZero`] for fewer than four entries above the threshold, or where the parabola misses them by more
    /// than 1 % of their range (root mean square).
    pub fn zeroed(mut self) -> Result<Self, SfsError> {
        let kept: Vec<(f64, f64)> = self
            .entries
            .iter()
            .filter(|(signal, _)| *signal > self.contact_threshold)
            .map(|(signal, depth)| (signal.as_f64(), depth.as_f64()))
            .collect();
        let zero = depth_at_zero(&kept)?;
        let moved = |&(s, d): &(f64, f64)| (T::of(s), T::of((d - zero).max(0.0)));
        self.entries = vec![(T::zero(), T::zero())];
        self.entries.extend(kept.iter().map(moved));
        Ok(self)
    }
}

/// Depth of the fitted parabola at signal zero. Entries increase in signal, so the range is positive for two or more.
fn depth_at_zero(entries: &[(f64, f64)]) -> Result<f64, SfsError> {
    let unfit = |misfit| SfsError::TableZero {
        entries: entries.len(),
        misfit,
    };
    let (Some(first), Some(last)) = (entries.first(), entries.last()) else {
        return Err(unfit(0.0));
    };
    if entries.len() < FEWEST {
        return Err(unfit(0.0));
    }
    // Signals and depths in parts of their largest values keep the normal equations' condition that of the table's shape.
    let (scale, range) = (last.0, last.1 - first.1);
    let row = |signal: f64| {
        let x = signal / scale;
        Vector3::new(1.0, x, x * x)
    };
    let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for &(signal, depth) in entries {
        normal += row(signal) * row(signal).transpose();
        right += row(signal) * (depth - first.1);
    }
    let fitted = normal.cholesky().ok_or_else(|| unfit(0.0))?.solve(&right);
    let square =
        |&(signal, depth): &(f64, f64)| (depth - first.1 - row(signal).dot(&fitted)).powi(2);
    let mean_square = entries.iter().map(square).sum::<f64>() / entries.len() as f64;
    let misfit = mean_square.sqrt();
    if misfit > LARGEST_MISFIT * range {
        return Err(unfit(misfit / range));
    }
    Ok(first.1 + fitted[0])
}
