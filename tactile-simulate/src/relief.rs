//! A surface pattern of bumps whose pixel averages are exact.
//!
//! On a rectangular face the height is h(X, Y) = h₀ + h₁ Σₖ b((X − Xₖ)/w) b((Y − Yₖ)/w) with b(t) = cos²(πt/2) for |t| < 1,
//! 0 beyond. It is continuous with its slope, each bump lies wholly on the face, and ∫b = (t + sin(πt)/π)/2 in closed
//! form makes every pixel's average a product of two differences.

use std::f64::consts::{FRAC_PI_2, PI};

use ndarray::Array2;
use rand_distr::{Distribution, Uniform};

use super::error::{SimulateError, at_least, not_negative, positive};
use super::random::{Purpose, row_stream};

/// The outline of a squeezed face.
///
/// ```
/// use tactile_simulate::{Camera, FaceOutline, UniaxialOptions, UniaxialScene};
/// let camera = Camera::default().coarser(16);
/// let disc = UniaxialOptions { outline: FaceOutline::Ellipse, face_m: [12e-3; 2], camera, ..UniaxialOptions::default() };
/// let scene = UniaxialScene::new(disc)?;
/// let state = scene.states()[0];
/// let undeformed = state.area_m2 / state.stretch_lateral.powi(2);
/// assert!((undeformed / (std::f64::consts::PI * 36e-6) - 1.0).abs() < 1e-12);
/// # Ok::<(), tactile_simulate::SimulateError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum FaceOutline {
    /// A rectangle of the face's sides: a block.
    #[default]
    Rectangle,
    /// The ellipse in it: a cylinder. Bumps that do not lie wholly on it are left out.
    Ellipse,
}

impl FaceOutline {
    /// Area of a face of these sides.
    pub(super) fn area_m2(self, size_m: [f64; 2]) -> f64 {
        let rectangle = size_m[0] * size_m[1];
        match self {
            Self::Rectangle => rectangle,
            Self::Ellipse => 0.25 * PI * rectangle,
        }
    }

    /// Whether the box around a point lies on a face of these sides.
    fn holds(self, at: [f64; 2], half_width_m: f64, size_m: [f64; 2]) -> bool {
        let reach: [f64; 2] =
            std::array::from_fn(|k| (at[k].abs() + half_width_m) / (0.5 * size_m[k]));
        match self {
            Self::Rectangle => true,
            Self::Ellipse => reach[0].hypot(reach[1]) <= 1.0,
        }
    }
}

/// Bumps on a plain face.
///
/// ```
/// use tactile_simulate::{Camera, SurfacePattern, UniaxialOptions, UniaxialScene};
/// let camera = Camera::default().coarser(16);
/// let pattern = SurfacePattern { bumps: [3, 3], bump_height_m: [0.4e-3, 0.4e-3], ..SurfacePattern::default() };
/// let scene = UniaxialScene::new(UniaxialOptions { camera, pattern, ..UniaxialOptions::default() })?;
/// let heights = scene.material_points(60, 60).into_iter().map(|p| p.z);
/// let (low, high) = heights.fold((f64::MAX, 0.0_f64), |(l, h), z| (l.min(z), h.max(z)));
/// assert!(low == 0.5e-3 && high > 0.89e-3 && high <= 0.9e-3, "0.4 mm bumps on a 0.5 mm base");
/// # Ok::<(), tactile_simulate::SimulateError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct SurfacePattern {
    /// Height of the plain face in metres.
    pub base_height_m: f64,
    /// Height of the bumps above it, the smallest and the largest, in metres.
    pub bump_height_m: [f64; 2],
    /// Columns and rows of bumps, one in each cell of a grid, at a random place in its cell.
    pub bumps: [usize; 2],
    /// Half width w of a bump as a share of the cell's shorter side, up to ½.
    pub bump_share: f64,
}

impl Default for SurfacePattern {
    /// A 0.5 mm base with 8×8 bumps of 0.3 to 0.6 mm.
    fn default() -> Self {
        Self {
            base_height_m: 0.5e-3,
            bump_height_m: [0.3e-3, 0.6e-3],
            bumps: [8, 8],
            bump_share: 0.4,
        }
    }
}

impl SurfacePattern {
    pub(super) fn validate(&self) -> Result<(), SimulateError> {
        positive("base_height_m", self.base_height_m)?;
        not_negative("bump_height_m", self.bump_height_m[0])?;
        super::error::within(
            "bump_height_m",
            self.bump_height_m[1],
            self.bump_height_m[0],
            f64::MAX,
        )?;
        at_least("bumps", self.bumps[0].min(self.bumps[1]), 1)?;
        super::error::within(
            "bumps",
            self.bumps[0].max(self.bumps[1]) as f64,
            1.0,
            1000.0,
        )?;
        super::error::within("bump_share", self.bump_share, 1e-6, 0.5)
    }

    /// Places the bumps on a face of `size_m` centred on the origin.
    pub(super) fn place(&self, outline: FaceOutline, size_m: [f64; 2], seed: u64) -> Relief {
        let mut rng = row_stream(seed, Purpose::Pattern, 0, 0);
        let cell: [f64; 2] = std::array::from_fn(|k| size_m[k] / self.bumps[k] as f64);
        let half_width_m = self.bump_share * cell[0].min(cell[1]);
        let mut uniform = |low: f64, high: f64| match Uniform::new_inclusive(low, high) {
            Ok(law) => law.sample(&mut rng),
            Err(_) => low, // an interval closed by rounding
        };
        let mut bumps = Vec::with_capacity(self.bumps[0] * self.bumps[1]);
        for row in 0..self.bumps[1] {
            for col in 0..self.bumps[0] {
                let at = [col, row];
                let centre_m = std::array::from_fn(|k| {
                    let low = -0.5 * size_m[k] + at[k] as f64 * cell[k] + half_width_m;
                    uniform(low, low + cell[k] - 2.0 * half_width_m)
                });
                bumps.push(Bump {
                    centre_m,
                    height_m: uniform(self.bump_height_m[0], self.bump_height_m[1]),
                });
            }
        }
        bumps.retain(|bump: &Bump| outline.holds(bump.centre_m, half_width_m, size_m));
        Relief {
            outline,
            size_m,
            base_height_m: self.base_height_m,
            half_width_m,
            bumps,
        }
    }
}

/// One bump.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Bump {
    pub(super) centre_m: [f64; 2],
    pub(super) height_m: f64,
}

/// A pattern in its place: heights over the material coordinates (X, Y) of the undeformed face.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Relief {
    pub(super) outline: FaceOutline,
    pub(super) size_m: [f64; 2],
    pub(super) base_height_m: f64,
    pub(super) half_width_m: f64,
    pub(super) bumps: Vec<Bump>,
}

impl Relief {
    /// Height at a material point; 0 off the face.
    pub(super) fn height_m(&self, at: [f64; 2]) -> f64 {
        if (0..2).any(|k| at[k].abs() > 0.5 * self.size_m[k])
            || !self.outline.holds(at, 0.0, self.size_m)
        {
            return 0.0;
        }
        let factor = |b: &Bump, k: usize| {
            let t = (at[k] - b.centre_m[k]) / self.half_width_m;
            if t.abs() < 1.0 {
                (FRAC_PI_2 * t).cos().powi(2)
            } else {
                0.0
            }
        };
        self.base_height_m
            + self
                .bumps
                .iter()
                .map(|b| b.height_m * factor(b, 0) * factor(b, 1))
                .sum::<f64>()
    }

    /// Volume between the face's plane and its heights, in cubic metres.
    pub(super) fn volume_m3(&self) -> f64 {
        let bumps: f64 = self.bumps.iter().map(|b| b.height_m).sum();
        self.base_height_m * self.outline.area_m2(self.size_m)
            + bumps * self.half_width_m * self.half_width_m
    }

    /// Shares of the cells between `rows` (y) and `columns` (x), edges in material coordinates, that an elliptic face covers: differences of the area of the
    /// unit disc to the lower left of the cells' corners.
    pub(super) fn covered_by_ellipse(&self, rows: &[f64], columns: &[f64]) -> Array2<f64> {
        let half = self.size_m.map(|side| 0.5 * side);
        let corner = |row: usize, column: usize| {
            disc_below(columns[column] / half[0], rows[row] / half[1]) * half[0] * half[1]
        };
        let corners = Array2::from_shape_fn((rows.len(), columns.len()), |(r, c)| corner(r, c));
        Array2::from_shape_fn((rows.len() - 1, columns.len() - 1), |(r, c)| {
            let covered = corners[[r + 1, c + 1]] - corners[[r + 1, c]] - corners[[r, c + 1]]
                + corners[[r, c]];
            let cell = (rows[r + 1] - rows[r]) * (columns[c + 1] - columns[c]);
            (covered / cell).clamp(0.0, 1.0)
        })
    }

    /// ∫ of the plain face's indicator from −∞ to `x` along axis `k`, in metres.
    pub(super) fn face_integral(&self, k: usize, x: f64) -> f64 {
        let half = 0.5 * self.size_m[k];
        x.clamp(-half, half) + half
    }

    /// ∫ of a bump's profile from −∞ to `x` along axis `k`, in metres.
    pub(super) fn bump_integral(&self, bump: &Bump, k: usize, x: f64) -> f64 {
        let t = ((x - bump.centre_m[k]) / self.half_width_m).clamp(-1.0, 1.0);
        0.5 * self.half_width_m * (1.0 + t + (PI * t).sin() / PI)
    }
}

/// Area of the unit disc where X ≤ x and Y ≤ y: ∫ (min(y, h) + h) dt over t from −1 to x with h = √(1 − t²), where y ≥ −h.
fn disc_below(x: f64, y: f64) -> f64 {
    let (x, y) = (x.clamp(-1.0, 1.0), y.clamp(-1.0, 1.0));
    // ∫ h from 0 to t.
    let half_disc = |t: f64| 0.5 * (t * (1.0 - t * t).max(0.0).sqrt() + t.asin());
    // Between −c and c the line Y = y lies inside the disc.
    let c = (1.0 - y * y).max(0.0).sqrt();
    let inside = |to: f64| to.clamp(-c, c) + c;
    let whole = half_disc(x) - half_disc(-1.0);
    let chord = half_disc(x.clamp(-c, c)) - half_disc(-c);
    // Where the line is inside: y + h; outside the chord: 2 h above the disc's middle, nothing below it.
    let beside = whole - chord;
    y * inside(x) + chord + if y >= 0.0 { 2.0 * beside } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_area_of_a_part_of_a_disc_is_that_of_a_fine_grid() {
        let n = 2000;
        let at = |k: usize| (k as f64 + 0.5) / f64::from(n) * 2.0 - 1.0;
        for (x, y) in [
            (1.0, 1.0),
            (0.3, 0.6),
            (-0.4, 0.7),
            (0.9, -0.8),
            (-0.2, -0.1),
            (2.0, 0.0),
        ] {
            let mut count = 0_u32;
            for (i, j) in ndarray::indices((n as usize, n as usize)) {
                let (u, v) = (at(i), at(j));
                count += u32::from(u <= x && v <= y && u * u + v * v <= 1.0);
            }
            let counted = f64::from(count) * 4.0 / f64::from(n).powi(2);
            // A grid of 2000² counts areas to some 1e-3 of its boundary's cells.
            assert!((disc_below(x, y) - counted).abs() < 2e-3, "{x} {y}");
        }
    }
}
