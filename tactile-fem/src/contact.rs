//! Contact: the points of a surface at which gaps are measured, and the forces that prevent
//! penetration.
//!
//! Gaps g are averaged over the hat functions φ of the first surface's nodes (linear on each half
//! of an edge): $g_v = \int \varphi_v g / \int \varphi_v$. The pressure per reference area is
//! $t = \sum_v \varphi_v t_v$ with $t_v = \langle \lambda_v - \varepsilon g_v \rangle$. One
//! pressure per nodal displacement is a stable pair, whereas discontinuous pressures that are
//! linear on each edge oscillate. The pressure derives from a potential, so the tangent is
//! symmetric. λ is set to t between equilibria (augmented Lagrangian, Uzawa).
//!
//! Opposite a deformable surface, the integrals are computed piecewise between the ends of the
//! other surface's edges (segment-to-segment), because its normal jumps there. Points fixed on the
//! first surface would transfer their whole force across the kink at once, and Newton's method
//! would cycle. Pieces that grow and shrink transfer it continuously.
//!
//! The module also finds closest points on a surface's edges, computes gaps with their derivatives,
//! and selects contact nodes that touch or may touch within a load step.

use crate::element::quadratic;
use crate::material::Kinematics;
use crate::model::{ElementModel, ModelFields};
use crate::surface::{
    BEND, ContactSegment, CurvePoint, DRIVER, GapPoint, Opposite, RigidShape, Slip, SurfaceCurve,
    combine,
};

/// Minimum distance of two cuts, relative to a segment. Closer ends of edges leave nothing to
/// integrate between them.
const SLIVER: f64 = 1e-6;

/// Minimum fraction of a node's area with something opposite to it. Below, the node is open.
const LEAST_SHARE: f64 = 0.25;

/// Geometry for the contact evaluation: reference coordinates and displacements.
#[derive(Clone, Copy)]
pub(crate) struct Placement<'a> {
    pub kinematics: Kinematics,
    pub nodes: &'a [[f64; 2]],
    pub displacement: &'a [f64],
    pub approach: f64,
}

impl Placement<'_> {
    /// Parameters on a segment that are closest to the ends of the opposite edges.
    fn cuts(&self, segment: &ContactSegment, curve: &SurfaceCurve) -> Vec<f64> {
        let at = |parameter: f64| {
            let (shape, derivative) = quadratic(parameter);
            let position = combine(&shape, segment.nodes, |n| self.current(n));
            (
                position,
                combine(&derivative, segment.nodes, |n| self.current(n)),
            )
        };
        let [start, end] = segment.ends;
        let (a, b) = (at(start).0, at(end).0);
        let chord = [b[0] - a[0], b[1] - a[1]];
        let square = chord[0] * chord[0] + chord[1] * chord[1];
        let margin = SLIVER * (end - start);
        let mut cuts = Vec::new();
        for edge in &curve.edges()[1..] {
            let corner = self.current(edge[0]);
            let offset = [corner[0] - a[0], corner[1] - a[1]];
            let along = (offset[0] * chord[0] + offset[1] * chord[1]) / square;
            let across = (offset[1] * chord[0] - offset[0] * chord[1]) / square;
            // Edges farther away than the length of the segment have no effect here.
            if !(-0.5..1.5).contains(&along) || across.abs() > 1.0 {
                continue;
            }
            let mut parameter = start + along * (end - start);
            // Newton's method without the curvature, because the segment is nearly straight.
            for _ in 0..8 {
                let (position, slope) = at(parameter);
                let metric = slope[0] * slope[0] + slope[1] * slope[1];
                parameter += ((corner[0] - position[0]) * slope[0]
                    + (corner[1] - position[1]) * slope[1])
                    / metric;
            }
            if parameter > start + margin && parameter < end - margin {
                cuts.push(parameter);
            }
        }
        cuts.sort_by(f64::total_cmp);
        cuts.dedup_by(|next, kept| *next - *kept < margin);
        cuts
    }

    /// Current position of a node. In linear kinematics it is at its undeformed radius, like gaps.
    pub(crate) fn current(&self, node: usize) -> [f64; 2] {
        let [r, z] = self.nodes[node];
        let [u, w] = self.moved(node);
        match self.kinematics {
            Kinematics::Finite => [r + u, z + w],
            Kinematics::Linear => [r, z + w],
        }
    }

    pub(crate) fn moved(&self, node: usize) -> [f64; 2] {
        [self.displacement[2 * node], self.displacement[2 * node + 1]]
    }

    /// Deformed area over reference area at a point of an edge with these shape functions. It is
    /// one in linear kinematics.
    pub(crate) fn stretch(
        &self,
        shape: &[f64; 3],
        derivative: &[f64; 3],
        nodes: [usize; 3],
    ) -> f64 {
        if self.kinematics == Kinematics::Linear {
            return 1.0;
        }
        let area = |at: &dyn Fn(usize) -> [f64; 2]| {
            let [r, _] = combine(shape, nodes, at);
            let [dr, dz] = combine(derivative, nodes, at);
            r * dr.hypot(dz)
        };
        area(&|n| self.current(n)) / area(&|n| self.nodes[n])
    }
}

/// A gap with its derivatives by the displacement components `dofs`.
#[derive(Debug, Clone)]
pub(crate) struct Gap {
    pub value: f64,
    pub dofs: Vec<usize>,
    pub first: Vec<f64>,
    /// Second derivatives, row by row.
    pub second: Vec<f64>,
    /// Axial component of the force from a unit pressure, per reference area.
    pub axial: f64,
}

/// The closest point of a surface to another point.
pub(crate) struct Nearest {
    pub at: CurvePoint,
    /// Parameter on its edge.
    xi: f64,
}

/// The weighted average of gaps. The weights sum to `total`.
fn averaged(gaps: &[(Gap, f64)], total: f64) -> Gap {
    let mut dofs: Vec<usize> = Vec::with_capacity(24);
    for (gap, _) in gaps {
        for dof in &gap.dofs {
            if !dofs.contains(dof) {
                dofs.push(*dof);
            }
        }
    }
    let count = dofs.len();
    let mut average = Gap {
        value: 0.0,
        first: vec![0.0; count],
        second: vec![0.0; count * count],
        dofs,
        axial: 0.0,
    };
    for (gap, weight) in gaps {
        let share = weight / total;
        average.value += share * gap.value;
        average.axial += share * gap.axial;
        let place = |dof: &usize| average.dofs.iter().position(|d| d == dof).unwrap_or(0);
        let places: Vec<usize> = gap.dofs.iter().map(place).collect();
        for (i, &a) in places.iter().enumerate() {
            average.first[a] += share * gap.first[i];
            for (j, &b) in places.iter().enumerate() {
                average.second[count * a + b] += share * gap.second[places.len() * i + j];
            }
        }
    }
    average
}

impl Placement<'_> {
    /// The gap of a point. `None` if nothing is opposite to it.
    pub(crate) fn gap(&self, point: &GapPoint, opposite: &Opposite) -> Option<Gap> {
        match opposite {
            Opposite::Rigid { shape, side } => self.rigid_gap(point, *shape, *side),
            Opposite::Surface(curve) => match self.kinematics {
                Kinematics::Finite => self.surface_gap(point, curve),
                Kinematics::Linear => self.vertical_gap(point, curve),
            },
        }
    }

    fn rigid_gap(&self, point: &GapPoint, shape: RigidShape, side: f64) -> Option<Gap> {
        let driven = side < 0.0;
        let reference = combine(&point.shape, point.nodes, |n| self.nodes[n]);
        let position = combine(&point.shape, point.nodes, |n| self.current(n));
        let linear = self.kinematics == Kinematics::Linear;
        let [profile, slope, bend] =
            shape.profile(if linear { reference[0] } else { position[0] })?;
        let (slope, bend) = if linear { (0.0, 0.0) } else { (slope, bend) };
        let moved = if driven { self.approach } else { 0.0 };
        // Above the surface (side +1) the pole of the shape is its lowest point; below, its
        // highest.
        let value = side * (moved - position[1]) + profile;
        let mut dofs = Vec::with_capacity(7);
        let mut first = Vec::with_capacity(7);
        for (node, n) in point.nodes.iter().zip(&point.shape) {
            dofs.extend([2 * node, 2 * node + 1]);
            first.extend([n * slope, -side * n]);
        }
        if driven {
            dofs.push(DRIVER);
            first.push(side);
        }
        let count = dofs.len();
        let mut second = vec![0.0; count * count];
        for (i, a) in point.shape.iter().enumerate() {
            for (j, b) in point.shape.iter().enumerate() {
                second[2 * i * count + 2 * j] = a * b * bend;
            }
        }
        Some(Gap {
            value,
            dofs,
            first,
            second,
            axial: 1.0,
        })
    }

    /// The closest point of a deformed surface. `None` outside its outer end.
    pub(crate) fn nearest(&self, curve: &SurfaceCurve, position: [f64; 2]) -> Option<Nearest> {
        let mut best: Option<(f64, Nearest, bool)> = None;
        for (index, edge) in curve.edges().iter().enumerate() {
            let [a, _, b] = edge.map(|node| self.current(node));
            let length = (b[0] - a[0]).hypot(b[1] - a[1]);
            let to_a = (position[0] - a[0]).hypot(position[1] - a[1]);
            // Lower bound of the distance to the edge: edges bulge by less than a fifth.
            if best
                .as_ref()
                .is_some_and(|(distance, ..)| to_a - 1.2 * length > *distance)
            {
                continue;
            }
            let xi = self.closest(curve, index, position);
            let at = curve.at(index, xi);
            let [r, z] = at.sum(&at.position, |n| self.current(n));
            let distance = (position[0] - r).hypot(position[1] - z);
            if best.as_ref().is_none_or(|(least, ..)| distance < *least) {
                let beyond = index + 1 == curve.edges().len() && xi >= 1.0;
                best = Some((distance, Nearest { at, xi }, beyond));
            }
        }
        let (_, nearest, beyond) = best?;
        (!beyond).then_some(nearest)
    }

    /// Distance to the closest point of the deformed surface, along its normal.
    fn surface_gap(&self, point: &GapPoint, curve: &SurfaceCurve) -> Option<Gap> {
        let position = combine(&point.shape, point.nodes, |n| self.current(n));
        let Nearest { at, xi } = self.nearest(curve, position)?;
        let on_curve = at.sum(&at.position, |n| self.current(n));
        let along = at.sum(&at.first, |n| self.current(n));
        let bend = at.sum(&BEND, |n| self.current(n));
        let offset = [position[0] - on_curve[0], position[1] - on_curve[1]];
        let metric = along[0] * along[0] + along[1] * along[1];
        let scale = curve.side / metric.sqrt();
        let normal = [along[1] * scale, -along[0] * scale];
        let value = offset[0] * normal[0] + offset[1] * normal[1];
        let curvature = bend[0] * normal[0] + bend[1] * normal[1];
        let denominator = metric - value * curvature;
        let mut relative = Relative::new(point, &at, normal, along);
        // At a kink between edges, or deep inside a strongly curved surface, the closest point does
        // not slide or is not unique. The second derivative is then omitted.
        if xi.abs() < 1.0 && denominator > 0.1 * metric {
            let bent = curvature / metric;
            relative.fill_second(|slip_i, turn_i, slip_j, turn_j| {
                -(slip_i * turn_j
                    + turn_i * slip_j
                    + value * turn_i * turn_j
                    + bent * slip_i * slip_j)
                    / denominator
            });
        }
        Some(relative.gap(value, normal))
    }

    /// Parameter of the closest point on an edge, limited to [−1, 1].
    fn closest(&self, curve: &SurfaceCurve, edge: usize, point: [f64; 2]) -> f64 {
        let [a, _, b] = curve.edges()[edge].map(|node| self.current(node));
        let chord = [b[0] - a[0], b[1] - a[1]];
        let square = chord[0] * chord[0] + chord[1] * chord[1];
        let along = (point[0] - a[0]) * chord[0] + (point[1] - a[1]) * chord[1];
        let mut xi = (2.0 * along / square - 1.0).clamp(-1.0, 1.0);
        // Newton's method on (x − x(ξ)) · x'(ξ) = 0. Edges are nearly straight, so a few steps are
        // enough.
        for _ in 0..20 {
            let at = curve.at(edge, xi);
            let position = at.sum(&at.position, |n| self.current(n));
            let slope = at.sum(&at.first, |n| self.current(n));
            let bend = at.sum(&BEND, |n| self.current(n));
            let offset = [point[0] - position[0], point[1] - position[1]];
            let metric = slope[0] * slope[0] + slope[1] * slope[1];
            let curved = metric - offset[0] * bend[0] - offset[1] * bend[1];
            // Far from a strongly curved edge the derivative may vanish; then only the metric is
            // used.
            let divisor = if curved > 0.1 * metric {
                curved
            } else {
                metric
            };
            let step = (offset[0] * slope[0] + offset[1] * slope[1]) / divisor;
            let next = (xi + step).clamp(-1.0, 1.0);
            if (next - xi).abs() < 1e-15 {
                return next;
            }
            xi = next;
        }
        xi
    }

    /// Edge and parameter of the surface point at a reference radius.
    pub(crate) fn opposite(&self, curve: &SurfaceCurve, radius: f64) -> Option<(usize, f64)> {
        let edge = curve.edges().iter().position(|edge| {
            let [a, _, b] = edge.map(|node| self.nodes[node][0]);
            a <= radius && radius <= b
        })?;
        let [a, _, b] = curve.edges()[edge].map(|node| self.nodes[node][0]);
        let mut xi = 2.0 * (radius - a) / (b - a) - 1.0;
        for _ in 0..5 {
            let at = curve.at(edge, xi);
            let [r, _] = at.sum(&at.position, |n| self.nodes[n]);
            let [slope, _] = at.sum(&at.first, |n| self.nodes[n]);
            xi += (radius - r) / slope;
        }
        Some((edge, xi))
    }

    /// Height above the undeformed surface at the same radius, with both displaced along z.
    fn vertical_gap(&self, point: &GapPoint, curve: &SurfaceCurve) -> Option<Gap> {
        let reference = combine(&point.shape, point.nodes, |n| self.nodes[n]);
        let moved = combine(&point.shape, point.nodes, |n| self.moved(n));
        let (edge, xi) = self.opposite(curve, reference[0])?;
        let at = curve.at(edge, xi);
        let [_, z] = at.sum(&at.position, |n| self.nodes[n]);
        let [_, w] = at.sum(&at.position, |n| self.moved(n));
        // The outward normal of a surface above points downwards.
        let up = -curve.side;
        let value = up * (reference[1] + moved[1] - z - w);
        Some(Relative::new(point, &at, [0.0, up], [0.0; 2]).gap(value, [0.0, up]))
    }
}

/// Derivatives of a point's displacement relative to a curve point, by the nodal components.
struct Relative {
    dofs: Vec<usize>,
    /// Component along the normal.
    first: Vec<f64>,
    /// Component along the curve.
    slip: Vec<f64>,
    /// Rotation of the curve.
    turn: Vec<f64>,
    second: Vec<f64>,
}

impl Relative {
    fn new(point: &GapPoint, at: &CurvePoint, normal: [f64; 2], along: [f64; 2]) -> Self {
        let mut relative = Self {
            dofs: Vec::with_capacity(12),
            first: Vec::with_capacity(12),
            slip: Vec::with_capacity(12),
            turn: Vec::with_capacity(12),
            second: vec![0.0; 144],
        };
        let own = point
            .nodes
            .iter()
            .zip(point.shape)
            .map(|(node, n)| (*node, n, 0.0));
        let weights = at.position.iter().zip(&at.first);
        let other = at
            .nodes
            .iter()
            .zip(weights)
            .map(|(node, (n, dn))| (*node, -n, *dn));
        for (node, n, dn) in own.chain(other) {
            for k in 0..2 {
                relative.dofs.push(2 * node + k);
                relative.first.push(n * normal[k]);
                relative.slip.push(n * along[k]);
                relative.turn.push(dn * normal[k]);
            }
        }
        relative
    }

    fn fill_second(&mut self, value: impl Fn(f64, f64, f64, f64) -> f64) {
        let count = self.dofs.len();
        for i in 0..count {
            for j in 0..count {
                self.second[count * i + j] =
                    value(self.slip[i], self.turn[i], self.slip[j], self.turn[j]);
            }
        }
    }

    fn gap(self, value: f64, normal: [f64; 2]) -> Gap {
        Gap {
            value,
            dofs: self.dofs,
            first: self.first,
            second: self.second,
            axial: normal[1].abs(),
        }
    }
}

/// A node of a contact surface that touches or may touch.
#[derive(Debug, Clone)]
pub(crate) struct Candidate {
    /// Index of the contact node.
    pub index: usize,
    pub gap: Gap,
    /// λ − ε g: the pressure per reference area, if positive.
    pub pressure: f64,
    /// Slip from the anchor. `None` if the node does not stick.
    pub slip: Option<Slip>,
}

impl ElementModel {
    /// The geometry for the contact evaluation in a state.
    pub(crate) fn placement<'a>(&'a self, fields: &'a ModelFields) -> Placement<'a> {
        Placement {
            kinematics: self.kinematics,
            nodes: &self.nodes,
            displacement: &fields.displacement,
            approach: fields.approach,
        }
    }

    /// Contact nodes that touch, or are closer than two spacings plus `margin`.
    pub(crate) fn candidates(&self, fields: &ModelFields, margin: f64) -> Vec<Candidate> {
        let placement = self.placement(fields);
        let points = self.contact_points(fields);
        let mut around: Vec<Vec<(Gap, f64)>> = vec![Vec::new(); self.contact_nodes.len()];
        for point in &points {
            // Points with nothing opposite to them are open.
            if let Some(gap) = placement.gap(point, &self.opposites[point.pair]) {
                let [(first, weight), (second, other)] = point.shares;
                around[first].push((gap.clone(), weight));
                around[second].push((gap, other));
            }
        }
        let mut candidates = Vec::new();
        for (index, (node, around)) in self.contact_nodes.iter().zip(&around).enumerate() {
            let total: f64 = around.iter().map(|(_, weight)| weight).sum();
            // A node at the rim of a punch has half of its surroundings under it.
            if total < LEAST_SHARE * node.weight {
                continue;
            }
            let weighted = around.iter().map(|(gap, weight)| gap.value * weight);
            let value = weighted.sum::<f64>() / total;
            if value < 2.0 * node.spacing + margin {
                candidates.push(Candidate {
                    index,
                    gap: averaged(around, total),
                    pressure: fields.multipliers[index] - node.penalty * value,
                    slip: (fields.anchors.get(index)).and_then(|anchor| {
                        anchor
                            .as_ref()
                            .map(|anchor| anchor.slip(&fields.displacement, fields.approach))
                    }),
                });
            }
        }
        candidates
    }

    /// The points at which gaps are measured in a state.
    pub(crate) fn contact_points(&self, fields: &ModelFields) -> Vec<GapPoint> {
        let placement = self.placement(fields);
        let mut points = Vec::with_capacity(3 * self.segments.len());
        for segment in &self.segments {
            let cuts = match (&self.opposites[segment.pair], self.kinematics) {
                (Opposite::Surface(curve), Kinematics::Finite) => placement.cuts(segment, curve),
                _ => Vec::new(),
            };
            points.extend(segment.points(&cuts, &self.nodes));
        }
        points
    }
}
