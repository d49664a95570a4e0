//! Mesh of a tissue block with a spherical inclusion under a guide's flat face.

use super::bodies::Inclusion;
use super::mesh::{Boundary, Mesh, MeshBuilder, graded, graded_up_to};

/// Lines of the cross-section: where its elements end.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct BlockMesh {
    pub(crate) block_height: f64,
    pub(crate) block_radius: f64,
    pub(crate) disc_radius: f64,
    /// Thickness of the guide's layers, that on the block first.
    pub(crate) layers: Vec<f64>,
    pub(crate) inclusion: Option<Inclusion>,
    /// Whether guide and block share the nodes of their interface.
    pub(crate) bonded: bool,
    /// Elements along an eighth of the inclusion's circumference; everything else follows.
    pub(crate) fineness: usize,
}

/// The guide's mesh and the block's; bonded, both in the first.
pub(crate) struct BlockMeshes {
    pub(crate) guide: Mesh,
    pub(crate) block: Option<Mesh>,
}

/// Shortest element at the rim of a face that slides, over the face's radius. Shared displacements hold finer ones less and
/// less as the face sinks in: of 0.02, they turn over at a tenth of the block's height, and the pressure within three
/// quarters of the face jumps by 1 %. Until then it is that of the finer ones within 0.05 %.
const SLIDING_RIM: f64 = 0.045;
/// Elements along an eighth of the inclusion's circumference up to which they hold it: finer meshes have flatter elements at the
/// rim, and with seven those of 0.045 turn over at some tenths of the height.
const SLIDING_FINENESS: f64 = 5.0;

impl BlockMesh {
    /// Box around the inclusion that takes a grid of its own: radius, lower and upper height.
    fn cell(&self) -> Option<(Inclusion, [f64; 3])> {
        let inclusion = self.inclusion?;
        let (radius, depth) = (inclusion.radius, inclusion.depth);
        let below = self.block_height - depth - 2.0 * radius;
        // Margins of the size of the circle's elements, where there is room.
        let margin = |room: f64| (0.4 * radius).min(0.5 * room);
        let cell = [
            radius + margin(self.disc_radius - radius),
            depth - margin(depth),
            depth + 2.0 * radius + margin(below),
        ];
        Some((inclusion, cell))
    }

    pub(crate) fn build(&self) -> BlockMeshes {
        let cell = self.cell();
        // Elements of the guide's face from the axis to its rim, finest at the rim where the
        // traction is singular.
        let face = self.disc_radius / (2.5 * self.fineness as f64);
        let inner = cell.map_or(0.5 * self.disc_radius, |(_, [radius, _, _])| radius);
        // Above a wide inclusion the pressure wants elements no longer than elsewhere.
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
            // Positions come from the same expressions as the limits: rounding alone tells them apart.
            if r <= 0.0 {
                Boundary::Axis
            } else if z <= glass * (1.0 - 1e-9) {
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

/// The box [0, r] × [low, high] with the inclusion: a core rectangle, shells to the circle, shells
/// to the box. Regions: `region` outside, `region + 1` inside.
fn add_cell(
    builder: &mut MeshBuilder,
    inclusion: Inclusion,
    [width, low, high]: [f64; 3],
    n: usize,
    region: usize,
) {
    let radius = inclusion.radius;
    let centre = inclusion.depth + radius;
    // A core of half the radius leaves elements of about one size.
    let core = 0.5 * radius;
    let total = 4 * n;
    // Node k of 8n + 1 along the three sides of a box from its lower end on the axis.
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
        // Sides bulge towards the circle, which opens the angles at the corners.
        let [r, z] = along_box(k, core, -core, core);
        let bulge = 0.15 * (1.0 - (r / core).powi(2)) + 0.15 * (1.0 - (z / core).powi(2));
        let scale = 0.9 * (1.0 + bulge);
        [r * scale, centre + z * scale]
    };
    let on_circle = |k: usize| {
        let angle = core::f64::consts::PI * k as f64 / (2 * total) as f64;
        [radius * angle.sin(), centre - radius * angle.cos()]
    };
    let between =
        |a: [f64; 2], b: [f64; 2], t: f64| [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])];
    let inner_shells = n.div_ceil(2).max(1);
    builder.block(inner_shells, total, region + 1, |i, j| {
        between(
            on_core(j),
            on_circle(j),
            i as f64 / (2 * inner_shells) as f64,
        )
    });
    let outer_shells = n.div_ceil(3).max(1);
    builder.block(outer_shells, total, region, |i, j| {
        let t = i as f64 / (2 * outer_shells) as f64;
        between(on_circle(j), along_box(j, width, low, high), t)
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
