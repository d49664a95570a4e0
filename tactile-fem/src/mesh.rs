//! Meshes of nine-node quadrilaterals in the half plane (r, z).

use std::collections::BTreeMap;

/// Parts of a body's boundary that conditions and contact refer to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) enum Boundary {
    /// The surface that may touch another body.
    Contact,
    /// The axis of revolution, r = 0.
    Axis,
    /// The surface that is held or driven: a guide's glass, a half ball's equator.
    Base,
    /// An object's far side, held by a stage.
    Stage,
    /// The free outer surface.
    Side,
    /// The interface between two bonded bodies that share their nodes.
    Interface,
}

/// A mesh of nine-node quadrilaterals in the half plane (r, z), r ≥ 0, of a body of revolution.
///
/// Each element belongs to a region, numbered from zero, that has one material. Edges of a boundary
/// run with the body on their left.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Mesh {
    /// Reference coordinates (r, z) of the nodes, in metres.
    pub(crate) nodes: Vec<[f64; 2]>,
    /// Nodes of each element: corners counter-clockwise, then the middles of the edges in the same order, then the centre.
    pub(crate) elements: Vec<[usize; 9]>,
    pub(crate) regions: Vec<usize>,
    pub(crate) boundaries: BTreeMap<Boundary, Vec<[usize; 3]>>,
}

/// Local nodes of the four edges: start, middle, end, counter-clockwise.
pub(crate) const EDGES: [[usize; 3]; 4] = [[0, 4, 1], [1, 5, 2], [2, 6, 3], [3, 7, 0]];

impl Mesh {
    /// Number of regions.
    pub(crate) fn region_count(&self) -> usize {
        self.regions.iter().max().map_or(0, |last| last + 1)
    }

    /// A rectangle of one region with elements between the given lines; its top is
    /// [`Boundary::Contact`], its bottom [`Boundary::Base`].
    #[cfg(test)]
    pub(crate) fn rectangle(r_lines: &[f64], z_lines: &[f64]) -> Self {
        let mut builder = MeshBuilder::default();
        builder.rectangle(r_lines, z_lines, 0);
        let mut mesh = builder.build();
        let (bottom, top) = (z_lines[0], z_lines[z_lines.len() - 1]);
        mesh.name_outer_edges(|[r, z]| {
            if r <= 0.0 {
                Boundary::Axis
            } else if z <= bottom {
                Boundary::Base
            } else if z >= top {
                Boundary::Contact
            } else {
                Boundary::Side
            }
        });
        mesh
    }

    /// Gives every outer edge the name that `name` finds for its middle node.
    pub(crate) fn name_outer_edges(&mut self, name: impl Fn([f64; 2]) -> Boundary) {
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
                    let boundary = name(self.nodes[middle]);
                    self.boundaries.entry(boundary).or_default().push(nodes);
                }
            }
        }
        let nodes = &self.nodes;
        for edges in self.boundaries.values_mut() {
            // Ordered by radius, so that pressures come out from the axis outwards.
            edges.sort_by(|a, b| {
                let (a, b) = (nodes[a[1]], nodes[b[1]]);
                a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1]))
            });
        }
    }

    /// Names the edges between elements for which `inside` holds and the others; they run with the
    /// elements inside on their left.
    pub(crate) fn name_interface(&mut self, boundary: Boundary, inside: impl Fn(usize) -> bool) {
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

/// Puts meshes together from mapped blocks; nodes that coincide are merged.
#[derive(Debug, Default)]
pub(crate) struct MeshBuilder {
    nodes: Vec<[f64; 2]>,
    elements: Vec<[usize; 9]>,
    regions: Vec<usize>,
}

impl MeshBuilder {
    /// Adds a block of `columns` by `rows` elements whose node (i, j), i ≤ 2 columns, j ≤ 2 rows, is
    /// at `position(i, j)`; i then j must turn counter-clockwise.
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
    /// along j) by transfinite interpolation, blended by the sides' arc lengths so that their
    /// grading carries inwards.
    pub(crate) fn transfinite(
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
            // Where the line from bottom to top crosses the one from left to right.
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

    /// The mesh, without boundaries.
    pub(crate) fn build(self) -> Mesh {
        // Coincident nodes of neighbouring blocks differ by rounding alone, distinct ones by a
        // fraction of an element: a ten-millionth of the extent tells them apart.
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
        // A node within rounding of the axis is on it.
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

/// Lines with the middle of each interval between them.
pub(crate) fn with_middles(lines: &[f64]) -> Vec<f64> {
    let mut all = vec![lines[0]];
    for pair in lines.windows(2) {
        all.push(0.5 * (pair[0] + pair[1]));
        all.push(pair[1]);
    }
    all
}

/// Distance along a polyline over its length.
fn arc_fractions(points: &[[f64; 2]]) -> Vec<f64> {
    let mut lengths = vec![0.0];
    for pair in points.windows(2) {
        let step = (pair[1][0] - pair[0][0]).hypot(pair[1][1] - pair[0][1]);
        lengths.push(lengths[lengths.len() - 1] + step);
    }
    let total = lengths[lengths.len() - 1];
    lengths.into_iter().map(|length| length / total).collect()
}

/// Lines from `start` to `end`: steps begin at `first` and grow by `growth`, scaled to fit.
pub(crate) fn graded(start: f64, end: f64, first: f64, growth: f64) -> Vec<f64> {
    let length = (end - start).abs();
    // Steps that sum to the length: n from the geometric series, at least one.
    let count = if (growth - 1.0).abs() < 1e-9 {
        length / first
    } else {
        (1.0 + length / first * (growth - 1.0)).max(1.0).ln() / growth.ln()
    };
    let count = (count.round() as usize).max(1);
    let mut offsets = vec![0.0];
    let mut step = 1.0;
    for _ in 0..count {
        offsets.push(offsets[offsets.len() - 1] + step);
        step *= growth;
    }
    let total = offsets[count];
    let scaled = offsets
        .iter()
        .map(|offset| start + (end - start) * offset / total);
    let mut lines: Vec<f64> = scaled.collect();
    lines[count] = end;
    lines
}

/// As [`graded`], with steps of about `largest` where they would be longer.
pub(crate) fn graded_up_to(
    start: f64,
    end: f64,
    first: f64,
    growth: f64,
    largest: f64,
) -> Vec<f64> {
    let length = (end - start).abs();
    let mut offsets = vec![0.0];
    let (mut step, mut reached) = (first, 0.0);
    while reached + 0.5 * step < length {
        reached += step;
        offsets.push(reached);
        step = (growth * step).min(largest);
    }
    let mut lines: Vec<f64> = (offsets.iter())
        .map(|offset| start + (end - start) * offset / reached)
        .collect();
    if let Some(last) = lines.last_mut() {
        *last = end;
    }
    lines
}
