//! Estimates of light and albedo from the image itself: asked for by name, never applied unasked.

use crate::{Domain, Frame, Lighting, Scalar, SfsError};

/// Fewest pixels statistics of an image make sense for.
const FEWEST: usize = 16;

/// Estimates light direction and albedo from the statistics of the image (after Zheng & Chellappa 1991).
///
/// Assumes a convex object whose normals are spread evenly over the visible half sphere: with μ₁ = ⟨I⟩, μ₂ = ⟨I²⟩ and
/// γ = √(6π² μ₂ − 48 μ₁²) the albedo is γ/π and cos(slant) = 4 μ₁/γ; the tilt is the mean direction of the image's
/// gradient. Real objects break the assumption: expect 5° to 20°, and prefer a calibrated light. The slant is kept
/// at 80° or less. The result has ambient 0 and the estimated albedo at unit intensity.
///
/// # Errors
/// Those of a wrong domain; [`SfsError::TooFewPixels`] below 16 finite pixels.
pub fn estimate_lighting<T: Scalar>(
    frame: Frame<'_, T>,
    domain: &Domain<'_, T>,
) -> Result<Lighting<T>, SfsError> {
    let (rows, columns) = frame.dim();
    let area = domain.validate(rows, columns)?;
    let value = |row: usize, column: usize| -> Option<f64> {
        let inside = row < rows && column < columns && domain.contains(row, column);
        inside.then(|| frame.at(row, column).as_f64()).filter(|value| value.is_finite())
    };
    let (mut count, mut first, mut second, mut tilt) = (0usize, 0.0, 0.0, [0.0; 2]);
    let [hx, hy] = domain.pixel_size_m.map(Scalar::as_f64);
    for row in area.top..area.top + area.rows {
        for column in area.left..area.left + area.columns {
            let Some(here) = value(row, column) else { continue };
            count += 1;
            first += here;
            second += here * here;
            if let (Some(right), Some(below)) = (value(row, column + 1), value(row + 1, column)) {
                let (gx, gy) = ((right - here) / hx, (below - here) / hy);
                let length = gx.hypot(gy);
                if length > 0.0 {
                    tilt[0] += gx / length;
                    tilt[1] += gy / length;
                }
            }
        }
    }
    if count < FEWEST {
        return Err(SfsError::TooFewPixels { needed: FEWEST, available: count });
    }
    let (first, second) = (first / count as f64, second / count as f64);
    let gamma = (6.0 * core::f64::consts::PI.powi(2) * second - 48.0 * first * first).max(0.0).sqrt();
    let slant = if gamma > 0.0 { (4.0 * first / gamma).clamp(0.0, 1.0).acos() } else { 0.0 };
    let slant = slant.min(80.0_f64.to_radians());
    let azimuth = tilt[1].atan2(tilt[0]);
    let direction = [slant.sin() * azimuth.cos(), slant.sin() * azimuth.sin(), slant.cos()];
    let light = Lighting::new(direction.map(T::of))?;
    let albedo = gamma / core::f64::consts::PI;
    if albedo > 0.0 { light.with_albedo(T::of(albedo)) } else { Ok(light) }
}

/// Estimates the intensity at normal incidence: the given quantile of the intensities above the ambient, which is
/// right if some part of the surface faces the light. 0.995 leaves out stray bright pixels.
///
/// # Errors
/// Those of a wrong domain; [`SfsError::InvalidOption`] for a quantile outside (0, 1];
/// [`SfsError::TooFewPixels`] below 16 finite pixels.
pub fn estimate_normal_intensity<T: Scalar>(
    frame: Frame<'_, T>,
    domain: &Domain<'_, T>,
    ambient: T,
    quantile: f64,
) -> Result<T, SfsError> {
    crate::error::in_range("quantile", "in (0, 1]", quantile, quantile > 0.0 && quantile <= 1.0)?;
    let (rows, columns) = frame.dim();
    let area = domain.validate(rows, columns)?;
    let mut values: Vec<f64> = Vec::with_capacity(area.area());
    for row in area.top..area.top + area.rows {
        for column in area.left..area.left + area.columns {
            let value = (frame.at(row, column) - ambient).as_f64();
            if domain.contains(row, column) && value.is_finite() {
                values.push(value);
            }
        }
    }
    if values.len() < FEWEST {
        return Err(SfsError::TooFewPixels { needed: FEWEST, available: values.len() });
    }
    let index = ((values.len() - 1) as f64 * quantile).round() as usize;
    Ok(T::of(*values.select_nth_unstable_by(index, f64::total_cmp).1))
}
