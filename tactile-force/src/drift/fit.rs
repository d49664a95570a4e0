//! The fit of a drift to the tiles outside the contact.

use super::columns::Columns;
use super::median::median;
use super::normal::Normal;
use super::{DriftCorrection, DriftOutcome, IlluminationDrift};
use crate::frame::{TILE_COLUMNS, TILE_ROWS, TileSum};

/// Largest standard error of an automatic correction: a force then is off by at most as much as a good gauge.
const LARGEST_ERROR: f64 = 0.005;
/// Least share of tiles that must agree: the median they start from is background only if most tiles are.
const LEAST_SHARE: f64 = 0.5;
/// Unevenness of the drift, as a share of the background, up to which a tile agrees.
const UNEVEN: f64 = 0.01;

/// Buffers of the fit, which goes over all tiles several times.
#[derive(Clone, Debug, Default)]
pub(crate) struct FitWorkspace {
    pub(crate) tiles: Vec<TileSum>,
    columns: Columns,
    pub(crate) residuals: Vec<f64>,
    /// |residual| of a pixel.
    levels: Vec<f64>,
    pub(crate) values: Vec<f64>,
    pub(crate) scratch: Vec<f64>,
}

/// Fits the correction to all tiles but those that stand out (the contact), by least squares on what stays, again and
/// again until the set settles; `sd` is the noise of one pixel's difference.
pub(crate) fn fit(
    correction: DriftCorrection,
    (rows, width): (usize, usize),
    given: impl Iterator<Item = TileSum>,
    sd: f64,
    workspace: &mut FitWorkspace,
) -> IlluminationDrift {
    let FitWorkspace {
        tiles,
        columns,
        residuals,
        levels,
        values,
        scratch,
    } = workspace;
    tiles.clear();
    tiles.extend(given);
    let middle = [0.5 * (width as f64 - 1.0), 0.5 * (rows as f64 - 1.0)];
    let mut drift = IlluminationDrift {
        correction,
        middle,
        ..IlluminationDrift::none()
    };
    if correction.is_multiplicative() {
        drift.coefficients[0] = 1.0;
    }
    columns.take(tiles, &drift);
    columns.residuals(&drift, tiles, residuals);
    columns.changes(residuals, values);
    drift.coefficients[0] += median(values, scratch);
    let mut kept = 0;
    for _ in 0..20 {
        columns.residuals(&drift, tiles, residuals);
        columns.levels(residuals, levels);
        let spread = 1.4826 * median(levels, scratch);
        let noise = sd / ((TILE_ROWS * TILE_COLUMNS) as f64).sqrt();
        let limit = 3.0 * spread.max(noise);
        // A plane needs the places of the tiles, too.
        let count = match correction.terms() {
            1 => drift.step::<1>(&columns.sums(residuals, levels, limit), sd),
            _ => {
                let both = tiles.iter().zip(residuals.iter().copied()).zip(&*levels);
                let near = both.filter(|(_, level)| **level <= limit).map(|(b, _)| b);
                drift.step::<3>(&Normal::of_places(&drift, near), sd)
            }
        };
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

impl IlluminationDrift {
    /// The automatic correction if it is sure enough, else none and the reason.
    fn accepted(self, tiles: &[TileSum], sd: f64) -> Self {
        let (mut agree, mut all) = (0.0, 0.0);
        for tile in tiles {
            let limit = 3.0 * sd * tile.pixels.sqrt() + UNEVEN * tile.reference;
            agree += f64::from(self.residual(tile).abs() <= limit);
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

    /// One least-squares step of so many terms by the normal equations of some tiles; returns the number of tiles.
    fn step<const TERMS: usize>(&mut self, sums: &Normal, sd: f64) -> usize {
        let scale = self.scale();
        let Some(inverse) = sums.matrix.try_inverse() else {
            return sums.count;
        };
        let step = inverse * sums.right;
        for i in 0..TERMS {
            self.coefficients[i] += step[i] / scale[i];
            for j in 0..TERMS {
                self.covariance[i][j] = inverse[(i, j)] * sd * sd / (scale[i] * scale[j]);
            }
        }
        self.standard_error = self.covariance[0][0].sqrt();
        self.reference = sums.reference / f64::max(sums.pixels, 1.0);
        sums.count
    }

    /// Units of the coefficients in the normal equations: half the frame.
    pub(super) fn scale(&self) -> [f64; 3] {
        [1.0, self.middle[0].max(1.0), self.middle[1].max(1.0)]
    }
}
