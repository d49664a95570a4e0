//! A cylinder squeezed between two rigid plates.

use super::interface::BondedInterface;
use super::material::{Kinematics, Material};
use super::mesh::Boundary;
use super::model::{Model, Support};
use super::press::{Object, Press};
use super::scene::{Interface, Scene};
use tactile_elasticity::ElasticityError;

impl Scene {
    /// A cylinder between two rigid plates to which both faces stick, or on which they slide without friction. One half of it is
    /// solved: the other is its mirror image, and the approach is that of one plate to the middle, half of the whole squeeze.
    ///
    /// The [pressure](super::State::pressure) is that on the face. Sliding, it is even, and the state is homogeneous; sticking, the sides bulge, the
    /// pressure depends on the radius and is singular at the rim, where it is the mean over the last element. That the bulging side comes to
    /// lie on the plate is not followed: at a squeeze of 10 % it does so over some hundredths of the radius.
    ///
    /// ```
    /// use tactile_fem::{Interface, Load, Material, Scene};
    ///
    /// let material = Material::new(103e3, 0.495)?;
    /// let force = |faces| {
    ///     let scene = Scene::cylinder_between_plates(6e-3, 6e-3, material, faces)?;
    ///     Ok::<_, tactile_elasticity::ElasticityError>(scene.solve(&[Load::Approach(0.15e-3)]).states[0].force_n())
    /// };
    /// assert!(force(Interface::Bonded)? > 1.2 * force(Interface::Frictionless)?);
    /// # Ok::<(), tactile_elasticity::ElasticityError>(())
    /// ```
    ///
    /// # Errors
    /// Lengths that are not positive.
    pub fn cylinder_between_plates(
        radius_m: f64,
        height_m: f64,
        material: Material,
        faces: Interface,
    ) -> Result<Self, ElasticityError> {
        let half = Object::Cylinder {
            radius_m,
            height_m: 0.5 * height_m,
        };
        let mesh = Press::new(half, material)?.object_mesh();
        let mut model = Model::new(Kinematics::Finite);
        let cylinder = model.add(&mesh, &[material])?;
        let support = match faces {
            Interface::Bonded => Support::Bonded,
            Interface::Frictionless => Support::Sliding,
        };
        model.drive(cylinder, Boundary::Contact, support);
        model.hold(cylinder, Boundary::Base, Support::Sliding);
        let face = model.edges(cylinder, Boundary::Contact);
        // The only body is above its face.
        model.interface = Some(BondedInterface::new(face, &model.elements, |_| true, 1.0));
        Ok(Self::from_model(model))
    }
}
