//! Elastic bodies: the object and the waveguide.
use crate::error::{SimulateError, at_least, positive, within};

/// A linear elastic, isotropic material.
///
/// ```
/// use tactile_simulate::{Elastic, PressOptions, PressScene, ElasticSphere};
/// let contact = |material| {
///     let object = ElasticSphere { radius_m: 3e-3, material };
///     let scene = PressScene::new(PressOptions { object, ..PressOptions::default() })?;
///     Ok::<_, tactile_simulate::SimulateError>(scene.truth(0).contact)
/// };
/// // 1/E* = (1 − ν₁²)/E₁ + (1 − ν₂²)/E₂, with the guide's layers in series as the second body.
/// let [soft, rigid] = [contact(Elastic::CL2000X)?, contact(Elastic::RIGID)?];
/// let of_the_ball = 1.0 / soft.effective_modulus_pa - 1.0 / rigid.effective_modulus_pa;
/// assert!((of_the_ball / (0.75 / 103e3) - 1.0).abs() < 1e-12);
/// # Ok::<(), tactile_simulate::SimulateError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Elastic {
    /// Young's modulus in pascals. Infinite for a rigid body.
    pub youngs_modulus_pa: f64,
    /// Poisson's ratio, in (−1, 0.5].
    pub poisson_ratio: f64,
}

impl Elastic {
    /// Versaflex CL2000X: 103 kPa, incompressible (the paper, §5).
    pub const CL2000X: Self = Self {
        youngs_modulus_pa: 103e3,
        poisson_ratio: 0.5,
    };
    /// Versaflex CL2003X: 62 kPa, incompressible (the paper, §5).
    pub const CL2003X: Self = Self {
        youngs_modulus_pa: 62e3,
        poisson_ratio: 0.5,
    };
    /// A body without deformation.
    pub const RIGID: Self = Self {
        youngs_modulus_pa: f64::INFINITY,
        poisson_ratio: 0.3,
    };

    /// (1 − ν²)/E in 1/Pa: contribution of the body to 1/E*. Zero for a rigid body.
    pub(crate) fn plane_strain_compliance(&self) -> f64 {
        (1.0 - self.poisson_ratio) * (1.0 + self.poisson_ratio) / self.youngs_modulus_pa
    }

    pub(crate) fn validate(&self) -> Result<(), SimulateError> {
        within(
            "youngs_modulus_pa",
            self.youngs_modulus_pa,
            f64::MIN_POSITIVE,
            f64::INFINITY,
        )?;
        within(
            "poisson_ratio",
            self.poisson_ratio,
            -1.0 + f64::EPSILON,
            0.5,
        )
    }
}

/// The object: an elastic sphere.
///
/// ```
/// use tactile_simulate::{Elastic, PressOptions, PressScene, ElasticSphere};
/// let radius = |radius_m| {
///     let object = ElasticSphere { radius_m, material: Elastic::CL2003X };
///     let scene = PressScene::new(PressOptions { object, ..PressOptions::default() })?;
///     Ok::<_, tactile_simulate::SimulateError>(scene.truth(0).contact.contact_radius_m)
/// };
/// assert!((radius(8e-3)? / radius(1e-3)? - 2.0).abs() < 1e-12, "a grows as ∛R");
/// # Ok::<(), tactile_simulate::SimulateError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ElasticSphere {
    /// Radius in metres.
    pub radius_m: f64,
    /// Material of the sphere.
    pub material: Elastic,
}

impl ElasticSphere {
    pub(crate) fn validate(&self) -> Result<(), SimulateError> {
        positive("radius_m", self.radius_m)?;
        self.material.validate()
    }
}

/// One layer of the waveguide.
///
/// ```
/// use tactile_simulate::{Elastic, PressOptions, PressScene, LightGuide, WaveguideLayer};
/// let layer = |thickness_m, youngs_modulus_pa| WaveguideLayer {
///     refractive_index: 1.41,
///     thickness_m,
///     material: Elastic { youngs_modulus_pa, poisson_ratio: 0.5 },
/// };
/// let waveguide = LightGuide { layers: vec![layer(1e-3, 200e3), layer(3e-3, 100e3)] };
/// let radius = |waveguide| {
///     let scene = PressScene::new(PressOptions { waveguide, ..PressOptions::default() })?;
///     Ok::<_, tactile_simulate::SimulateError>(scene.truth(0).contact.contact_radius_m)
/// };
/// assert!(
///     radius(waveguide)? < radius(LightGuide::default())?,
///     "stiffer layers, a smaller contact"
/// );
/// # Ok::<(), tactile_simulate::SimulateError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct WaveguideLayer {
    /// Refractive index.
    pub refractive_index: f64,
    /// Thickness in metres.
    pub thickness_m: f64,
    /// Material of the layer.
    pub material: Elastic,
}

/// The layered waveguide, from the side of the object to the glass.
///
/// ```
/// use tactile_simulate::LightGuide;
/// // Epidermis, dermis and subcutanea of the paper's sensor: 2, 3 and 5 mm.
/// let guide = LightGuide::default();
/// let thickness_m: f64 = guide.layers.iter().map(|layer| layer.thickness_m).sum();
/// assert!((thickness_m - 10e-3).abs() < 1e-12);
/// ```
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct LightGuide {
    /// Layers, the touched one first.
    pub layers: Vec<WaveguideLayer>,
}

impl Default for LightGuide {
    /// Epidermis, dermis and subcutanea of the paper (§2.2): PDMS of 2, 3 and 5 mm with indices
    /// 1.41, 1.40 and 1.39 and moduli 1.36×10⁵, 8.0×10⁴ and 3.4×10⁴ Pa. For the first layer, which
    /// it calls the stiffest, the paper prints 1.4×10² Pa; its source has 1.36×10⁵ Pa.
    fn default() -> Self {
        let layer = |refractive_index, thickness_m, youngs_modulus_pa| WaveguideLayer {
            refractive_index,
            thickness_m,
            material: Elastic {
                youngs_modulus_pa,
                poisson_ratio: 0.5,
            },
        };
        Self {
            layers: vec![
                layer(1.41, 2e-3, 1.36e5),
                layer(1.40, 3e-3, 8.0e4),
                layer(1.39, 5e-3, 3.4e4),
            ],
        }
    }
}

impl LightGuide {
    /// The stack as one material: the layers in series, E = Σh / Σ(h/E), and Poisson's ratio
    /// averaged by thickness (0.5 for the paper's stack).
    pub(crate) fn series(&self) -> Elastic {
        let height = self.thickness_m();
        let compliance: f64 = self
            .layers
            .iter()
            .map(|l| l.thickness_m / l.material.youngs_modulus_pa)
            .sum();
        let weighted: f64 = self
            .layers
            .iter()
            .map(|l| l.thickness_m * l.material.poisson_ratio)
            .sum();
        Elastic {
            youngs_modulus_pa: height / compliance,
            // By rounding, the mean of equal ratios of ½ can exceed ½.
            poisson_ratio: (weighted / height).min(0.5),
        }
    }

    /// Thickness of the whole stack in metres.
    pub(crate) fn thickness_m(&self) -> f64 {
        self.layers.iter().map(|l| l.thickness_m).sum()
    }

    pub(crate) fn validate(&self) -> Result<(), SimulateError> {
        at_least("layers", self.layers.len(), 1)?;
        for layer in &self.layers {
            positive("thickness_m", layer.thickness_m)?;
            within("refractive_index", layer.refractive_index, 1.0, 10.0)?;
            layer.material.validate()?;
        }
        Ok(())
    }
}
