//! The image plane: pixels to places on the sensor's surface.

use std::f64::consts::TAU;

use ndarray::Array2;

use super::{Disc, GAUSS, Patch, Window, touched};

/// Pixels of any size behind a lens that distorts about the frame's middle.
#[derive(Debug, Clone, Copy)]
pub(in super::super) struct Plane {
    pub(in super::super) middle_px: [f64; 2],
    pub(in super::super) pixel_size_m: [f64; 2],
    /// d = e (1 + bend e²), e the distance at which a place is seen, in metres of the frame's middle.
    pub(in super::super) bend: f64,
}

impl Plane {
    pub(in super::super) fn is_flat(&self) -> bool {
        self.bend == 0.0
    }

    /// Metres from the frame's middle that a pixel shows.
    pub(in super::super) fn to_metres(self, pixel: [f64; 2]) -> [f64; 2] {
        let [x, y] = std::array::from_fn(|k| (pixel[k] - self.middle_px[k]) * self.pixel_size_m[k]);
        let stretch = 1.0 + self.bend * (x * x + y * y);
        [x * stretch, y * stretch]
    }

    /// The pixel that shows a place, in metres from the frame's middle.
    pub(in super::super) fn to_pixel(self, metres: [f64; 2]) -> [f64; 2] {
        let distance = metres[0].hypot(metres[1]);
        // Newton's method on e (1 + bend e²) = d: the slope is positive wherever the image does not fold.
        let mut seen = distance;
        for _ in 0..20 {
            let square = self.bend * seen * seen;
            seen -= (seen * (1.0 + square) - distance) / (1.0 + 3.0 * square);
        }
        let shrink = if distance > 0.0 { seen / distance } else { 1.0 };
        std::array::from_fn(|k| self.middle_px[k] + metres[k] * shrink / self.pixel_size_m[k])
    }
}

/// Steps a side in a pixel near the rim; twice as many change the light by some 10⁻⁴ of the rim's pixels.
const RIM_STEPS: usize = 8;
/// Pixels this close to the rim, in pixels, are averaged over the fine grid.
const RIM_ZONE: f64 = 2.0;

impl Disc {
    /// Metres from the frame's middle to the contact's: `centre_px` is where it would be seen without distortion.
    fn place(&self, plane: Plane) -> [f64; 2] {
        std::array::from_fn(|k| (self.centre_px[k] - plane.middle_px[k]) * self.pixel_size_m[k])
    }

    /// [`window`](Self::window) behind a lens that distorts.
    pub(in super::super) fn bent_window(
        &self,
        plane: Plane,
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
            // A pixel more: the rim between two of its 64 points.
            let half = 0.5 * (high[k] - low[k]) + 1.0;
            touched(0.5 * (low[k] + high[k]), half, length, margin)
        };
        [span(1, shape[0]), span(0, shape[1])]
    }

    /// [`average_radial`](Self::average_radial) behind a lens that distorts.
    pub(in super::super) fn average_bent(
        &self,
        plane: Plane,
        window: Window,
        value: impl Fn(f64) -> f64,
    ) -> Patch {
        let [[row0, row1], [col0, col1]] = window;
        let centre = self.place(plane);
        let distance = |pixel: [f64; 2]| {
            let place = plane.to_metres(pixel);
            (place[0] - centre[0]).hypot(place[1] - centre[1])
        };
        let reach = RIM_ZONE * self.pixel_size_m[0].max(self.pixel_size_m[1]);
        let fine: Vec<(f64, f64)> = (0..RIM_STEPS)
            .map(|k| {
                let steps = RIM_STEPS as f64;
                ((k as f64 + 0.5) / steps - 0.5, 1.0 / steps)
            })
            .collect();
        let shape = ((row1 - row0) as usize, (col1 - col0) as usize);
        let values = Array2::from_shape_fn(shape, |(r, c)| {
            let pixel = [(col0 + c as isize) as f64, (row0 + r as isize) as f64];
            let from_rim = distance(pixel) - self.radius_m;
            if from_rim > reach {
                return 0.0;
            }
            let nodes = if from_rim < -reach { &GAUSS[..] } else { &fine };
            let mut sum = 0.0;
            for &(v, weight_y) in nodes {
                for &(u, weight_x) in nodes {
                    let at = distance([pixel[0] + u, pixel[1] + v]);
                    sum += weight_x * weight_y * value(at);
                }
            }
            sum
        });
        Patch {
            origin: [row0, col0],
            values,
        }
    }
}
