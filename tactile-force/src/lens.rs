//! Camera geometry: from pixels to metres on the surface of the sensor, with radial distortion and
//! non-square pixels, and its fit to a dot target.

use nalgebra::{Matrix2, Matrix3, SMatrix, SVector, Vector2, Vector3};
use tactile_core::{Estimate, Requirement, StopReason};

use crate::error::{ForceError, check_observations};

/// The map from pixels to undistorted metres: pixel sizes h_x and h_y, and Brown's radial
/// distortion about a centre c.
///
/// With (u, v) = p − c in pixels and ρ² = (u² + (v h_y/h_x)²)/R²,
///
/// X = h_x (c_x + u s), Y = h_y (c_y + v s), s = 1 + k₁ρ² + k₂ρ⁴
///
/// (D. C. Brown, "Decentering distortion of lenses", 1966, without its tangential terms). R is a
/// length in pixels, by convention half the diagonal of the frame, so that k₁ and k₂ are the
/// relative displacements of the corners. Barrel distortion of the image has k₁ > 0, pincushion
/// distortion k₁ < 0. Without distortion a position is the pixel times the pixel size.
///
/// ```
/// use tactile_force::LensGeometry;
///
/// // The corners of a frame of 1392 × 1042 pixels appear 3 % too close to its centre.
/// let plain = LensGeometry::new([21.6e-6, 22.0e-6])?;
/// let lens = plain.with_distortion([695.5, 520.5], 869.0, [0.03, 0.0])?;
/// assert_eq!((lens.pixel_size_m(), lens.distortion()), ([21.6e-6, 22.0e-6], [0.03, 0.0]));
/// assert_eq!(lens.to_metres([695.5, 520.5]), plain.to_metres([695.5, 520.5]));
/// let corner = lens.to_metres([0.0, 0.0]);
/// assert!(corner[0] < -0.4e-3);
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

/// A geometry as stored in a file.
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

/// Number of contour points that are undistorted.
const DIRECTIONS: usize = 16;
/// Radius of the ring, relative to the contact, on which a quadratic has the same mean as over
/// Hertz's pressure: √0.4.
const HERTZ_RADIUS: f64 = 0.632_455_532_033_675_9;

/// Value and derivatives of the map at a pixel.
struct Local {
    metres: [f64; 2],
    /// ∂(X, Y)/∂(u, v), by rows.
    jacobian: [[f64; 2]; 2],
}

impl LensGeometry {
    /// A lens without distortion, with pixels of the given size [x, y] in metres.
    ///
    /// # Errors
    /// An error for a size that is not positive and finite.
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

    /// Sets radial distortion [k₁, k₂] about a centre [x, y], normalised by `radius_px`.
    ///
    /// # Errors
    /// An error if a centre or coefficient is not finite, if a radius is not positive, or if the
    /// distortion folds the image inside the radius: 1 + 3k₁ρ² + 5k₂ρ⁴ must be positive up to ρ =
    /// 1.
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
        // The slope is a parabola in ρ²: its minimum on [0, 1] is at an end or at its vertex.
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

    /// The undistorted position [X, Y] of a pixel [x, y], in metres from the undistorted position
    /// of the first pixel.
    pub fn to_metres(&self, pixel: [f64; 2]) -> [f64; 2] {
        self.local(pixel).metres
    }

    /// Distances [x, y] in metres between neighbouring pixels at a position: h_x and h_y without
    /// distortion.
    pub(crate) fn pixel_step_m(&self, pixel: [f64; 2]) -> [f64; 2] {
        let [[xu, xv], [yu, yv]] = self.local(pixel).jacobian;
        [xu.hypot(yu), xv.hypot(yv)]
    }

    /// Area in square metres covered by a pixel: dS of (6).
    pub fn pixel_area_m2(&self, pixel: [f64; 2]) -> f64 {
        let [[xu, xv], [yu, yv]] = self.local(pixel).jacobian;
        (xu * yv - xv * yu).abs()
    }

    /// Mean pixel area over a ball's contact around a centre [x, y], weighted by Hertz's pressure
    /// and accurate to second order in the contact radius. It is dS of (6) for a contact that is
    /// not small compared with the frame.
    ///
    /// ```
    /// use tactile_force::LensGeometry;
    ///
    /// let plain = LensGeometry::new([20e-6; 2])?;
    /// let lens = plain.with_distortion([100.0, 100.0], 100.0, [0.05, 0.0])?;
    /// // Around the centre of distortion pixels grow by 4 k₁ρ², on average over the pressure by
    /// // 4 k₁ · 0.4 a²/R².
    /// let mean = lens.mean_pixel_area_m2([100.0, 100.0], 30.0);
    /// assert!((mean / 4e-10 - 1.0 - 4.0 * 0.05 * 0.4 * 0.09).abs() < 1e-4);
    /// # Ok::<(), tactile_force::ForceError>(())
    /// ```
    pub fn mean_pixel_area_m2(&self, centre_px: [f64; 2], radius_px: f64) -> f64 {
        let ring = Self::ring(centre_px, HERTZ_RADIUS * radius_px, 1.0);
        ring.map(|p| self.pixel_area_m2(p)).iter().sum::<f64>() / DIRECTIONS as f64
    }

    /// Undistorted centre [X, Y] and radius, in metres, of a contact that appears as a circle of
    /// `radius_px` pixel widths, for pixels `aspect` times as high as wide. The radius belongs to a
    /// circle with the area of the undistorted contour.
    pub(crate) fn contact_m(
        &self,
        centre_px: [f64; 2],
        radius_px: f64,
        aspect: f64,
    ) -> ([f64; 2], f64) {
        let (mut centre, mut weights) = ([0.0; 2], 0.0);
        // Weighted by the pixel area, so that the mean is over the surface rather than over the
        // image.
        for pixel in Self::ring(centre_px, HERTZ_RADIUS * radius_px, aspect) {
            let (place, weight) = (self.to_metres(pixel), self.pixel_area_m2(pixel));
            centre = [centre[0] + weight * place[0], centre[1] + weight * place[1]];
            weights += weight;
        }
        // Twice the area of the contour's polygon, by the shoelace formula.
        let contour = Self::ring(centre_px, radius_px, aspect).map(|p| self.to_metres(p));
        let ends = (0..DIRECTIONS).map(|k| [contour[k], contour[(k + 1) % DIRECTIONS]]);
        let twice_area: f64 = ends.map(|[a, b]| a[0] * b[1] - b[0] * a[1]).sum();
        // A regular polygon with n corners on a circle has an area of n sin(2π/n)/2 times the
        // squared radius.
        let turn = std::f64::consts::TAU / DIRECTIONS as f64;
        let radius = (twice_area / (DIRECTIONS as f64 * turn.sin())).sqrt();
        (centre.map(|c| c / weights), radius)
    }

    /// Pixels on a circle of `radius_px` pixel widths.
    fn ring(centre_px: [f64; 2], radius_px: f64, aspect: f64) -> [[f64; 2]; DIRECTIONS] {
        std::array::from_fn(|k| {
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

/// A dot of a target: its position in the image and in the drawing of the target.
///
/// ```
/// use tactile_force::DotPair;
///
/// let dot = DotPair { pixel: [312.4, 87.9], target_m: [6e-3, 2e-3] };
/// assert_eq!(dot.target_m, [6e-3, 2e-3]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct DotPair {
    /// Centroid [x, y] of the dot in the frame, in pixels.
    pub pixel: [f64; 2],
    /// Position [x, y] of the dot on the target, in metres from any origin.
    pub target_m: [f64; 2],
}

/// A fitted camera geometry.
///
/// ```
/// use tactile_force::{DotPair, LensFit, LensGeometry};
///
/// let truth =
///     LensGeometry::new([20e-6, 21e-6])?.with_distortion([159.5, 119.5], 199.3, [0.04, 0.002])?;
/// // 9 × 7 dots on a target rotated by 20 mrad.
/// let (sin, cos) = 0.02_f64.sin_cos();
/// let mut dots = Vec::new();
/// for k in 0..63 {
///     let pixel = [15.0 + 35.0 * f64::from(k % 9), 15.0 + 35.0 * f64::from(k / 9)];
///     let [x, y] = truth.to_metres(pixel);
///     dots.push(DotPair { pixel, target_m: [cos * x - sin * y, sin * x + cos * y] });
/// }
/// let fit = LensFit::from_dots(&dots, (240, 320))?;
/// assert!((fit.pixel_size_m[1].value / 21e-6 - 1.0).abs() < 1e-9);
/// assert!((fit.distortion[0].value - 0.04).abs() < 1e-6);
/// assert!(
///     (fit.geometry.to_metres([10.0, 12.0])[0] - truth.to_metres([10.0, 12.0])[0]).abs() < 1e-10
/// );
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct LensFit {
    /// The geometry.
    pub geometry: LensGeometry,
    /// Pixel sizes [h_x, h_y] in metres with their standard errors.
    pub pixel_size_m: [Estimate; 2],
    /// Brown's coefficients [k₁, k₂] with their standard errors.
    pub distortion: [Estimate; 2],
    /// Covariance of [h_x, h_y, k₁, k₂].
    pub covariance: [[f64; 4]; 4],
    /// Standard deviation of a dot's residual along one axis, in pixels.
    pub residual_sd_px: f64,
    /// Number of Gauss–Newton steps.
    pub iterations: usize,
    /// Why the fit stopped.
    pub stop: StopReason,
}

/// Parameters: h_x, h_y, k₁, k₂, and the pose of the target (angle and translation).
const PARAMETERS: usize = 7;
type Normal = SMatrix<f64, PARAMETERS, PARAMETERS>;
type Vector = SVector<f64, PARAMETERS>;

/// Minimum number of dots: 14 coordinates for 7 parameters leave as many degrees of freedom as
/// parameters.
const FEWEST_DOTS: usize = 7;
const MAX_STEPS: usize = 50;

impl LensFit {
    /// Least-squares fit to the undistorted positions of the dots: pixel sizes, k₁ and k₂ about the
    /// centre of the frame, and the pose of the target, which may be mirrored. O(dots).
    ///
    /// # Errors
    /// An error for fewer than seven dots, a dot that is not finite, or dots on a line.
    pub fn from_dots(
        dots: &[DotPair],
        (rows, columns): (usize, usize),
    ) -> Result<Self, ForceError> {
        check_observations(dots, FEWEST_DOTS, |d| {
            [d.pixel[0], d.pixel[1], d.target_m[0], d.target_m[1]]
        })?;
        let centre = [0.5 * (columns as f64 - 1.0), 0.5 * (rows as f64 - 1.0)];
        let radius = centre[0].hypot(centre[1]).max(1.0);
        let mut problem = Problem {
            dots,
            centre,
            radius,
            mirror: 1.0,
        };
        let mut parameters = problem.start()?;
        let (mut iterations, mut stop) = (0, StopReason::IterationLimit);
        let mut state = problem.assemble(&parameters);
        while iterations < MAX_STEPS {
            iterations += 1;
            let step = state
                .step()
                .ok_or(ForceError::DegeneratePairs { span: 0.0 })?;
            parameters += step;
            state = problem.assemble(&parameters);
            // Steps are compared with the scale of each parameter, because metres and angles have
            // no common unit.
            if step.component_div(&state.scale()).amax() < 1e-11 {
                stop = StopReason::Converged;
                break;
            }
        }
        problem.report(&parameters, &state, iterations, stop)
    }
}

struct Problem<'a> {
    dots: &'a [DotPair],
    centre: [f64; 2],
    radius: f64,
    /// −1 if the y axis of the target is opposite to that of the frame.
    mirror: f64,
}

/// Normal equations of the fit.
struct Equations {
    normal: Normal,
    gradient: Vector,
    squares: f64,
}

impl Equations {
    /// The change of each parameter that moves the dots by their extent.
    fn scale(&self) -> Vector {
        let largest = self.normal[(5, 5)].max(self.normal[(6, 6)]);
        self.normal.diagonal().map(|d| (largest / d).sqrt())
    }

    /// The Gauss–Newton step, with columns scaled to unit length, because the parameters differ by
    /// ten orders of magnitude.
    fn step(&self) -> Option<Vector> {
        let inverse = self.inverse()?;
        Some(inverse * self.gradient)
    }

    fn inverse(&self) -> Option<Normal> {
        let length = self.normal.diagonal().map(f64::sqrt);
        if length.min() <= 0.0 {
            return None;
        }
        let scaled = Normal::from_fn(|i, j| self.normal[(i, j)] / (length[i] * length[j]));
        // For dots on a line the scaled matrix is singular to rounding.
        let cholesky = scaled.cholesky()?;
        if cholesky.l_dirty().diagonal().min() < 1e-7 {
            return None;
        }
        let inverse = cholesky.inverse();
        Some(Normal::from_fn(|i, j| {
            inverse[(i, j)] / (length[i] * length[j])
        }))
    }
}

impl Problem<'_> {
    /// Pixel sizes and pose from the affine map pixel → target, without distortion.
    fn start(&mut self) -> Result<Vector, ForceError> {
        let (mut normal, mut right) = (Matrix3::zeros(), [Vector3::zeros(); 2]);
        for dot in self.dots {
            // Positions from −1 to 1 give the normal equations a good condition number.
            let u = (dot.pixel[0] - self.centre[0]) / self.radius;
            let v = (dot.pixel[1] - self.centre[1]) / self.radius;
            let row = Vector3::new(u, v, 1.0);
            normal += row * row.transpose();
            for (sum, target) in right.iter_mut().zip(dot.target_m) {
                *sum += row * target;
            }
        }
        let degenerate = ForceError::DegeneratePairs { span: 0.0 };
        let cholesky = normal.cholesky().ok_or(degenerate.clone())?;
        if cholesky.l_dirty().diagonal().min() < 1e-6 {
            return Err(degenerate);
        }
        let [x, y] = right.map(|r| cholesky.solve(&r));
        let affine = Matrix2::new(x[0], x[1], y[0], y[1]) / self.radius;
        if affine.determinant() < 0.0 {
            self.mirror = -1.0;
        }
        let affine = Matrix2::new(1.0, 0.0, 0.0, self.mirror) * affine;
        let sizes = [affine.column(0).norm(), affine.column(1).norm()];
        // The target rotated by −angle is aligned with the axes of the frame.
        let angle = -affine[(1, 0)].atan2(affine[(0, 0)]);
        let middle = Vector2::new(x[2], self.mirror * y[2]);
        let (sin, cos) = angle.sin_cos();
        let turned = Vector2::new(
            cos * middle.x - sin * middle.y,
            sin * middle.x + cos * middle.y,
        );
        let shift = [
            sizes[0] * self.centre[0] - turned.x,
            sizes[1] * self.centre[1] - turned.y,
        ];
        Ok(Vector::from([
            sizes[0], sizes[1], 0.0, 0.0, angle, shift[0], shift[1],
        ]))
    }

    /// Residuals (pose of the target − position of the pixel) and their derivatives by all
    /// parameters.
    fn assemble(&self, parameters: &Vector) -> Equations {
        let [hx, hy, k1, k2, angle, tx, ty] = parameters.data.0[0];
        let (sin, cos) = angle.sin_cos();
        let (aspect2, scale) = ((hy / hx).powi(2), 1.0 / (self.radius * self.radius));
        let mut equations = Equations {
            normal: Normal::zeros(),
            gradient: Vector::zeros(),
            squares: 0.0,
        };
        for dot in self.dots {
            let (u, v) = (dot.pixel[0] - self.centre[0], dot.pixel[1] - self.centre[1]);
            let rho2 = (u * u + aspect2 * v * v) * scale;
            let (s, slope) = (1.0 + rho2 * (k1 + rho2 * k2), k1 + 2.0 * k2 * rho2);
            let rho2_by_hx = -2.0 * v * v * aspect2 * scale / hx;
            let rho2_by_hy = 2.0 * v * v * aspect2 * scale / hy;
            let (x, y) = (dot.target_m[0], self.mirror * dot.target_m[1]);
            let turned = [cos * x - sin * y, sin * x + cos * y];
            let seen = [hx * (self.centre[0] + u * s), hy * (self.centre[1] + v * s)];
            // Derivatives of the negative residual. The derivative of a rotated position by the
            // angle is (−y, x).
            let along_x = Vector::from([
                self.centre[0] + u * s + hx * u * slope * rho2_by_hx,
                hx * u * slope * rho2_by_hy,
                hx * u * rho2,
                hx * u * rho2 * rho2,
                turned[1],
                -1.0,
                0.0,
            ]);
            let along_y = Vector::from([
                hy * v * slope * rho2_by_hx,
                self.centre[1] + v * s + hy * v * slope * rho2_by_hy,
                hy * v * rho2,
                hy * v * rho2 * rho2,
                -turned[0],
                0.0,
                -1.0,
            ]);
            for (row, residual) in [
                (along_x, turned[0] + tx - seen[0]),
                (along_y, turned[1] + ty - seen[1]),
            ] {
                equations.normal += row * row.transpose();
                equations.gradient += row * residual;
                equations.squares += residual * residual;
            }
        }
        equations
    }

    fn report(
        &self,
        parameters: &Vector,
        equations: &Equations,
        iterations: usize,
        stop: StopReason,
    ) -> Result<LensFit, ForceError> {
        let [hx, hy, k1, k2, ..] = parameters.data.0[0];
        let geometry =
            LensGeometry::new([hx, hy])?.with_distortion(self.centre, self.radius, [k1, k2])?;
        let variance = equations.squares / (2 * self.dots.len() - PARAMETERS) as f64;
        let inverse = equations
            .inverse()
            .ok_or(ForceError::DegeneratePairs { span: 0.0 })?;
        let covariance: [[f64; 4]; 4] =
            std::array::from_fn(|i| std::array::from_fn(|j| inverse[(i, j)] * variance));
        let estimate = |k: usize| Estimate::from_variance(parameters[k], covariance[k][k]);
        Ok(LensFit {
            geometry,
            pixel_size_m: [estimate(0), estimate(1)],
            distortion: [estimate(2), estimate(3)],
            covariance,
            residual_sd_px: (variance / (hx * hy)).sqrt(),
            iterations,
            stop,
        })
    }
}
