//! Averages of the contact pressure over pixels, exact also at the rim.
//!
//! A pixel records the mean of the light over its square, not the value at its centre. With G(x,
//! y) = ∫₀ˣ∫₀ʸ f(s² + t²) ds dt, the integral over a pixel is the inclusion–exclusion sum of G at
//! its corners. In the sum over all pixels the inner corners cancel, so the sum of the frame is the
//! force. In units of the contact radius
//!
//! * f = √(1 − ρ²): 6G = 2xyz + x(3 − x²) atan(y/z) + y(3 − y²) atan(x/z) − 2 atan(xy/z), z = √(1 −
//!   x² − y²)
//! * f = 1 − ρ²:    G = xy(1 − (x² + y²)/3)
//!
//! inside. Outside the disc, G is the integral over the quarter disc minus the two caps beyond x
//! and beyond y.
//!
//! The module also averages any function of the distance from the contact's centre by quadrature,
//! and maps pixels to positions on the surface of the sensor.

use ndarray::Array2;
use std::f64::consts::{PI, TAU};

/// Upper limit of the steps per side, for contacts far below a pixel, whose light is negligible.
const MOST_STEPS: f64 = 512.0;

/// Minimum number of steps per contact radius, for contacts below a pixel.
const STEPS_IN_RADIUS: f64 = 24.0;

/// Steps per side in a pixel at the rim. Twice as many change the light of a contact of 20 pixels
/// by 2e-5.
const RIM_STEPS: f64 = 16.0;

/// Distance to the rim, in pixels, within which pixels are averaged over a fine grid: pressures
/// fall to zero there as a square root.
const RIM_ZONE: f64 = 3.0;

/// Corresponding distance behind a distorting lens.
const BENT_RIM_ZONE: f64 = 2.0;

/// Steps per side in a pixel near the rim behind a distorting lens. Twice as many change the light
/// of the rim's pixels by about 10⁻⁴.
const BENT_RIM_STEPS: usize = 8;

/// Rows and columns of the image plane: the first and one past the last of each.
pub(crate) type Window = [[isize; 2]; 2];

/// A patch of the image plane, which may extend beyond the frame.
#[derive(Debug, Clone)]
pub(crate) struct PixelPatch {
    /// Row and column of the first value.
    pub origin: [isize; 2],
    /// Values `[row, column]`.
    pub values: Array2<f64>,
}

impl PixelPatch {
    /// Zeros over `window`.
    pub(crate) fn zeros([[row0, row1], [col0, col1]]: Window) -> Self {
        Self {
            origin: [row0, col0],
            values: Array2::zeros(((row1 - row0) as usize, (col1 - col0) as usize)),
        }
    }

    /// Adds the part of the patch inside `frame`.
    pub(crate) fn add_to(&self, frame: &mut Array2<f64>) {
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

/// The profile that is averaged over the pixels, with the value 1 at the centre and 0 at the rim.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Profile {
    /// √(1 − r²/a²): the pressure.
    Hemisphere,
    /// 1 − r²/a²: its square.
    Paraboloid,
}

/// Position of the contact and size of the pixels.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Disc {
    pub centre_px: [f64; 2],
    pub radius_m: f64,
    pub pixel_size_m: [f64; 2],
}

impl Disc {
    /// Rows and columns (first, one past the last) touched by the disc, extended by `margin` pixels
    /// and limited to `margin` around a frame of `shape`.
    pub(crate) fn window(&self, shape: [usize; 2], margin: usize) -> Window {
        let span = |axis: usize, length: usize| {
            let radius_px = self.radius_m / self.pixel_size_m[axis];
            touched(self.centre_px[axis], radius_px, length, margin)
        };
        [span(1, shape[0]), span(0, shape[1])]
    }

    /// Pixel averages of `profile` over `window`.
    pub(crate) fn average(&self, profile: Profile, window: Window) -> PixelPatch {
        let [[row0, row1], [col0, col1]] = window;
        let (rows, cols) = ((row1 - row0) as usize, (col1 - col0) as usize);
        let mut values = Array2::zeros((rows, cols));
        // Pixel sizes and first edges, in units of the radius.
        let size: [f64; 2] = std::array::from_fn(|k| self.pixel_size_m[k] / self.radius_m);
        let edge = |axis: usize, k: isize| (k as f64 - 0.5 - self.centre_px[axis]) * size[axis];
        let columns: Vec<Span> = (col0..col1)
            .map(|k| Span::new(edge(0, k), size[0]))
            .collect();
        let xs: Vec<f64> = (col0..=col1).map(|k| edge(0, k)).collect();
        // Neighbouring pixels share the value at a corner, which cancels exactly in their sum.
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
                    // Rounding of the corner values can leave a pixel outside the disc slightly
                    // below zero.
                    (corners.integral(c) / (size[0] * size[1])).max(0.0)
                };
            }
        }
        PixelPatch {
            origin: [row0, col0],
            values,
        }
    }
}

/// First and one past the last of the pixels along one axis within `half` of `centre`, extended by
/// `margin` and limited to `margin` around a frame of `length` pixels.
pub(crate) fn touched(centre: f64, half: f64, length: usize, margin: usize) -> [isize; 2] {
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

/// If the pixel is smaller than this fraction of 1 − ρ², quadrature of order 8 is exact to
/// rounding: its error falls with the eighth power of that ratio. It avoids the cancellation at the
/// corners, which grows as (radius/pixel)², and their cost.
pub(crate) const SMOOTH: f64 = 0.03;

/// Nodes and weights of the four-point Gauss–Legendre rule on (−½, ½).
const GAUSS: [(f64, f64); 4] = [
    (-0.430_568_155_797_026_3, 0.173_927_422_568_726_93),
    (-0.169_990_521_792_428_13, 0.326_072_577_431_273_07),
    (0.169_990_521_792_428_13, 0.326_072_577_431_273_07),
    (0.430_568_155_797_026_3, 0.173_927_422_568_726_93),
];

/// Extent of a pixel along one axis, in units of the radius from the centre of the contact.
#[derive(Debug, Clone, Copy)]
struct Span {
    first: f64,
    /// Squares of the coordinates nearest to and farthest from the centre.
    nearest_squared: f64,
    farthest_squared: f64,
    /// Squares of the coordinates of the quadrature nodes, and their mean over the pixel.
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
            // Exact: the mean of the square is that of the middle plus the variance of a uniform
            // distribution.
            mean_squared: middle * middle + size * size / 12.0,
        }
    }

    /// Average over the pixel of this x span and that y span, entirely inside the disc.
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

/// Values of G at the corners of a row of pixels, each computed on first use.
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

    /// Advances to the row between `above` and `below`. The corners shared with the last row are
    /// kept.
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
pub(crate) fn corner(profile: Profile, x: f64, y: f64) -> f64 {
    // Outside the extent of the disc, G is constant.
    let (u, v) = (x.abs().min(1.0), y.abs().min(1.0));
    let outside = u * u + v * v >= 1.0;
    let g = match (profile, outside) {
        (Profile::Hemisphere, false) => {
            // Arctangents of quotients by z use `atan2`, because z is 0 at the rim.
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

/// The midpoint rule with `steps` steps on [−½, ½]: positions and weights.
fn midpoints(steps: usize) -> Vec<(f64, f64)> {
    let weight = 1.0 / steps as f64;
    let place = |k: usize| (k as f64 + 0.5) / steps as f64 - 0.5;
    (0..steps).map(|k| (place(k), weight)).collect()
}

/// The mean over a pixel, by one rule along both of its sides.
fn mean_over(nodes: &[(f64, f64)], value: impl Fn(f64, f64) -> f64) -> f64 {
    let mut sum = 0.0;
    for &(v, weight_y) in nodes {
        for &(u, weight_x) in nodes {
            sum += weight_x * weight_y * value(u, v);
        }
    }
    sum
}

impl Disc {
    /// Pixel averages over `window` of `value`, a function of the distance from the centre in
    /// metres that is zero from the rim on.
    ///
    /// It uses four by four Gauss nodes inside, and 16 by 16 midpoints at the rim, with an error of
    /// about 1e-5 of the light.
    pub(crate) fn average_radial(&self, window: Window, value: impl Fn(f64) -> f64) -> PixelPatch {
        let [[row0, row1], [col0, col1]] = window;
        let [width, height] = self.pixel_size_m;
        let smooth_below = self.radius_m - RIM_ZONE * width.max(height);
        let least = (STEPS_IN_RADIUS * width.max(height) / self.radius_m).ceil();
        let steps = least.clamp(RIM_STEPS, MOST_STEPS) as usize;
        let midpoints = midpoints(steps);
        let shape = ((row1 - row0) as usize, (col1 - col0) as usize);
        let values = Array2::from_shape_fn(shape, |(r, c)| {
            let x = ((col0 + c as isize) as f64 - self.centre_px[0]) * width;
            let y = ((row0 + r as isize) as f64 - self.centre_px[1]) * height;
            let nearest = (x.abs() - 0.5 * width)
                .max(0.0)
                .hypot((y.abs() - 0.5 * height).max(0.0));
            if nearest >= self.radius_m {
                return 0.0;
            }
            let farthest = (x.abs() + 0.5 * width).hypot(y.abs() + 0.5 * height);
            let nodes = if farthest < smooth_below {
                &GAUSS[..]
            } else {
                &midpoints
            };
            mean_over(nodes, |u, v| {
                value(((x + u * width).powi(2) + (y + v * height).powi(2)).sqrt())
            })
        });
        PixelPatch {
            origin: [row0, col0],
            values,
        }
    }
}

/// Pixels of any size behind a lens that distorts about the centre of the frame.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PixelPlane {
    pub middle_px: [f64; 2],
    pub pixel_size_m: [f64; 2],
    /// d = e (1 + bend e²), with e the apparent distance from the centre of the frame in metres.
    pub bend: f64,
}

impl PixelPlane {
    pub(crate) fn is_flat(&self) -> bool {
        self.bend == 0.0
    }

    /// Position of a pixel in metres from the centre of the frame.
    pub(crate) fn to_metres(self, pixel: [f64; 2]) -> [f64; 2] {
        let [x, y] = std::array::from_fn(|k| (pixel[k] - self.middle_px[k]) * self.pixel_size_m[k]);
        let stretch = 1.0 + self.bend * (x * x + y * y);
        [x * stretch, y * stretch]
    }

    /// The pixel that shows a position in metres from the centre of the frame.
    fn to_pixel(self, metres: [f64; 2]) -> [f64; 2] {
        let distance = metres[0].hypot(metres[1]);
        // Newton's method on e (1 + bend e²) = d. The slope is positive if the image does not fold.
        let mut seen = distance;
        for _ in 0..20 {
            let square = self.bend * seen * seen;
            seen -= (seen * (1.0 + square) - distance) / (1.0 + 3.0 * square);
        }
        let shrink = if distance > 0.0 { seen / distance } else { 1.0 };
        std::array::from_fn(|k| self.middle_px[k] + metres[k] * shrink / self.pixel_size_m[k])
    }
}

impl Disc {
    /// Position of the contact in metres from the centre of the frame. `centre_px` is its pixel
    /// without distortion.
    fn place(&self, plane: PixelPlane) -> [f64; 2] {
        std::array::from_fn(|k| (self.centre_px[k] - plane.middle_px[k]) * self.pixel_size_m[k])
    }

    /// Like [`window`](Self::window), behind a distorting lens.
    pub(crate) fn bent_window(
        &self,
        plane: PixelPlane,
        shape: [usize; 2],
        margin: usize,
    ) -> Window {
        let centre = self.place(plane);
        let rim = (0..64).map(|k| {
            let (sin, cos) = (TAU * f64::from(k) / 64.0).sin_cos();
            plane.to_pixel([
                centre[0] + self.radius_m * cos,
                centre[1] + self.radius_m * sin,
            ])
        });
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for pixel in rim {
            for k in 0..2 {
                low[k] = low[k].min(pixel[k]);
                high[k] = high[k].max(pixel[k]);
            }
        }
        let span = |k: usize, length: usize| {
            // One more pixel, because the rim may lie between two of its 64 points.
            let half = 0.5 * (high[k] - low[k]) + 1.0;
            touched(0.5 * (low[k] + high[k]), half, length, margin)
        };
        [span(1, shape[0]), span(0, shape[1])]
    }

    /// Like [`average_radial`](Self::average_radial), behind a distorting lens.
    pub(crate) fn average_bent(
        &self,
        plane: PixelPlane,
        window: Window,
        value: impl Fn(f64) -> f64,
    ) -> PixelPatch {
        let [[row0, row1], [col0, col1]] = window;
        let centre = self.place(plane);
        let distance = |pixel: [f64; 2]| {
            let place = plane.to_metres(pixel);
            (place[0] - centre[0]).hypot(place[1] - centre[1])
        };
        let reach = BENT_RIM_ZONE * self.pixel_size_m[0].max(self.pixel_size_m[1]);
        let fine = midpoints(BENT_RIM_STEPS);
        let shape = ((row1 - row0) as usize, (col1 - col0) as usize);
        let values = Array2::from_shape_fn(shape, |(r, c)| {
            let pixel = [(col0 + c as isize) as f64, (row0 + r as isize) as f64];
            let from_rim = distance(pixel) - self.radius_m;
            if from_rim > reach {
                return 0.0;
            }
            let nodes = if from_rim < -reach { &GAUSS[..] } else { &fine };
            mean_over(nodes, |u, v| value(distance([pixel[0] + u, pixel[1] + v])))
        });
        PixelPatch {
            origin: [row0, col0],
            values,
        }
    }
}
