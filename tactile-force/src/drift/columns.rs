//! The tiles of a frame as columns of numbers, which loops go over with wide instructions.

use super::IlluminationDrift;
use super::normal::{Normal, weight};
use crate::frame::TileSum;
use crate::simd::vectorized;

const LANES: usize = 8;

#[derive(Clone, Debug, Default)]
pub(super) struct Columns {
    difference: Vec<f64>,
    reference: Vec<f64>,
    pixels: Vec<f64>,
    /// Derivative of the sum by a coefficient of the drift that is the same everywhere, as the fit weighs it.
    weight: Vec<f64>,
    /// The weight over the number of pixels.
    share: Vec<f64>,
    multiplicative: bool,
}

impl Columns {
    pub(super) fn take(&mut self, tiles: &[TileSum], drift: &IlluminationDrift) {
        self.multiplicative = drift.correction.is_multiplicative();
        self.difference.clear();
        self.difference.extend(tiles.iter().map(|t| t.difference));
        self.reference.clear();
        self.reference.extend(tiles.iter().map(|t| t.reference));
        self.pixels.clear();
        self.pixels.extend(tiles.iter().map(|t| t.pixels));
        self.weight.clear();
        self.weight.extend(tiles.iter().map(|t| weight(drift, t)));
        self.share.clear();
        let both = self.weight.iter().zip(&self.pixels);
        self.share.extend(both.map(|(w, n)| w / n));
    }

    /// What the drift leaves of every tile.
    pub(super) fn residuals(
        &self,
        drift: &IlluminationDrift,
        tiles: &[TileSum],
        residuals: &mut Vec<f64>,
    ) {
        residuals.clear();
        if drift.correction.terms() > 1 {
            residuals.extend(tiles.iter().map(|tile| drift.residual(tile)));
            return;
        }
        residuals.resize(self.difference.len(), 0.0);
        let [value, ..] = drift.coefficients;
        let (by, change) = if self.multiplicative {
            (&self.reference, value - 1.0)
        } else {
            (&self.pixels, value)
        };
        vectorized(Residuals {
            difference: &self.difference,
            by,
            change,
            residuals,
        });
    }

    /// Residuals over their weight.
    pub(super) fn changes(&self, residuals: &[f64], changes: &mut Vec<f64>) {
        changes.clear();
        changes.extend(residuals.iter().zip(&self.weight).map(|(r, w)| r / w));
    }

    /// |residual| of a pixel.
    pub(super) fn levels(&self, residuals: &[f64], levels: &mut Vec<f64>) {
        levels.clear();
        let both = residuals.iter().zip(&self.pixels);
        levels.extend(both.map(|(residual, pixels)| (residual / pixels).abs()));
    }

    /// Normal equations of a drift that is the same everywhere, of the tiles whose level is within the limit.
    pub(super) fn sums(&self, residuals: &[f64], levels: &[f64], limit: f64) -> Normal {
        let [right, matrix, count, reference, pixels] = vectorized(Sums {
            columns: self,
            residuals,
            levels,
            limit,
        });
        let mut normal = Normal::empty(1);
        normal.right[0] = right;
        normal.matrix[(0, 0)] = matrix;
        normal.count = count as usize;
        (normal.reference, normal.pixels) = (reference, pixels);
        normal
    }
}

struct Residuals<'a> {
    difference: &'a [f64],
    by: &'a [f64],
    change: f64,
    residuals: &'a mut [f64],
}

impl pulp::NullaryFnOnce for Residuals<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let both = self.difference.iter().zip(self.by);
        for (residual, (difference, by)) in self.residuals.iter_mut().zip(both) {
            *residual = difference - by * self.change;
        }
    }
}

struct Sums<'a> {
    columns: &'a Columns,
    residuals: &'a [f64],
    levels: &'a [f64],
    limit: f64,
}

impl pulp::NullaryFnOnce for Sums<'_> {
    type Output = [f64; 5];

    /// Σ w r/n, Σ w²/n, Σ 1, Σ of the reference's sums and Σ n.
    #[inline(always)]
    fn call(self) -> [f64; 5] {
        let c = self.columns;
        // In lanes, so that no sum waits for the one before.
        let mut sums = [[0.0; LANES]; 5];
        let columns = [
            self.levels,
            self.residuals,
            &c.weight,
            &c.share,
            &c.reference,
            &c.pixels,
        ];
        let chunks = columns.map(|column| column.as_chunks::<LANES>());
        let [level, residual, weight, share, reference, pixels] = chunks.map(|(whole, _)| whole);
        let rows = level.iter().zip(residual).zip(weight.iter().zip(share));
        let rows = rows.zip(reference.iter().zip(pixels));
        for (((level, residual), (weight, share)), (reference, pixels)) in rows {
            for k in 0..LANES {
                let near = level[k] <= self.limit;
                let kept = |term: f64| if near { term } else { 0.0 };
                sums[0][k] += kept(share[k] * residual[k]);
                sums[1][k] += kept(share[k] * weight[k]);
                sums[2][k] += kept(1.0);
                sums[3][k] += kept(reference[k]);
                sums[4][k] += kept(pixels[k]);
            }
        }
        let [level, residual, weight, share, reference, pixels] = chunks.map(|(_, rest)| rest);
        for k in 0..level.len() {
            if level[k] <= self.limit {
                let (w, of_n) = (weight[k], share[k]);
                let terms = [of_n * residual[k], of_n * w, 1.0, reference[k], pixels[k]];
                for (sums, term) in sums.iter_mut().zip(terms) {
                    sums[0] += term;
                }
            }
        }
        sums.map(|lanes| lanes.iter().sum())
    }
}
