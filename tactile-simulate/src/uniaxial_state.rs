//! Stretch, strain and stress of the squeezed block in closed form; the equations are in [`uniaxial`](super::uniaxial).
use super::error::SimulateError;
use super::material::Elastic;

/// Stretch, strain and stress at one force. Compression is negative.
///
/// ```
/// use tactile_simulate::{UniaxialOptions, UniaxialScene};
/// let scene = UniaxialScene::new(UniaxialOptions::default())?;
/// let state = scene.states()[2]; // 1.2 N on a block of 103 kPa
/// assert!((state.second_piola_zz_pa - 103e3 * state.strain_zz).abs() < 1e-9, "S = E e");
/// assert!((state.cauchy_zz_pa * state.area_m2 + 1.2).abs() < 1e-12, "compression is negative");
/// let volume = state.stretch_z * state.stretch_lateral.powi(2);
/// assert!(state.stretch_z < 1.0 && (volume - 1.0).abs() < 0.02, "ν = ½ in small strain");
/// # Ok::<(), tactile_simulate::SimulateError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct UniaxialState {
    /// Compressive force in newton.
    pub force_n: f64,
    /// λ_z.
    pub stretch_z: f64,
    /// λ_t.
    pub stretch_lateral: f64,
    /// Green–Lagrange strain e_zz.
    pub strain_zz: f64,
    /// Second Piola–Kirchhoff stress S_zz in pascal.
    pub second_piola_zz_pa: f64,
    /// Cauchy stress in pascal: the negative of force over the deformed face.
    pub cauchy_zz_pa: f64,
    /// Deformed face in square metres.
    pub area_m2: f64,
}

impl UniaxialState {
    pub(super) fn new(
        material: &Elastic,
        area0_m2: f64,
        force_n: f64,
    ) -> Result<Self, SimulateError> {
        let e = material.youngs_modulus_pa;
        // Nominal stress over modulus: λ(1 − λ²)/2, greatest at 1/√3.
        let load = force_n / (e * area0_m2);
        let limit = 1.0 / 27.0_f64.sqrt();
        if load >= limit {
            return Err(SimulateError::Overload {
                force_n,
                limit_n: limit * e * area0_m2,
            });
        }
        // λ³ − λ + 2·load = 0: the largest of three real roots by the cosine formula.
        let stretch = 2.0 / 3.0_f64.sqrt() * ((-load / limit).acos() / 3.0).cos();
        let strain_zz = 0.5 * (stretch - 1.0) * (stretch + 1.0);
        let stretch_lateral = (1.0 - 2.0 * material.poisson_ratio * strain_zz).sqrt();
        let area_m2 = area0_m2 * stretch_lateral * stretch_lateral;
        Ok(Self {
            force_n,
            stretch_z: stretch,
            stretch_lateral,
            strain_zz,
            second_piola_zz_pa: e * strain_zz,
            cauchy_zz_pa: -force_n / area_m2,
            area_m2,
        })
    }
}
