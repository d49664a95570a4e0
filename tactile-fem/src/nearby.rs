//! Scenes near a solved one, on the same mesh: derivatives by parameters.

use crate::element::{ElementGeometry, Elimination};
use crate::material::Material;
use crate::model::{ElementModel, Fields};
use crate::scene::FemScene;
use crate::sparse::Factors;
use crate::state::{PressurePoint, State};
use crate::system::{Layout, Slot, Tangent};
use std::sync::Arc;
use tactile_elasticity::ElasticityError;

impl FemScene {
    /// This scene with other materials and moved nodes.
    ///
    /// # Errors
    /// An element would be turned inside out.
    pub fn changed(
        &self,
        materials: &[(usize, Material)],
        moved: Option<&dyn Fn([f64; 2]) -> [f64; 2]>,
    ) -> Result<Self, ElasticityError> {
        let mut model = self.model().clone();
        for &(region, material) in materials {
            model.materials[region] = material;
        }
        if let Some(moved) = moved {
            model.move_nodes(|_, node| moved(node))?;
        }
        Ok(Self::from_model(model))
    }

    /// The equations of this scene and of those [changed](Self::changed) from it, analysed. `None`
    /// where there is no memory for them.
    pub fn layout(&self) -> Option<Layout> {
        let mut layout = Layout::new(self.model());
        layout
            .pattern(&self.model().elements, core::iter::empty())
            .ok()?;
        Some(layout)
    }

    /// What solutions of nearby scenes start from. `None` where the tangent is singular.
    pub fn neighbourhood<'a>(
        &'a self,
        layout: &mut Layout,
        state: &'a State,
    ) -> Option<SolvedNeighbourhood<'a>> {
        let model = self.model();
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

/// What one iteration finds of a nearby scene.
#[derive(Debug, Clone)]
pub struct Found {
    /// The interface pressure over the radius.
    pub pressure: Vec<PressurePoint>,
    /// The force, in newtons.
    pub force_n: f64,
    /// r and z of every node but the elements' centres.
    pub displacement: Vec<f64>,
}

/// A state with its tangent.
pub struct SolvedNeighbourhood<'a> {
    model: &'a ElementModel,
    fields: &'a Fields,
    tangent: Tangent,
    factors: Factors,
    slots: Arc<[Slot]>,
    eliminations: Vec<Elimination>,
}

impl SolvedNeighbourhood<'_> {
    /// What is found of nearby scenes at their approaches, each by one iteration from the
    /// state with its tangent: the error is of second order in the scenes' difference.
    ///
    /// Elements are evaluated anew only where they differ, and without their stiffness.
    ///
    /// `None` where an element is turned inside out.
    pub fn solve(&self, nearby: &[(&FemScene, f64)]) -> Option<Vec<Found>> {
        let size = self.tangent.right.len();
        // The last column is the answer to a unit approach.
        let mut columns = Vec::with_capacity((nearby.len() + 1) * size);
        let mut changes = Vec::with_capacity(nearby.len());
        for (scene, _) in nearby {
            let mut right = self.tangent.right.clone();
            changes.push(self.change(scene.model(), &mut right)?);
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
            found.push(self.interface(scene.model(), &changes[k], approach, step)?);
        }
        Some(found)
    }

    /// The residual's change from this scene to a nearby one, taken from `right`, and the
    /// eliminations of the elements that differ.
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
    ) -> Option<Found> {
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
        // The pressures are read from the elements at the interface alone.
        for &index in &interface.elements {
            let nodes = &nearby.elements[index];
            let outer = core::array::from_fn(|k| steps[2 * nodes[k / 2] + k % 2]);
            let elimination = changes[index].as_ref().unwrap_or(&self.eliminations[index]);
            let (centre, pressures) = elimination.recover(&outer);
            fields.displacement[2 * nodes[8]] += centre[0];
            fields.displacement[2 * nodes[8] + 1] += centre[1];
            fields.pressures[index] = pressures;
        }
        Some(Found {
            pressure: nearby.interface_pressure(interface, &fields),
            force_n: nearby.interface_forces(interface, &fields).sum(),
            displacement: fields.displacement,
        })
    }
}

impl ElementModel {
    /// Moves nodes, each by its index and position. Elements whose nodes stay keep their geometry.
    ///
    /// # Errors
    /// An element would be turned inside out.
    pub fn move_nodes(
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
