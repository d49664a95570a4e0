//! Scenes near a solved one, on the same mesh: derivatives by parameters.

use super::element::Geometry;
use super::layout::Layout;
use super::material::Material;
use super::pressure::PressurePoint;
use super::scene::Scene;
use super::sparse::Factors;
use super::state::State;
use crate::ElasticityError;

impl Scene {
    /// This scene with other materials and moved nodes.
    ///
    /// # Errors
    /// An element would be turned inside out.
    pub(crate) fn changed(
        &self,
        materials: &[(usize, Material)],
        moved: Option<&dyn Fn([f64; 2]) -> [f64; 2]>,
    ) -> Result<Self, ElasticityError> {
        let mut model = self.model().clone();
        for &(region, material) in materials {
            model.materials[region] = material;
        }
        if let Some(moved) = moved {
            for node in &mut model.nodes {
                *node = moved(*node);
            }
            let elements = model.geometry.iter_mut().zip(&model.elements);
            for (index, (geometry, element)) in elements.enumerate() {
                let corners = element.map(|node| model.nodes[node]);
                *geometry = Geometry::new(&corners)
                    .ok_or(ElasticityError::DegenerateElement { element: index })?;
            }
        }
        Ok(Self::from_model(model))
    }

    /// What solutions of nearby scenes start from; `None` where the tangent is singular.
    pub(crate) fn neighbourhood<'a>(&'a self, state: &'a State) -> Option<Neighbourhood<'a>> {
        let mut layout = Layout::new(self.model());
        let system = self.model().assemble(&mut layout, &state.fields, 0.0)?;
        let factors = system.factors().ok()?;
        Some(Neighbourhood {
            state,
            layout,
            factors,
        })
    }
}

/// A state with its tangent.
pub(crate) struct Neighbourhood<'a> {
    state: &'a State,
    layout: Layout,
    factors: Factors,
}

impl Neighbourhood<'_> {
    /// Interface pressure and force of a nearby scene at an approach, by one iteration from the state
    /// with its tangent: the error is of second order in the scenes' difference.
    ///
    /// `None` where an element is turned inside out.
    pub(crate) fn solve(
        &mut self,
        nearby: &Scene,
        approach_m: f64,
    ) -> Option<(Vec<PressurePoint>, f64)> {
        let model = nearby.model();
        let interface = model.interface.as_ref()?;
        let fields = &self.state.fields;
        let system = model.assemble(&mut self.layout, fields, 0.0)?;
        let step = system.nearby_step(&self.factors, fields, approach_m).ok()?;
        let fields = step.apply(fields, 1.0);
        let force = model.interface_forces(interface, &fields).sum();
        Some((model.interface_pressure(interface, &fields), force))
    }
}
