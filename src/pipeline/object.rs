//! What is pressed.
use super::error::PipelineError;
use crate::elasticity::modulus::{Cone, HertzSphere};

/// The pressed object, as far as it is known.
///
/// ```
/// use tactile_imaging::Object;
/// let ball = Object::sphere(3e-3);
/// assert_eq!(ball, Object::Sphere { radius_m: 3e-3, poisson_ratio: Object::DEFAULT_POISSON_RATIO });
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize),
    serde(tag = "shape", rename_all = "snake_case")
)]
#[non_exhaustive]
pub enum Object {
    /// A ball.
    Sphere {
        /// Its radius in metres.
        radius_m: f64,
        /// Its Poisson ratio.
        poisson_ratio: f64,
    },
    /// A flat-ended cylinder: loaded uniaxially.
    FlatPunch {
        /// Its radius in metres.
        radius_m: f64,
        /// Its Poisson ratio.
        poisson_ratio: f64,
    },
    /// A block with a flat face of any outline, squeezed between the sensor and a plate: loaded uniaxially.
    Block {
        /// Its Poisson ratio.
        poisson_ratio: f64,
    },
    /// A cylinder standing on its flat face, squeezed between the sensor and a plate: loaded uniaxially.
    Cylinder {
        /// Its Poisson ratio.
        poisson_ratio: f64,
    },
    /// A thin flat sample, bonded to a rigid base and pressed by a rigid ball: the sensor's own gel, for instance.
    Layer {
        /// The ball's radius in metres.
        indenter_radius_m: f64,
        /// The sample's thickness in metres.
        thickness_m: f64,
        /// The sample's Poisson ratio.
        poisson_ratio: f64,
    },
    /// A deep sample, pressed by a rigid cone.
    Cone {
        /// Half of the cone's opening angle, from its axis, in radians.
        half_angle_rad: f64,
        /// The sample's Poisson ratio.
        poisson_ratio: f64,
    },
    /// Nothing is known of its shape: it is read as a block where its contacts are those of a flat face, and refused where not.
    Unknown {
        /// Its Poisson ratio.
        poisson_ratio: f64,
    },
}

impl Object {
    /// Poisson's ratio where none is given: rubber, incompressible.
    pub const DEFAULT_POISSON_RATIO: f64 = 0.5;

    /// A rubber ball of this radius in metres.
    pub fn sphere(radius_m: f64) -> Self {
        Self::Sphere {
            radius_m,
            poisson_ratio: Self::DEFAULT_POISSON_RATIO,
        }
    }

    /// The radius of a ball.
    pub(crate) fn sphere_radius_m(&self) -> Option<f64> {
        if let Self::Sphere { radius_m, .. } = self {
            Some(*radius_m)
        } else {
            None
        }
    }

    /// Poisson's ratio of what is read as a specimen with a flat face, whose strain is that of its area.
    pub(super) fn flat_face(&self) -> Option<f64> {
        match *self {
            Self::Block { poisson_ratio }
            | Self::Cylinder { poisson_ratio }
            | Self::Unknown { poisson_ratio } => Some(poisson_ratio),
            _ => None,
        }
    }

    /// Whether the user has said that its face is flat.
    pub(super) fn is_flat(&self) -> bool {
        matches!(self, Self::Block { .. } | Self::Cylinder { .. })
    }

    /// Refuses what is not physical.
    pub(super) fn checked(self) -> Result<Self, PipelineError> {
        let length_and_ratio =
            |length_m, poisson_ratio| HertzSphere::new(length_m, poisson_ratio).map(drop);
        let checked = match self {
            Self::Sphere {
                radius_m,
                poisson_ratio,
            }
            | Self::FlatPunch {
                radius_m,
                poisson_ratio,
            } => length_and_ratio(radius_m, poisson_ratio),
            Self::Layer {
                indenter_radius_m,
                thickness_m,
                poisson_ratio,
            } => length_and_ratio(indenter_radius_m, poisson_ratio)
                .and_then(|()| length_and_ratio(thickness_m, poisson_ratio)),
            Self::Cone {
                half_angle_rad,
                poisson_ratio,
            } => Cone::new(half_angle_rad, poisson_ratio).map(drop),
            Self::Block { poisson_ratio }
            | Self::Cylinder { poisson_ratio }
            | Self::Unknown { poisson_ratio } => length_and_ratio(1.0, poisson_ratio),
        };
        checked.map(|()| self).map_err(PipelineError::Material)
    }
}
