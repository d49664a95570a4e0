//! Estimates of light and albedo from the image itself; no method applies them by itself.

use crate::{Domain, Frame, Lighting, Scalar, SfsError};

/// Fewest pixels statistics of an image make sense for.
const FEWEST: usize = 16;

/// Estimates light direction and albedo from the statistics of the image (after Zheng & Chellappa 1991).
///
/// Assumes a convex object whose normals are spread evenly over the visible half sphere: with μ₁ = ⟨I⟩, μ₂ = ⟨I²⟩ and
/// γ = √(6π² μ₂ − 48 μ₁²) the albedo is γ/π and cos(slant) = 4 μ₁/γ; the tilt is the mean direction of the image's
/// gradient. Real objects break the assumption: expect 5° to 20°, and prefer a calibrated light. The slant is kept
/// at 80° or less. The result has ambient 0 and the estimated albedo as its intensity at normal incidence.
///
/// O(pixels of the mask's box).
///
/// ```
/// use ndarray::Array2;
/// use tactile_sfs::{Domain, Frame, Lighting, estimate_lighting};
/// // A hemisphere lit from the right.
/// let light = Lighting::new([0.5, 0.0, 1.0])?;
/// let z2 = |r: usize, c: usize| 400.0 - (r as f64 - 20.0).powi(2) - (c as f64 - 20.0).powi(2);
/// let mask = Array2::from_shape_fn((41, 41), |(r, c)| z2(r, c) > 1.0);
/// let image = Array2::from_shape_fn((41, 41), |(r, c)| {
///     let z = z2(r, c).max(1.0).sqrt();
///     light.shade((20.0 - c as f64) / z, (20.0 - r as f64) / z)
/// });
/// let domain = Domain::default().with_mask(mask.view());
/// let found = estimate_lighting(Frame::Real(image.view()), &domain)?.direction();
/// let cosine: f64 = found.iter().zip(light.direction()).map(|(a, b)| a * b).sum();
/// assert!(cosine > 20.0_f64.to_radians().cos());
/// # Ok::<(), tactile_sfs::SfsError>(())
/// ```
///
/// # Errors
/// Those of a wrong domain; [`SfsError::TooFewPixels`] below 16 finite pixels.
pub fn estimate_lighting<T: Scalar>(
    frame: Frame<'_, T>,
    domain: &Domain<'_, T>,
) -> Result<Lighting<T>, SfsError> {
    let Statistics {
        mean,
        square,
        gradient,
        ..
    } = Statistics::of(&frame, domain)?;
    let gamma = (6.0 * core::f64::consts::PI.powi(2) * square - 48.0 * mean * mean)
        .max(0.0)
        .sqrt();
    let slant = if gamma > 0.0 {
        (4.0 * mean / gamma).clamp(0.0, 1.0).acos()
    } else {
        0.0
    };
    let slant = slant.min(80.0_f64.to_radians());
    let azimuth = gradient[1].atan2(gradient[0]);
    let direction = [
        slant.sin() * azimuth.cos(),
        slant.sin() * azimuth.sin(),
        slant.cos(),
    ];
    let light = Lighting::new(direction.map(T::of))?;
    let albedo = gamma / core::f64::consts::PI;
    if albedo > 0.0 {
        light.with_normal_intensity(T::of(albedo))
    } else {
        Ok(light)
    }
}

/// What the image says about the light.
struct Statistics {
    count: usize,
    /// Means of the intensity and of its square.
    mean: f64,
    square: f64,
    /// Sum of the unit vectors along the gradient.
    gradient: [f64; 2],
}

impl Statistics {
    fn of<T: Scalar>(frame: &Frame<'_, T>, domain: &Domain<'_, T>) -> Result<Self, SfsError> {
        let (rows, columns) = frame.dim();
        let area = domain.validate(rows, columns)?;
        let value = |row: usize, column: usize| -> Option<f64> {
            let inside = row < rows && column < columns && domain.contains(row, column);
            inside
                .then(|| frame.at(row, column).as_f64())
                .filter(|value| value.is_finite())
        };
        let [hx, hy] = domain.pixel_size_m.map(T::as_f64);
        let mut sums = Self {
            count: 0,
            mean: 0.0,
            square: 0.0,
            gradient: [0.0; 2],
        };
        for (row, column) in area.pixels() {
            let Some(here) = value(row, column) else {
                continue;
            };
            sums.count += 1;
            sums.mean += here;
            sums.square += here * here;
            if let (Some(right), Some(below)) = (value(row, column + 1), value(row + 1, column)) {
                sums.turn([(right - here) / hx, (below - here) / hy]);
            }
        }
        enough(sums.count)?;
        let n = sums.count as f64;
        Ok(Self {
            mean: sums.mean / n,
            square: sums.square / n,
            ..sums
        })
    }

    /// Adds the direction of one gradient.
    fn turn(&mut self, [gx, gy]: [f64; 2]) {
        let length = gx.hypot(gy);
        if length > 0.0 {
            self.gradient[0] += gx / length;
            self.gradient[1] += gy / length;
        }
    }
}

fn enough(available: usize) -> Result<(), SfsError> {
    if available < FEWEST {
        Err(SfsError::TooFewPixels {
            needed: FEWEST,
            available,
        })
    } else {
        Ok(())
    }
}
