//! Scenes close to a solved one, on the same mesh: derivatives by parameters.

use crate::element::{ElementGeometry, Elimination};
use crate::material::Material;
use crate::model::{ElementModel, ModelFields};
use crate::recovery::PressurePoint;
use crate::scene::{AppliedLoad, FemScene, Outcome};
use crate::sparse::Factors;
use crate::state::{State, pressure_at};
use crate::system::{Layout, Slot, Tangent};
use std::sync::Arc;
use tactile_elasticity::ElasticityError;

impl FemScene {
    /// This scene with other materials and moved nodes.
    ///
    /// # Errors
    /// An error if an element would be inverted.
    pub fn changed(
        &self,
        materials: &[(usize, Material)],
        moved: Option<&dyn Fn([f64; 2]) -> [f64; 2]>,
    ) -> Result<Self, ElasticityError> {
        let mut model = self.model.clone();
        for &(region, material) in materials {
            model.materials[region] = material;
        }
        if let Some(moved) = moved {
            model.move_nodes(|_, node| moved(node))?;
        }
        Ok(Self { model })
    }

    /// The analysed equations of this scene and of scenes [changed](Self::changed) from it. `None`
    /// if there is not enough memory.
    fn layout(&self) -> Option<Layout> {
        let mut layout = Layout::new(&self.model);
        layout
            .pattern(&self.model.elements, core::iter::empty())
            .ok()?;
        Some(layout)
    }

    /// The start of solutions of nearby scenes. `None` if the tangent is singular.
    fn neighbourhood<'a>(
        &'a self,
        layout: &mut Layout,
        state: &'a State,
    ) -> Option<SolvedNeighbourhood<'a>> {
        let model = &self.model;
        let system = model.assemble(layout, &state.fields, 0.0)?;
        let (tangent, slots, eliminations) = system.into_parts();
        Some(SolvedNeighbourhood {
            model,
            fields: &state.fields,
            factors: tangent.matrix.factorise().ok()?,
            tangent,
            slots,
            eliminations,
        })
    }
}

/// Pressure on the interface and force of one frame of a nearby scene.
#[derive(Debug, Clone)]
pub struct FrameResponse {
    pressure: Vec<PressurePoint>,
    force: f64,
    /// r and z of each node except the elements' centres.
    displacement: Vec<f64>,
}

impl FrameResponse {
    /// The force, in newtons.
    pub fn force_n(&self) -> f64 {
        self.force
    }

    /// Pressure at a radius of the interface, see [`State::pressure_at`].
    pub fn pressure_at(&self, radius_m: f64) -> f64 {
        pressure_at(&self.pressure, radius_m)
    }
}

/// A scene with an interface, solved at several approaches. Nearby scenes on the same mesh are
/// solved from it in fewer iterations, and it gives derivatives by any change of a scene.
///
/// ```
/// use tactile_fem::{Block, FemScene, Guide, GuideLayer, Interface, Material, SolvedFrames};
///
/// let gel = |modulus| Material::new(modulus, 0.49);
/// let guide = Guide::new(vec![GuideLayer { thickness_m: 5e-3, material: gel(5e4)? }], 10e-3)?;
/// let block = Block { height_m: 20e-3, radius_m: 30e-3, material: gel(1e4)?, lump: None };
/// let scene = FemScene::block_under_guide(&block, &guide, Interface::Bonded)?;
/// let solved = SolvedFrames::new(&scene, &[0.5e-3], None, None).unwrap();
/// // The tissue, the region after the guide's single layer, becomes stiffer by a thousandth.
/// let stiffer = gel(1.001e4)?;
/// let changed = |scene: &FemScene| Some(vec![scene.changed(&[(1, stiffer)], None).ok()?]);
/// let answers = solved.responses(changed, |_| vec![0.5e-3; 2]).unwrap();
/// let [there, here] = [&answers[0][0], &answers[1][0]].map(|frame| frame.force_n());
/// assert!(there > here && (there / here - 1.0) < 1e-3);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone)]
pub struct SolvedFrames {
    /// Layout of the mesh, which does not depend on the positions of its nodes.
    layout: Layout,
    /// One scene for all frames, or one per frame if surfaces slide.
    scenes: Vec<FemScene>,
    states: Vec<State>,
    sliding_depth: Option<f64>,
}

impl SolvedFrames {
    /// Solves a scene at approaches in metres, starting from a nearby solution if there is one. If
    /// the mesh must follow sliding surfaces, `sliding_depth_m` is the depth below the surface to
    /// which it may move. `None` if an approach is not reached.
    pub fn new(
        scene: &FemScene,
        approaches_m: &[f64],
        sliding_depth_m: Option<f64>,
        near: Option<&Self>,
    ) -> Option<Self> {
        let on_mesh = near.filter(|near| near.scenes[0].model.elements == scene.model.elements);
        let mut solved = Self {
            layout: match on_mesh {
                Some(near) => near.layout.clone(),
                None => scene.layout()?,
            },
            scenes: Vec::with_capacity(approaches_m.len()),
            states: Vec::with_capacity(approaches_m.len()),
            sliding_depth: sliding_depth_m,
        };
        let mut layout = solved.layout.clone();
        let Some(depth) = sliding_depth_m else {
            let loads: Vec<AppliedLoad> = (approaches_m.iter().copied())
                .map(AppliedLoad::Approach)
                .collect();
            let guesses = on_mesh.map_or(&[][..], |near| &near.states);
            let solution = scene.model.solve_near(&mut layout, &loads, guesses);
            solved.scenes.push(scene.clone());
            solved.states = solution.states;
            return (solution.report.outcome == Outcome::Solved).then_some(solved);
        };
        // Frame by frame, each from the same frame of the nearby solution or from the previous
        // frame.
        for (frame, &approach) in approaches_m.iter().enumerate() {
            let before = || solved.scenes.last().zip(solved.states.last());
            let near = near.map(|near| (near.scene(frame), &near.states[frame]));
            let (scene, state) = scene.slid(&mut layout, approach, depth, near.or_else(before))?;
            solved.scenes.push(scene);
            solved.states.push(state);
        }
        Some(solved)
    }

    /// The state of each frame.
    pub fn states(&self) -> &[State] {
        &self.states
    }

    fn scene(&self, frame: usize) -> &FemScene {
        &self.scenes[frame.min(self.scenes.len() - 1)]
    }

    /// Responses of changed scenes and, last, of the scene itself, each frame by frame, by one
    /// iteration from the solution with its tangent. The error is of second order in the change.
    ///
    /// `changed` creates the changed scenes of a frame's scene. `approaches_m` gives the approach
    /// of each in a frame, and last that of the scene itself. The cost is one factorisation per
    /// frame, and one residual per scene and frame. The iteration on the scene itself is used for
    /// differences, because it cancels the residual imbalance of the solution. `None` if an element
    /// is inverted.
    pub fn responses(
        &self,
        changed: impl Fn(&FemScene) -> Option<Vec<FemScene>>,
        approaches_m: impl Fn(usize) -> Vec<f64>,
    ) -> Option<Vec<Vec<FrameResponse>>> {
        let mut layout = self.layout.clone();
        let mut nearby = changed(self.scene(0))?;
        let mut answers = vec![Vec::with_capacity(self.states.len()); nearby.len() + 1];
        for (frame, state) in self.states.iter().enumerate() {
            let scene = self.scene(frame);
            if frame > 0 && frame < self.scenes.len() {
                nearby = changed(scene)?;
            }
            let neighbourhood = scene.neighbourhood(&mut layout, state)?;
            let approaches = approaches_m(frame);
            let solve = |nearby: &[FemScene]| {
                let scenes = nearby.iter().chain([scene]);
                let at: Vec<(&FemScene, f64)> = scenes.zip(approaches.iter().copied()).collect();
                neighbourhood.solve(&at)
            };
            let mut found = solve(&nearby)?;
            if let Some(depth) = self.sliding_depth {
                // Realigns the faces of the changed scenes: a tenth of the distance remains.
                let met = scene.distances(&found[nearby.len()].displacement);
                for (nearby, found) in nearby.iter_mut().zip(&found) {
                    let apart = nearby.distances(&found.displacement);
                    let apart: Vec<f64> = apart.iter().zip(&met).map(|(a, b)| a - b).collect();
                    *nearby = nearby.moved_back(&apart, depth)?;
                }
                found = solve(&nearby)?;
            }
            for (answers, found) in answers.iter_mut().zip(found) {
                answers.push(found);
            }
        }
        Some(answers)
    }
}

/// A state with its tangent.
struct SolvedNeighbourhood<'a> {
    model: &'a ElementModel,
    fields: &'a ModelFields,
    tangent: Tangent,
    factors: Factors,
    slots: Arc<[Slot]>,
    eliminations: Vec<Elimination>,
}

impl SolvedNeighbourhood<'_> {
    /// Responses of nearby scenes at their approaches, each by one iteration from the state with
    /// its tangent. The error is of second order in the difference of the scenes.
    ///
    /// Elements are evaluated again only if they differ, and without their stiffness.
    ///
    /// `None` if an element is inverted.
    fn solve(&self, nearby: &[(&FemScene, f64)]) -> Option<Vec<FrameResponse>> {
        let size = self.tangent.right.len();
        // The last column is the solution for a unit approach.
        let mut columns = Vec::with_capacity((nearby.len() + 1) * size);
        let mut changes = Vec::with_capacity(nearby.len());
        for (scene, _) in nearby {
            let mut right = self.tangent.right.clone();
            changes.push(self.change(&scene.model, &mut right)?);
            columns.append(&mut right);
        }
        columns.extend(&self.tangent.driver_column);
        self.factors.solve(&mut columns).ok()?;
        let (columns, by_approach) = columns.split_at(nearby.len() * size);
        let mut found = Vec::with_capacity(nearby.len());
        for (k, (scene, approach_m)) in nearby.iter().enumerate() {
            let solution = &columns[k * size..(k + 1) * size];
            let approach = approach_m - self.fields.approach;
            let step = |equation: usize| solution[equation] - approach * by_approach[equation];
            found.push(self.interface(&scene.model, &changes[k], approach, step)?);
        }
        Some(found)
    }

    /// Subtracts the change of the residual from this scene to a nearby one from `right`. Returns
    /// the eliminations of the elements that differ.
    fn change(&self, nearby: &ElementModel, right: &mut [f64]) -> Option<Vec<Option<Elimination>>> {
        let model = self.model;
        let mut changes = Vec::with_capacity(model.elements.len());
        for (index, nodes) in model.elements.iter().enumerate() {
            let materials = [model, nearby].map(|m| &m.materials[m.regions[index]]);
            let geometry = &nearby.geometry[index];
            let is_moved = !Arc::ptr_eq(&model.geometry[index], geometry);
            if materials[0] == materials[1] && !is_moved {
                changes.push(None);
                continue;
            }
            let here = &self.eliminations[index];
            let before = here.outer_residual_before();
            let (after, elimination) = if is_moved {
                let u = self.fields.element(nodes);
                geometry.nearby(model.kinematics, materials[1], &u, here)?
            } else {
                geometry.of_material(materials, here)
            };
            for (k, (after, before)) in after.iter().zip(&before).enumerate() {
                if let Slot::Equation(row) = self.slots[2 * nodes[k / 2] + k % 2] {
                    right[row] -= after - before;
                }
            }
            changes.push(Some(elimination));
        }
        Some(changes)
    }

    /// Pressure and force on the interface after a step of the equations' unknowns and the
    /// approach.
    fn interface(
        &self,
        nearby: &ElementModel,
        changes: &[Option<Elimination>],
        approach: f64,
        step: impl Fn(usize) -> f64,
    ) -> Option<FrameResponse> {
        let interface = nearby.interface.as_ref()?;
        let steps: Vec<f64> = (self.slots.iter())
            .map(|slot| match *slot {
                Slot::Nowhere => 0.0,
                Slot::Driver(factor) => factor * approach,
                Slot::Equation(equation) => step(equation),
            })
            .collect();
        let mut fields = self.fields.clone();
        for (u, step) in fields.displacement.iter_mut().zip(&steps) {
            *u += step;
        }
        // The pressures are computed only from the elements at the interface.
        for &index in &interface.elements {
            let nodes = &nearby.elements[index];
            let outer = core::array::from_fn(|k| steps[2 * nodes[k / 2] + k % 2]);
            let elimination = changes[index].as_ref().unwrap_or(&self.eliminations[index]);
            let (centre, pressures) = elimination.recover(&outer);
            fields.displacement[2 * nodes[8]] += centre[0];
            fields.displacement[2 * nodes[8] + 1] += centre[1];
            fields.pressures[index] = pressures;
        }
        Some(FrameResponse {
            pressure: nearby.interface_pressure(interface, &fields),
            force: nearby.interface_forces(interface, &fields).sum(),
            displacement: fields.displacement,
        })
    }
}

impl ElementModel {
    /// Moves nodes, each given by index and position. Elements with unchanged nodes keep their
    /// geometry.
    ///
    /// # Errors
    /// An error if an element would be inverted.
    pub(crate) fn move_nodes(
        &mut self,
        moved: impl Fn(usize, [f64; 2]) -> [f64; 2],
    ) -> Result<(), ElasticityError> {
        let mut is_moved = Vec::with_capacity(self.nodes.len());
        for (index, node) in self.nodes.iter_mut().enumerate() {
            let to = moved(index, *node);
            is_moved.push(to != *node);
            *node = to;
        }
        for (index, element) in self.elements.iter().enumerate() {
            if element.iter().any(|&node| is_moved[node]) {
                let geometry = ElementGeometry::new(&element.map(|node| self.nodes[node]))
                    .ok_or(ElasticityError::DegenerateElement { element: index })?;
                self.geometry[index] = Arc::new(geometry);
            }
        }
        Ok(())
    }
}
