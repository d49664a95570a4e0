//! Materials and their stress response.

use tactile_elasticity::{ElasticityError, Quantity};

/// Largest Poisson ratio that the elements support: at ½ the bulk modulus is infinite.
const LARGEST_POISSON_RATIO: f64 = 0.4999;

/// An isotropic elastic material: compressible neo-Hookean at finite strain,
///
/// $$ W = \frac{\mu}{2}(J^{-2/3} \mathrm{tr}\, F^T F - 3) + \frac{\kappa}{2} (J - 1)^2, $$
///
/// with $\mu = E / 2(1 + \nu)$, $\kappa = E / 3(1 - 2\nu)$. Hooke's law with the same constants in
/// linear kinematics.
///
/// ```
/// use tactile_fem::Material;
///
/// let tissue = Material::new(10e3, 0.495).unwrap();
/// assert_eq!(tissue.youngs_modulus_pa(), 10e3);
/// assert!(Material::new(10e3, 0.5).is_err());
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Material {
    youngs_modulus_pa: f64,
    poisson_ratio: f64,
}

impl Material {
    /// Creates a material from Young's modulus (Pa) and Poisson ratio.
    ///
    /// # Errors
    /// An error for a modulus that is not positive, or a Poisson ratio outside (−1, 0.4999].
    pub fn new(youngs_modulus_pa: f64, poisson_ratio: f64) -> Result<Self, ElasticityError> {
        Quantity::YoungsModulus.positive(youngs_modulus_pa)?;
        if !(poisson_ratio > -1.0 && poisson_ratio <= 0.5) {
            return Err(ElasticityError::PoissonRatio {
                found: poisson_ratio,
            });
        }
        if poisson_ratio > LARGEST_POISSON_RATIO {
            return Err(Quantity::PoissonRatio.beyond(poisson_ratio, LARGEST_POISSON_RATIO));
        }
        Ok(Self {
            youngs_modulus_pa,
            poisson_ratio,
        })
    }

    /// Young's modulus, in pascals.
    ///
    /// ```
    /// use tactile_fem::Material;
    /// assert_eq!(Material::new(10e3, 0.495).unwrap().youngs_modulus_pa(), 10e3);
    /// ```
    pub fn youngs_modulus_pa(&self) -> f64 {
        self.youngs_modulus_pa
    }

    /// Poisson's ratio.
    ///
    /// ```
    /// use tactile_fem::Material;
    /// assert_eq!(Material::new(10e3, 0.495).unwrap().poisson_ratio(), 0.495);
    /// ```
    pub fn poisson_ratio(&self) -> f64 {
        self.poisson_ratio
    }

    /// μ = E / 2(1 + ν), in pascals.
    #[inline]
    pub(crate) fn shear_modulus(&self) -> f64 {
        self.youngs_modulus_pa / (2.0 * (1.0 + self.poisson_ratio))
    }

    /// κ = E / 3(1 − 2ν), in pascals.
    #[inline]
    pub(crate) fn bulk_modulus(&self) -> f64 {
        self.youngs_modulus_pa / (3.0 * (1.0 - 2.0 * self.poisson_ratio))
    }
}

/// Strain measure, and the geometry on which contact is evaluated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Kinematics {
    /// Finite strain, with contact on the deformed surfaces.
    #[default]
    Finite,
    /// Infinitesimal strain and Hooke's law, with contact gaps along z on the undeformed surfaces.
    Linear,
}

/// The components of the deformation gradient: rr, rz, zr, zz, θθ.
pub(crate) type Gradient = [f64; 5];

/// Stress without its pressure part, and the volume change.
pub(crate) struct StressResponse {
    /// Deviatoric first Piola–Kirchhoff stress.
    pub stress: Gradient,
    /// Volume change J − 1 (the strain's trace in linear kinematics).
    pub volume: f64,
    /// Derivative of the volume change, the cofactor of F.
    pub cofactor: Gradient,
}

/// (1 + v)^(−1/3), accurate to rounding.
#[inline]
pub(crate) fn inverse_cube_root(v: f64) -> f64 {
    // The error of the series is below 0.15 v⁴, and about twice its square after a Newton step.
    const SERIES: f64 = 0.1;
    let j = 1.0 + v;
    if v.abs() > SERIES {
        return 1.0 / j.cbrt();
    }
    let mut x = 1.0 - v * (1.0 / 3.0 - v * (2.0 / 9.0 - v * (14.0 / 81.0)));
    for _ in 0..2 {
        x *= (4.0 - j * (x * x * x)) * (1.0 / 3.0);
    }
    x
}

/// A deformed material point: the quantities common to stress and tangent.
pub(crate) enum PointDeformation {
    Linear {
        shear: f64,
        /// Displacement gradient.
        h: Gradient,
    },
    Finite {
        f: Gradient,
        cofactor: Gradient,
        /// J − 1.
        volume: f64,
        /// μ J^(−2/3).
        scale: f64,
        /// tr FᵀF.
        invariant: f64,
    },
}

impl PointDeformation {
    /// Creates the point for a displacement gradient `h`. `None` if J ≤ 0.
    #[inline]
    pub(crate) fn new(kinematics: Kinematics, shear: f64, h: &Gradient) -> Option<Self> {
        if kinematics == Kinematics::Linear {
            return Some(Self::Linear { shear, h: *h });
        }
        let f = [1.0 + h[0], h[1], h[2], 1.0 + h[3], 1.0 + h[4]];
        // J − 1 in expanded form, so that small strains keep their digits.
        let plane = h[0] + h[3] + h[0] * h[3] - h[1] * h[2];
        let volume = plane + h[4] + plane * h[4];
        let j = 1.0 + volume;
        if !(j > 0.0 && f[4] > 0.0) {
            return None;
        }
        Some(Self::Finite {
            cofactor: [
                f[3] * f[4],
                -f[2] * f[4],
                -f[1] * f[4],
                f[0] * f[4],
                f[0] * f[3] - f[1] * f[2],
            ],
            volume,
            scale: shear * inverse_cube_root(volume).powi(2),
            invariant: f.iter().map(|component| component * component).sum(),
            f,
        })
    }

    #[inline]
    pub(crate) fn response(&self) -> StressResponse {
        match *self {
            Self::Linear { shear, h } => {
                let trace = h[0] + h[3] + h[4];
                let shear_strain = 0.5 * (h[1] + h[2]);
                let mean = trace / 3.0;
                let e = [
                    h[0] - mean,
                    shear_strain,
                    shear_strain,
                    h[3] - mean,
                    h[4] - mean,
                ];
                StressResponse {
                    stress: e.map(|component| 2.0 * shear * component),
                    volume: trace,
                    cofactor: [1.0, 0.0, 0.0, 1.0, 1.0],
                }
            }
            Self::Finite {
                f,
                cofactor,
                volume,
                scale,
                invariant,
            } => {
                let ratio = invariant / (3.0 * (1.0 + volume));
                StressResponse {
                    stress: core::array::from_fn(|k| scale * (f[k] - ratio * cofactor[k])),
                    volume,
                    cofactor,
                }
            }
        }
    }

    /// Derivative of the first Piola–Kirchhoff stress by F at a given pressure (tension positive).
    #[inline]
    pub(crate) fn tangent(&self, pressure: f64) -> [Gradient; 5] {
        match *self {
            Self::Linear { shear, .. } => {
                let (a, b) = (4.0 / 3.0 * shear, -2.0 / 3.0 * shear);
                [
                    [a, 0.0, 0.0, b, b],
                    [0.0, shear, shear, 0.0, 0.0],
                    [0.0, shear, shear, 0.0, 0.0],
                    [b, 0.0, 0.0, a, b],
                    [b, 0.0, 0.0, b, a],
                ]
            }
            Self::Finite {
                f,
                cofactor: c,
                volume,
                scale,
                invariant,
            } => {
                let j = 1.0 + volume;
                let mixed = 2.0 / (3.0 * j);
                let double = 5.0 * invariant / (9.0 * j * j);
                let mut a = [[0.0; 5]; 5];
                for k in 0..5 {
                    for l in 0..=k {
                        let value =
                            scale * (double * c[k] * c[l] - mixed * (f[k] * c[l] + c[k] * f[l]));
                        a[k][l] = value;
                        a[l][k] = value;
                    }
                    a[k][k] += scale;
                }
                // The second derivative of J, with factors from the pressure and the deviator.
                let factor = pressure - scale * invariant / (3.0 * j);
                let second = [
                    (0, 3, f[4]),
                    (1, 2, -f[4]),
                    (0, 4, f[3]),
                    (3, 4, f[0]),
                    (1, 4, -f[2]),
                    (2, 4, -f[1]),
                ];
                for (k, l, value) in second {
                    a[k][l] += factor * value;
                    a[l][k] += factor * value;
                }
                a
            }
        }
    }
}
