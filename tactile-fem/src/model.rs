//! Bodies, materials, supports and contacts: what is to be solved.
//!
//! The unknowns of a model.
//!
//! An interface whose nodes the bodies share.
//!
//! Rigid bodies of revolution.

use crate::element::{ALL, ElementGeometry};
use crate::material::{Kinematics, Material};
use crate::mesh::{Boundary, Mesh};
use crate::surface::{
    Anchor, ContactNode, ContactSegment, Opposite, RigidShape, SurfaceCurve, contact_segments,
};
use std::collections::BTreeMap;
use std::sync::Arc;
use tactile_elasticity::{ElasticityError, Quantity};

/// A body of an [`ElementModel`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct BodyIndex(usize);

/// How a boundary is held.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Support {
    /// No displacement but the support's own: glued to glass or to a stage.
    Bonded,
    /// Free to slide along r: a lubricated stage, or a plane of symmetry.
    Sliding,
}

/// What a displacement component does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum DofMotion {
    Free,
    Zero,
    /// Moves by the approach times this.
    Driven(f64),
}

#[derive(Debug, Clone)]
pub(crate) struct Part {
    pub regions: core::ops::Range<usize>,
    pub boundaries: BTreeMap<Boundary, Vec<[usize; 3]>>,
}

/// An axisymmetric problem: bodies with their materials, supports and contacts.
///
/// The approach δ, one number, moves every boundary that is [driven](Self::drive) by δ along +z. SI
/// units. The axis of revolution is r = 0. Guides lie below z = 0 and objects above.
#[derive(Debug, Clone, Default)]
pub(crate) struct ElementModel {
    pub kinematics: Kinematics,
    pub nodes: Vec<[f64; 2]>,
    pub elements: Vec<[usize; 9]>,
    /// Material of each element, an index of `materials`.
    pub regions: Vec<usize>,
    /// Shared by the scenes on one mesh whose nodes are moved elsewhere only.
    pub geometry: Vec<Arc<ElementGeometry>>,
    pub materials: Vec<Material>,
    pub parts: Vec<Part>,
    /// Of each displacement component, 2 node + (0 for r, 1 for z).
    pub motion: Vec<DofMotion>,
    pub opposites: Vec<Opposite>,
    pub segments: Vec<ContactSegment>,
    pub contact_nodes: Vec<ContactNode>,
    /// Whether contacts stick.
    pub sticks: bool,
    /// A bonded interface whose pressure is wanted.
    pub interface: Option<BondedInterface>,
    /// The node whose axial displacement a node shares.
    pub partners: Vec<Option<usize>>,
    /// External forces on displacement components, for tests by manufactured solutions.
    pub external: Vec<f64>,
}

impl ElementModel {
    /// An empty model.
    pub(crate) fn new(kinematics: Kinematics) -> Self {
        Self {
            kinematics,
            ..Self::default()
        }
    }

    /// Adds a body with one material a region.
    ///
    /// # Errors
    /// Materials that are not one a region. An element that is degenerate or turned inside out.
    pub(crate) fn add(
        &mut self,
        mesh: &Mesh,
        materials: &[Material],
    ) -> Result<BodyIndex, ElasticityError> {
        Quantity::Layers.entries(materials.len(), mesh.region_count())?;
        let mut geometry = Vec::with_capacity(mesh.elements.len());
        for (index, element) in mesh.elements.iter().enumerate() {
            let element = ElementGeometry::new(&element.map(|node| mesh.nodes[node]));
            let element = element.ok_or(ElasticityError::DegenerateElement { element: index })?;
            geometry.push(Arc::new(element));
        }
        let (first, region) = (self.nodes.len(), self.materials.len());
        self.nodes.extend(&mesh.nodes);
        self.elements
            .extend(mesh.elements.iter().map(|e| e.map(|node| node + first)));
        self.regions.extend(mesh.regions.iter().map(|r| r + region));
        self.geometry.extend(geometry);
        self.materials.extend(materials);
        for node in &mesh.nodes {
            let radial = if node[0] == 0.0 {
                DofMotion::Zero
            } else {
                DofMotion::Free
            };
            self.motion.extend([radial, DofMotion::Free]);
            self.external.extend([0.0; 2]);
            self.partners.push(None);
        }
        let shifted = mesh.boundaries.iter().map(|(name, edges)| {
            (
                *name,
                edges
                    .iter()
                    .map(|edge| edge.map(|node| node + first))
                    .collect(),
            )
        });
        self.parts.push(Part {
            regions: region..self.materials.len(),
            boundaries: shifted.collect(),
        });
        Ok(BodyIndex(self.parts.len() - 1))
    }

    /// Materials of a body, by region.
    pub(crate) fn materials(&self, body: BodyIndex) -> &[Material] {
        &self.materials[self.parts[body.0].regions.clone()]
    }

    /// Edges of a body's boundary, by the model's node numbers.
    pub(crate) fn edges(&self, body: BodyIndex, boundary: Boundary) -> &[[usize; 3]] {
        self.parts[body.0]
            .boundaries
            .get(&boundary)
            .map_or(&[], Vec::as_slice)
    }

    /// Regions of a body among the model's.
    fn body_regions(&self, body: BodyIndex) -> core::ops::Range<usize> {
        self.parts[body.0].regions.clone()
    }

    /// Holds a boundary in its place.
    pub(crate) fn hold(&mut self, body: BodyIndex, boundary: Boundary, support: Support) {
        self.support(body, boundary, support, DofMotion::Zero);
    }

    /// Moves a boundary by the approach along +z.
    pub(crate) fn drive(&mut self, body: BodyIndex, boundary: Boundary, support: Support) {
        self.support(body, boundary, support, DofMotion::Driven(1.0));
    }

    fn support(&mut self, body: BodyIndex, boundary: Boundary, support: Support, axial: DofMotion) {
        for edge in self.edges(body, boundary).to_vec() {
            for node in edge {
                self.motion[2 * node + 1] = axial;
                if support == Support::Bonded {
                    self.motion[2 * node] = DofMotion::Zero;
                }
            }
        }
    }

    /// Lets two bodies' [`Boundary::Contact`] touch without friction.
    ///
    /// Gaps are measured from `first`, which had better be the one with the finer mesh or the more
    /// convex of the two.
    pub(crate) fn contact(&mut self, first: BodyIndex, second: BodyIndex) {
        let curve = SurfaceCurve::new(self.edges(second, Boundary::Contact), &self.nodes);
        let softer = self.softest(first).min(self.softest(second));
        self.add_points(first, Opposite::Surface(curve), softer);
    }

    /// Lets two surfaces that touch from the start slide on each other without friction: nodes at
    /// the same place share their axial displacement. The pressure on the second body's surface,
    /// above the first, becomes the pressure of the states.
    ///
    /// The nodes of one place do not stay at one radius: where the second body spreads more, the
    /// first feels its pressure somewhat further in, which matters little where the first is the
    /// stiffer. The surfaces are not let part.
    pub(crate) fn slide(&mut self, first: BodyIndex, second: BodyIndex) {
        let nodes: Vec<usize> = self
            .edges(first, Boundary::Contact)
            .iter()
            .flatten()
            .copied()
            .collect();
        let mut shared = Vec::new();
        for edge in self.edges(second, Boundary::Contact).to_vec() {
            for other in edge {
                let [s, w] = self.nodes[other];
                let near = |node: &usize| {
                    let [r, z] = self.nodes[*node];
                    // Meshes built on the same lines: rounding alone parts their nodes.
                    (r - s).abs() + (z - w).abs() < 1e-9 * (1.0 + r)
                };
                self.partners[other] = nodes.iter().copied().find(near);
            }
            if edge.iter().all(|&node| self.partners[node].is_some()) {
                shared.push(edge);
            }
        }
        let regions = self.body_regions(second);
        let is_upper = |index: usize| regions.contains(&self.regions[index]);
        self.interface = Some(BondedInterface::new(&shared, &self.elements, is_upper, 1.0));
    }

    /// Lets a body's [`Boundary::Contact`] touch a rigid body without friction, whose pole is at
    /// z = 0: above it (`side` +1) one that does not move, below it (−1) one that moves by the
    /// approach.
    pub(crate) fn contact_rigid(&mut self, body: BodyIndex, shape: RigidShape, side: f64) {
        let softer = self.softest(body);
        self.add_points(body, Opposite::Rigid { shape, side }, softer);
    }

    /// Forbids slip in all contacts of the model, as with unlimited friction: what touches stays
    /// where it first touched until it parts.
    ///
    /// Loads are then followed in steps that let the approach grow by a tenth: forces hold to a
    /// thousandth and contact radii to two, whatever loads are asked for on the way. At ν near 0
    /// the radius is up to 1.5 % low: the pressure near the rim is not that of sliding.
    pub(crate) fn forbid_slip(&mut self) {
        self.sticks = true;
    }

    /// Makes the pressure on a body's [`Boundary::Interface`], above its first `lower` regions, the
    /// pressure of the states.
    pub(crate) fn bond(&mut self, body: BodyIndex, lower: usize) {
        let first = self.body_regions(body).start;
        let edges = self.edges(body, Boundary::Interface);
        let is_lower = |index: usize| (first..first + lower).contains(&self.regions[index]);
        self.interface = Some(BondedInterface::new(edges, &self.elements, is_lower, -1.0));
    }

    fn add_points(&mut self, body: BodyIndex, opposite: Opposite, softer: f64) {
        let edges = self.edges(body, Boundary::Contact).to_vec();
        let pair = self.opposites.len();
        self.opposites.push(opposite);
        let first = self.contact_nodes.len();
        let (segments, nodes) = contact_segments(pair, first, &edges, &self.nodes, softer);
        self.segments.extend(segments);
        self.contact_nodes.extend(nodes);
    }

    fn softest(&self, body: BodyIndex) -> f64 {
        let moduli = self.materials(body).iter().map(Material::youngs_modulus_pa);
        moduli.fold(f64::INFINITY, f64::min)
    }
}

/// The unknowns: displacements, element pressures and the approach.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ModelFields {
    /// Component 2 node + (0 for r, 1 for z).
    pub displacement: Vec<f64>,
    pub pressures: Vec<[f64; 3]>,
    pub approach: f64,
    /// Contact pressures per reference area kept by the augmented Lagrangian.
    pub multipliers: Vec<f64>,
    /// Contact pressures per reference area, unknowns of their own as element pressures are.
    pub contact: Vec<f64>,
    /// Where contact nodes stick. Empty where surfaces slide.
    pub anchors: Vec<Option<Anchor>>,
}

impl ModelFields {
    pub(crate) fn zero(model: &ElementModel) -> Self {
        Self {
            displacement: vec![0.0; 2 * model.nodes.len()],
            pressures: vec![[0.0; 3]; model.elements.len()],
            approach: 0.0,
            multipliers: vec![0.0; model.contact_nodes.len()],
            contact: vec![0.0; model.contact_nodes.len()],
            anchors: if model.sticks {
                vec![None; model.contact_nodes.len()]
            } else {
                Vec::new()
            },
        }
    }

    pub(crate) fn element(&self, nodes: &[usize; 9]) -> [f64; ALL] {
        core::array::from_fn(|k| self.displacement[2 * nodes[k / 2] + k % 2])
    }
}

/// An equilibrium.
pub(crate) struct Equilibrium {
    pub fields: ModelFields,
    pub force: f64,
}

/// Edges between bonded bodies and the elements on one of its sides.
#[derive(Debug, Clone)]
pub(crate) struct BondedInterface {
    /// Nodes from the axis outwards.
    pub nodes: Vec<usize>,
    pub edges: Vec<[usize; 3]>,
    /// Elements of one of the bodies that touch the interface.
    pub elements: Vec<usize>,
    /// −1 where that body is the lower one: it is pushed down. +1 for the upper one.
    pub sign: f64,
}

impl BondedInterface {
    pub(crate) fn new(
        edges: &[[usize; 3]],
        elements: &[[usize; 9]],
        is_inside: impl Fn(usize) -> bool,
        sign: f64,
    ) -> Self {
        let mut nodes: Vec<usize> = Vec::new();
        for &node in edges.iter().flatten() {
            if !nodes.contains(&node) {
                nodes.push(node);
            }
        }
        let touching = (0..elements.len()).filter(|&index| {
            is_inside(index) && elements[index].iter().any(|node| nodes.contains(node))
        });
        Self {
            edges: edges.to_vec(),
            sign,
            elements: touching.collect(),
            nodes,
        }
    }
}
