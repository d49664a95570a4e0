//! The sample, and what it is pressed on.

use crate::contact::{Body, Waveguide};
use crate::error::{ElasticityError, Quantity, poisson};

/// The pressed object, as far as it is known.
///
/// ```
/// use tactile_elasticity::modulus::Object;
/// let ball = Object::sphere(3e-3);
/// assert_eq!(
///     ball,
///     Object::Sphere {
///         radius_m: 3e-3,
///         poisson_ratio: Object::DEFAULT_POISSON_RATIO
///     }
/// );
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize),
    serde(tag = "shape", rename_all = "snake_case")
)]
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
    /// A block with a flat face of any outline, squeezed between the sensor and a plate: loaded
    /// uniaxially.
    Block {
        /// Its Poisson ratio.
        poisson_ratio: f64,
    },
    /// A cylinder standing on its flat face, squeezed between the sensor and a plate: loaded
    /// uniaxially.
    Cylinder {
        /// Its Poisson ratio.
        poisson_ratio: f64,
    },
    /// A thin flat sample, bonded to a rigid base and pressed by a rigid ball: the sensor's own
    /// gel, for instance.
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
    /// Nothing is known of its shape: it is read as a block where its contacts are those of a flat
    /// face, and refused where not.
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

    /// The radius of a ball in metres. `None` of every other object.
    pub fn sphere_radius_m(&self) -> Option<f64> {
        match self {
            Self::Sphere { radius_m, .. } => Some(*radius_m),
            _ => None,
        }
    }

    /// Its Poisson ratio.
    pub fn poisson_ratio(&self) -> f64 {
        match self {
            Self::Sphere { poisson_ratio, .. }
            | Self::FlatPunch { poisson_ratio, .. }
            | Self::Layer { poisson_ratio, .. }
            | Self::Cone { poisson_ratio, .. }
            | Self::Block { poisson_ratio }
            | Self::Cylinder { poisson_ratio }
            | Self::Unknown { poisson_ratio } => *poisson_ratio,
        }
    }

    /// Whether it is the object that touches the sensor. A layer and a deep sample are pressed by a
    /// rigid indenter instead.
    fn touches_guide(&self) -> bool {
        !matches!(self, Self::Layer { .. } | Self::Cone { .. })
    }

    /// Itself, if it is physical.
    ///
    /// # Errors
    /// [`ElasticityError::NotPositive`], [`ElasticityError::OutOfRange`] for an angle outside (0,
    /// π/2), [`ElasticityError::PoissonRatio`].
    pub fn validated(self) -> Result<Self, ElasticityError> {
        match self {
            Self::Sphere { radius_m, .. } | Self::FlatPunch { radius_m, .. } => {
                Quantity::Radius.positive(radius_m)?;
            }
            Self::Layer {
                indenter_radius_m,
                thickness_m,
                ..
            } => {
                Quantity::Radius.positive(indenter_radius_m)?;
                Quantity::Thickness.positive(thickness_m)?;
            }
            Self::Cone { half_angle_rad, .. } => {
                half_angle(half_angle_rad)?;
            }
            Self::Block { .. } | Self::Cylinder { .. } | Self::Unknown { .. } => {}
        }
        poisson(self.poisson_ratio())?;
        Ok(self)
    }
}

/// A cone's half opening angle in (0, π/2).
pub(super) fn half_angle(angle_rad: f64) -> Result<f64, ElasticityError> {
    let limit = std::f64::consts::FRAC_PI_2;
    Quantity::HalfAngle.positive(angle_rad)?;
    if angle_rad >= limit {
        return Err(Quantity::HalfAngle.beyond(angle_rad, limit));
    }
    Ok(angle_rad)
}

/// The bodies of a press: the sample, and the guide it is pressed on. They stand beside the loads
/// in the input of an estimator.
///
/// ```
/// use tactile_elasticity::contact::{Layer, Waveguide};
/// use tactile_elasticity::modulus::{Bodies, Object};
///
/// let gel = Layer { thickness_m: 10e-3, youngs_modulus_pa: 75e3, poisson_ratio: 0.5 };
/// let gel = Waveguide::new(vec![gel])?;
/// let bodies = Bodies::new(Object::sphere(3e-3), Some(gel.clone()));
/// assert_eq!(bodies.in_series(), gel.as_body());
/// // A rigid cone presses a deep sample: the guide has no part in it.
/// let sample = Object::Cone { half_angle_rad: 1.0, poisson_ratio: 0.5 };
/// assert!(Bodies::new(sample, Some(gel)).guide().is_none());
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Bodies {
    object: Object,
    guide: Option<Waveguide>,
}

impl Bodies {
    /// Of the sample, and the layers of the guide where they are known.
    pub fn new(object: Object, guide: Option<Waveguide>) -> Self {
        Self { object, guide }
    }

    /// The sample.
    pub fn object(&self) -> Object {
        self.object
    }

    /// The guide that the sample is pressed on. `None` if its layers are not known or a rigid
    /// indenter presses the sample instead.
    pub fn guide(&self) -> Option<&Waveguide> {
        let guide = self.guide.as_ref()?;
        self.object.touches_guide().then_some(guide)
    }

    /// The guide as one half-space of its layers in series. Rigid where there is none.
    pub fn in_series(&self) -> Body {
        self.guide().map_or_else(Body::rigid, Waveguide::as_body)
    }

    /// The layer that the sample touches, as a half-space. Rigid where there is none.
    pub fn touched(&self) -> Body {
        self.guide().map_or_else(Body::rigid, Waveguide::touched)
    }
}
