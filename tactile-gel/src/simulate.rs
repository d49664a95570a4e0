//! Simulated frames of a gel lit in colours from three sides, with the truth at each pixel. The
//! faces are exact: a ball on a half-space by Hertz's law, and pressures on a bonded layer.

use ndarray::{Array2, Array3};
use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;
use rand_distr::{Distribution, Normal};

use crate::plane::bessel_j0;

/// A gel with a Lambertian face, lit from three sides by red, green and blue lamps.
///
/// The level of a channel is ambient + brightness · fall-off · max(n·l, 0) · gain plus noise, in
/// eight bits. Lamps are 120° apart at `elevation` above the face, and their light decreases
/// linearly across the frame. A face that points away from a lamp is not lit by it. Shadows and
/// reflections from other walls are neglected.
///
/// ```
/// use tactile_gel::simulate::{ColourGel, GelObject};
/// let gel = ColourGel::default();
/// let ball = GelObject::Ball { radius_px: 30.0, contact_px: 20.0 };
/// let depth = gel.depth_px(&ball, [80.0, 60.0]);
/// assert!((depth[[60, 80]] - (30.0 - 500_f64.sqrt())).abs() < 1e-9);
/// let frame = gel.frame(&depth, 1);
/// assert_eq!(frame.dim(), (120, 160, 3));
/// assert_eq!(frame, gel.frame(&depth, 1)); // the seed determines the noise
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct ColourGel {
    /// Number of rows and columns.
    pub shape: [usize; 2],
    /// Elevation of the lamps above the face in radians.
    pub elevation: f64,
    /// Fraction by which a lamp's light decreases from its side of the frame to the other.
    pub fall_off: f64,
    /// Standard deviation of the pixel noise in grey levels.
    pub noise: f64,
    /// Factor of all levels, for an exposure that changes between frames.
    pub gain: f64,
    /// Brightness factors of the red, green and blue lamps, which vary between units.
    pub lamps: [f64; 3],
    /// Angle in radians by which all lamps are rotated.
    pub turn: f64,
    /// Length in pixels over which the free gel around a contact returns to its rest level.
    pub sag_px: f64,
}

impl Default for ColourGel {
    /// 160 × 120 pixels, lamps at 35°, light that decreases by 0.4, noise of one level.
    fn default() -> Self {
        Self {
            shape: [120, 160],
            elevation: 35_f64.to_radians(),
            fall_off: 0.4,
            noise: 1.0,
            gain: 1.0,
            lamps: [1.0; 3],
            turn: 0.0,
            sag_px: 12.0,
        }
    }
}

/// An object pressed into the gel. Lengths are in pixels.
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
    /// A flat punch with an edge rounded as a parabola.
    Flat {
        /// Radius of the flat with its edge.
        contact_px: f64,
        /// Depth.
        depth_px: f64,
        /// Width of the edge, over which the depth decreases to zero.
        edge_px: f64,
    },
    /// A wedge along y: depth decreases linearly on both sides of an edge.
    Edge {
        /// Half the width of the contact.
        contact_px: f64,
        /// Depth at the edge.
        depth_px: f64,
    },
    /// A ball with sinusoidal waves.
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
    /// Depth at a position relative to the object's centre. `None` outside the contact.
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

    /// Slope of the free gel at the rim, and the distance from the rim.
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
    /// The gel's surface around an object at (x, y), in pixels: positive depth in the contact, and
    /// negative depth where the free gel hangs from the rim.
    ///
    /// The free gel decreases from the rim as −s L (1 − e^(−d/L)), with the object's slope s at the
    /// rim, the distance d and the length L. It is level far away.
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
        // The surface is extended horizontally outside the frame.
        let at = |row: usize, column: usize| depth_px[[row.min(rows - 1), column.min(columns - 1)]];
        let mut frame = Array3::zeros((rows, columns, 3));
        for ((row, column, channel), level) in frame.indexed_iter_mut() {
            let p = 0.5 * (at(row, column + 1) - at(row, column.saturating_sub(1)));
            let q = 0.5 * (at(row + 1, column) - at(row.saturating_sub(1), column));
            // The offset keeps the lamps off the pixel axes.
            let angle = core::f64::consts::TAU * (channel as f64 / 3.0 + 0.1) + self.turn;
            let (sin, cos) = angle.sin_cos();
            let across = (column as f64 / columns as f64 - 0.5) * cos
                + (row as f64 / rows as f64 - 0.5) * sin;
            let (up, flat) = self.elevation.sin_cos();
            // The gel bulges towards the camera, from which its normal is (p, q, 1).
            let lit = (flat * (p * cos + q * sin) + up) / (1.0 + p * p + q * q).sqrt();
            let lamp = 170.0 * self.lamps[channel] * (1.0 + self.fall_off * across);
            let light = 40.0 + lamp * lit.max(0.0);
            let error = noise.map_or(0.0, |noise| noise.sample(&mut random));
            *level = (self.gain * light + error).round().clamp(0.0, 255.0) as u8;
        }
        frame
    }
}

/// A pressure p₀ √(1 − r²/a²) on an elastic face, as under a ball by Hertz's law.
///
/// ```
/// use tactile_gel::simulate::{ElasticFace, HertzPress};
/// // A ball of 40 px in contact up to 10 px sinks by a²/R below the free face, half of it below
/// // the rim of the contact.
/// let press = HertzPress::ball([32.0, 24.0], 40.0, 10.0);
/// let depth = ElasticFace::HALF_SPACE.depth_px([48, 64], &[press]);
/// assert!((depth[[24, 32]] - 2.5).abs() < 1e-12 && (depth[[24, 42]] - 1.25).abs() < 1e-6);
/// // A layer that is thin compared with the contact yields less.
/// let layer = ElasticFace { thickness_px: 20.0, poisson_ratio: 0.48 };
/// assert!(layer.depth_px([48, 64], &[press])[[24, 32]] < 2.0);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HertzPress {
    /// Column and row of the centre.
    pub at_px: [f64; 2],
    /// Contact radius a.
    pub contact_px: f64,
    /// 2 p₀/E*, with the gel's plane-strain modulus E*.
    pub pressure: f64,
}

impl HertzPress {
    /// A ball on a half-space: 2 p₀/E* = 4 a/(π R).
    pub fn ball(at_px: [f64; 2], ball_px: f64, contact_px: f64) -> Self {
        Self {
            at_px,
            contact_px,
            pressure: 4.0 * contact_px / (core::f64::consts::PI * ball_px),
        }
    }

    /// The force ⅔ π a² p₀ in newtons.
    pub fn force_n(&self, plane_strain_modulus_pa: f64, pixel_size_m: f64) -> f64 {
        let area = core::f64::consts::PI * (self.contact_px * pixel_size_m).powi(2);
        2.0 / 3.0 * area * 0.5 * self.pressure * plane_strain_modulus_pa
    }
}

/// An elastic face: a half-space, or a layer bonded to a rigid plate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ElasticFace {
    /// Thickness in pixels. Infinite for a half-space.
    pub thickness_px: f64,
    /// Poisson's ratio.
    pub poisson_ratio: f64,
}

impl ElasticFace {
    /// A half-space.
    pub const HALF_SPACE: Self = Self {
        thickness_px: f64::INFINITY,
        poisson_ratio: 0.5,
    };

    /// Linear displacement in pixels, on a grid of rows and columns, under all presses together.
    pub fn depth_px(&self, [rows, columns]: [usize; 2], presses: &[HertzPress]) -> Array2<f64> {
        let mut depth = Array2::zeros((rows, columns));
        for press in presses {
            let reach = (rows as f64).hypot(columns as f64) + press.at_px[0].hypot(press.at_px[1]);
            // The contribution of the layer is smooth, so values one pixel apart are enough.
            let less: Vec<f64> = match self.thickness_px.is_finite() {
                true => (0..reach as usize + 2)
                    .map(|r| self.less(press, r as f64))
                    .collect(),
                false => Vec::new(),
            };
            for ((row, column), depth) in depth.indexed_iter_mut() {
                let r = (column as f64 - press.at_px[0]).hypot(row as f64 - press.at_px[1]);
                *depth += half_space(press, r);
                if let Some(pair) = less.get(r as usize..r as usize + 2) {
                    *depth += pair[0] + (r - r.floor()) * (pair[1] - pair[0]);
                }
            }
        }
        depth
    }

    /// Reduction of a half-space's displacement by the finite layer, at a distance.
    ///
    /// With the transform 2π p₀ a² (sin ka − ka cos ka)/(ka)³ of the pressure, the displacement is
    /// ∫ p̄ L J₀(kr) dk/πE*. L − 1 decays as e^(−2kh).
    fn less(&self, press: &HertzPress, r: f64) -> f64 {
        let (a, h) = (press.contact_px, self.thickness_px);
        let kappa = 3.0 - 4.0 * self.poisson_ratio;
        let integrand = |k: f64| {
            let (s, x) = (k * h, k * a);
            let transform = match x < 1e-2 {
                true => 1.0 / 3.0 - x * x / 30.0,
                false => (x.sin() - x * x.cos()) / x.powi(3),
            };
            let (sinh, cosh) = ((2.0 * s).sinh(), (2.0 * s).cosh());
            let yields = (2.0 * kappa * sinh - 4.0 * s)
                / (2.0 * kappa * cosh + 4.0 * s * s + 1.0 + kappa * kappa);
            transform * (yields - 1.0) * bessel_j0(k * r)
        };
        // Simpson's rule with steps that resolve the fastest wave over the frame.
        let last = 12.0 / h;
        let steps = 2 * (200 + (last * (r + a) * 2.0) as usize);
        let step = last / steps as f64;
        let weight = |i: usize| match i {
            0 => 1.0,
            i if i == steps => 1.0,
            i if i.is_multiple_of(2) => 2.0,
            _ => 4.0,
        };
        let sum: f64 = (0..=steps)
            .map(|i| weight(i) * integrand(i as f64 * step))
            .sum();
        press.pressure * a * a * sum * step / 3.0
    }
}

/// Displacement of a half-space: d − r²/2R inside with d = π a f/4 (Johnson, Contact Mechanics,
/// section 3.4), and its continuation outside.
fn half_space(press: &HertzPress, r: f64) -> f64 {
    use core::f64::consts::PI;
    let a = press.contact_px;
    let depth = 0.25 * PI * a * press.pressure;
    let rho = r / a;
    match rho <= 1.0 {
        true => depth * (1.0 - 0.5 * rho * rho),
        false => {
            let root = (rho * rho - 1.0).sqrt();
            depth / PI * ((2.0 - rho * rho) * (1.0 / rho).asin() + root)
        }
    }
}
