//! Pressures and contact radii as results.

/// Pressure at a point of a contact or of a bonded interface.
///
/// ```
/// use tactile_fem::{Load, Material, Object, Press};
///
/// let scene = Press::new(Object::Ball { radius_m: 3e-3 }, Material::new(1e5, 0.495).unwrap()).and_then(|press| press.scene()).unwrap();
/// let state = &scene.solve(&[Load::Approach(0.3e-3)]).states[0];
/// assert!(state.pressure()[0].pressure_pa > state.pressure()[5].pressure_pa);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct PressurePoint {
    /// Deformed distance from the axis, in metres.
    pub r_m: f64,
    /// Deformed height, in metres.
    pub z_m: f64,
    /// Force per deformed area, in pascals.
    pub pressure_pa: f64,
}

/// A contact radius and how far the mesh leaves it open.
///
/// ```
/// use tactile_fem::{Load, Material, Object, Press};
///
/// let scene = Press::new(Object::Ball { radius_m: 3e-3 }, Material::new(1e5, 0.495).unwrap()).and_then(|press| press.scene()).unwrap();
/// let state = &scene.solve(&[Load::Approach(0.3e-3)]).states[0];
/// let radius = state.contact_radius().unwrap();
/// assert!(radius.uncertainty_m < 0.01 * radius.radius_m);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct ContactRadius {
    /// The radius, in metres.
    pub radius_m: f64,
    /// Numerical uncertainty: the difference between two extrapolations of the pressure to zero.
    pub uncertainty_m: f64,
}

/// Pressure at a radius, by the cubic through the four nearest points; constant beyond the last.
pub fn pressure_at(points: &[PressurePoint], radius: f64) -> f64 {
    let after = points.partition_point(|point| point.r_m < radius);
    let Some(last) = points.last() else {
        return 0.0;
    };
    if after == points.len() {
        return last.pressure_pa;
    }
    let first = after.saturating_sub(2).min(points.len().saturating_sub(4));
    let near = &points[first..points.len().min(first + 4)];
    let mut sum = 0.0;
    for (i, point) in near.iter().enumerate() {
        let mut weight = 1.0;
        for (j, other) in near.iter().enumerate() {
            if i != j {
                weight *= (radius - other.r_m) / (point.r_m - other.r_m);
            }
        }
        sum += weight * point.pressure_pa;
    }
    sum
}
