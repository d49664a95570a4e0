//! Frames of a gel that is lit in colours from three sides, with the truth at every pixel.

use ndarray::{Array2, Array3};
use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;
use rand_distr::{Distribution, Normal};

/// A gel with a Lambertian face that red, green and blue lamps light from three sides.
///
/// The level of a channel is ambient + brightness · fall-off · max(n·l, 0) · gain, with noise, in
/// eight bits. Lamps stand 120° apart at `elevation` above the face, and their light falls linearly
/// across the frame. A face turned away from a lamp gets none of its light. Light that the
/// surroundings block, and light that other walls reflect, are left out.
///
/// ```
/// use tactile_simulate::{ColourGel, GelObject};
/// let gel = ColourGel::default();
/// let ball = GelObject::Ball { radius_px: 30.0, contact_px: 20.0 };
/// let depth = gel.depth_px(&ball, [80.0, 60.0]);
/// assert!((depth[[60, 80]] - (30.0 - 500_f64.sqrt())).abs() < 1e-9);
/// let frame = gel.frame(&depth, 1);
/// assert_eq!(frame.dim(), (120, 160, 3));
/// assert_eq!(frame, gel.frame(&depth, 1)); // the seed fixes the noise
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct ColourGel {
    /// Rows and columns.
    pub shape: [usize; 2],
    /// Elevation of the lamps above the face in radians.
    pub elevation: f64,
    /// Share by which a lamp's light falls from its side of the frame to the other.
    pub fall_off: f64,
    /// Standard deviation of a pixel's noise in grey levels.
    pub noise: f64,
    /// Factor of all levels, as of an exposure that changes between frames.
    pub gain: f64,
    /// Length in pixels over which the free gel around a contact comes up to its rest.
    pub sag_px: f64,
}

impl Default for ColourGel {
    /// 160 × 120 pixels, lamps at 35°, light that falls by 0.4, noise of one level.
    fn default() -> Self {
        Self {
            shape: [120, 160],
            elevation: 35_f64.to_radians(),
            fall_off: 0.4,
            noise: 1.0,
            gain: 1.0,
            sag_px: 12.0,
        }
    }
}

/// What is pressed into the gel. Lengths in pixels.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum GelObject {
    /// A ball.
    Ball {
        /// Radius of the ball.
        radius_px: f64,
        /// Radius of the contact circle.
        contact_px: f64,
    },
    /// A flat punch whose edge is rounded, as a parabola.
    Flat {
        /// Radius of the flat and its edge.
        contact_px: f64,
        /// Depth.
        depth_px: f64,
        /// Width of the edge, over which the depth falls to zero.
        edge_px: f64,
    },
    /// A wedge along y: depth falls linearly to both sides of an edge.
    Edge {
        /// Half the width of the contact.
        contact_px: f64,
        /// Depth at the edge.
        depth_px: f64,
    },
    /// A ball with waves of this height and length.
    Texture {
        /// Radius of the ball.
        radius_px: f64,
        /// Radius of the contact circle.
        contact_px: f64,
        /// Height of the waves.
        height_px: f64,
        /// Length of the waves along x and y.
        length_px: f64,
    },
}

impl GelObject {
    /// Depth at a place relative to the object's middle, and whether it touches there.
    fn depth_px(&self, x: f64, y: f64) -> Option<f64> {
        let distance = x.hypot(y);
        let cap = |radius: f64, contact: f64| {
            let rim = (radius * radius - contact * contact).sqrt();
            (distance < contact).then(|| (radius * radius - distance * distance).sqrt() - rim)
        };
        match *self {
            Self::Ball {
                radius_px,
                contact_px,
            } => cap(radius_px, contact_px),
            Self::Flat {
                contact_px,
                depth_px,
                edge_px,
            } => {
                let fall = ((distance - contact_px + edge_px) / edge_px).max(0.0);
                (distance < contact_px).then_some(depth_px * (1.0 - fall * fall))
            }
            Self::Edge {
                contact_px,
                depth_px,
            } => (x.abs() < contact_px).then(|| depth_px * (1.0 - x.abs() / contact_px)),
            Self::Texture {
                radius_px,
                contact_px,
                height_px,
                length_px,
            } => {
                let wave = |v: f64| (core::f64::consts::TAU * v / length_px).cos();
                // Waves end at the rim, where the gel leaves the object.
                let inside = (1.0 - (distance / contact_px).powi(2)).max(0.0);
                cap(radius_px, contact_px).map(|z| z + height_px * inside * wave(x) * wave(y))
            }
        }
    }

    /// Slope of the free gel at the rim, and the distance from it.
    fn rim(&self, x: f64, y: f64) -> (f64, f64) {
        match *self {
            Self::Ball {
                radius_px,
                contact_px,
            }
            | Self::Texture {
                radius_px,
                contact_px,
                ..
            } => {
                let up = (radius_px * radius_px - contact_px * contact_px).sqrt();
                (contact_px / up, x.hypot(y) - contact_px)
            }
            Self::Flat {
                contact_px,
                depth_px,
                edge_px,
            } => (2.0 * depth_px / edge_px, x.hypot(y) - contact_px),
            Self::Edge {
                contact_px,
                depth_px,
            } => (depth_px / contact_px, x.abs() - contact_px),
        }
    }
}

impl ColourGel {
    /// The gel's surface around an object at (x, y): its depth where it touches, and below zero
    /// where the free gel hangs from the rim. In pixels.
    ///
    /// The free gel falls from the rim as −s L (1 − e^(−d/L)), with the object's slope s there, the
    /// distance d and the length L. It is level far away.
    pub fn depth_px(&self, object: &GelObject, [x0, y0]: [f64; 2]) -> Array2<f64> {
        let [rows, columns] = self.shape;
        Array2::from_shape_fn((rows, columns), |(row, column)| {
            let (x, y) = (column as f64 - x0, row as f64 - y0);
            object.depth_px(x, y).unwrap_or_else(|| {
                let (slope, distance) = object.rim(x, y);
                slope * self.sag_px * ((-distance.max(0.0) / self.sag_px).exp() - 1.0)
            })
        })
    }

    /// The frame of a surface, `[row, column, channel]`. The same seed gives the same noise.
    pub fn frame(&self, depth_px: &Array2<f64>, seed: u64) -> Array3<u8> {
        let [rows, columns] = self.shape;
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let noise = Normal::new(0.0, self.noise).ok();
        // The surface is continued level beyond the frame's edge.
        let at = |row: usize, column: usize| depth_px[[row.min(rows - 1), column.min(columns - 1)]];
        let mut frame = Array3::zeros((rows, columns, 3));
        for ((row, column, channel), level) in frame.indexed_iter_mut() {
            let p = 0.5 * (at(row, column + 1) - at(row, column.saturating_sub(1)));
            let q = 0.5 * (at(row + 1, column) - at(row.saturating_sub(1), column));
            // The offset keeps the lamps off the pixel axes.
            let angle = core::f64::consts::TAU * (channel as f64 / 3.0 + 0.1);
            let (sin, cos) = angle.sin_cos();
            let across = (column as f64 / columns as f64 - 0.5) * cos
                + (row as f64 / rows as f64 - 0.5) * sin;
            let (up, flat) = self.elevation.sin_cos();
            // The gel bulges towards the camera: its normal is (p, q, 1) seen from there.
            let lit = (flat * (p * cos + q * sin) + up) / (1.0 + p * p + q * q).sqrt();
            let light = 40.0 + 170.0 * (1.0 + self.fall_off * across) * lit.max(0.0);
            let error = noise.map_or(0.0, |noise| noise.sample(&mut random));
            *level = (self.gain * light + error).round().clamp(0.0, 255.0) as u8;
        }
        frame
    }
}
