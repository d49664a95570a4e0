//! Mapped meshes of nine-node quadrilaterals in the half plane (r, z). They are made for bodies
//! that touch a sensor, and for a tissue block with a spherical inclusion under the flat face of a
//! guide.

use crate::spacing::{arc_fractions, graded, graded_up_to, grow, with_middles};
use std::collections::BTreeMap;

/// Distance between the core of a ball and the first shell, relative to an element. With 0.02 the
/// mesh of sixteen elements has a degenerate one; with 0.05 and 0.2 all meshes from 2 to 24
/// elements are valid (test `a_ball_can_be_meshed_at_any_fineness`). A larger value compresses the
/// corner of the core.
const CORNER_ROOM: f64 = 0.05;

/// Maximum number of elements along an eighth of the inclusion's circumference for sliding faces.
/// Finer meshes have flatter elements at the rim, and with seven, those of 0.045 are inverted at an
/// approach of several tenths of the height.
const SLIDING_FINENESS: f64 = 5.0;

/// Shortest element at the rim of a sliding face, relative to the face radius. Shared displacements
/// become less valid for finer elements as the face sinks in. Elements of 0.02 are inverted at a
/// tenth of the block's height, and the pressure within three quarters of the face jumps by 1 %.
/// Until then it agrees with that of finer elements within 0.05 %.
const SLIDING_RIM: f64 = 0.045;

/// Parts of a body's boundary to which conditions and contact refer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) enum Boundary {
    /// The surface that may touch another body.
    Contact,
    /// The axis of revolution, r = 0.
    Axis,
    /// The surface that is held or driven: the glass of a guide, or the equator of a half ball.
    Base,
    /// The far side of an object, held by a stage.
    Stage,
    /// The free outer surface.
    Side,
    /// The interface between two bonded bodies that share their nodes.
    Interface,
}

/// A mesh of nine-node quadrilaterals in the half plane (r, z), r ≥ 0, of a body of revolution.
///
/// Each element belongs to a region, numbered from zero, with one material. The edges of a boundary
/// are oriented with the body on their left.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Mesh {
    /// Reference coordinates (r, z) of the nodes, in metres.
    pub nodes: Vec<[f64; 2]>,
    /// Nodes of each element: corners counter-clockwise, then the midpoints of the edges in the
    /// same order, then the centre.
    pub elements: Vec<[usize; 9]>,
    pub regions: Vec<usize>,
    pub boundaries: BTreeMap<Boundary, Vec<[usize; 3]>>,
}

/// Local nodes of the four edges: start, middle, end, counter-clockwise.
const EDGES: [[usize; 3]; 4] = [[0, 4, 1], [1, 5, 2], [2, 6, 3], [3, 7, 0]];

impl Mesh {
    /// Number of regions.
    pub(crate) fn region_count(&self) -> usize {
        self.regions.iter().max().map_or(0, |last| last + 1)
    }

    /// Names each outer edge off the axis by the result of `name` for its middle node.
    fn name_outer_edges(&mut self, name: impl Fn([f64; 2]) -> Boundary) {
        let mut uses: BTreeMap<usize, usize> = BTreeMap::new();
        for element in &self.elements {
            for edge in EDGES {
                *uses.entry(element[edge[1]]).or_default() += 1;
            }
        }
        for element in &self.elements {
            for edge in EDGES {
                let middle = element[edge[1]];
                if uses[&middle] == 1 {
                    let nodes = edge.map(|local| element[local]);
                    let boundary = match self.nodes[middle] {
                        [r, _] if r <= 0.0 => Boundary::Axis,
                        node => name(node),
                    };
                    self.boundaries.entry(boundary).or_default().push(nodes);
                }
            }
        }
        let nodes = &self.nodes;
        for edges in self.boundaries.values_mut() {
            // Ordered by radius, so that pressures are listed from the axis outwards.
            edges.sort_by(|a, b| {
                let (a, b) = (nodes[a[1]], nodes[b[1]]);
                a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1]))
            });
        }
    }

    /// Names the edges between elements for which `inside` is true and the others. They are
    /// oriented with the inside elements on their left.
    fn name_interface(&mut self, boundary: Boundary, inside: impl Fn(usize) -> bool) {
        let mut outside_middles = std::collections::BTreeSet::new();
        for (element, &region) in self.elements.iter().zip(&self.regions) {
            if !inside(region) {
                outside_middles.extend(EDGES.map(|edge| element[edge[1]]));
            }
        }
        let mut edges = Vec::new();
        for (element, &region) in self.elements.iter().zip(&self.regions) {
            if inside(region) {
                for edge in EDGES {
                    if outside_middles.contains(&element[edge[1]]) {
                        edges.push(edge.map(|local| element[local]));
                    }
                }
            }
        }
        edges.sort_by(|a, b| self.nodes[a[1]][0].total_cmp(&self.nodes[b[1]][0]));
        self.boundaries.insert(boundary, edges);
    }
}

/// Assembles meshes from mapped blocks. Coincident nodes are merged.
#[derive(Debug, Default)]
struct MeshBuilder {
    nodes: Vec<[f64; 2]>,
    elements: Vec<[usize; 9]>,
    regions: Vec<usize>,
}

impl MeshBuilder {
    /// Adds a block of `columns` by `rows` elements whose node (i, j), i ≤ 2 columns, j ≤ 2 rows,
    /// is at `position(i, j)`. The directions i, j must be oriented counter-clockwise.
    pub(crate) fn block(
        &mut self,
        columns: usize,
        rows: usize,
        region: usize,
        position: impl Fn(usize, usize) -> [f64; 2],
    ) {
        let first = self.nodes.len();
        let stride = 2 * columns + 1;
        for j in 0..=2 * rows {
            for i in 0..stride {
                self.nodes.push(position(i, j));
            }
        }
        let node = |i: usize, j: usize| first + j * stride + i;
        for row in 0..rows {
            for column in 0..columns {
                let (i, j) = (2 * column, 2 * row);
                self.elements.push([
                    node(i, j),
                    node(i + 2, j),
                    node(i + 2, j + 2),
                    node(i, j + 2),
                    node(i + 1, j),
                    node(i + 2, j + 1),
                    node(i + 1, j + 2),
                    node(i, j + 1),
                    node(i + 1, j + 1),
                ]);
                self.regions.push(region);
            }
        }
    }

    /// Adds a rectangle with elements between the lines.
    pub(crate) fn rectangle(&mut self, r_lines: &[f64], z_lines: &[f64], region: usize) {
        let (r, z) = (with_middles(r_lines), with_middles(z_lines));
        self.block(r_lines.len() - 1, z_lines.len() - 1, region, |i, j| {
            [r[i], z[j]]
        });
    }

    /// Adds a block between four sides given by their nodes (bottom and top along i, left and right
    /// along j) by transfinite interpolation. The blending uses the arc lengths of the sides, so
    /// that their grading continues inside.
    fn transfinite(
        &mut self,
        bottom: &[[f64; 2]],
        top: &[[f64; 2]],
        left: &[[f64; 2]],
        right: &[[f64; 2]],
        region: usize,
    ) {
        debug_assert_eq!(bottom.len(), top.len());
        debug_assert_eq!(left.len(), right.len());
        let (bottom_s, top_s) = (arc_fractions(bottom), arc_fractions(top));
        let (left_s, right_s) = (arc_fractions(left), arc_fractions(right));
        let (last_i, last_j) = (bottom.len() - 1, left.len() - 1);
        self.block(last_i / 2, last_j / 2, region, |i, j| {
            // Intersection of the line from bottom to top with the line from left to right.
            let du = top_s[i] - bottom_s[i];
            let dv = right_s[j] - left_s[j];
            let u = (bottom_s[i] + left_s[j] * du) / (1.0 - du * dv);
            let v = left_s[j] + u * dv;
            core::array::from_fn(|k| {
                let across = (1.0 - v) * bottom[i][k] + v * top[i][k];
                let along = (1.0 - u) * left[j][k] + u * right[j][k];
                let corners = (1.0 - u) * ((1.0 - v) * bottom[0][k] + v * top[0][k])
                    + u * ((1.0 - v) * bottom[last_i][k] + v * top[last_i][k]);
                across + along - corners
            })
        });
    }

    /// Builds the mesh, without boundaries.
    pub(crate) fn build(self) -> Mesh {
        // Coincident nodes of adjacent blocks differ only by rounding, and distinct ones by a
        // fraction of an element: a ten-millionth of the extent separates the cases.
        let extent = (self.nodes.iter()).fold(0.0_f64, |m, p| m.max(p[0].abs()).max(p[1].abs()));
        let cell = 1e-7 * extent.max(f64::MIN_POSITIVE);
        let mut index: BTreeMap<(i64, i64), usize> = BTreeMap::new();
        let mut nodes: Vec<[f64; 2]> = Vec::new();
        let mut renumbered = Vec::with_capacity(self.nodes.len());
        for point in &self.nodes {
            let key = point.map(|x| (x / cell).round() as i64);
            let neighbours = (-1..=1).flat_map(|i| (-1..=1).map(move |j| (i, j)));
            let known = neighbours
                .filter_map(|(i, j)| index.get(&(key[0] + i, key[1] + j)))
                .next()
                .copied();
            renumbered.push(known.unwrap_or_else(|| {
                index.insert((key[0], key[1]), nodes.len());
                nodes.push(*point);
                nodes.len() - 1
            }));
        }
        // A node within rounding of the axis is moved onto it.
        for node in &mut nodes {
            if node[0].abs() < cell {
                node[0] = 0.0;
            }
        }
        let elements = self.elements.into_iter();
        Mesh {
            nodes,
            elements: elements.map(|e| e.map(|node| renumbered[node])).collect(),
            regions: self.regions,
            boundaries: BTreeMap::new(),
        }
    }
}

/// Element sizes of a body with a contact around its axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ContactMesh {
    /// Radius of the core with uniform elements, about half the smallest contact radius.
    pub inner: f64,
    /// Number of elements across the core.
    pub count: usize,
    /// Growth factor of the elements outwards.
    pub growth: f64,
}

impl ContactMesh {
    /// Distance from the pole to the corner of the core inside the body: outside the ends of the
    /// core, inside the first shell.
    fn corner(&self) -> f64 {
        self.inner * (1.0 + 0.8 / self.count as f64).min(1.16)
    }
}

/// A spheroidal inclusion on the axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct InclusionSize {
    /// Half axes across the axis and along it.
    pub half_axes: [f64; 2],
    /// Distance from the surface of the block to the top of the inclusion.
    pub depth: f64,
}

/// The lowest point of a body: a core of quadrilaterals with shells around it.
struct Pole<S> {
    /// Number of elements along each side of the core.
    elements: usize,
    /// Surface parameter of the end of the core.
    core: f64,
    /// Upper end of the core on the axis.
    axis: [f64; 2],
    /// Corner of the core inside the body.
    corner: [f64; 2],
    /// The surface as a function of its parameter, which is zero at the pole.
    surface: S,
    /// Height of the flat end of the body.
    height: f64,
}

impl<S: Fn(f64) -> [f64; 2]> Pole<S> {
    /// Builds the mesh with shells at `parameters` (those of elements' ends and midpoints). `shell`
    /// gives node k of 4m + 1 from the surface to the axis.
    fn mesh(&self, parameters: &[f64], shell: impl Fn(f64, usize) -> [f64; 2]) -> Mesh {
        let m = self.elements;
        let line = |a: [f64; 2], b: [f64; 2]| -> Vec<[f64; 2]> {
            (0..=2 * m)
                .map(|k| {
                    let t = k as f64 / (2 * m) as f64;
                    [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])]
                })
                .collect()
        };
        let bottom: Vec<[f64; 2]> = (0..=2 * m)
            .map(|k| (self.surface)(self.core * k as f64 / (2 * m) as f64))
            .collect();
        let left = line([0.0, 0.0], self.axis);
        let right = line(bottom[2 * m], self.corner);
        let top = line(self.axis, self.corner);
        let mut builder = MeshBuilder::default();
        builder.transfinite(&bottom, &top, &left, &right, 0);
        // Block between the outer sides of the core and the first shell.
        let outer: Vec<[f64; 2]> = right
            .iter()
            .copied()
            .chain(top.iter().rev().skip(1).copied())
            .collect();
        let start = parameters[0];
        builder.block(1, 2 * m, 0, |i, j| {
            let (a, b) = (outer[j], shell(start, j));
            let t = 0.5 * i as f64;
            if j == 0 {
                return (self.surface)(self.core + t * (start - self.core));
            }
            [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])]
        });
        builder.block(parameters.len() / 2, 2 * m, 0, |i, j| {
            shell(parameters[i], j)
        });
        let mut mesh = builder.build();
        mesh.name_outer_edges(|[_, z]| {
            if z >= self.height * (1.0 - 1e-12) {
                Boundary::Base
            } else {
                Boundary::Contact
            }
        });
        mesh
    }
}

impl Mesh {
    /// The half of a ball of radius `radius` on the side of its pole, which is at the origin. The
    /// centre of the ball is at z = `radius`, and its equator is [`Boundary::Base`].
    ///
    /// A core of quadrilaterals at the pole is surrounded by shells along circles that meet the
    /// axis and the surface of the ball at right angles.
    pub(crate) fn half_ball(radius: f64, size: ContactMesh) -> Self {
        let m = size.count;
        let first = size.inner / m as f64;
        // Angles of the shells along the surface. The first surrounds the core.
        let start = (size.inner + first) / radius;
        let limit = core::f64::consts::FRAC_PI_2;
        let largest = 1.6 * limit / (2.0 * m as f64);
        let mut angles = vec![start];
        grow(&mut angles, first / radius, size.growth, largest, limit);
        let angles = with_middles(&angles);
        // Node k of 4m + 1 from the surface to the axis, on the shell at `angle`.
        let shell = |angle: f64, k: usize| -> [f64; 2] {
            let v = k as f64 / (4 * m) as f64;
            if angle >= limit {
                return [(1.0 - v) * radius, radius];
            }
            // The circle about (0, −c) that meets the ball at a right angle.
            let c = radius * (1.0 / angle.cos() - 1.0);
            let circle = radius * angle.tan();
            let from_axis = (limit - angle) * (1.0 - v);
            // −c + circle · cos, without cancellation for large circles.
            let top = radius * (1.0 - (1.0 - angle.sin()) / angle.cos());
            let half = (0.5 * from_axis).sin();
            debug_assert!(c >= 0.0);
            [circle * from_axis.sin(), top - 2.0 * circle * half * half]
        };
        // The shells are closer to the pole inside the ball than on its surface: on a fine mesh
        // they would cut the corner.
        let [r, z] = shell(start, 2 * m);
        let corner = size.corner().min(r.hypot(z) - CORNER_ROOM * first);
        let pole = Pole {
            elements: m,
            core: size.inner / radius,
            axis: [0.0, size.inner],
            // The free corner of the core is inside that of a square, which opens the angle there.
            corner: [core::f64::consts::FRAC_1_SQRT_2 * corner; 2],
            surface: |angle: f64| {
                let half = (0.5 * angle).sin();
                [radius * angle.sin(), 2.0 * radius * half * half]
            },
            height: radius,
        };
        pole.mesh(&angles, shell)
    }

    /// A cylinder of one region. Its lower end is [`Boundary::Contact`], its upper end
    /// [`Boundary::Base`].
    pub(crate) fn cylinder(r_lines: &[f64], z_lines: &[f64]) -> Self {
        let mut builder = MeshBuilder::default();
        builder.rectangle(r_lines, z_lines, 0);
        let mut mesh = builder.build();
        let (bottom, top) = (z_lines[0], z_lines[z_lines.len() - 1]);
        mesh.name_outer_edges(|[_, z]| {
            if z <= bottom {
                Boundary::Contact
            } else if z >= top {
                Boundary::Base
            } else {
                Boundary::Side
            }
        });
        mesh
    }

    /// A cone with its tip at the origin. Its side is [`Boundary::Contact`], and its flat end at
    /// z = `height` is [`Boundary::Base`].
    ///
    /// A core of quadrilaterals at the tip is surrounded by shells that meet the axis at right
    /// angles and become flat towards the base.
    pub(crate) fn cone(half_angle: f64, height: f64, size: ContactMesh) -> Self {
        let m = size.count;
        let (sin, cos) = half_angle.sin_cos();
        let side = height / cos;
        let first = size.inner / m as f64;
        let start = size.inner + first;
        let largest = 1.6 * side / (2.0 * m as f64);
        let mut distances = vec![start];
        grow(&mut distances, first, size.growth, largest, side);
        // Height on the axis of the shell at a distance along the side: the distance itself near
        // the tip, and the height of the cone at its end.
        let on_axis = |s: f64| s / (1.0 + s / side * (1.0 / cos - 1.0));
        let shell = |s: f64, k: usize| -> [f64; 2] {
            let v = 1.0 - k as f64 / (4 * m) as f64;
            if s >= side {
                return [v * side * sin, height];
            }
            let axis = on_axis(s);
            [v * s * sin, axis + (s * cos - axis) * v * v]
        };
        let axis = on_axis(size.inner);
        let pole = Pole {
            elements: m,
            core: size.inner,
            axis: [0.0, axis],
            // Halfway between the shell at the ends of the core and the first shell.
            corner: shell(size.inner + 0.5 * first, 2 * m),
            surface: |s: f64| [s * sin, s * cos],
            height,
        };
        pole.mesh(&with_middles(&distances), shell)
    }

    /// Bonded layers below z = 0, the first on top, with thicknesses `thickness` and radius
    /// `radius`. Each layer is a region.
    pub(crate) fn layered_disc(
        thickness: &[f64],
        r_lines: &[f64],
        first: f64,
        growth: f64,
    ) -> Self {
        let mut builder = MeshBuilder::default();
        let mut top = 0.0;
        let mut step = first;
        for (region, &thickness) in thickness.iter().enumerate() {
            let mut lines = graded(top, top - thickness, step, growth);
            if let [.., a, b] = lines[..] {
                step = (a - b) * growth;
            }
            lines.reverse();
            builder.rectangle(r_lines, &lines, region);
            top -= thickness;
        }
        let mut mesh = builder.build();
        mesh.name_outer_edges(|[_, z]| {
            if z >= 0.0 {
                Boundary::Contact
            } else if z <= top * (1.0 - 1e-9) {
                Boundary::Base
            } else {
                Boundary::Side
            }
        });
        mesh
    }
}

/// Lines of the cross-section, at which elements end.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct BlockMesh {
    pub block_height: f64,
    pub block_radius: f64,
    pub disc_radius: f64,
    /// Thicknesses of the guide's layers, the one on the block first.
    pub layers: Vec<f64>,
    pub inclusion: Option<InclusionSize>,
    /// Whether guide and block share the nodes of their interface.
    pub bonded: bool,
    /// Elements along an eighth of the inclusion's circumference, which determines all other sizes.
    pub fineness: usize,
}

/// The meshes of guide and block. If they are bonded, both are in the first.
pub(crate) struct BlockMeshes {
    pub guide: Mesh,
    pub block: Option<Mesh>,
}

impl BlockMesh {
    /// Box around the inclusion with its own grid: radius, lower and upper height.
    fn cell(&self) -> Option<(InclusionSize, [f64; 3])> {
        let inclusion = self.inclusion?;
        let ([radius, half_height], depth) = (inclusion.half_axes, inclusion.depth);
        let bottom = depth + 2.0 * half_height;
        // Margins of the size of the ellipse's elements, if there is space.
        let margin = |half_axis: f64, room: f64| (0.4 * half_axis).min(0.5 * room);
        let cell = [
            radius + margin(radius, self.disc_radius - radius),
            depth - margin(half_height, depth),
            bottom + margin(half_height, self.block_height - bottom),
        ];
        Some((inclusion, cell))
    }

    pub(crate) fn build(&self) -> BlockMeshes {
        let cell = self.cell();
        // Elements of the guide's face from the axis to its rim, finest at the rim, where the
        // traction is singular.
        let face = self.disc_radius / (2.5 * self.fineness as f64);
        let inner = cell.map_or(0.5 * self.disc_radius, |(_, [radius, _, _])| radius);
        // Above a wide inclusion, elements must not be longer than elsewhere.
        let n = self.fineness.max((inner / face).ceil() as usize);
        let shortest = if self.bonded {
            0.0
        } else {
            SLIDING_RIM * (self.fineness as f64 / SLIDING_FINENESS).max(1.0)
        };
        let first = (0.25 * face).max(shortest * self.disc_radius);
        let mut rim = graded_up_to(self.disc_radius, inner, first, 1.35, face);
        rim.reverse();
        let core: Vec<f64> = (0..=n).map(|k| inner * k as f64 / n as f64).collect();
        let beyond = graded(self.disc_radius, self.block_radius, first, 1.7);
        let heights = match cell {
            Some((_, [_, low, high])) => {
                let size = (high - low) / (2 * n) as f64;
                let steps = (low / size).ceil().max(2.0) as usize;
                let near = (0..=steps).map(|k| low * k as f64 / steps as f64).collect();
                let far = graded(high, self.block_height, size, 1.5);
                let middle = (0..=2 * n).map(|k| low + size * k as f64).collect();
                [near, middle, far]
            }
            None => {
                let middle = 0.4 * self.block_height;
                [
                    graded(0.0, middle, face, 1.15),
                    graded(middle, 0.7 * self.block_height, 2.0 * face, 1.0),
                    graded(0.7 * self.block_height, self.block_height, 2.0 * face, 1.0),
                ]
            }
        };
        let first_region = if self.bonded { self.layers.len() } else { 0 };
        let mut guide = MeshBuilder::default();
        self.add_guide(&mut guide, &[&core, &rim], face);
        let mut block = MeshBuilder::default();
        let target = if self.bonded { &mut guide } else { &mut block };
        for (row, z_lines) in heights.iter().enumerate() {
            for (column, r_lines) in [&core, &rim, &beyond].into_iter().enumerate() {
                match cell {
                    Some((inclusion, cell)) if row == 1 && column == 0 => {
                        add_cell(target, inclusion, cell, n, first_region);
                    }
                    _ => target.rectangle(r_lines, z_lines, first_region),
                }
            }
        }
        let mut guide = guide.build();
        self.name(&mut guide);
        if self.bonded {
            guide.name_interface(Boundary::Interface, |region| region < first_region);
            return BlockMeshes { guide, block: None };
        }
        let mut block = block.build();
        self.name(&mut block);
        BlockMeshes {
            guide,
            block: Some(block),
        }
    }

    fn add_guide(&self, guide: &mut MeshBuilder, r_lines: &[&[f64]], face: f64) {
        let mut top = 0.0;
        let mut step = 0.5 * face;
        for (region, &thickness) in self.layers.iter().enumerate() {
            let mut lines = graded(top, top - thickness, step, 1.3);
            if let [.., a, b] = lines[..] {
                step = a - b;
            }
            lines.reverse();
            for r_lines in r_lines {
                guide.rectangle(r_lines, &lines, region);
            }
            top -= thickness;
        }
    }

    fn name(&self, mesh: &mut Mesh) {
        let glass = -self.layers.iter().sum::<f64>();
        let (stage, disc) = (self.block_height, self.disc_radius);
        let is_bonded = self.bonded;
        mesh.name_outer_edges(|[r, z]| {
            // The positions come from the same expressions as the limits, so they differ only by
            // rounding.
            if z <= glass * (1.0 - 1e-9) {
                Boundary::Base
            } else if z >= stage * (1.0 - 1e-9) {
                Boundary::Stage
            } else if z.abs() < 1e-9 * stage && (!is_bonded || r < disc) {
                Boundary::Contact
            } else {
                Boundary::Side
            }
        });
    }
}

/// The box [0, r] × [low, high] with the inclusion: a core rectangle, shells to the ellipse, and
/// shells to the box. The region is `region` outside and `region + 1` inside.
fn add_cell(
    builder: &mut MeshBuilder,
    inclusion: InclusionSize,
    [width, low, high]: [f64; 3],
    n: usize,
    region: usize,
) {
    let [radius, half_height] = inclusion.half_axes;
    let centre = inclusion.depth + half_height;
    // A core of half the size leaves elements of similar size.
    let core = [0.5 * radius, 0.5 * half_height];
    let total = 4 * n;
    // Node k of 8n + 1 along the three sides of a box, from its lower end on the axis.
    let along_box = |k: usize, width: f64, low: f64, high: f64| -> [f64; 2] {
        let t = k as f64 / (2 * n) as f64;
        if t <= 1.0 {
            [t * width, low]
        } else if t <= 3.0 {
            [width, low + 0.5 * (t - 1.0) * (high - low)]
        } else {
            [(4.0 - t) * width, high]
        }
    };
    let on_core = |k: usize| {
        // The sides bulge towards the ellipse, which opens the angles at the corners.
        let [r, z] = along_box(k, core[0], -core[1], core[1]);
        let bulge = 0.15 * (1.0 - (r / core[0]).powi(2)) + 0.15 * (1.0 - (z / core[1]).powi(2));
        let scale = 0.9 * (1.0 + bulge);
        [r * scale, centre + z * scale]
    };
    let on_ellipse = |k: usize| {
        let angle = core::f64::consts::PI * k as f64 / (2 * total) as f64;
        [radius * angle.sin(), centre - half_height * angle.cos()]
    };
    let between =
        |a: [f64; 2], b: [f64; 2], t: f64| [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])];
    let inner_shells = n.div_ceil(2).max(1);
    builder.block(inner_shells, total, region + 1, |i, j| {
        between(
            on_core(j),
            on_ellipse(j),
            i as f64 / (2 * inner_shells) as f64,
        )
    });
    let outer_shells = n.div_ceil(3).max(1);
    builder.block(outer_shells, total, region, |i, j| {
        let t = i as f64 / (2 * outer_shells) as f64;
        between(on_ellipse(j), along_box(j, width, low, high), t)
    });
    let side = |k: usize| on_core(k);
    let bottom: Vec<[f64; 2]> = (0..=2 * n).map(side).collect();
    let right: Vec<[f64; 2]> = (2 * n..=6 * n).map(side).collect();
    let top: Vec<[f64; 2]> = (6 * n..=8 * n).rev().map(side).collect();
    let (start, end) = (bottom[0], top[0]);
    let left: Vec<[f64; 2]> = (0..=4 * n)
        .map(|k| between(start, end, k as f64 / (4 * n) as f64))
        .collect();
    builder.transfinite(&bottom, &top, &left, &right, region + 1);
}
