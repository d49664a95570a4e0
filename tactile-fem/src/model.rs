//! The model to be solved: bodies, materials, supports, contacts and unknowns, interfaces with
//! shared nodes, and rigid bodies of revolution.

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

/// Support of a boundary.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Support {
    /// Moves only with the support: glued to glass or to a stage.
    Bonded,
    /// Free to slide along r: on a lubricated stage, or in a plane of symmetry.
    Sliding,
}

/// Motion of a displacement component.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum DofMotion {
    Free,
    Zero,
    /// Displaced by the approach times this factor.
    Driven(f64),
}

#[derive(Debug, Clone)]
pub(crate) struct Part {
    pub regions: core::ops::Range<usize>,
    pub boundaries: BTreeMap<Boundary, Vec<[usize; 3]>>,
}

/// An axisymmetric problem: bodies with their materials, supports and contacts.
///
/// The approach δ, one number, moves every [driven](Self::drive) boundary by δ along +z. SI units
/// are used, and the axis of revolution is r = 0. Guides are below z = 0 and objects above.
#[derive(Debug, Clone, Default)]
pub(crate) struct ElementModel {
    pub kinematics: Kinematics,
    pub nodes: Vec<[f64; 2]>,
    pub elements: Vec<[usize; 9]>,
    /// Material of each element, as an index of `materials`.
    pub regions: Vec<usize>,
    /// Geometry of each element, shared by scenes on one mesh with partly moved nodes.
    pub geometry: Vec<Arc<ElementGeometry>>,
    pub materials: Vec<Material>,
    pub parts: Vec<Part>,
    /// Motion of each displacement component, 2 node + (0 for r, 1 for z).
    pub motion: Vec<DofMotion>,
    pub opposites: Vec<Opposite>,
    pub segments: Vec<ContactSegment>,
    pub contact_nodes: Vec<ContactNode>,
    /// Whether contacts stick.
    pub sticks: bool,
    /// A bonded interface whose pressure is evaluated.
    pub interface: Option<BondedInterface>,
    /// The node with which each node shares its axial displacement.
    pub partners: Vec<Option<usize>>,
    /// External forces on displacement components, for tests with manufactured solutions.
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

    /// Adds a body with one material per region.
    ///
    /// # Errors
    /// An error if the number of materials differs from that of regions, or if an element is
    /// degenerate or inverted.
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

    /// Edges of a body's boundary, with the node numbers of the model.
    pub(crate) fn edges(&self, body: BodyIndex, boundary: Boundary) -> &[[usize; 3]] {
        self.parts[body.0]
            .boundaries
            .get(&boundary)
            .map_or(&[], Vec::as_slice)
    }

    /// Regions of a body, numbered in the model.
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

    /// Lets the [`Boundary::Contact`] of two bodies touch without friction.
    ///
    /// Gaps are measured from `first`, which should be the body with the finer mesh or the more
    /// convex one.
    pub(crate) fn contact(&mut self, first: BodyIndex, second: BodyIndex) {
        let curve = SurfaceCurve::new(self.edges(second, Boundary::Contact), &self.nodes);
        let softer = self.softest(first).min(self.softest(second));
        self.add_points(first, Opposite::Surface(curve), softer);
    }

    /// Lets two surfaces that touch from the start slide on each other without friction: coincident
    /// nodes share their axial displacement. The pressure on the surface of the second body, above
    /// the first, becomes the pressure of the states.
    ///
    /// Coincident nodes do not keep the same radius: if the second body spreads more, the first
    /// gets its pressure slightly further inside, which matters little if the first is stiffer. The
    /// surfaces cannot separate.
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
                    // The meshes are built on the same lines, so their nodes differ only by
                    // rounding.
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

    /// Lets the [`Boundary::Contact`] of a body touch a rigid body without friction. The pole of
    /// the rigid body is at z = 0. Above (`side` +1) it is fixed; below (−1) it moves by the
    /// approach.
    pub(crate) fn contact_rigid(&mut self, body: BodyIndex, shape: RigidShape, side: f64) {
        let softer = self.softest(body);
        self.add_points(body, Opposite::Rigid { shape, side }, softer);
    }

    /// Forbids slip in all contacts of the model, as with unlimited friction: points that touch
    /// stay together until they separate.
    ///
    /// Loads are then followed in steps with a growth of the approach by a tenth. Forces are
    /// accurate to a thousandth and contact radii to two thousandths, independently of intermediate
    /// loads. At ν near 0 the radius is up to 1.5 % low, because the pressure near the rim differs
    /// from that of sliding.
    pub(crate) fn forbid_slip(&mut self) {
        self.sticks = true;
    }

    /// Makes the pressure on the [`Boundary::Interface`] of a body, above its first `lower`
    /// regions, the pressure of the states.
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
    /// Contact pressures per reference area, stored by the augmented Lagrangian.
    pub multipliers: Vec<f64>,
    /// Contact pressures per reference area, as independent unknowns like element pressures.
    pub contact: Vec<f64>,
    /// Anchors of sticking contact nodes. Empty if surfaces slide.
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

/// Edges between bonded bodies, with the elements on one side.
#[derive(Debug, Clone)]
pub(crate) struct BondedInterface {
    /// Nodes from the axis outwards.
    pub nodes: Vec<usize>,
    pub edges: Vec<[usize; 3]>,
    /// Elements of one of the bodies at the interface.
    pub elements: Vec<usize>,
    /// −1 if this body is the lower one, which is pushed down, and +1 for the upper one.
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
