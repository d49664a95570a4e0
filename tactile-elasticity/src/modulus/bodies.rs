//! The sample, and the guide that it is pressed against.

use crate::contact::{Body, GuideErrors, Layer, Waveguide};
use crate::error::{ElasticityError, Quantity, poisson};
use nalgebra::{DMatrix, DVector};
use tactile_core::{Source, Uncertain};

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
#[non_exhaustive]
pub enum Object {
    /// A ball.
    Sphere {
        /// Radius in metres.
        radius_m: f64,
        /// Poisson ratio.
        poisson_ratio: f64,
    },
    /// A flat-ended cylinder under uniaxial load.
    FlatPunch {
        /// Radius in metres.
        radius_m: f64,
        /// Poisson ratio.
        poisson_ratio: f64,
    },
    /// A block with a flat face of any outline, compressed between the sensor and a plate under
    /// uniaxial load.
    Block {
        /// Poisson ratio.
        poisson_ratio: f64,
    },
    /// A cylinder standing on its flat face, compressed between the sensor and a plate under
    /// uniaxial load.
    Cylinder {
        /// Poisson ratio.
        poisson_ratio: f64,
    },
    /// A thin flat sample, bonded to a rigid base and pressed by a rigid ball, for example the
    /// sensor's own gel.
    Layer {
        /// Radius of the ball in metres.
        indenter_radius_m: f64,
        /// Thickness of the sample in metres.
        thickness_m: f64,
        /// Poisson ratio of the sample.
        poisson_ratio: f64,
    },
    /// A deep sample, pressed by a rigid cone.
    Cone {
        /// Half of the cone's opening angle, from its axis, in radians.
        half_angle_rad: f64,
        /// Poisson ratio of the sample.
        poisson_ratio: f64,
    },
    /// An object of unknown shape. It is treated as a block if its contacts are those of a flat
    /// face, and rejected otherwise.
    Unknown {
        /// Poisson ratio.
        poisson_ratio: f64,
    },
}

impl Object {
    /// Default Poisson ratio, that of incompressible rubber.
    pub const DEFAULT_POISSON_RATIO: f64 = 0.5;

    /// A rubber ball of this radius in metres.
    pub fn sphere(radius_m: f64) -> Self {
        Self::Sphere {
            radius_m,
            poisson_ratio: Self::DEFAULT_POISSON_RATIO,
        }
    }

    /// The radius of a ball in metres. `None` for any other object.
    pub fn sphere_radius_m(&self) -> Option<f64> {
        match self {
            Self::Sphere { radius_m, .. } => Some(*radius_m),
            _ => None,
        }
    }

    /// The radius in metres of a ball, a punch, or the ball that indents a layer. `None` for any
    /// other object.
    pub fn radius_m(&self) -> Option<f64> {
        match *self {
            Self::Sphere { radius_m, .. } | Self::FlatPunch { radius_m, .. } => Some(radius_m),
            Self::Layer {
                indenter_radius_m, ..
            } => Some(indenter_radius_m),
            _ => None,
        }
    }

    /// Poisson ratio of the object.
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

    /// Whether the object itself touches the sensor. A layer and a deep sample are pressed by a
    /// rigid indenter instead.
    fn touches_guide(&self) -> bool {
        !matches!(self, Self::Layer { .. } | Self::Cone { .. })
    }

    /// Returns the object if it is physical.
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

/// The bodies of a press: the sample and the guide that it is pressed against, with the errors of
/// their parameters. Together with the loads they are the input of an estimator.
///
/// ```
/// use tactile_elasticity::contact::{Layer, Waveguide};
/// use tactile_elasticity::modulus::{Bodies, Object};
///
/// let gel = Layer { thickness_m: 10e-3, youngs_modulus_pa: 75e3, poisson_ratio: 0.5 };
/// let gel = Waveguide::new(vec![gel])?;
/// let bodies = Bodies::new(Object::sphere(3e-3), Some(gel.clone()));
/// assert_eq!(bodies.in_series(), gel.as_body());
/// // A rigid cone presses a deep sample, without the guide.
/// let sample = Object::Cone { half_angle_rad: 1.0, poisson_ratio: 0.5 };
/// assert!(Bodies::new(sample, Some(gel)).guide().is_none());
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Bodies {
    object: Object,
    guide: Option<Waveguide>,
    size_error: f64,
    poisson_ratio_error: f64,
    adhesion_n: f64,
    guide_error: GuideError,
}

#[derive(Clone, Debug, PartialEq)]
enum GuideError {
    /// Error of the compliance, common to all contacts.
    Common(Uncertain),
    OfLayers(GuideErrors),
}

impl Bodies {
    /// Creates the bodies from the sample and, if they are known, the layers of the guide. Both are
    /// exact.
    pub fn new(object: Object, guide: Option<Waveguide>) -> Self {
        Self {
            object,
            guide,
            size_error: 0.0,
            poisson_ratio_error: 0.0,
            adhesion_n: 0.0,
            guide_error: GuideError::Common(Uncertain::exact(1.0)),
        }
    }

    /// States the relative standard error of the object's size, [`Source::ObjectSize`]: that of its
    /// radius, or of the tangent of its half angle.
    ///
    /// # Errors
    /// [`ElasticityError::Negative`].
    pub fn with_size_error(mut self, relative: f64) -> Result<Self, ElasticityError> {
        self.size_error = Quantity::StandardError.not_negative(relative)?;
        Ok(self)
    }

    /// States the standard error of the sample's Poisson ratio, [`Source::PoissonRatio`].
    ///
    /// # Errors
    /// [`ElasticityError::Negative`].
    pub fn with_poisson_ratio_error(mut self, error: f64) -> Result<Self, ElasticityError> {
        self.poisson_ratio_error = Quantity::StandardError.not_negative(error)?;
        Ok(self)
    }

    /// States the possible work of adhesion w (J/m²) of a ball, [`Source::Adhesion`]. The contact
    /// of a ball of radius R under a force F appears softer by ½ √(6πwR/F), to first order in √w
    /// (Johnson, Kendall and Roberts 1971). The radius corresponds to the force F + √(6πwR F), and
    /// the pressure lacks its rim. For other objects it has no effect.
    ///
    /// # Errors
    /// [`ElasticityError::Negative`].
    pub fn with_adhesion_j_per_m2(mut self, work: f64) -> Result<Self, ElasticityError> {
        Quantity::StandardError.not_negative(work)?;
        let radius_m = self.object.sphere_radius_m().unwrap_or(0.0);
        self.adhesion_n = 6.0 * std::f64::consts::PI * work * radius_m;
        Ok(self)
    }

    /// States the ratio of the guide's true compliance to the stated one, for every contact: one,
    /// with errors of [`Source::Guide`], and of [`Source::PixelSize`] if the guide was checked with
    /// contact radii measured by the same pixels.
    ///
    /// # Errors
    /// [`ElasticityError::Negative`].
    ///
    /// ```
    /// use tactile_elasticity::modulus::{Bodies, Object, Source, Uncertain};
    /// let factor = Uncertain::exact(1.0).by(Source::Guide, 0.05);
    /// let bodies = Bodies::new(Object::sphere(3e-3), None).with_guide_error(factor)?;
    /// assert_eq!(bodies.guide_compliance(1e-3), factor);
    /// # Ok::<(), tactile_elasticity::ElasticityError>(())
    /// ```
    pub fn with_guide_error(mut self, factor: Uncertain) -> Result<Self, ElasticityError> {
        Quantity::StandardError.not_negative(factor.standard_error())?;
        self.guide_error = GuideError::Common(factor);
        Ok(self)
    }

    /// States the covariance of ln E of all layers, then of ln h, then of ν
    /// ([`Layer::PARAMETERS`]), and the change of each per standard deviation of the pixel size,
    /// if they are correlated.
    ///
    /// # Errors
    /// [`ElasticityError::LengthMismatch`], [`ElasticityError::NotFinite`].
    ///
    /// ```
    /// use nalgebra::{DMatrix, DVector};
    /// use tactile_elasticity::contact::{Layer, Waveguide};
    /// use tactile_elasticity::modulus::{Bodies, Object, Source};
    /// let gel = Layer { thickness_m: 10e-3, youngs_modulus_pa: 75e3, poisson_ratio: 0.5 };
    /// let bodies = Bodies::new(Object::sphere(3e-3), Some(Waveguide::new(vec![gel])?));
    /// // Two per cent of the modulus are two per cent of the compliance; a stiffer gel yields less.
    /// let covariance = DMatrix::from_diagonal(&vec![4e-4, 0.0, 0.0].into());
    /// let by_pixel_size = DVector::from_column_slice(&[0.01, 0.0, 0.0]);
    /// let bodies = bodies.with_layer_errors(covariance, Some(by_pixel_size))?;
    /// let factor = bodies.guide_compliance(1e-3);
    /// assert!((factor.standard_error() - 0.02).abs() < 1e-6);
    /// assert!((factor.part(Source::PixelSize) + 0.01).abs() < 1e-6);
    /// # Ok::<(), tactile_elasticity::ElasticityError>(())
    /// ```
    pub fn with_layer_errors(
        mut self,
        covariance: DMatrix<f64>,
        by_pixel_size: Option<DVector<f64>>,
    ) -> Result<Self, ElasticityError> {
        let layers = self.guide.as_ref().map_or(0, |guide| guide.layers().len());
        let expected = Layer::PARAMETERS * layers;
        let sizes = by_pixel_size.as_ref().map_or(expected, |v| v.len());
        for found in [covariance.nrows(), covariance.ncols(), sizes] {
            Quantity::StandardError.entries(found, expected)?;
        }
        for &entry in covariance.iter().chain(by_pixel_size.iter().flatten()) {
            Quantity::StandardError.finite(entry)?;
        }
        self.guide_error = match &self.guide {
            None => GuideError::Common(Uncertain::exact(1.0)),
            Some(guide) => {
                GuideError::OfLayers(GuideErrors::new(guide.clone(), covariance, by_pixel_size))
            }
        };
        Ok(self)
    }

    /// The sample.
    pub fn object(&self) -> Object {
        self.object
    }

    /// The guide that the sample is pressed against. `None` if its layers are unknown, or if a
    /// rigid indenter presses the sample instead.
    pub fn guide(&self) -> Option<&Waveguide> {
        let guide = self.guide.as_ref()?;
        self.object.touches_guide().then_some(guide)
    }

    /// The guide as one half-space of its layers in series. Rigid if there is none.
    pub fn in_series(&self) -> Body {
        self.guide().map_or_else(Body::rigid, Waveguide::as_body)
    }

    /// The layer that the sample touches, as a half-space. Rigid if there is none.
    pub fn touched(&self) -> Body {
        self.guide().map_or_else(Body::rigid, Waveguide::touched)
    }

    /// The true size of the object relative to the stated one: one, with its error.
    pub fn size(&self) -> Uncertain {
        Uncertain::exact(1.0).by(Source::ObjectSize, self.size_error)
    }

    /// The sample's Poisson ratio with its error.
    pub fn poisson_ratio(&self) -> Uncertain {
        let ratio = Uncertain::exact(self.object.poisson_ratio());
        ratio.by(Source::PoissonRatio, self.poisson_ratio_error)
    }

    /// The guide's true compliance relative to the stated one, for a contact of this radius (m):
    /// one, with its error. Exact if there is no guide or its contact cannot be solved.
    pub fn guide_compliance(&self, contact_radius_m: f64) -> Uncertain {
        match &self.guide_error {
            GuideError::Common(factor) => *factor,
            GuideError::OfLayers(errors) => {
                let found = errors.compliance(contact_radius_m);
                found.unwrap_or(Uncertain::exact(1.0))
            }
        }
    }

    /// Relative error of E* from adhesion under a force (N).
    pub(super) fn adhesion(&self, force_n: f64) -> f64 {
        0.5 * (self.adhesion_n / force_n).max(0.0).sqrt()
    }
}
