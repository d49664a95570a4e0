//! Pressures and contact radii as results.

/// Pressure at a point of a contact or of a bonded interface.
///
/// ```
/// use tactile_elasticity::fem::{Load, Material, Scene};
///
/// let scene = Scene::ball_on_flat(3e-3, Material::new(1e5, 0.495).unwrap()).unwrap();
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
/// use tactile_elasticity::fem::{Load, Material, Scene};
///
/// let scene = Scene::ball_on_flat(3e-3, Material::new(1e5, 0.495).unwrap()).unwrap();
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
