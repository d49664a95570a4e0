//! Mapped meshes of the bodies a sensor meets.

use super::mesh::{Boundary, Mesh, MeshBuilder, graded, with_middles};

/// Lines that resolve a contact around the axis at every size from `inner` outwards: `count`
/// uniform steps up to `inner`, then growing by `growth` up to steps of `largest`, to `end`.
pub(crate) fn contact_lines(
    inner: f64,
    count: usize,
    growth: f64,
    largest: f64,
    end: f64,
) -> Vec<f64> {
    let mut lines: Vec<f64> = (0..=count)
        .map(|k| inner * k as f64 / count as f64)
        .collect();
    let mut step = inner / count as f64;
    loop {
        step = (step * growth).min(largest);
        let last = lines[lines.len() - 1];
        let left = end - last;
        // The last two steps share what is left rather than leave a sliver.
        if left <= 1.5 * step {
            if left > 0.0 {
                lines.push(end);
            }
            return lines;
        }
        lines.push(last + step);
    }
}

/// Size of the elements of a body with a contact around its axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ContactMesh {
    /// Radius of the core with uniform elements, about half the smallest contact radius.
    pub(crate) inner: f64,
    /// Elements across the core.
    pub(crate) count: usize,
    /// Growth of the elements outwards.
    pub(crate) growth: f64,
}

/// A spherical inclusion on the axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Inclusion {
    pub(crate) radius: f64,
    /// From the block's surface to the inclusion's top.
    pub(crate) depth: f64,
}

impl Mesh {
    /// The half of a ball of radius `radius` on the side of its pole, which is at the origin; the
    /// ball's centre is at z = `radius`, its equator [`Boundary::Base`].
    ///
    /// Around a core of quadrilaterals at the pole lie shells along circles that meet the axis and
    /// the ball's surface at right angles.
    pub(crate) fn half_ball(radius: f64, size: ContactMesh) -> Self {
        let m = size.count;
        let first = size.inner / m as f64;
        // Angles of the shells along the surface; the first lies around the core.
        let start = (size.inner + first) / radius;
        let limit = core::f64::consts::FRAC_PI_2;
        let largest = 1.6 * limit / (2.0 * m as f64);
        let mut angles = vec![start];
        let mut step = first / radius;
        loop {
            step = (step * size.growth).min(largest);
            let last = angles[angles.len() - 1];
            if limit - last <= 1.5 * step {
                angles.push(limit);
                break;
            }
            angles.push(last + step);
        }
        let angles = with_middles(&angles);
        // Node k of 4m + 1 from the surface to the axis on the shell at `angle`.
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
        let core_angle = size.inner / radius;
        let surface = [radius * core_angle.sin(), radius * (1.0 - core_angle.cos())];
        // The core's free corner lies inside the square's, which opens the angle there.
        let corner = [0.82 * size.inner, 0.82 * size.inner];
        let axis = [0.0, size.inner];
        let line = |a: [f64; 2], b: [f64; 2]| -> Vec<[f64; 2]> {
            (0..=2 * m)
                .map(|k| {
                    let t = k as f64 / (2 * m) as f64;
                    [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])]
                })
                .collect()
        };
        let bottom: Vec<[f64; 2]> = (0..=2 * m)
            .map(|k| {
                let angle = core_angle * k as f64 / (2 * m) as f64;
                let half = (0.5 * angle).sin();
                [radius * angle.sin(), 2.0 * radius * half * half]
            })
            .collect();
        let (left, right) = (line([0.0, 0.0], axis), line(surface, corner));
        let top = line(axis, corner);
        let mut builder = MeshBuilder::default();
        builder.transfinite(&bottom, &top, &left, &right, 0);
        // Between the core's outer sides and the first shell.
        let outer: Vec<[f64; 2]> = right
            .iter()
            .copied()
            .chain(top.iter().rev().skip(1).copied())
            .collect();
        builder.block(1, 2 * m, 0, |i, j| {
            let (a, b) = (outer[j], shell(start, j));
            let t = 0.5 * i as f64;
            if j == 0 {
                let angle = core_angle + t * (start - core_angle);
                let half = (0.5 * angle).sin();
                return [radius * angle.sin(), 2.0 * radius * half * half];
            }
            [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])]
        });
        builder.block(angles.len() / 2, 2 * m, 0, |i, j| shell(angles[i], j));
        let mut mesh = builder.build();
        mesh.name_outer_edges(|[r, z]| {
            if r <= 0.0 {
                Boundary::Axis
            } else if z >= radius * (1.0 - 1e-12) {
                Boundary::Base
            } else {
                Boundary::Contact
            }
        });
        mesh
    }

    /// Bonded layers below z = 0, the first on top, of thicknesses `thickness` and radius `radius`;
    /// a region each.
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
        mesh.name_outer_edges(|[r, z]| {
            if r <= 0.0 {
                Boundary::Axis
            } else if z >= 0.0 {
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
