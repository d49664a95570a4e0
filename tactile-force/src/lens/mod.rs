//! Camera geometry: from pixels to metres on the sensor's surface, with radial distortion and pixels that are not square.

mod fit;

pub use fit::{DotPair, LensFit};

use crate::error::ForceError;
use tactile_core::Requirement;

/// The map from pixels to undistorted metres: pixel sizes h_x and h_y, and Brown's radial distortion about a centre c.
///
/// With (u, v) = p − c in pixels and ρ² = (u² + (v h_y/h_x)²)/R²,
///
/// X = h_x (c_x + u s), Y = h_y (c_y + v s), s = 1 + k₁ρ² + k₂ρ⁴
///
/// (D. C. Brown, "Decentering distortion of lenses", 1966, without its tangential terms). R is a length in pixels, half the
/// frame's diagonal by custom, which makes k₁ and k₂ numbers: the share by which the corners are moved. Barrel distortion of the
/// image has k₁ > 0, pincushion k₁ < 0. Without distortion a place is its pixel times the pixel's size.
///
/// ```
/// use tactile_force::LensGeometry;
///
/// // The corners of a frame of 1392 × 1042 pixels appear 3 % too close to its middle.
/// let plain = LensGeometry::new([21.6e-6, 22.0e-6])?;
/// let lens = plain.with_distortion([695.5, 520.5], 869.0, [0.03, 0.0])?;
/// assert_eq!((lens.pixel_size_m(), lens.distortion()), ([21.6e-6, 22.0e-6], [0.03, 0.0]));
/// assert_eq!(lens.to_metres([695.5, 520.5]), plain.to_metres([695.5, 520.5]));
/// let corner = lens.to_metres([0.0, 0.0]);
/// assert!(corner[0] < -0.4e-3);
/// // And back.
/// let [x, y] = lens.to_pixels(corner).expect("in the lens's range");
/// assert!(x.abs() < 1e-9 && y.abs() < 1e-9);
/// // A pixel in the corner covers 1 + 3 k₁ along the radius and 1 + k₁ across it.
/// assert!((lens.pixel_area_m2([0.0, 0.0]) / (21.6e-6 * 22.0e-6) - 1.09 * 1.03).abs() < 2e-3);
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(try_from = "Unchecked")
)]
pub struct LensGeometry {
    pixel_size_m: [f64; 2],
    centre_px: [f64; 2],
    radius_px: f64,
    distortion: [f64; 2],
}

/// A geometry as a file has it.
#[cfg(feature = "serde")]
#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Unchecked {
    pixel_size_m: [f64; 2],
    centre_px: [f64; 2],
    radius_px: f64,
    distortion: [f64; 2],
}

#[cfg(feature = "serde")]
impl TryFrom<Unchecked> for LensGeometry {
    type Error = ForceError;

    fn try_from(given: Unchecked) -> Result<Self, ForceError> {
        Self::new(given.pixel_size_m)?.with_distortion(
            given.centre_px,
            given.radius_px,
            given.distortion,
        )
    }
}

/// Points of a contour that is undistorted.
const DIRECTIONS: usize = 16;
/// Radius of the ring, as a share of the contact's, on which a quadratic has the mean that it has over Hertz's pressure: √0.4.
const HERTZ_RADIUS: f64 = 0.632_455_532_033_675_9;

/// Value and derivatives of the map at a pixel.
struct Local {
    metres: [f64; 2],
    /// ∂(X, Y)/∂(u, v), row by row.
    jacobian: [[f64; 2]; 2],
}

impl LensGeometry {
    /// A lens without distortion and pixels of the given size [x, y] in metres.
    ///
    /// # Errors
    /// A size that is not positive and finite.
    pub fn new(pixel_size_m: [f64; 2]) -> Result<Self, ForceError> {
        for size in pixel_size_m {
            Requirement::Positive.check("pixel_size_m", size)?;
        }
        Ok(Self {
            pixel_size_m,
            centre_px: [0.0; 2],
            radius_px: 1.0,
            distortion: [0.0; 2],
        })
    }

    /// Adds radial distortion [k₁, k₂] about a centre [x, y], normalised by `radius_px`.
    ///
    /// # Errors
    /// A centre or coefficient that is not finite, a radius that is not positive, or a distortion that folds the image within the
    /// radius: 1 + 3k₁ρ² + 5k₂ρ⁴ must stay positive up to ρ = 1.
    pub fn with_distortion(
        mut self,
        centre_px: [f64; 2],
        radius_px: f64,
        [k1, k2]: [f64; 2],
    ) -> Result<Self, ForceError> {
        for c in centre_px {
            Requirement::Finite.check("centre_px", c)?;
        }
        Requirement::Positive.check("radius_px", radius_px)?;
        Requirement::Finite.check("k1", k1)?;
        Requirement::Finite.check("k2", k2)?;
        // The slope is a parabola in ρ²: its least value on [0, 1] lies at an end or at its vertex.
        let slope = |t: f64| 1.0 + t * (3.0 * k1 + t * 5.0 * k2);
        let vertex = if k2 == 0.0 {
            1.0
        } else {
            (-0.3 * k1 / k2).clamp(0.0, 1.0)
        };
        Requirement::Positive.check(
            "least slope of the distortion",
            slope(1.0).min(slope(vertex)),
        )?;
        self.centre_px = centre_px;
        self.radius_px = radius_px;
        self.distortion = [k1, k2];
        Ok(self)
    }

    /// Size [x, y] of a pixel at the centre of distortion, in metres.
    pub fn pixel_size_m(&self) -> [f64; 2] {
        self.pixel_size_m
    }

    /// Brown's coefficients [k₁, k₂].
    pub fn distortion(&self) -> [f64; 2] {
        self.distortion
    }

    /// The undistorted place [X, Y] of a pixel [x, y], in metres from where the first pixel would be without distortion.
    pub fn to_metres(&self, pixel: [f64; 2]) -> [f64; 2] {
        self.local(pixel).metres
    }

    /// The pixel [x, y] of a place in metres, by Newton's method; `None` where no pixel within three radii of the centre is seen
    /// there.
    pub fn to_pixels(&self, metres: [f64; 2]) -> Option<[f64; 2]> {
        let undistorted = |k: usize| metres[k] / self.pixel_size_m[k];
        let mut pixel = [undistorted(0), undistorted(1)];
        if self.distortion == [0.0; 2] {
            return Some(pixel);
        }
        for _ in 0..50 {
            let Local {
                metres: here,
                jacobian: [[xu, xv], [yu, yv]],
            } = self.local(pixel);
            let (ex, ey) = (metres[0] - here[0], metres[1] - here[1]);
            let determinant = xu * yv - xv * yu;
            let step = [
                (yv * ex - xv * ey) / determinant,
                (xu * ey - yu * ex) / determinant,
            ];
            pixel = [pixel[0] + step[0], pixel[1] + step[1]];
            let away = (pixel[0] - self.centre_px[0]).hypot(pixel[1] - self.centre_px[1]);
            if !(determinant > 0.0 && away < 3.0 * self.radius_px) {
                return None;
            }
            if step[0].hypot(step[1]) <= 1e-12 * self.radius_px {
                return Some(pixel);
            }
        }
        None
    }

    /// Distances [x, y] in metres that one pixel step covers at a pixel: h_x and h_y without distortion.
    pub(crate) fn pixel_step_m(&self, pixel: [f64; 2]) -> [f64; 2] {
        let [[xu, xv], [yu, yv]] = self.local(pixel).jacobian;
        [xu.hypot(yu), xv.hypot(yv)]
    }

    /// Area in square metres that a pixel covers: dS of (6).
    pub fn pixel_area_m2(&self, pixel: [f64; 2]) -> f64 {
        let [[xu, xv], [yu, yv]] = self.local(pixel).jacobian;
        (xu * yv - xv * yu).abs()
    }

    /// Mean area of a pixel over a ball's contact around a centre [x, y], weighted with Hertz's pressure: right to second order
    /// in the contact's radius. dS of (6) for a contact that is not small beside the frame.
    ///
    /// ```
    /// use tactile_force::LensGeometry;
    ///
    /// let lens = LensGeometry::new([20e-6; 2])?.with_distortion([100.0, 100.0], 100.0, [0.05, 0.0])?;
    /// // Around the centre of distortion pixels grow by 4 k₁ρ², on average over the pressure by 4 k₁ · 0.4 a²/R².
    /// let mean = lens.mean_pixel_area_m2([100.0, 100.0], 30.0);
    /// assert!((mean / 4e-10 - 1.0 - 4.0 * 0.05 * 0.4 * 0.09).abs() < 1e-4);
    /// # Ok::<(), tactile_force::ForceError>(())
    /// ```
    pub fn mean_pixel_area_m2(&self, centre_px: [f64; 2], radius_px: f64) -> f64 {
        let ring = Self::ring(centre_px, HERTZ_RADIUS * radius_px, 1.0);
        ring.map(|p| self.pixel_area_m2(p)).sum::<f64>() / DIRECTIONS as f64
    }

    /// Undistorted centre [X, Y] and radius, in metres, of a contact seen as a circle of `radius_px` pixel widths where pixels are
    /// `aspect` times as high as wide: the radius is that of the circle of the undistorted contour's area.
    pub(crate) fn contact_m(
        &self,
        centre_px: [f64; 2],
        radius_px: f64,
        aspect: f64,
    ) -> ([f64; 2], f64) {
        let (mut centre, mut weights) = ([0.0; 2], 0.0);
        for pixel in Self::ring(centre_px, HERTZ_RADIUS * radius_px, aspect) {
            let (place, weight) = (self.to_metres(pixel), self.pixel_area_m2(pixel));
            centre = [centre[0] + weight * place[0], centre[1] + weight * place[1]];
            weights += weight;
        }
        let mut twice_area = 0.0;
        let mut before: Option<[f64; 2]> = None;
        let contour = Self::ring(centre_px, radius_px, aspect).map(|p| self.to_metres(p));
        let closed = contour.clone().chain(contour.take(1));
        for place in closed {
            if let Some(last) = before {
                twice_area += last[0] * place[1] - last[1] * place[0];
            }
            before = Some(place);
        }
        // A regular polygon with n corners on a circle has n sin(2π/n)/2 of its squared radius.
        let turn = std::f64::consts::TAU / DIRECTIONS as f64;
        let radius = (twice_area / (DIRECTIONS as f64 * turn.sin())).sqrt();
        (centre.map(|c| c / weights), radius)
    }

    /// Pixels on a circle of `radius_px` pixel widths.
    fn ring(
        centre_px: [f64; 2],
        radius_px: f64,
        aspect: f64,
    ) -> impl Iterator<Item = [f64; 2]> + Clone {
        (0..DIRECTIONS).map(move |k| {
            let (sin, cos) = (std::f64::consts::TAU * k as f64 / DIRECTIONS as f64).sin_cos();
            [
                centre_px[0] + radius_px * cos,
                centre_px[1] + radius_px * sin / aspect,
            ]
        })
    }

    fn local(&self, pixel: [f64; 2]) -> Local {
        let [hx, hy] = self.pixel_size_m;
        let [k1, k2] = self.distortion;
        let (u, v) = (pixel[0] - self.centre_px[0], pixel[1] - self.centre_px[1]);
        let (aspect2, scale) = ((hy / hx).powi(2), 1.0 / (self.radius_px * self.radius_px));
        let rho2 = (u * u + aspect2 * v * v) * scale;
        let (s, slope) = (1.0 + rho2 * (k1 + rho2 * k2), k1 + 2.0 * k2 * rho2);
        let (by_u, by_v) = (2.0 * u * scale * slope, 2.0 * aspect2 * v * scale * slope);
        Local {
            metres: [
                hx * (self.centre_px[0] + u * s),
                hy * (self.centre_px[1] + v * s),
            ],
            jacobian: [
                [hx * (s + u * by_u), hx * u * by_v],
                [hy * v * by_u, hy * (s + v * by_v)],
            ],
        }
    }
}
