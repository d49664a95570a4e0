//! Gaps between a point of a surface and what lies opposite, with their derivatives.

use super::contact::{ContactPoint, Opposite};
use super::curve::{BEND, CurvePoint, SurfaceCurve};
use super::material::Kinematics;
use super::placement::{Placement, combine};
use super::rigid::RigidShape;

/// Stands for the approach among the displacement components of a [`Gap`].
pub(crate) const DRIVER: usize = usize::MAX;

/// A gap and its derivatives by the displacement components `dofs`.
#[derive(Debug, Clone)]
pub(crate) struct Gap {
    pub(crate) value: f64,
    pub(crate) dofs: Vec<usize>,
    pub(crate) first: Vec<f64>,
    /// Row after row.
    pub(crate) second: Vec<f64>,
    /// Axial component of the force by a unit pressure, over the reference area.
    pub(crate) axial: f64,
}

/// The point of a surface that is closest to another.
pub(crate) struct Nearest {
    pub(crate) at: CurvePoint,
    /// Parameter on its edge.
    xi: f64,
}

/// The average of gaps with weights that sum to `total`.
pub(crate) fn averaged(gaps: &[(Gap, f64)], total: f64) -> Gap {
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
    /// The gap of a point, `None` where there is nothing opposite to it.
    pub(crate) fn gap(&self, point: &ContactPoint, opposite: &Opposite) -> Option<Gap> {
        match opposite {
            Opposite::Rigid {
                shape,
                side,
                height,
                driven,
            } => self.rigid_gap(point, *shape, *side, *height, *driven),
            Opposite::Surface(curve) => match self.kinematics {
                Kinematics::Finite => self.surface_gap(point, curve),
                Kinematics::Linear => self.vertical_gap(point, curve),
            },
        }
    }

    fn rigid_gap(
        &self,
        point: &ContactPoint,
        shape: RigidShape,
        side: f64,
        height: f64,
        driven: bool,
    ) -> Option<Gap> {
        let reference = combine(&point.shape, point.nodes, |n| self.nodes[n]);
        let position = combine(&point.shape, point.nodes, |n| self.current(n));
        let linear = self.kinematics == Kinematics::Linear;
        let [profile, slope, bend] =
            shape.profile(if linear { reference[0] } else { position[0] })?;
        let (slope, bend) = if linear { (0.0, 0.0) } else { (slope, bend) };
        let moved = if driven { self.approach } else { 0.0 };
        // Above the surface (side +1) the shape's pole is its lowest point; below, its highest.
        let value = side * (height + moved - position[1]) + profile;
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

    /// The closest point of a deformed surface; `None` beyond its outer end.
    pub(crate) fn nearest(&self, curve: &SurfaceCurve, position: [f64; 2]) -> Option<Nearest> {
        let mut best: Option<(f64, Nearest, bool)> = None;
        for (index, edge) in curve.edges().iter().enumerate() {
            let [a, _, b] = edge.map(|node| self.current(node));
            let length = (b[0] - a[0]).hypot(b[1] - a[1]);
            let to_a = (position[0] - a[0]).hypot(position[1] - a[1]);
            // No point of the edge is nearer than this: edges bulge less than a fifth.
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
    fn surface_gap(&self, point: &ContactPoint, curve: &SurfaceCurve) -> Option<Gap> {
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
        // At a kink between edges, or deep within a strongly bent surface, the closest point does not
        // slide or is not unique: no second derivative.
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

    /// Parameter of an edge's closest point, within [−1, 1].
    fn closest(&self, curve: &SurfaceCurve, edge: usize, point: [f64; 2]) -> f64 {
        let [a, _, b] = curve.edges()[edge].map(|node| self.current(node));
        let chord = [b[0] - a[0], b[1] - a[1]];
        let square = chord[0] * chord[0] + chord[1] * chord[1];
        let along = (point[0] - a[0]) * chord[0] + (point[1] - a[1]) * chord[1];
        let mut xi = (2.0 * along / square - 1.0).clamp(-1.0, 1.0);
        // Newton's method on (x − x(ξ)) · x'(ξ) = 0: edges are nearly straight, few steps do.
        for _ in 0..20 {
            let at = curve.at(edge, xi);
            let position = at.sum(&at.position, |n| self.current(n));
            let slope = at.sum(&at.first, |n| self.current(n));
            let bend = at.sum(&BEND, |n| self.current(n));
            let offset = [point[0] - position[0], point[1] - position[1]];
            let metric = slope[0] * slope[0] + slope[1] * slope[1];
            let curved = metric - offset[0] * bend[0] - offset[1] * bend[1];
            // Far from a strongly bent edge the derivative may vanish: the metric alone then.
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

    /// Edge and parameter of a surface's point at a reference radius.
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

    /// Height over the undeformed surface at the same radius, both displaced along z.
    fn vertical_gap(&self, point: &ContactPoint, curve: &SurfaceCurve) -> Option<Gap> {
        let reference = combine(&point.shape, point.nodes, |n| self.nodes[n]);
        let moved = combine(&point.shape, point.nodes, |n| self.moved(n));
        let (edge, xi) = self.opposite(curve, reference[0])?;
        let at = curve.at(edge, xi);
        let [_, z] = at.sum(&at.position, |n| self.nodes[n]);
        let [_, w] = at.sum(&at.position, |n| self.moved(n));
        // The outward normal of a surface above points down.
        let up = -curve.side;
        let value = up * (reference[1] + moved[1] - z - w);
        Some(Relative::new(point, &at, [0.0, up], [0.0; 2]).gap(value, [0.0, up]))
    }
}

/// Components of the displacement of a point relative to one of a curve, by their nodes'.
struct Relative {
    dofs: Vec<usize>,
    /// Along the normal.
    first: Vec<f64>,
    /// Along the curve.
    slip: Vec<f64>,
    /// The curve's turning.
    turn: Vec<f64>,
    second: Vec<f64>,
}

impl Relative {
    fn new(point: &ContactPoint, at: &CurvePoint, normal: [f64; 2], along: [f64; 2]) -> Self {
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
