//! Averages of the contact's pressure over pixels, exact also at the rim.
//!
//! A pixel sees the mean of the light over its square, not the value at its centre. With
//! G(x, y) = ∫₀ˣ∫₀ʸ f(s² + t²) ds dt the integral over a pixel is the inclusion–exclusion sum of G at its corners; summed
//! over all pixels the inner corners cancel, so the frame's sum is the force. In units of the contact radius
//!
//! * f = √(1 − ρ²): 6G = 2xyz + x(3 − x²) atan(y/z) + y(3 − y²) atan(x/z) − 2 atan(xy/z), z = √(1 − x² − y²)
//! * f = 1 − ρ²:    G = xy(1 − (x² + y²)/3)
//!
//! inside; outside the disc, G is the quarter disc's integral less the two caps beyond x and beyond y.

use std::f64::consts::PI;

use ndarray::Array2;

/// A patch of the image plane, which may reach beyond the frame.
#[derive(Debug, Clone)]
pub(super) struct Patch {
    /// Row and column of the first value.
    pub(super) origin: [isize; 2],
    /// Values `[row, column]`.
    pub(super) values: Array2<f64>,
}

impl Patch {
    /// Adds the part of the patch that lies in `frame`.
    pub(super) fn add_to(&self, frame: &mut Array2<f64>) {
        let [row0, col0] = self.origin;
        let (skip, first) = ((-col0).max(0) as usize, col0.max(0) as usize);
        for (r, line) in self.values.rows().into_iter().enumerate() {
            let row = row0 + r as isize;
            if row < 0 || row >= frame.nrows() as isize {
                continue;
            }
            for (value, &light) in
                frame.row_mut(row as usize).iter_mut().skip(first).zip(line.iter().skip(skip))
            {
                *value += light;
            }
        }
    }
}

/// What is averaged over the pixels, with the value 1 at the centre and 0 at the rim.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Profile {
    /// √(1 − r²/a²): the pressure.
    Hemisphere,
    /// 1 − r²/a²: its square.
    Paraboloid,
}

/// Where the contact lies and how large the pixels are.
#[derive(Debug, Clone, Copy)]
pub(super) struct Disc {
    pub(super) centre_px: [f64; 2],
    pub(super) radius_m: f64,
    pub(super) pixel_size_m: [f64; 2],
}

impl Disc {
    /// Rows and columns (first, one past the last) that the disc touches, widened by `margin` pixels and cut to what
    /// lies within `margin` of a frame of `shape`.
    pub(super) fn window(&self, shape: [usize; 2], margin: usize) -> [[isize; 2]; 2] {
        let m = margin as isize;
        let span = |axis: usize, length: usize| {
            let (c, r) = (self.centre_px[axis], self.radius_m / self.pixel_size_m[axis]);
            let (limit, lowest) = (length as isize + m, -m);
            let first = ((c - r + 0.5).floor() as isize - m).clamp(lowest, limit);
            let last = ((c + r + 0.5).ceil() as isize + m).clamp(first, limit);
            [first, last]
        };
        [span(1, shape[0]), span(0, shape[1])]
    }

    /// Pixel averages of `profile` over `window`.
    pub(super) fn average(&self, profile: Profile, window: [[isize; 2]; 2]) -> Patch {
        let [[row0, row1], [col0, col1]] = window;
        let (rows, cols) = ((row1 - row0) as usize, (col1 - col0) as usize);
        let mut values = Array2::zeros((rows, cols));
        // In units of the radius: pixel sizes, and the pixels' first edges.
        let size: [f64; 2] = std::array::from_fn(|k| self.pixel_size_m[k] / self.radius_m);
        let edge = |axis: usize, k: isize| (k as f64 - 0.5 - self.centre_px[axis]) * size[axis];
        let columns: Vec<Span> = (col0..col1).map(|k| Span::new(edge(0, k), size[0])).collect();
        let xs: Vec<f64> = (col0..=col1).map(|k| edge(0, k)).collect();
        let mut corners = Corners::new(profile, &xs);
        for (r, mut line) in values.rows_mut().into_iter().enumerate() {
            let row = Span::new(edge(1, row0 + r as isize), size[1]);
            corners.next_row(row.first, edge(1, row0 + r as isize + 1));
            for (c, (value, column)) in line.iter_mut().zip(&columns).enumerate() {
                let rest = 1.0 - column.farthest_squared - row.farthest_squared;
                *value = if size[0].max(size[1]) < SMOOTH * rest {
                    column.smooth_average(&row, profile)
                } else if column.nearest_squared + row.nearest_squared >= 1.0 {
                    0.0
                } else {
                    // Rounding of the corners can leave a pixel outside the disc a hair below zero.
                    (corners.integral(c) / (size[0] * size[1])).max(0.0)
                };
            }
        }
        Patch { origin: [row0, col0], values }
    }
}

/// Where the pixel is smaller than this share of 1 − ρ², quadrature of order 8 is exact to rounding: its error falls as
/// the eighth power of that ratio. It spares the corners' cancellation, which grows as (radius/pixel)², and their cost.
const SMOOTH: f64 = 0.03;

/// Nodes and weights of the four-point Gauss–Legendre rule on (−½, ½).
const GAUSS: [(f64, f64); 4] = [
    (-0.430_568_155_797_026_3, 0.173_927_422_568_726_93),
    (-0.169_990_521_792_428_13, 0.326_072_577_431_273_07),
    (0.169_990_521_792_428_13, 0.326_072_577_431_273_07),
    (0.430_568_155_797_026_3, 0.173_927_422_568_726_93),
];

/// A pixel's extent along one axis, in units of the radius from the contact's centre.
#[derive(Debug, Clone, Copy)]
struct Span {
    first: f64,
    /// Squares of the coordinates nearest to and farthest from the centre.
    nearest_squared: f64,
    farthest_squared: f64,
    /// Squares of the coordinates of the quadrature's nodes, and their mean over the pixel.
    nodes_squared: [f64; 4],
    mean_squared: f64,
}

impl Span {
    fn new(first: f64, size: f64) -> Self {
        let (last, middle) = (first + size, first + 0.5 * size);
        let nearest = if first > 0.0 {
            first
        } else if last < 0.0 {
            last
        } else {
            0.0
        };
        Self {
            first,
            nearest_squared: nearest * nearest,
            farthest_squared: first.abs().max(last.abs()).powi(2),
            nodes_squared: GAUSS.map(|(node, _)| (middle + node * size).powi(2)),
            mean_squared: middle * middle + size * size / 12.0,
        }
    }

    /// Average over the pixel of this span of x and that one of y, wholly inside the disc.
    fn smooth_average(&self, row: &Self, profile: Profile) -> f64 {
        if profile == Profile::Paraboloid {
            return 1.0 - self.mean_squared - row.mean_squared;
        }
        let mut sum = 0.0;
        for (y, (_, v)) in row.nodes_squared.iter().zip(GAUSS) {
            let rest = 1.0 - y;
            for (x, (_, u)) in self.nodes_squared.iter().zip(GAUSS) {
                sum += u * v * (rest - x).sqrt();
            }
        }
        sum
    }
}

/// Values of G at the corners of a row of pixels, each computed when first asked for.
struct Corners<'a> {
    profile: Profile,
    xs: &'a [f64],
    ys: [f64; 2],
    above: Vec<f64>,
    below: Vec<f64>,
}

impl<'a> Corners<'a> {
    fn new(profile: Profile, xs: &'a [f64]) -> Self {
        let unknown = vec![f64::NAN; xs.len()];
        Self { profile, xs, ys: [0.0; 2], above: unknown.clone(), below: unknown }
    }

    /// Moves on to the row between `above` and `below`; the corners between it and the last row are kept.
    fn next_row(&mut self, above: f64, below: f64) {
        self.ys = [above, below];
        std::mem::swap(&mut self.above, &mut self.below);
        self.below.fill(f64::NAN);
    }

    /// Integral over the pixel in column `c`.
    fn integral(&mut self, c: usize) -> f64 {
        let (profile, xs) = (self.profile, self.xs);
        let at = |values: &mut [f64], c: usize, y: f64| {
            if values[c].is_nan() {
                values[c] = corner(profile, xs[c], y);
            }
            values[c]
        };
        let below = at(&mut self.below, c + 1, self.ys[1]) - at(&mut self.below, c, self.ys[1]);
        let above = at(&mut self.above, c + 1, self.ys[0]) - at(&mut self.above, c, self.ys[0]);
        below - above
    }
}

/// G(x, y), odd in x and in y.
fn corner(profile: Profile, x: f64, y: f64) -> f64 {
    let (u, v) = (x.abs().min(1.0), y.abs().min(1.0));
    let outside = u * u + v * v >= 1.0;
    let g = match (profile, outside) {
        (Profile::Hemisphere, false) => {
            let z = (1.0 - u * u - v * v).sqrt();
            let atans = u * (3.0 - u * u) * v.atan2(z) + v * (3.0 - v * v) * u.atan2(z);
            (2.0 * u * v * z + atans - 2.0 * (u * v).atan2(z)) / 6.0
        }
        (Profile::Hemisphere, true) => PI / 6.0 - hemisphere_cap(u) - hemisphere_cap(v),
        (Profile::Paraboloid, false) => u * v * (1.0 - (u * u + v * v) / 3.0),
        (Profile::Paraboloid, true) => PI / 8.0 - paraboloid_cap(u) - paraboloid_cap(v),
    };
    if (x < 0.0) != (y < 0.0) { -g } else { g }
}

/// ∫ₓ¹ (π/4)(1 − s²) ds.
fn hemisphere_cap(x: f64) -> f64 {
    PI / 12.0 * (1.0 - x) * (1.0 - x) * (2.0 + x)
}

/// ∫ₓ¹ (2/3)(1 − s²)^{3/2} ds.
fn paraboloid_cap(x: f64) -> f64 {
    let s = ((1.0 - x) * (1.0 + x)).sqrt();
    (1.5 * x.acos() - x * s * (2.5 - x * x)) / 6.0
}

#[cfg(test)]
#[allow(clippy::print_stderr)]
mod tests {
    use super::*;

    /// Mean over a pixel by `n`×`n` midpoints.
    fn sampled(disc: &Disc, profile: Profile, row: isize, col: isize, n: usize) -> f64 {
        let offset = |k: usize| (k as f64 + 0.5) / n as f64 - 0.5;
        let mut sum = 0.0;
        for i in 0..n {
            for j in 0..n {
                let x = (col as f64 + offset(j) - disc.centre_px[0]) * disc.pixel_size_m[0] / disc.radius_m;
                let y = (row as f64 + offset(i) - disc.centre_px[1]) * disc.pixel_size_m[1] / disc.radius_m;
                let rest = (1.0 - x * x - y * y).max(0.0);
                sum += if profile == Profile::Hemisphere { rest.sqrt() } else { rest };
            }
        }
        sum / (n * n) as f64
    }

    #[test]
    fn averages_agree_with_brute_force_for_oblong_pixels_inside_and_at_the_rim() {
        let disc = Disc { centre_px: [6.3, 4.8], radius_m: 4.1, pixel_size_m: [0.9, 1.3] };
        for profile in [Profile::Hemisphere, Profile::Paraboloid] {
            let patch = disc.average(profile, [[0, 10], [0, 13]]);
            for ((r, c), &value) in patch.values.indexed_iter() {
                let slow = sampled(&disc, profile, r as isize, c as isize, 400);
                // 400 midpoints a side miss about h^1.5 = 1e-4 of a pixel at the rim, where the slope is infinite.
                assert!((value - slow).abs() < 1e-4, "{profile:?} row {r} column {c}: {value} {slow}");
            }
        }
    }

    #[test]
    fn the_sum_over_pixels_is_the_integral() {
        for (centre, radius) in [([40.2, 33.9], 27.3), ([40.0, 33.5], 12.0), ([40.13, 33.4], 0.3)] {
            let disc = Disc { centre_px: centre, radius_m: radius, pixel_size_m: [1.0, 0.8] };
            let window = disc.window([80, 80], 0);
            let hemisphere = disc.average(Profile::Hemisphere, window).values.sum() * 0.8;
            let paraboloid = disc.average(Profile::Paraboloid, window).values.sum() * 0.8;
            let (a2, eps) = (radius * radius, f64::EPSILON);
            // The corners telescope; what remains is the rounding of about a² pixels of size eps·a².
            assert!((hemisphere / (2.0 / 3.0 * PI * a2) - 1.0).abs() < 1e3 * eps, "{hemisphere}");
            assert!((paraboloid / (0.5 * PI * a2) - 1.0).abs() < 1e3 * eps, "{paraboloid}");
        }
    }

    #[test]
    fn a_disc_cut_by_the_frame_keeps_the_values_of_its_visible_pixels() {
        let disc = Disc { centre_px: [1.4, 9.2], radius_m: 6.0, pixel_size_m: [1.0; 2] };
        let whole = disc.average(Profile::Hemisphere, [[-10, 30], [-10, 30]]);
        let cut = disc.average(Profile::Hemisphere, disc.window([12, 12], 0));
        assert_eq!(cut.origin, [3, 0]);
        for ((r, c), &value) in cut.values.indexed_iter() {
            let same = whole.values[[r + 3 + 10, c + 10]];
            assert!((value - same).abs() < 1e-13, "the corner sums differ by rounding only");
        }
    }

    #[test]
    fn quadrature_and_corners_agree_where_both_hold() {
        let disc = Disc { centre_px: [50.3, 49.8], radius_m: 60.0, pixel_size_m: [1.1, 0.7] };
        for profile in [Profile::Hemisphere, Profile::Paraboloid] {
            let patch = disc.average(profile, disc.window([100, 100], 0));
            let (mut smooth, mut worst) = (0, 0.0_f64);
            for ((r, c), &value) in patch.values.indexed_iter() {
                let at = |axis: usize, k: isize| {
                    (k as f64 - 0.5 - disc.centre_px[axis]) * disc.pixel_size_m[axis] / disc.radius_m
                };
                let (col, row) = (c as isize + patch.origin[1], r as isize + patch.origin[0]);
                let g = |i: isize, j: isize| corner(profile, at(0, col + i), at(1, row + j));
                let exact = (g(1, 1) - g(0, 1) - g(1, 0) + g(0, 0)) / (1.1 * 0.7 / 3600.0);
                let x = at(0, col).abs().max(at(0, col + 1).abs());
                let y = at(1, row).abs().max(at(1, row + 1).abs());
                smooth += usize::from(1.1 / 60.0 < SMOOTH * (1.0 - x * x - y * y));
                worst = worst.max((value - exact.max(0.0)).abs());
            }
            assert!(smooth > 1000, "{smooth}");
            // The corners' rounding: 4 ulps of 1 over a pixel of 2e-4 of the radius squared is 4e-12.
            assert!(worst < 4e-12, "{profile:?} {worst:e}");
        }
    }

    #[test]
    fn averages_agree_with_the_reference_numbers() {
        let home = std::env::var_os("TACTILE_DATA").map(std::path::PathBuf::from);
        let home = home.unwrap_or_else(|| concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data").into());
        let Ok(text) = std::fs::read_to_string(home.join("reference/image.json")) else {
            eprintln!("skipped: no reference numbers at {}", home.display());
            return;
        };
        let data: serde_json::Value = serde_json::from_str(&text).unwrap();
        let mut cases = 0;
        for case in data["cases"].as_array().unwrap().iter().filter(|c| c["kind"] == "hertz") {
            let (pitch, size) = (case["pitch"].as_f64().unwrap(), case["size"].as_u64().unwrap() as usize);
            let at = |name: &str| case["params"][name].as_f64().unwrap();
            // There, pixel (0, 0) covers [0, h] × [0, h]; here its centre is the origin.
            let centre_px = [at("cx") / pitch - 0.5, at("cy") / pitch - 0.5];
            let disc = Disc { centre_px, radius_m: at("a"), pixel_size_m: [pitch; 2] };
            let found = disc.average(Profile::Hemisphere, [[0, size as isize], [0, size as isize]]);
            // Near the rim, corners are of size 1 in units of the radius, a pixel of (h/a)²; the discs met by the rim have
            // radii below 10 pixels.
            let cancelled = 20.0 * f64::EPSILON * (at("a") / pitch).clamp(1.0, 10.0).powi(2);
            let Some(expected) = case["expected"]["pixels"].as_array() else {
                assert!(found.values.iter().all(|&v| v == 0.0), "{} is empty", case["id"]);
                continue;
            };
            let expected = expected.iter().flat_map(|line| line.as_array().unwrap());
            for (value, found) in expected.zip(&found.values) {
                let error = (at("amplitude") * found - value.as_f64().unwrap()).abs() / at("amplitude");
                assert!(error < cancelled, "{}: {error:e}", case["id"]);
            }
            cases += 1;
        }
        assert!(cases >= 7);
    }
}
