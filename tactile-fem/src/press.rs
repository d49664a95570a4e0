//! Presses of objects on a rigid flat or on a guide of soft layers on glass.

use crate::material::{Kinematics, Material};
use crate::mesh::{Boundary, ContactMesh, Mesh};
use crate::model::{ElementModel, Support};
use crate::spacing::{contact_lines, graded};
use crate::surface::RigidShape;
use tactile_elasticity::{ElasticityError, Quantity};

/// A layer of a [`Guide`].
///
/// ```
/// use tactile_fem::{GuideLayer, Material};
///
/// let epidermis = GuideLayer {
///     thickness_m: 2e-3,
///     material: Material::new(136e3, 0.495).unwrap(),
/// };
/// assert_eq!(epidermis.material.youngs_modulus_pa(), 136e3);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct GuideLayer {
    /// Thickness, in metres.
    pub thickness_m: f64,
    /// Material of the layer.
    pub material: Material,
}

/// A soft guide: bonded layers, starting on the side of the object, with the last one bonded to
/// rigid glass.
///
/// ```
/// use tactile_fem::{Guide, GuideLayer, Material};
///
/// let layer = |thickness_m, modulus| GuideLayer {
///     thickness_m,
///     material: Material::new(modulus, 0.495).unwrap(),
/// };
/// let guide = Guide::new(
///     vec![layer(2e-3, 136e3), layer(3e-3, 80e3), layer(5e-3, 34e3)],
///     25e-3,
/// )
/// .unwrap();
/// assert_eq!((guide.layers().len(), guide.radius_m()), (3, 25e-3));
/// assert!(Guide::new(vec![], 25e-3).is_err());
/// ```
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Guide {
    layers: Vec<GuideLayer>,
    radius_m: f64,
}

impl Guide {
    /// Creates a guide from its layers, starting on the side of the object, and its radius in
    /// metres.
    ///
    /// # Errors
    /// An error for no layer, and for a thickness or a radius that is not positive.
    pub fn new(layers: Vec<GuideLayer>, radius_m: f64) -> Result<Self, ElasticityError> {
        Quantity::Radius.positive(radius_m)?;
        Quantity::Layers.at_least(layers.len(), 1)?;
        for layer in &layers {
            Quantity::Thickness.positive(layer.thickness_m)?;
        }
        Ok(Self { layers, radius_m })
    }

    /// The layers, starting on the side of the object.
    pub fn layers(&self) -> &[GuideLayer] {
        &self.layers
    }

    /// Radius in metres.
    pub fn radius_m(&self) -> f64 {
        self.radius_m
    }

    pub(crate) fn thicknesses(&self) -> Vec<f64> {
        self.layers.iter().map(|layer| layer.thickness_m).collect()
    }

    pub(crate) fn materials(&self) -> Vec<Material> {
        self.layers.iter().map(|layer| layer.material).collect()
    }
}

/// A soft body of revolution pressed against a sensor: its lowest point touches, and its far side
/// is fixed.
///
/// ```
/// use tactile_fem::{AppliedLoad, Material, ObjectShape, ObjectPress};
///
/// let force = |object| {
///     let scene = ObjectPress::new(object, Material::new(100e3, 0.495)?)?.scene()?;
///     Ok::<_, tactile_elasticity::ElasticityError>(
///         scene.solve(&[AppliedLoad::Approach(0.2e-3)]).states[0].force_n(),
///     )
/// };
/// let ball = force(ObjectShape::Ball { radius_m: 3e-3 })?;
/// let half_ball = force(ObjectShape::HalfBall { radius_m: 3e-3 })?;
/// let cylinder = force(ObjectShape::Cylinder { radius_m: 3e-3, height_m: 5e-3 })?;
/// let cone = force(ObjectShape::Cone { half_angle_rad: 1.2, height_m: 2e-3 })?;
/// assert!(half_ball > ball, "glued to its stage it cannot spread");
/// assert!(cone < ball && ball < cylinder);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum ObjectShape {
    /// The half of a ball next to the contact. Its equator spreads freely in its plane, as if the
    /// ball were pressed equally from both sides.
    Ball {
        /// Radius in metres.
        radius_m: f64,
    },
    /// A half ball whose flat side is glued to a stage.
    HalfBall {
        /// Radius in metres.
        radius_m: f64,
    },
    /// A cylinder whose far end is glued to a stage. If it is wider than the guide, it is a flat
    /// plate.
    Cylinder {
        /// Radius in metres.
        radius_m: f64,
        /// Height in metres.
        height_m: f64,
    },
    /// A cone with its tip towards the sensor and its base glued to a stage. On a soft guide, one
    /// sharper than about 1.1 rad ends early with [`Outcome::Stopped`](crate::Outcome::Stopped),
    /// because the strain at its tip is unbounded.
    Cone {
        /// Angle between its axis and its surface, in radians.
        half_angle_rad: f64,
        /// Distance from its tip to its base, in metres.
        height_m: f64,
    },
}

/// Whether two surfaces pressed together slide.
///
/// ```
/// use tactile_fem::{Block, Guide, Interface, GuideLayer, AppliedLoad, Material, FemScene};
///
/// let material = Material::new(1e4, 0.49).unwrap();
/// let block = Block { height_m: 20e-3, radius_m: 30e-3, material, lump: None };
/// let guide = Guide::new(vec![GuideLayer { thickness_m: 5e-3, material }], 10e-3).unwrap();
/// let force = |interface| {
///     let scene = FemScene::block_under_guide(&block, &guide, interface).unwrap();
///     scene.solve(&[AppliedLoad::Approach(0.2e-3)]).states[0].force_n()
/// };
/// assert!(force(Interface::Bonded) > force(Interface::Frictionless));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Interface {
    /// The surfaces move together, from the start or from where they first touch.
    Bonded,
    /// The surfaces slide on each other. A guide and a block cannot separate; their pressure is
    /// positive in compression.
    Frictionless,
}

/// An [`ObjectShape`] pressed on a rigid flat or on a [`Guide`], by default without friction, with
/// the fineness of its mesh.
///
/// ```
/// use tactile_fem::{Guide, GuideLayer, AppliedLoad, Material, ObjectShape, ObjectPress};
///
/// let gel = Material::new(80e3, 0.495)?;
/// let guide = Guide::new(
///     vec![GuideLayer {
///         thickness_m: 6e-3,
///         material: gel,
///     }],
///     16e-3,
/// )?;
/// let press = ObjectPress::new(
///     ObjectShape::HalfBall { radius_m: 3e-3 },
///     Material::new(60e3, 0.495)?,
/// )?
/// .on_guide(guide)?;
/// let coarse = press.clone().with_fineness(4)?.scene()?;
/// let fine = press.with_fineness(8)?.scene()?;
/// assert!(fine.element_count() > 2 * coarse.element_count());
/// let force = |scene: &tactile_fem::FemScene| {
///     scene.solve(&[AppliedLoad::Approach(0.5e-3)]).states[0].force_n()
/// };
/// // Both meshes are fine enough for half a per cent of the force.
/// assert!((force(&coarse) / force(&fine) - 1.0).abs() < 5e-3);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct ObjectPress {
    object: ObjectShape,
    material: Material,
    guide: Option<Guide>,
    interface: Interface,
    fineness: usize,
}

/// Number of elements across the core of a contact, 0.06 radii of a ball. With five, the contact
/// radius of a ball on a flat is accurate to 0.2 % from a/R = 0.15 on. Ten take four times as long
/// (`cargo bench -p tactile-benches --features fem --bench finite_elements`).
const FINENESS: usize = 5;

impl ObjectPress {
    /// An object of one material on a rigid flat.
    ///
    /// # Errors
    /// An error for lengths that are not positive, and for a cone's angle not between 0 and π/2.
    pub fn new(object: ObjectShape, material: Material) -> Result<Self, ElasticityError> {
        object.check()?;
        Ok(Self {
            object,
            material,
            guide: None,
            interface: Interface::Frictionless,
            fineness: FINENESS,
        })
    }

    /// Uses this guide instead of a rigid flat. Contact radii reach 1.3 ball radii and more, until
    /// the equator of the ball or the thickness of the guide is the limit: the solution then ends
    /// with [`Outcome::Stopped`](crate::Outcome::Stopped).
    ///
    /// ```
    /// use tactile_fem::{AppliedLoad, Guide, GuideLayer, Material, ObjectPress, ObjectShape};
    ///
    /// # fn main() -> Result<(), tactile_elasticity::ElasticityError> {
    /// let layer = GuideLayer { thickness_m: 10e-3, material: Material::new(80e3, 0.495)? };
    /// let guide = Guide::new(vec![layer], 25e-3)?;
    /// let press =
    ///     ObjectPress::new(ObjectShape::Ball { radius_m: 3e-3 }, Material::new(103e3, 0.495)?)?
    ///         .on_guide(guide)?;
    /// let state = &press.scene()?.solve(&[AppliedLoad::Approach(1e-3)]).states[0];
    /// // Softer than a rigid flat: at the same approach the force is below six tenths of Hertz's.
    /// let hertz =
    ///     4.0 / 3.0 * 103e3 / (1.0 - 0.495 * 0.495) * 3e-3_f64.sqrt() * 1e-3_f64.powf(1.5);
    /// assert!(state.force_n() > 0.0 && state.force_n() < 0.6 * hertz);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// [`ElasticityError::OutOfRange`] for a guide that is not wider than the object, unless the
    /// object is a cylinder.
    pub fn on_guide(mut self, guide: Guide) -> Result<Self, ElasticityError> {
        let radius = self.object.radius_m();
        let may_cover = matches!(self.object, ObjectShape::Cylinder { .. });
        if guide.radius_m() <= radius && !may_cover {
            return Err(Quantity::Radius.beyond(radius, guide.radius_m()));
        }
        self.guide = Some(guide);
        Ok(self)
    }

    /// Sets whether surfaces in contact slide, the default, or stick ([`Interface::Bonded`]):
    /// touching points then stay together until they separate. This takes several times longer,
    /// because loads are followed in short steps.
    ///
    /// ```
    /// use tactile_fem::{Interface, AppliedLoad, Material, ObjectShape, ObjectPress};
    ///
    /// let press = ObjectPress::new(
    ///     ObjectShape::Ball { radius_m: 3e-3 },
    ///     Material::new(103e3, 0.3)?,
    /// )?;
    /// let force = |interface| {
    ///     let scene = press.clone().with_interface(interface).scene()?;
    ///     Ok::<_, tactile_elasticity::ElasticityError>(
    ///         scene.solve(&[AppliedLoad::Approach(0.1e-3)]).states[0].force_n(),
    ///     )
    /// };
    /// // Without slip a ball on a rigid flat is stiffer by a few per cent, more for smaller ν.
    /// let ratio = force(Interface::Bonded)? / force(Interface::Frictionless)?;
    /// assert!(1.01 < ratio && ratio < 1.05, "{ratio}");
    /// # Ok::<(), tactile_elasticity::ElasticityError>(())
    /// ```
    pub fn with_interface(mut self, interface: Interface) -> Self {
        self.interface = interface;
        self
    }

    /// Sets the number of elements across the middle of the contact (default 5). Other elements
    /// scale with it. The time grows with its square.
    ///
    /// # Errors
    /// [`ElasticityError::OutOfRange`] below 2.
    pub fn with_fineness(mut self, elements: usize) -> Result<Self, ElasticityError> {
        const FEWEST: usize = 2;
        if elements < FEWEST {
            return Err(Quantity::Elements.beyond(elements as f64, FEWEST as f64));
        }
        self.fineness = elements;
        Ok(self)
    }

    /// The finite-element model: the far side of the object is fixed, and the glass or flat moves
    /// by the approach.
    pub(crate) fn model(&self) -> Result<ElementModel, ElasticityError> {
        let mut model = ElementModel::new(Kinematics::Finite);
        let object = model.add(&self.object_mesh(), &[self.material])?;
        let far_side = match self.object {
            ObjectShape::Ball { .. } => Support::Sliding,
            _ => Support::Bonded,
        };
        model.hold(object, Boundary::Base, far_side);
        match &self.guide {
            None => model.contact_rigid(object, RigidShape::Flat, -1.0),
            Some(guide) => {
                let disc = model.add(&self.guide_mesh(guide), &guide.materials())?;
                model.drive(disc, Boundary::Base, Support::Bonded);
                // Each point from which gaps are measured must have something opposite to it.
                if guide.radius_m() > self.object.radius_m() {
                    model.contact(object, disc);
                } else {
                    model.contact(disc, object);
                }
            }
        }
        if self.interface == Interface::Bonded {
            model.forbid_slip();
        }
        Ok(model)
    }

    fn size(&self) -> ContactMesh {
        let radius = match self.object {
            // The length of its side.
            ObjectShape::Cone {
                half_angle_rad,
                height_m,
            } => height_m / half_angle_rad.cos(),
            object => object.radius_m(),
        };
        ContactMesh {
            inner: 0.06 * radius,
            count: self.fineness,
            growth: self.growth(1.12),
        }
    }

    /// Growth factor between elements that equals `growth` at the default fineness, and gives the
    /// same total growth over a length at any fineness.
    fn growth(&self, growth: f64) -> f64 {
        growth.powf(FINENESS as f64 / self.fineness as f64)
    }

    pub(crate) fn object_mesh(&self) -> Mesh {
        match self.object {
            ObjectShape::Ball { radius_m } | ObjectShape::HalfBall { radius_m } => {
                Mesh::half_ball(radius_m, self.size())
            }
            ObjectShape::Cylinder { radius_m, height_m } => {
                let first = self.at_rim(radius_m.min(height_m));
                Mesh::cylinder(
                    &self.rim_lines(radius_m),
                    &graded(0.0, height_m, first, self.growth(1.4)),
                )
            }
            ObjectShape::Cone {
                half_angle_rad,
                height_m,
            } => Mesh::cone(half_angle_rad, height_m, self.size()),
        }
    }

    /// Element size at the rim of a cylinder, where the pressure is singular, relative to a length.
    fn at_rim(&self, length: f64) -> f64 {
        0.1 * length / self.fineness as f64
    }

    /// Lines from the axis to the rim of a cylinder, densest at the rim.
    fn rim_lines(&self, radius: f64) -> Vec<f64> {
        let mut lines = graded(radius, 0.0, self.at_rim(radius), self.growth(1.25));
        lines.reverse();
        lines
    }

    fn guide_mesh(&self, guide: &Guide) -> Mesh {
        let thickness: f64 = guide.thicknesses().iter().sum();
        let (mut lines, first) = match self.object {
            ObjectShape::Cylinder { radius_m, .. } => {
                let inside = self.rim_lines(radius_m.min(guide.radius_m()));
                (inside, 2.0 * self.at_rim(radius_m.min(thickness)))
            }
            _ => {
                let size = self.size();
                let radius = self.object.radius_m();
                let largest = 0.15 * radius * FINENESS as f64 / self.fineness as f64;
                // The contact may grow to about the radius of the ball; outside, elements grow
                // freely.
                let end = (1.3 * radius).min(0.5 * (radius + guide.radius_m()));
                let lines = contact_lines(size.inner, size.count, size.growth, largest, end);
                (lines, 2.0 * size.inner / size.count as f64)
            }
        };
        let last = lines[lines.len() - 1];
        let left = guide.radius_m() - last;
        if left > 0.0 {
            let (step, growth) = match self.object {
                ObjectShape::Cylinder { radius_m, .. } => {
                    (self.at_rim(radius_m), self.growth(1.25))
                }
                object => (
                    0.2 * object.radius_m() * FINENESS as f64 / self.fineness as f64,
                    self.growth(1.4),
                ),
            };
            let outer = contact_lines(step, 1, growth, 0.5 * thickness, left);
            lines.extend(outer.iter().skip(1).map(|r| last + r));
        }
        Mesh::layered_disc(&guide.thicknesses(), &lines, first, self.growth(1.35))
    }
}

impl ObjectShape {
    fn check(&self) -> Result<(), ElasticityError> {
        match *self {
            Self::Ball { radius_m } | Self::HalfBall { radius_m } => {
                Quantity::Radius.positive(radius_m)?;
            }
            Self::Cylinder { radius_m, height_m } => {
                Quantity::Radius.positive(radius_m)?;
                Quantity::Thickness.positive(height_m)?;
            }
            Self::Cone {
                half_angle_rad,
                height_m,
            } => {
                Quantity::HalfAngle.positive(half_angle_rad)?;
                Quantity::Thickness.positive(height_m)?;
                let limit = core::f64::consts::FRAC_PI_2;
                if half_angle_rad >= limit {
                    return Err(Quantity::HalfAngle.beyond(half_angle_rad, limit));
                }
            }
        }
        Ok(())
    }

    /// Largest radius.
    fn radius_m(&self) -> f64 {
        match *self {
            Self::Ball { radius_m }
            | Self::HalfBall { radius_m }
            | Self::Cylinder { radius_m, .. } => radius_m,
            Self::Cone {
                half_angle_rad,
                height_m,
            } => height_m * half_angle_rad.tan(),
        }
    }
}
