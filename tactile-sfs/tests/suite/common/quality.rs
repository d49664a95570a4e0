//! Errors of a surface relative to the truth, and shaded images of a surface.

use ndarray::{Array2, ArrayView2};
use tactile_sfs::{Lighting, slopes};

/// The least-squares fit before heights are compared.
#[derive(Clone, Copy, Debug)]
pub enum Alignment {
    None,
    Offset,
    /// Scale and constant.
    Affine,
}

/// Errors of scale · z + offset, and those of a constant.
#[derive(Clone, Copy, Debug)]
pub struct HeightError {
    pub mean_absolute: f64,
    pub rms: f64,
    pub max: f64,
    /// 1 unless affine.
    pub scale: f64,
    /// Mean absolute error of the best constant, the median: a method must be better.
    pub constant_guess: f64,
    /// Range of the true heights.
    pub range: f64,
}

/// Compares heights with the truth where both are finite.
pub fn height_error(
    heights: ArrayView2<'_, f64>,
    truth: ArrayView2<'_, f64>,
    alignment: Alignment,
) -> HeightError {
    let pairs = heights.iter().copied().zip(truth.iter().copied());
    let pairs: Vec<(f64, f64)> = pairs
        .filter(|(z, t)| z.is_finite() && t.is_finite())
        .collect();
    let n = pairs.len() as f64;
    assert!(n > 0.0, "no heights");
    let mean = |of: &dyn Fn(&(f64, f64)) -> f64| pairs.iter().map(of).sum::<f64>() / n;
    let (z, t) = (mean(&|pair| pair.0), mean(&|pair| pair.1));
    let (scale, offset) = match alignment {
        Alignment::None => (1.0, 0.0),
        Alignment::Offset => (1.0, t - z),
        Alignment::Affine => {
            // Relative to the means: second moments of heights far from 0 would cancel.
            let zz = mean(&|pair| (pair.0 - z) * (pair.0 - z));
            let zt = mean(&|pair| (pair.0 - z) * (pair.1 - t));
            let scale = if zz > 0.0 { zt / zz } else { 1.0 };
            (scale, t - scale * z)
        }
    };
    let error = |pair: &(f64, f64)| scale * pair.0 + offset - pair.1;
    let mut sorted: Vec<f64> = pairs.iter().map(|pair| pair.1).collect();
    sorted.sort_by(f64::total_cmp);
    let (low, median, high) = (
        sorted[0],
        sorted[sorted.len() / 2],
        sorted[sorted.len() - 1],
    );
    HeightError {
        mean_absolute: mean(&|pair| error(pair).abs()),
        rms: mean(&|pair| error(pair).powi(2)).sqrt(),
        max: pairs
            .iter()
            .fold(0.0, |max, pair| error(pair).abs().max(max)),
        scale,
        constant_guess: mean(&|pair| (pair.1 - median).abs()),
        range: high - low,
    }
}

/// Shades a surface. NaN at pixels without a height.
pub fn render(
    heights: ArrayView2<'_, f64>,
    pixel_size: [f64; 2],
    lighting: &Lighting<f64>,
) -> Array2<f64> {
    let (p, q) = slopes(heights, pixel_size);
    Array2::from_shape_fn(heights.dim(), |at| {
        if heights[at].is_finite() {
            lighting.shade(p[at], q[at])
        } else {
            f64::NAN
        }
    })
}
