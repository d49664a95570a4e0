//! Ready models of what a sensor meets.
//!
//! Loads, and what a solution reports.
//!
//! A cylinder squeezed between two rigid plates.

use crate::material::{Kinematics, Material};
use crate::mesh::{BlockMesh, Boundary, InclusionSize};
use crate::model::{BondedInterface, ElementModel, Support};
use crate::press::{Guide, Interface, ObjectPress, ObjectShape};
use crate::state::{State, Stress};
use tactile_elasticity::{ElasticityError, Quantity};

/// Mesh fineness where nothing else is asked: elements along an eighth of an inclusion's
/// circumference.
const BLOCK_FINENESS: usize = 5;

/// A spheroid of another material within a block, on its axis: a ball where it is as tall as wide.
///
/// ```
/// use tactile_fem::{Block, Lump, Material};
///
/// let material = |modulus| Material::new(modulus, 0.495).unwrap();
/// let lump = Lump {
///     diameter_m: 8e-3,
///     height_m: 8e-3,
///     depth_m: 5e-3,
///     material: material(40e3),
/// };
/// let block = Block {
///     height_m: 30e-3,
///     radius_m: 40e-3,
///     material: material(4e3),
///     lump: Some(lump),
/// };
/// assert!(
///     block
///         .lump
///         .is_some_and(|lump| lump.depth_m + lump.height_m < block.height_m)
/// );
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Lump {
    /// Its diameter across the axis, in metres.
    pub diameter_m: f64,
    /// Its height along the axis, in metres.
    pub height_m: f64,
    /// From the block's surface to its top, in metres.
    pub depth_m: f64,
    /// What it is made of.
    pub material: Material,
}

/// A cylindrical block of tissue whose far side is held.
///
/// ```
/// use tactile_fem::{Block, Guide, Interface, GuideLayer, AppliedLoad, Lump, Material, FemScene};
///
/// let soft = Material::new(5e3, 0.495).unwrap();
/// let stiff = Material::new(5e4, 0.495).unwrap();
/// let lump = Lump { diameter_m: 10e-3, height_m: 10e-3, depth_m: 6e-3, material: stiff };
/// let block = Block { height_m: 30e-3, radius_m: 40e-3, material: soft, lump: Some(lump) };
/// let layer = GuideLayer { thickness_m: 10e-3, material: stiff };
/// let guide = Guide::new(vec![layer], 16e-3).unwrap();
/// let scene = FemScene::block_under_guide(&block, &guide, Interface::Bonded).unwrap();
/// let plain = FemScene::block_under_guide(
///     &Block {
///         lump: None,
///         ..block
///     },
///     &guide,
///     Interface::Bonded,
/// )
/// .unwrap();
/// let force = |scene: &FemScene| scene.solve(&[AppliedLoad::Approach(1e-3)]).states[0].force_n();
/// assert!(force(&scene) > force(&plain));
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Block {
    /// Its height, in metres.
    pub height_m: f64,
    /// Its radius, in metres, greater than the guide's.
    pub radius_m: f64,
    /// What it is made of.
    pub material: Material,
    /// An inclusion, if it has one.
    pub lump: Option<Lump>,
}

/// A model ready to be solved, with the pressure between guide and object as its result.
///
/// ```
/// use tactile_fem::{AppliedLoad, Material, ObjectShape, ObjectPress};
///
/// let scene = ObjectPress::new(
///     ObjectShape::Ball { radius_m: 3e-3 },
///     Material::new(103e3, 0.495).unwrap(),
/// )
/// .and_then(|press| press.scene())
/// .unwrap();
/// let solution = scene.solve(&[AppliedLoad::Force(0.2)]);
/// let radius = solution.states[0].contact_radius().unwrap();
/// assert!((radius.radius_m - 1.51e-3).abs() < 0.02e-3);
/// ```
#[derive(Debug, Clone)]
pub struct FemScene {
    pub(crate) model: ElementModel,
}

impl FemScene {
    /// A block with or without an inclusion under a guide's face. The block's far side is held, the
    /// guide's glass moves by the approach. [`Block`] and [`Interface`] have examples.
    ///
    /// # Errors
    /// Lengths that are not positive. A block no wider than the guide. An inclusion that is not
    /// inside the block, not narrower than the guide or below a fiftieth of its radius.
    pub fn block_under_guide(
        block: &Block,
        guide: &Guide,
        interface: Interface,
    ) -> Result<Self, ElasticityError> {
        Self::block_with_mesh(block, guide, interface, BLOCK_FINENESS, Kinematics::Finite)
    }

    /// [`Self::block_under_guide`] on a mesh with `fineness` elements along an eighth of the
    /// inclusion's circumference, at finite or small strain.
    pub fn block_with_mesh(
        block: &Block,
        guide: &Guide,
        interface: Interface,
        fineness: usize,
        kinematics: Kinematics,
    ) -> Result<Self, ElasticityError> {
        Quantity::Thickness.positive(block.height_m)?;
        Quantity::Radius.positive(block.radius_m)?;
        if block.radius_m <= guide.radius_m() {
            return Err(Quantity::Radius.beyond(guide.radius_m(), block.radius_m));
        }
        if let Some(lump) = block.lump {
            Quantity::Radius.positive(lump.diameter_m)?;
            Quantity::Thickness.positive(lump.height_m)?;
            Quantity::Thickness.positive(lump.depth_m)?;
            // The number of elements grows as the face over the lump: below these parts of its
            // radius there would be thousands of them, for a lump that does not show.
            let (least_diameter, least_depth) = (0.02, 0.001);
            for (quantity, found, part) in [
                (Quantity::Radius, lump.diameter_m, least_diameter),
                (Quantity::Thickness, lump.height_m, least_diameter),
                (Quantity::Thickness, lump.depth_m, least_depth),
            ] {
                let limit = part * guide.radius_m();
                if found < limit {
                    return Err(quantity.beyond(found, limit));
                }
            }
            let bottom = lump.depth_m + lump.height_m;
            if bottom >= block.height_m {
                return Err(Quantity::Thickness.beyond(bottom, block.height_m));
            }
            let face = 2.0 * guide.radius_m();
            if lump.diameter_m >= face {
                return Err(Quantity::Radius.beyond(lump.diameter_m, face));
            }
        }
        let bonded = interface == Interface::Bonded;
        let meshes = BlockMesh {
            block_height: block.height_m,
            block_radius: block.radius_m,
            disc_radius: guide.radius_m(),
            layers: guide.thicknesses(),
            inclusion: block.lump.map(|lump| InclusionSize {
                half_axes: [0.5 * lump.diameter_m, 0.5 * lump.height_m],
                depth: lump.depth_m,
            }),
            bonded,
            fineness,
        }
        .build();
        let mut tissue = vec![block.material];
        tissue.extend(block.lump.map(|lump| lump.material));
        let mut model = ElementModel::new(kinematics);
        match meshes.block {
            None => {
                let materials = [guide.materials(), tissue].concat();
                let both = model.add(&meshes.guide, &materials)?;
                model.drive(both, Boundary::Base, Support::Bonded);
                model.hold(both, Boundary::Stage, Support::Bonded);
                model.bond(both, guide.layers().len());
            }
            Some(mesh) => {
                let disc = model.add(&meshes.guide, &guide.materials())?;
                let tissue = model.add(&mesh, &tissue)?;
                model.drive(disc, Boundary::Base, Support::Bonded);
                model.hold(tissue, Boundary::Stage, Support::Bonded);
                model.slide(disc, tissue);
            }
        }
        Ok(Self { model })
    }

    /// Solves for the loads in order.
    pub fn solve(&self, loads: &[AppliedLoad]) -> Solution {
        self.model.solve(loads)
    }

    /// Number of elements of all bodies.
    ///
    /// ```
    /// use tactile_fem::{Material, ObjectShape, ObjectPress};
    /// let scene = ObjectPress::new(
    ///     ObjectShape::Ball { radius_m: 3e-3 },
    ///     Material::new(1e5, 0.495).unwrap(),
    /// )
    /// .and_then(|press| press.scene())
    /// .unwrap();
    /// assert!(scene.element_count() > 100);
    /// ```
    pub fn element_count(&self) -> usize {
        self.model.elements.len()
    }

    /// Cauchy stress at the material point with reference coordinates (r, z) in metres. `None`
    /// outside the bodies, or for a state of another scene.
    ///
    /// From the derivatives of quadratic displacements: second order in the elements' size,
    /// discontinuous between elements. O(elements).
    ///
    /// ```
    /// use tactile_fem::{AppliedLoad, Material, ObjectShape, ObjectPress};
    /// let scene = ObjectPress::new(
    ///     ObjectShape::Ball { radius_m: 3e-3 },
    ///     Material::new(1e5, 0.495).unwrap(),
    /// )
    /// .and_then(|press| press.scene())
    /// .unwrap();
    /// let state = &scene.solve(&[AppliedLoad::Approach(0.3e-3)]).states[0];
    /// // Pressed along the axis.
    /// assert!(scene.stress(state, [0.1e-3, 1e-3]).unwrap().zz_pa < 0.0);
    /// ```
    pub fn stress(&self, state: &State, point: [f64; 2]) -> Option<Stress> {
        self.model.stress(state, point)
    }
}

impl ObjectPress {
    /// The scene of it: the object's far side stays, the glass or the flat moves by the approach.
    ///
    /// # Errors
    /// [`ElasticityError::DegenerateElement`] where the proportions leave an element without area.
    pub fn scene(&self) -> Result<FemScene, ElasticityError> {
        Ok(FemScene {
            model: self.model()?,
        })
    }
}

/// One load: how far the driven boundaries have moved, or with what force.
///
/// ```
/// use tactile_fem::AppliedLoad;
///
/// let loads = [0.2, 0.7, 1.2].map(AppliedLoad::Force);
/// assert_eq!(loads[1], AppliedLoad::Force(0.7));
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum AppliedLoad {
    /// The approach δ, in metres.
    Approach(f64),
    /// The force on the driven boundaries, in newtons. Positive presses.
    Force(f64),
}

/// How a solution ended.
///
/// ```
/// use tactile_fem::Outcome;
///
/// assert_ne!(Outcome::Solved, Outcome::Stopped { load: 1, approach_m: 1e-3, force_n: 0.2 });
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub enum Outcome {
    /// Every load has its state.
    Solved,
    /// This load was not reached. The states of those before it are given.
    Stopped {
        /// Index of the load.
        load: usize,
        /// The last approach in equilibrium, in metres.
        approach_m: f64,
        /// The force there, in newtons.
        force_n: f64,
    },
}

/// What the solver did.
///
/// ```
/// use tactile_fem::{AppliedLoad, Material, ObjectShape, Outcome, ObjectPress};
///
/// # fn main() -> Result<(), tactile_elasticity::ElasticityError> {
/// let press = ObjectPress::new(ObjectShape::Ball { radius_m: 3e-3 }, Material::new(1e5, 0.495)?)?;
/// let report = press.scene()?.solve(&[AppliedLoad::Approach(0.3e-3)]).report;
/// assert_eq!(report.outcome, Outcome::Solved);
/// assert!(report.iterations > report.steps);
/// # Ok(())
/// # }
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct SolverReport {
    /// Whether all loads were reached.
    pub outcome: Outcome,
    /// Load steps that converged.
    pub steps: usize,
    /// Load steps given up and taken again in halves.
    pub rejected_steps: usize,
    /// Newton iterations, those with an earlier tangent and of rejected steps too.
    pub iterations: usize,
}

/// States at the loads that were reached, in order, and a report.
///
/// ```
/// use tactile_fem::{AppliedLoad, Material, ObjectShape, Outcome, ObjectPress};
///
/// # fn main() -> Result<(), tactile_elasticity::ElasticityError> {
/// let press = ObjectPress::new(
///     ObjectShape::Ball { radius_m: 3e-3 },
///     Material::new(1e5, 0.495)?,
/// )?;
/// let solution = press.scene()?.solve(&[
///     AppliedLoad::Approach(0.3e-3),
///     AppliedLoad::Approach(f64::NAN),
/// ]);
/// assert_eq!(solution.states.len(), 1);
/// assert!(matches!(solution.report.outcome, Outcome::Stopped { load: 1, .. }));
/// # Ok(())
/// # }
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Solution {
    /// One state a load.
    pub states: Vec<State>,
    /// What the solver did.
    pub report: SolverReport,
}

impl FemScene {
    /// A cylinder between two rigid plates to which both faces stick, or on which they slide
    /// without friction. One half of it is solved: the other is its mirror image, and the approach
    /// is that of one plate to the middle, half of the whole squeeze.
    ///
    /// The [pressure](crate::State::pressure) is that on the face. Sliding, it is even, and the
    /// state is homogeneous. Sticking, the sides bulge, the pressure depends on the radius and is
    /// singular at the rim, where it is the mean over the last element. That the bulging side comes
    /// to lie on the plate is not followed: at a squeeze of 10 % it does so over some hundredths of
    /// the radius.
    ///
    /// ```
    /// use tactile_fem::{Interface, AppliedLoad, Material, FemScene};
    ///
    /// let material = Material::new(103e3, 0.495)?;
    /// let force = |faces| {
    ///     let scene = FemScene::cylinder_between_plates(6e-3, 6e-3, material, faces)?;
    ///     Ok::<_, tactile_elasticity::ElasticityError>(
    ///         scene.solve(&[AppliedLoad::Approach(0.15e-3)]).states[0].force_n(),
    ///     )
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
        let half = ObjectShape::Cylinder {
            radius_m,
            height_m: 0.5 * height_m,
        };
        let mesh = ObjectPress::new(half, material)?.object_mesh();
        let mut model = ElementModel::new(Kinematics::Finite);
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
        Ok(Self { model })
    }
}
