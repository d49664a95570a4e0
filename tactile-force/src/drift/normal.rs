//! Normal equations of a drift.

use super::IlluminationDrift;
use crate::frame::TileSum;

/// Derivative of a tile's sum by the first coefficient.
pub(super) fn weight(drift: &IlluminationDrift, tile: &TileSum) -> f64 {
    if drift.correction.is_multiplicative() {
        tile.reference.max(1.0)
    } else {
        tile.pixels
    }
}

/// Normal equations of the tiles' residuals, and the tiles' own sums.
pub(super) struct Normal {
    pub(super) matrix: nalgebra::Matrix3<f64>,
    pub(super) right: nalgebra::Vector3<f64>,
    pub(super) count: usize,
    pub(super) reference: f64,
    pub(super) pixels: f64,
}

impl Normal {
    /// Of so many terms; the others are left alone.
    pub(super) fn empty(terms: usize) -> Self {
        let (mut matrix, right) = (nalgebra::Matrix3::identity(), nalgebra::Vector3::zeros());
        matrix.view_mut((0, 0), (terms, terms)).fill(0.0);
        Self {
            matrix,
            right,
            count: 0,
            reference: 0.0,
            pixels: 0.0,
        }
    }

    /// Of a plane, from tiles and their residuals. Places count from the frame's middle.
    pub(super) fn of_places<'a>(
        drift: &IlluminationDrift,
        tiles: impl Iterator<Item = (&'a TileSum, f64)>,
    ) -> Self {
        let scale = drift.scale();
        let mut sums = Self::empty(3);
        for (tile, residual) in tiles {
            let w = weight(drift, tile);
            let place = |k: usize, x: f64| (x - drift.middle[k]) / scale[k + 1];
            let at = [1.0, place(0, tile.x), place(1, tile.y)];
            for i in 0..3 {
                sums.right[i] += w * at[i] * residual / tile.pixels;
                for j in 0..3 {
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
