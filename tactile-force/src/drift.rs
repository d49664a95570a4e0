//! IlluminationDrift of illumination and stray light since the reference was taken, estimated from the pixels outside the contact.

use crate::frame::{TILE_COLUMNS, TILE_ROWS, TileSum};

/// The change of illumination or stray light that is corrected; none by default.
///
/// ```
/// use ndarray::Array2;
/// use tactile_force::{ContactDetector, ContactOptions, Detection, DriftCorrection, ReferenceFrame};
///
/// // Three grey levels of stray light everywhere are no contact.
/// let reference = ReferenceFrame::new(Array2::from_elem((160, 160), 20_u8).view())?;
/// let brighter = Array2::from_elem((160, 160), 23_u8);
/// let options = ContactOptions::default().with_drift(DriftCorrection::Offset);
/// let found: Detection<f64> =
///     ContactDetector::new(options).detect_with(&mut Default::default(), brighter.view(), &reference)?;
/// assert!(found.contact.is_none());
/// assert!((found.drift.coefficients[0] - 3.0).abs() < 1e-9);
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum DriftCorrection {
    /// Frames are taken as they are.
    #[default]
    None,
    /// Stray light added everywhere alike: d = f − r − b.
    Offset,
    /// Stray light with a gradient: d = f − r − (b + bₓ x + b_y y).
    Plane,
    /// Illumination brighter or darker, background and signal alike: d = f/g − r.
    Illumination,
    /// Illumination that also changed its distribution, as when an LED moves: d = f/(g + gₓ x + g_y y) − r.
    TiltedIllumination,
    /// [`Illumination`](Self::Illumination) where the frame shows it, nothing where it does not: [`DriftOutcome`] says which.
    Automatic,
}

/// Whether the drift of a frame is known.
///
/// ```
/// use ndarray::Array2;
/// use tactile_force::{
///     ContactDetector, ContactOptions, Detection, DriftCorrection, DriftOutcome, ForceError, ReferenceFrame,
/// };
///
/// let options = ContactOptions::default().with_drift(DriftCorrection::Automatic);
/// let outcome = |at_rest: u8, now: u8| -> Result<DriftOutcome, ForceError> {
///     let reference = ReferenceFrame::new(Array2::from_elem((160, 160), at_rest).view())?;
///     let frame = Array2::from_elem((160, 160), now);
///     let found: Detection<f64> =
///         ContactDetector::new(options).detect_with(&mut Default::default(), frame.view(), &reference)?;
///     Ok(found.drift.outcome)
/// };
/// assert_eq!(outcome(100, 103)?, DriftOutcome::Corrected);
/// // A black background shows nothing of the illumination.
/// assert!(matches!(outcome(0, 0)?, DriftOutcome::TooDark { .. }));
/// # Ok::<(), ForceError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum DriftOutcome {
    /// No correction was asked for.
    #[default]
    NotRequested,
    /// The drift was estimated and corrected.
    Corrected,
    /// The background is too dark beside its noise: the illumination would be known to no better than this standard error, where
    /// 0.5 % is required. Nothing was corrected.
    TooDark {
        /// Standard error of the relative illumination.
        standard_error: f64,
    },
    /// Less than half of the frame agrees on one illumination, as under a contact that covers most of it. Nothing was corrected.
    TooLittleBackground {
        /// Share of the tiles that agree.
        share: f64,
    },
}

/// Largest standard error of an automatic correction: a force then is off by at most as much as a good gauge.
const LARGEST_ERROR: f64 = 0.005;
/// Least share of tiles that must agree: the median they start from is background only if most tiles are.
const LEAST_SHARE: f64 = 0.5;
/// Unevenness of the drift, as a share of the background, up to which a tile agrees.
const UNEVEN: f64 = 0.01;

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
    middle: [f64; 2],
    /// Covariance of the coefficients.
    covariance: [[f64; 3]; 3],
    /// Mean grey level of the reference where the drift was read.
    reference: f64,
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
    pub(crate) fn difference(&self, x: usize, frame: f32, reference: f32) -> f32 {
        let level = self.start + self.step * x as f32;
        if self.multiplicative {
            frame / level - reference
        } else {
            frame - reference - level
        }
    }
}

impl DriftCorrection {
    fn is_multiplicative(self) -> bool {
        matches!(
            self,
            Self::Illumination | Self::TiltedIllumination | Self::Automatic
        )
    }

    fn terms(self) -> usize {
        match self {
            Self::None => 0,
            Self::Offset | Self::Illumination | Self::Automatic => 1,
            Self::Plane | Self::TiltedIllumination => 3,
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
        let [value, per_column, per_row] = self.coefficients;
        let at = value + per_column * (x - self.middle[0]) + per_row * (y - self.middle[1]);
        if self.correction.is_multiplicative() {
            reference * (at - 1.0)
        } else {
            at
        }
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
    pub(crate) fn residual(&self, tile: &TileSum) -> f64 {
        tile.difference - tile.pixels * self.level(tile.x, tile.y, tile.reference / tile.pixels)
    }
}

/// Fits the correction to all tiles but those that stand out (the contact), by least squares on what stays, again and
/// again until the set settles; `sd` is the noise of one pixel's difference.
pub(crate) fn fit(
    correction: DriftCorrection,
    (rows, columns): (usize, usize),
    tiles: impl Iterator<Item = TileSum> + Clone,
    sd: f64,
    scratch: &mut Vec<f64>,
) -> IlluminationDrift {
    let middle = [0.5 * (columns as f64 - 1.0), 0.5 * (rows as f64 - 1.0)];
    let mut drift = IlluminationDrift {
        correction,
        middle,
        ..IlluminationDrift::none()
    };
    if correction.is_multiplicative() {
        drift.coefficients[0] = 1.0;
    }
    let terms = correction.terms();
    drift.coefficients[0] += median(
        scratch,
        tiles
            .clone()
            .map(|t| drift.residual(&t) / weight(&drift, &t)),
    );
    let mut kept = 0;
    for _ in 0..20 {
        let spread = 1.4826
            * median(
                scratch,
                tiles.clone().map(|t| (drift.residual(&t) / t.pixels).abs()),
            );
        let noise = sd / ((TILE_ROWS * TILE_COLUMNS) as f64).sqrt();
        let limit = 3.0 * spread.max(noise);
        let before = drift;
        let near = tiles
            .clone()
            .filter(|t| (before.residual(t) / t.pixels).abs() <= limit);
        let count = drift.step(near, terms, sd);
        drift.tiles = count;
        if count == kept {
            break;
        }
        kept = count;
    }
    match correction {
        DriftCorrection::Automatic => drift.accepted(tiles, sd),
        _ => IlluminationDrift {
            outcome: DriftOutcome::Corrected,
            ..drift
        },
    }
}

/// Derivative of a tile's sum by the first coefficient.
fn weight(drift: &IlluminationDrift, tile: &TileSum) -> f64 {
    if drift.correction.is_multiplicative() {
        tile.reference.max(1.0)
    } else {
        tile.pixels
    }
}

impl IlluminationDrift {
    /// The automatic correction if it is sure enough, else none and the reason.
    fn accepted(self, tiles: impl Iterator<Item = TileSum>, sd: f64) -> Self {
        let (mut agree, mut all) = (0.0, 0.0);
        for tile in tiles {
            let limit = 3.0 * sd * tile.pixels.sqrt() + UNEVEN * tile.reference;
            agree += f64::from(self.residual(&tile).abs() <= limit);
            all += 1.0;
        }
        let share = agree / f64::max(all, 1.0);
        let standard_error = self.standard_error;
        let known = standard_error > 0.0 && standard_error <= LARGEST_ERROR && self.reference > 0.0;
        let refused = |outcome| Self {
            outcome,
            ..Self::none()
        };
        if !known {
            return refused(DriftOutcome::TooDark { standard_error });
        }
        if share < LEAST_SHARE {
            return refused(DriftOutcome::TooLittleBackground { share });
        }
        Self {
            correction: DriftCorrection::Illumination,
            outcome: DriftOutcome::Corrected,
            ..self
        }
    }

    /// One least-squares step on the given tiles; returns their number.
    fn step(&mut self, tiles: impl Iterator<Item = TileSum>, terms: usize, sd: f64) -> usize {
        let scale = [1.0, self.middle[0].max(1.0), self.middle[1].max(1.0)];
        let sums = Normal::of(self, tiles, terms, scale);
        let Some(inverse) = sums.matrix.try_inverse() else {
            return sums.count;
        };
        let step = inverse * sums.right;
        for i in 0..terms {
            self.coefficients[i] += step[i] / scale[i];
            for j in 0..terms {
                self.covariance[i][j] = inverse[(i, j)] * sd * sd / (scale[i] * scale[j]);
            }
        }
        self.standard_error = self.covariance[0][0].sqrt();
        self.reference = sums.reference / f64::max(sums.pixels, 1.0);
        sums.count
    }
}

/// Normal equations of the tiles' residuals, and the tiles' own sums.
struct Normal {
    matrix: nalgebra::Matrix3<f64>,
    right: nalgebra::Vector3<f64>,
    count: usize,
    reference: f64,
    pixels: f64,
}

impl Normal {
    /// Places count from the frame's middle, in units of `scale`.
    fn of(
        drift: &IlluminationDrift,
        tiles: impl Iterator<Item = TileSum>,
        terms: usize,
        scale: [f64; 3],
    ) -> Self {
        let (mut matrix, right) = (nalgebra::Matrix3::identity(), nalgebra::Vector3::zeros());
        matrix.view_mut((0, 0), (terms, terms)).fill(0.0);
        let mut sums = Self {
            matrix,
            right,
            count: 0,
            reference: 0.0,
            pixels: 0.0,
        };
        for tile in tiles {
            let w = weight(drift, &tile);
            let at = [
                1.0,
                (tile.x - drift.middle[0]) / scale[1],
                (tile.y - drift.middle[1]) / scale[2],
            ];
            let residual = drift.residual(&tile);
            for i in 0..terms {
                sums.right[i] += w * at[i] * residual / tile.pixels;
                for j in 0..terms {
                    sums.matrix[(i, j)] += w * at[i] * w * at[j] / tile.pixels;
                }
            }
            sums.count += 1;
            sums.reference += tile.reference;
            sums.pixels += tile.pixels;
        }
        sums
    }
}

fn median(scratch: &mut Vec<f64>, values: impl Iterator<Item = f64>) -> f64 {
    scratch.clear();
    scratch.extend(values);
    if scratch.is_empty() {
        return 0.0;
    }
    let middle = scratch.len() / 2;
    *scratch.select_nth_unstable_by(middle, f64::total_cmp).1
}
