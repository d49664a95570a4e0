//! A ball fitted to a depth map.

use core::fmt;

use nalgebra::{Matrix3, Vector3};
use ndarray::ArrayView2;

use crate::Domain;

/// Ratio between neighbouring trial radii: sixty steps cover a factor of a hundred.
const RADIUS_STEP: f64 = 1.08;

/// A spherical cap z = √(R² − ρ²) − √(R² − a²) fitted to heights, with ρ the distance from the
/// centre.
///
/// ```
/// use ndarray::Array2;
/// use tactile_sfs::{BallFit, Domain};
/// // A ball of 4 mm radius, in contact up to 2.4 mm from its axis, has an indentation of
/// // 4 − √(4² − 2.4²) = 0.8 mm.
/// let depth_m = |(r, c): (usize, usize)| {
///     let square = 1e-8 * ((r as f64 - 32.0).powi(2) + (c as f64 - 32.0).powi(2));
///     (16e-6 - square).sqrt() - 3.2e-3
/// };
/// let touched = |z: f64| if z > 0.0 { z } else { f64::NAN };
/// let heights = Array2::from_shape_fn((64, 64), depth_m).mapv(touched);
/// let domain = Domain::new([1e-4; 2])?;
/// let fit = BallFit::of_radius(heights.view(), &domain, 4e-3).expect("a cap");
/// assert!((fit.contact_radius_m - 2.4e-3).abs() < 1e-9 && fit.mean_absolute_error_m < 1e-9);
/// let any = BallFit::of_any_radius(heights.view(), &domain).expect("a cap");
/// assert!((any.radius_m - 4e-3).abs() < 1e-7);
/// # Ok::<(), tactile_sfs::SfsError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct BallFit {
    /// Radius R of the ball in metres.
    pub radius_m: f64,
    /// Centre (x, y) in metres from the first pixel of the heights.
    pub centre_m: [f64; 2],
    /// Radius a of the circle where the cap meets depth zero, in metres.
    pub contact_radius_m: f64,
    /// Mean absolute difference between heights and cap over the pixels inside the contact circle,
    /// in metres.
    pub mean_absolute_error_m: f64,
    /// Number of pixels inside the contact circle.
    pub pixels: usize,
    /// Number of Gauss–Newton steps.
    pub iterations: usize,
}

impl BallFit {
    /// Fits a ball of radius `radius_m` by least squares over the centre and the height of its
    /// equator.
    ///
    /// Gauss–Newton, O(pixels) per step. `None` if fewer than 16 pixels have a height, if the
    /// heights extend farther than the ball, if no cap fits, or if the mask has another shape.
    pub fn of_radius(
        heights: ArrayView2<'_, f64>,
        domain: &Domain<'_, f64>,
        radius_m: f64,
    ) -> Option<Self> {
        fit(&pixels(heights, domain)?, radius_m)
    }

    /// Fits a ball and its radius: the radius with the least mean absolute error.
    ///
    /// The best of 60 radii, from half the width of the heights to a hundred times that, is refined
    /// by a golden-section search between its neighbours. The cost equals 120 fits with a known
    /// radius. `None` under the conditions of [`of_radius`](Self::of_radius).
    pub fn of_any_radius(heights: ArrayView2<'_, f64>, domain: &Domain<'_, f64>) -> Option<Self> {
        let pixels = pixels(heights, domain)?;
        let ([x, y], (rows, columns)) = (domain.pixel_size_m, heights.dim());
        let half_width = 0.5 * f64::max(columns as f64 * x, rows as f64 * y);
        let error = |radius: f64| {
            fit(&pixels, radius).map_or(f64::INFINITY, |fit| fit.mean_absolute_error_m)
        };
        let radii = (0..60).map(|k| half_width * RADIUS_STEP.powi(k));
        let best = radii.min_by(|a, b| error(*a).total_cmp(&error(*b)))?;
        let (mut low, mut high) = (best / RADIUS_STEP, best * RADIUS_STEP);
        let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
        // 30 steps reduce the bracket of 16 % to a millionth of its width.
        for _ in 0..30 {
            let (a, b) = (high - golden * (high - low), low + golden * (high - low));
            if error(a) < error(b) {
                high = b;
            } else {
                low = a;
            }
        }
        fit(&pixels, 0.5 * (low + high))
    }

    /// Depth of the cap in metres at (x, y) in metres: zero outside the circle.
    pub fn depth_m(&self, [x, y]: [f64; 2]) -> f64 {
        let square = (x - self.centre_m[0]).powi(2) + (y - self.centre_m[1]).powi(2);
        if square >= self.contact_radius_m.powi(2) {
            return 0.0;
        }
        let r2 = self.radius_m.powi(2);
        (r2 - square).sqrt() - (r2 - self.contact_radius_m.powi(2)).sqrt()
    }
}

impl fmt::Display for BallFit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [x, y] = self.centre_m.map(|v| v * 1e3);
        write!(
            f,
            "ball of radius {:.3} mm at ({x:.3}, {y:.3}) mm   contact radius {:.3} mm   \
             mean absolute error {:.1} µm over {} pixels",
            self.radius_m * 1e3,
            self.contact_radius_m * 1e3,
            self.mean_absolute_error_m * 1e6,
            self.pixels
        )
    }
}

/// The pixels with a height, as (x, y, z) in metres. `None` if the domain has another shape or the
/// pixels are too few.
fn pixels(heights: ArrayView2<'_, f64>, domain: &Domain<'_, f64>) -> Option<Vec<[f64; 3]>> {
    domain.bounding_box(heights.dim()).ok()?;
    let [hx, hy] = domain.pixel_size_m;
    let inside = heights
        .indexed_iter()
        .filter(|((row, column), z)| z.is_finite() && domain.contains(*row, *column));
    let pixels: Vec<_> = inside
        .map(|((row, column), z)| [column as f64 * hx, row as f64 * hy, *z])
        .collect();
    (pixels.len() >= 16).then_some(pixels)
}

fn fit(pixels: &[[f64; 3]], radius_m: f64) -> Option<BallFit> {
    if !(radius_m > 0.0 && radius_m.is_finite()) {
        return None;
    }
    let mean = |k: usize| pixels.iter().map(|p| p[k]).sum::<f64>() / pixels.len() as f64;
    // Centre and height of the equator. If the cap is less deep than half a ball, the height is
    // negative.
    let mut at = Vector3::new(mean(0), mean(1), 0.0);
    let mut iterations = 0;
    while iterations < 50 {
        iterations += 1;
        let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
        for [x, y, z] in pixels {
            let (u, v) = (x - at.x, y - at.y);
            let square = radius_m * radius_m - u * u - v * v;
            // At the ball's equator the slope is infinite: such pixels are left out.
            if square > 1e-6 * radius_m * radius_m {
                let up = square.sqrt();
                let slope = Vector3::new(u / up, v / up, 1.0);
                normal += slope * slope.transpose();
                right += slope * (z - up - at.z);
            }
        }
        let step = normal.cholesky()?.solve(&right);
        at += step;
        // Far smaller than a pixel, and larger than the rounding of coordinates.
        if step.amax() < 1e-9 * radius_m {
            break;
        }
    }
    let contact_radius_m = (radius_m * radius_m - at.z * at.z).sqrt();
    // An equator above depth zero would mean more than half a ball. NaN fails both comparisons.
    if !(at.z < 0.0 && contact_radius_m > 0.0) {
        return None;
    }
    let mut fit = BallFit {
        radius_m,
        centre_m: [at.x, at.y],
        contact_radius_m,
        mean_absolute_error_m: 0.0,
        pixels: 0,
        iterations,
    };
    let mut sum = 0.0;
    for [x, y, z] in pixels {
        let depth = fit.depth_m([*x, *y]);
        if depth > 0.0 {
            sum += (z - depth).abs();
            fit.pixels += 1;
        }
    }
    fit.mean_absolute_error_m = sum / fit.pixels.max(1) as f64;
    Some(fit)
}
