//! IlluminationDrift of illumination and stray light since the reference was taken, estimated from the pixels outside the contact.

mod columns;
mod correction;
mod fit;
mod median;
mod normal;

pub use correction::{DriftCorrection, DriftOutcome};

pub(crate) use fit::{FitWorkspace, fit};
pub(crate) use median::median;

use crate::frame::TileSum;

/// The drift found in one frame. `coefficients` are [value, per column, per row] about the frame's middle: grey
/// levels for stray light, shares for illumination.
///
/// ```
/// use ndarray::Array2;
/// use tactile_force::{ContactDetector, ContactOptions, Detection, DriftCorrection, ReferenceFrame};
///
/// // Illumination a tenth brighter.
/// let reference = ReferenceFrame::new(Array2::from_elem((160, 160), 100_u8).view())?;
/// let brighter = Array2::from_elem((160, 160), 110_u8);
/// let options = ContactOptions::default().with_drift(DriftCorrection::Illumination);
/// let found: Detection<f64> =
///     ContactDetector::new(options).detect_with(&mut Default::default(), brighter.view(), &reference)?;
/// assert!((found.drift.coefficients[0] - 1.1).abs() < 1e-9);
/// assert_eq!(found.drift.tiles, 20 * 5);
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct IlluminationDrift {
    /// The correction that was made.
    pub correction: DriftCorrection,
    /// Whether the drift is known.
    pub outcome: DriftOutcome,
    /// Offset (grey levels) or relative illumination (1 for unchanged) in the frame's middle, and its change per column and per row.
    pub coefficients: [f64; 3],
    /// Standard error of the first coefficient.
    pub standard_error: f64,
    /// Tiles of 8 × 32 pixels it was read from.
    pub tiles: usize,
    pub(super) middle: [f64; 2],
    /// Covariance of the coefficients.
    pub(super) covariance: [[f64; 3]; 3],
    /// Mean grey level of the reference where the drift was read.
    pub(super) reference: f64,
}

/// The correction along one row.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DriftLine {
    multiplicative: bool,
    start: f32,
    step: f32,
}

impl DriftLine {
    /// Corrected difference of the pixel `x` columns from the line's start.
    #[inline(always)]
    pub(crate) fn difference(&self, x: usize, frame: f32, reference: f32) -> f32 {
        // Frames are narrower than 2³¹, and this conversion has wide instructions.
        let level = self.start + self.step * (x as i32) as f32;
        if self.multiplicative {
            frame / level - reference
        } else {
            frame - reference - level
        }
    }
}

impl IlluminationDrift {
    /// No correction of a frame of the given size.
    pub(crate) fn none() -> Self {
        Self::default()
    }

    pub(crate) fn is_zero(&self) -> bool {
        self.correction == DriftCorrection::None
    }

    pub(crate) fn line(&self, row: usize, first_column: usize) -> DriftLine {
        let [value, per_column, per_row] = self.coefficients;
        let y = row as f64 - self.middle[1];
        let x = first_column as f64 - self.middle[0];
        let start = value + per_column * x + per_row * y;
        DriftLine {
            multiplicative: self.correction.is_multiplicative(),
            start: start as f32,
            step: per_column as f32,
        }
    }

    /// Variances due to the correction's own error at a place: of the background in squared grey levels, and of the signal's scale.
    pub(crate) fn variances(&self, x: f64, y: f64) -> [f64; 2] {
        let at = [1.0, x - self.middle[0], y - self.middle[1]];
        let mut variance = 0.0;
        for i in 0..3 {
            for j in 0..3 {
                variance += at[i] * self.covariance[i][j] * at[j];
            }
        }
        if self.correction.is_multiplicative() {
            [variance * self.reference * self.reference, variance]
        } else {
            [variance, 0.0]
        }
    }

    /// Background that the correction subtracts from a frame at a place where the reference is `reference`.
    fn level(&self, x: f64, y: f64, reference: f64) -> f64 {
        let at = self.at(x, y);
        if self.correction.is_multiplicative() {
            reference * (at - 1.0)
        } else {
            at
        }
    }

    #[inline]
    fn at(&self, x: f64, y: f64) -> f64 {
        let [value, per_column, per_row] = self.coefficients;
        value + per_column * (x - self.middle[0]) + per_row * (y - self.middle[1])
    }

    /// The greatest background that the correction removes anywhere in a frame of a given size, in grey levels, for a reference
    /// of even brightness `mean`.
    pub(crate) fn greatest_grey(&self, (rows, columns): (usize, usize), mean: f64) -> f64 {
        if self.is_zero() {
            return 0.0;
        }
        let (right, bottom) = (columns as f64 - 1.0, rows as f64 - 1.0);
        let corners = [[0.0, 0.0], [right, 0.0], [0.0, bottom], [right, bottom]];
        corners
            .iter()
            .map(|[x, y]| self.level(*x, *y, mean).abs())
            .fold(0.0, f64::max)
    }

    /// A tile's summed difference after the correction.
    #[inline]
    pub(crate) fn residual(&self, tile: &TileSum) -> f64 {
        let at = self.at(tile.x, tile.y);
        let background = if self.correction.is_multiplicative() {
            tile.reference * (at - 1.0)
        } else {
            tile.pixels * at
        };
        tile.difference - background
    }
}
