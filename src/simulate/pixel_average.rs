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
        let edge = |axis: usize, k: isize| {
            (k as f64 - 0.5 - self.centre_px[axis]) * self.pixel_size_m[axis] / self.radius_m
        };
        let xs: Vec<f64> = (col0..=col1).map(|k| edge(0, k)).collect();
        let area = self.pixel_size_m[0] / self.radius_m * (self.pixel_size_m[1] / self.radius_m);
        let corners = |y: f64, out: &mut Vec<f64>| {
            out.clear();
            out.extend(xs.iter().map(|&x| corner(profile, x, y)));
        };
        let (mut above, mut below) = (Vec::new(), Vec::new());
        corners(edge(1, row0), &mut above);
        for (r, mut line) in values.rows_mut().into_iter().enumerate() {
            corners(edge(1, row0 + r as isize + 1), &mut below);
            for (c, value) in line.iter_mut().enumerate() {
                let integral = (below[c + 1] - below[c]) - (above[c + 1] - above[c]);
                // Rounding of the corners can leave a pixel outside the disc a hair below zero.
                *value = (integral / area).max(0.0);
            }
            std::mem::swap(&mut above, &mut below);
        }
        Patch { origin: [row0, col0], values }
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
            // Corners are of size 1 in units of the radius, a pixel of (h/a)².
            let cancelled = 20.0 * f64::EPSILON * (at("a") / pitch).powi(2).max(1.0);
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
