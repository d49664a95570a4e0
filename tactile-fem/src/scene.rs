//! Ready models of typical sensor contacts, their loads, and the report of a solution. Includes a
//! cylinder compressed between two rigid plates.

use crate::material::{Kinematics, Material};
use crate::mesh::{BlockMesh, Boundary, InclusionSize};
use crate::model::{BondedInterface, ElementModel, Support};
use crate::press::{Guide, Interface, ObjectPress, ObjectShape};
use crate::state::{State, Stress};
use tactile_elasticity::{ElasticityError, Quantity};

/// Default mesh fineness: elements along an eighth of an inclusion's circumference.
const BLOCK_FINENESS: usize = 5;

/// A spheroid of another material inside a block, on its axis. It is a ball if it is as tall as
/// wide.
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
    /// Diameter across the axis, in metres.
    pub diameter_m: f64,
    /// Height along the axis, in metres.
    pub height_m: f64,
    /// Distance from the block's surface to its top, in metres.
    pub depth_m: f64,
    /// Material of the lump.
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
    /// Height in metres.
    pub height_m: f64,
    /// Radius in metres, greater than that of the guide.
    pub radius_m: f64,
    /// Material of the block.
    pub material: Material,
    /// The inclusion. `None` for a homogeneous block.
    pub lump: Option<Lump>,
}

/// A model ready to be solved. Its result is the pressure between guide and object.
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
    /// A block with or without an inclusion under the face of a guide. The far side of the block is
    /// held, and the glass of the guide moves by the approach. [`Block`] and [`Interface`] have
    /// examples.
    ///
    /// # Errors
    /// An error if a length is not positive or the block is no wider than the guide. The inclusion
    /// must lie inside the block, be narrower than the guide and be at least a fiftieth of the
    /// guide's radius.
    pub fn block_under_guide(
        block: &Block,
        guide: &Guide,
        interface: Interface,
    ) -> Result<Self, ElasticityError> {
        Self::block_with_mesh(block, guide, interface, BLOCK_FINENESS, Kinematics::Finite)
    }

    /// Like [`Self::block_under_guide`], on a mesh with `fineness` elements along an eighth of the
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
            // The number of elements grows with the ratio of the face to the lump. Below these
            // fractions of the face radius there would be thousands of elements, for a lump that
            // has no visible effect.
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
    /// It is computed from the derivatives of quadratic displacements: second order in the element
    /// size, and discontinuous between elements. O(elements).
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
    /// // Compression along the axis.
    /// assert!(scene.stress(state, [0.1e-3, 1e-3]).unwrap().zz_pa < 0.0);
    /// ```
    pub fn stress(&self, state: &State, point: [f64; 2]) -> Option<Stress> {
        self.model.stress(state, point)
    }
}

impl ObjectPress {
    /// The scene of this press: the far side of the object is fixed, and the glass or flat moves by
    /// the approach.
    ///
    /// # Errors
    /// [`ElasticityError::DegenerateElement`] if the proportions leave an element without area.
    pub fn scene(&self) -> Result<FemScene, ElasticityError> {
        Ok(FemScene {
            model: self.model()?,
        })
    }
}

/// One load: the displacement of the driven boundaries, or their force.
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
    /// The force on the driven boundaries, in newtons, positive in compression.
    Force(f64),
}

/// Outcome of a solution.
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
    /// Every load was reached.
    Solved,
    /// This load was not reached. The states of earlier loads are available.
    Stopped {
        /// Index of the load.
        load: usize,
        /// Approach of the last equilibrium, in metres.
        approach_m: f64,
        /// Force of the last equilibrium, in newtons.
        force_n: f64,
    },
}

/// Report of the solver.
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
    /// Number of load steps that converged.
    pub steps: usize,
    /// Number of load steps that were rejected and repeated in halves.
    pub rejected_steps: usize,
    /// Number of Newton iterations, including those with an earlier tangent and those of rejected
    /// steps.
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
    /// One state per load.
    pub states: Vec<State>,
    /// Report of the solver.
    pub report: SolverReport,
}

impl FemScene {
    /// A cylinder between two rigid plates, to which both faces stick or on which they slide
    /// without friction. One half is solved, because the other is its mirror image. The approach of
    /// one plate to the middle, half of the total compression.
    ///
    /// The [pressure](crate::State::pressure) is that on the face. With sliding it is uniform, and
    /// the state is homogeneous. With sticking, the sides bulge, and the pressure depends on the
    /// radius. It is singular at the rim, where the result is the mean over the last element. The
    /// bulging side can come into contact with the plate, which is neglected: at a compression of
    /// 10 % this affects several hundredths of the radius.
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
    /// An error for lengths that are not positive.
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
