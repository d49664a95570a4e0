//! Moments of float images, and profiles averaged over pixels exactly.

mod double;
mod gaussian;
mod hemisphere;
mod moments;
mod quadrature;

pub use gaussian::GaussianProfile;
pub use hemisphere::HertzProfile;
pub use moments::ImageMoments;

use crate::estimate::Real;

/// Integral, centroid and spread of a profile over part of the plane.
///
/// ```
/// use tactile_force::HertzProfile;
///
/// let whole = HertzProfile::new([7.0_f64, 8.0], 5.0, 100.0)?.whole();
/// assert_eq!(whole.centroid, [7.0, 8.0]);
/// assert!((whole.radius_of_gyration - 5.0 * 0.4_f64.sqrt()).abs() < 1e-14);
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ProfileMoments<T> {
    /// ∫ p dx dy.
    pub integral: T,
    /// ∫ (x, y) p / ∫ p.
    pub centroid: [T; 2],
    /// √(∫ |x − centroid|² p / ∫ p).
    pub radius_of_gyration: T,
}

/// The square grid of an image: pixel (row, column) = (i, j) is centred at first + (j, i) × size.
///
/// ```
/// use tactile_force::{HertzProfile, PixelGrid};
///
/// // Pixels twice as wide as high, in metres.
/// let grid = PixelGrid { rows: 40, columns: 20, size: [40e-6, 20e-6], first: [20e-6, 10e-6] };
/// let image = HertzProfile::new([400e-6_f64, 400e-6], 300e-6, 1.0)?.image(&grid);
/// let volume = image.sum() * grid.size[0] * grid.size[1];
/// assert!((volume / (2.0 / 3.0 * std::f64::consts::PI * 9e-8) - 1.0).abs() < 1e-12);
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PixelGrid<T> {
    /// Number of rows.
    pub rows: usize,
    /// Number of columns.
    pub columns: usize,
    /// Width and height of a pixel.
    pub size: [T; 2],
    /// Centre [x, y] of the first pixel.
    pub first: [T; 2],
}

impl<T: Real> PixelGrid<T> {
    /// Lower edge of pixel `k` along x (axis 0) or y (axis 1), in double precision.
    fn edge(&self, axis: usize, k: usize) -> f64 {
        self.first[axis].as_f64() + (2.0 * k as f64 - 1.0) * (0.5 * self.size[axis].as_f64())
    }

    /// The pixel's rectangle, from and to along x and y.
    fn pixel(&self, row: usize, column: usize) -> [[f64; 2]; 2] {
        [
            [self.edge(0, column), self.edge(0, column + 1)],
            [self.edge(1, row), self.edge(1, row + 1)],
        ]
    }
}
