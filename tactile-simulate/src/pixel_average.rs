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

mod plane;
mod radial;

use std::f64::consts::PI;

use ndarray::Array2;

pub(super) use plane::Plane;

/// Rows and columns of the image plane: the first and one past the last of each.
pub(super) type Window = [[isize; 2]; 2];

/// A patch of the image plane, which may reach beyond the frame.
#[derive(Debug, Clone)]
pub(super) struct Patch {
    /// Row and column of the first value.
    pub(super) origin: [isize; 2],
    /// Values `[row, column]`.
    pub(super) values: Array2<f64>,
}

impl Patch {
    /// Zeros over `window`.
    pub(super) fn zeros([[row0, row1], [col0, col1]]: Window) -> Self {
        Self {
            origin: [row0, col0],
            values: Array2::zeros(((row1 - row0) as usize, (col1 - col0) as usize)),
        }
    }

    /// Adds the part of the patch that lies in `frame`.
    pub(super) fn add_to(&self, frame: &mut Array2<f64>) {
        let [row0, col0] = self.origin;
        let (skip, first) = ((-col0).max(0) as usize, col0.max(0) as usize);
        for (r, line) in self.values.rows().into_iter().enumerate() {
            let row = row0 + r as isize;
            if row < 0 || row >= frame.nrows() as isize {
                continue;
            }
            for (value, &light) in frame
                .row_mut(row as usize)
                .iter_mut()
                .skip(first)
                .zip(line.iter().skip(skip))
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
    pub(super) fn window(&self, shape: [usize; 2], margin: usize) -> Window {
        let span = |axis: usize, length: usize| {
            let radius_px = self.radius_m / self.pixel_size_m[axis];
            touched(self.centre_px[axis], radius_px, length, margin)
        };
        [span(1, shape[0]), span(0, shape[1])]
    }

    /// Pixel averages of `profile` over `window`.
    pub(super) fn average(&self, profile: Profile, window: Window) -> Patch {
        let [[row0, row1], [col0, col1]] = window;
        let (rows, cols) = ((row1 - row0) as usize, (col1 - col0) as usize);
        let mut values = Array2::zeros((rows, cols));
        // In units of the radius: pixel sizes, and the pixels' first edges.
        let size: [f64; 2] = std::array::from_fn(|k| self.pixel_size_m[k] / self.radius_m);
        let edge = |axis: usize, k: isize| (k as f64 - 0.5 - self.centre_px[axis]) * size[axis];
        let columns: Vec<Span> = (col0..col1)
            .map(|k| Span::new(edge(0, k), size[0]))
            .collect();
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
        Patch {
            origin: [row0, col0],
            values,
        }
    }
}

/// First and one past the last of the pixels along one axis that lie within `half` of `centre`, widened by `margin` and cut to what lies
/// within `margin` of a frame of `length` pixels.
pub(super) fn touched(centre: f64, half: f64, length: usize, margin: usize) -> [isize; 2] {
    let margin = margin as isize;
    let limit = length as isize + margin;
    let first = ((centre - half + 0.5).floor() as isize)
        .saturating_sub(margin)
        .clamp(-margin, limit);
    let last = ((centre + half + 0.5).ceil() as isize)
        .saturating_add(margin)
        .clamp(first, limit);
    [first, last]
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
        Self {
            profile,
            xs,
            ys: [0.0; 2],
            above: unknown.clone(),
            below: unknown,
        }
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
mod tests;
