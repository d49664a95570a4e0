//! The fit of a camera's geometry to a dot target.

use nalgebra::{Matrix2, Matrix3, SMatrix, SVector, Vector2, Vector3};

use super::LensGeometry;
use crate::error::ForceError;
use tactile_core::Estimate;
use tactile_core::StopReason;

/// A dot of a target: where the camera sees it, and where the target's drawing has it.
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
    /// Place [x, y] of the dot on the target, in metres from any origin.
    pub target_m: [f64; 2],
}

/// A fitted camera geometry.
///
/// ```
/// use tactile_force::{DotPair, LensFit, LensGeometry};
///
/// let truth = LensGeometry::new([20e-6, 21e-6])?.with_distortion([159.5, 119.5], 199.3, [0.04, 0.002])?;
/// // 9 × 7 dots, 0.7 mm apart, on a target turned by 20 mrad.
/// let (sin, cos) = 0.02_f64.sin_cos();
/// let mut dots = Vec::new();
/// for k in 0..63 {
///     let target_m = [0.7e-3 * f64::from(k % 9), 0.7e-3 * f64::from(k / 9)];
///     let [x, y] = target_m;
///     let place = [0.3e-3 + cos * x - sin * y, 0.2e-3 + sin * x + cos * y];
///     dots.push(DotPair { pixel: truth.to_pixels(place).unwrap(), target_m });
/// }
/// let fit = LensFit::from_dots(&dots, (240, 320))?;
/// assert!((fit.pixel_size_m[1].value / 21e-6 - 1.0).abs() < 1e-9);
/// assert!((fit.distortion[0].value - 0.04).abs() < 1e-6);
/// assert!((fit.geometry.to_metres([10.0, 12.0])[0] - truth.to_metres([10.0, 12.0])[0]).abs() < 1e-10);
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
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
    /// Gauss–Newton steps taken.
    pub iterations: usize,
    /// Why the fit stopped.
    pub stop: StopReason,
}

/// Parameters: h_x, h_y, k₁, k₂, and the target's pose: angle and shift.
const PARAMETERS: usize = 7;
type Normal = SMatrix<f64, PARAMETERS, PARAMETERS>;
type Vector = SVector<f64, PARAMETERS>;

/// Fewest dots: 14 coordinates for 7 parameters leave as many degrees of freedom as parameters.
const FEWEST_DOTS: usize = 7;
const MAX_STEPS: usize = 50;

impl LensFit {
    /// Least squares on the undistorted places of the dots: pixel sizes, k₁, k₂ about the frame's middle, and the pose of the
    /// target, which may be mirrored. O(dots).
    ///
    /// # Errors
    /// Fewer than seven dots, one that is not finite, or dots on a line.
    pub fn from_dots(
        dots: &[DotPair],
        (rows, columns): (usize, usize),
    ) -> Result<Self, ForceError> {
        if dots.len() < FEWEST_DOTS {
            return Err(ForceError::TooFewPairs {
                required: FEWEST_DOTS,
                found: dots.len(),
            });
        }
        let finite = |d: &DotPair| d.pixel.iter().chain(&d.target_m).all(|v| v.is_finite());
        if let Some(index) = dots.iter().position(|d| !finite(d)) {
            return Err(ForceError::NonFinitePair { index });
        }
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
            // Steps in units of the parameters' own size: metres and angles have none in common.
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
    /// −1 where the target's y runs against the frame's.
    mirror: f64,
}

/// Normal equations.
struct Equations {
    normal: Normal,
    gradient: Vector,
    squares: f64,
}

impl Equations {
    /// The size of a parameter that moves the dots by their extent.
    fn scale(&self) -> Vector {
        let largest = self.normal[(5, 5)].max(self.normal[(6, 6)]);
        self.normal.diagonal().map(|d| (largest / d).sqrt())
    }

    /// The Gauss–Newton step, with columns scaled to unit length: parameters differ by ten orders of magnitude.
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
        // Dots on a line leave the scaled matrix singular to rounding.
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
    /// Sizes and pose from the affine map pixel → target, no distortion.
    fn start(&mut self) -> Result<Vector, ForceError> {
        let (mut normal, mut right) = (Matrix3::zeros(), [Vector3::zeros(); 2]);
        for dot in self.dots {
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
        // The target turned by −angle lies along the frame's axes.
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

    /// Residuals (pose of the target − place of the pixel) and their derivatives by all parameters.
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
