//! Pixel averages of any function of the distance from the contact's centre, by quadrature.

use ndarray::Array2;

use super::{Disc, GAUSS, Patch, Window};

/// Pixels this close to the rim, in pixels, are averaged over a fine grid: pressures fall to zero there as a square root.
const RIM_ZONE: f64 = 3.0;
/// Steps a side in a pixel at the rim. Twice as many change the light of a contact of 20 pixels by 2e-5.
const RIM_STEPS: f64 = 16.0;
/// Least steps in the contact's radius, for contacts below a pixel.
const STEPS_IN_RADIUS: f64 = 24.0;
/// Bound on the steps a side, for contacts far below a pixel, whose light nobody sees.
const MOST_STEPS: f64 = 512.0;

impl Disc {
    /// Pixel averages over `window` of `value`, a function of the distance from the centre in metres that is zero from the rim on.
    ///
    /// Four by four Gauss nodes inside; at the rim 16 by 16 midpoints, with an error of some 1e-5 of the light.
    pub(in super::super) fn average_radial(
        &self,
        window: Window,
        value: impl Fn(f64) -> f64,
    ) -> Patch {
        let [[row0, row1], [col0, col1]] = window;
        let [width, height] = self.pixel_size_m;
        let smooth_below = self.radius_m - RIM_ZONE * width.max(height);
        let least = (STEPS_IN_RADIUS * width.max(height) / self.radius_m).ceil();
        let steps = least.clamp(RIM_STEPS, MOST_STEPS) as usize;
        let midpoints: Vec<(f64, f64)> = (0..steps)
            .map(|k| ((k as f64 + 0.5) / steps as f64 - 0.5, 1.0 / steps as f64))
            .collect();
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
            let mut sum = 0.0;
            for &(v, weight_y) in nodes {
                let y2 = (y + v * height).powi(2);
                for &(u, weight_x) in nodes {
                    let distance = ((x + u * width).powi(2) + y2).sqrt();
                    sum += weight_x * weight_y * value(distance);
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
