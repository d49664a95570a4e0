//! The flat field of a lens with vignetting, from the brightness of the reference itself.

use nalgebra::{SMatrix, SVector};

use crate::tiles::TileSum;

/// Brightness relative to the centre of the frame: a quadratic L(x, y), fitted by least squares to
/// the tiles of a reference frame.
///
/// If stray light reaches the camera through the same lens as the signal, the reference contains
/// the vignetting of both.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FlatField {
    /// Coefficients of 1, u, v, u², uv, v², with u and v from −1 to 1 over the frame. The first is
    /// 1.
    coefficients: [f64; 6],
    middle: [f64; 2],
    /// Covariance of the unscaled coefficients, divided by the square of the first.
    covariance: [[f64; 6]; 6],
}

/// The relative brightness along one row, a parabola.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FlatLine([f64; 3]);

impl FlatLine {
    /// Value at `x` columns from the start of the line.
    #[inline(always)]
    pub(crate) fn at(&self, x: usize) -> f32 {
        // Frames are narrower than 2³¹, and this conversion has SIMD instructions.
        let x = f64::from(x as i32);
        (self.0[0] + x * (self.0[1] + x * self.0[2])) as f32
    }
}

impl FlatField {
    /// Fits the flat field. `None` if the reference is black or has too few tiles for six
    /// coefficients. `variance` refers to one pixel of the reference.
    pub(crate) fn fit(
        (rows, columns): (usize, usize),
        tiles: impl Iterator<Item = TileSum>,
        variance: f64,
    ) -> Option<Self> {
        let middle = [0.5 * (columns as f64 - 1.0), 0.5 * (rows as f64 - 1.0)];
        let (mut normal, mut right) = (SMatrix::<f64, 6, 6>::zeros(), SVector::<f64, 6>::zeros());
        for tile in tiles {
            let terms = SVector::<f64, 6>::from(terms(middle, tile.x, tile.y));
            normal += terms * terms.transpose() * tile.pixels;
            right += terms * tile.reference;
        }
        let cholesky = normal.cholesky()?;
        let (found, inverse) = (cholesky.solve(&right), cholesky.inverse());
        // Relative to the centre of the frame, where u and v are zero.
        let level = found[0];
        (level > 0.0).then(|| Self {
            coefficients: std::array::from_fn(|k| found[k] / level),
            middle,
            covariance: std::array::from_fn(|i| {
                std::array::from_fn(|j| inverse[(i, j)] * variance / (level * level))
            }),
        })
    }

    /// Variance of the relative brightness at a pixel: the ratio of two correlated levels.
    pub(crate) fn variance_at(&self, x: f64, y: f64) -> f64 {
        let mut by = terms(self.middle, x, y);
        // The level at the centre is in both the numerator and the denominator of the ratio.
        by[0] -= self.at(x, y);
        let row = |i: usize| {
            by.iter()
                .zip(&self.covariance[i])
                .map(|(b, c)| b * c)
                .sum::<f64>()
        };
        by.iter().enumerate().map(|(i, b)| b * row(i)).sum()
    }

    /// Relative brightness at a pixel.
    pub(crate) fn at(&self, x: f64, y: f64) -> f64 {
        terms(self.middle, x, y)
            .iter()
            .zip(&self.coefficients)
            .map(|(t, c)| t * c)
            .sum()
    }

    /// The change over the squared distance from the middle, and the middle: the smaller of the
    /// curvatures along x and y. `None` if they differ in sign.
    pub(crate) fn by_distance(&self) -> Option<(f64, [f64; 2])> {
        let [u, v] = [(3, 0), (5, 1)]
            .map(|(term, axis)| self.coefficients[term] / self.middle[axis].max(1.0).powi(2));
        (u * v > 0.0).then(|| (u.abs().min(v.abs()), self.middle))
    }

    pub(crate) fn line(&self, row: usize, first_column: usize) -> FlatLine {
        let (x, y, wide) = (first_column as f64, row as f64, self.middle[0].max(1.0));
        let bend = self.coefficients[3] / (wide * wide);
        let slope = self.at(x + 1.0, y) - self.at(x, y) - bend;
        FlatLine([self.at(x, y), slope, bend])
    }
}

pub(crate) fn terms(middle: [f64; 2], x: f64, y: f64) -> [f64; 6] {
    let (u, v) = (
        (x - middle[0]) / middle[0].max(1.0),
        (y - middle[1]) / middle[1].max(1.0),
    );
    [1.0, u, v, u * u, u * v, v * v]
}

/// Longest side for which all integer sums of the pass fit their types: 16384⁴/3 · 255 < 2⁶³.
pub(crate) const LONGEST_SIDE: usize = 16_384;
