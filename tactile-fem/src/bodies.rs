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

impl ContactMesh {
    /// Distance from the pole to the core's corner inside the body: beyond the core's ends, inside the first shell.
    fn corner(&self) -> f64 {
        self.inner * (1.0 + 0.8 / self.count as f64).min(1.16)
    }
}

/// Between a ball's core and the first shell, as a share of an element. With 0.02 the mesh of sixteen elements has one without area, with
/// 0.05 and 0.2 all from 2 to 24 are sound (the test `a_ball_can_be_meshed_at_any_fineness`); more squeezes the core's corner instead.
const CORNER_ROOM: f64 = 0.05;

/// A spherical inclusion on the axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Inclusion {
    pub(crate) radius: f64,
    /// From the block's surface to the inclusion's top.
    pub(crate) depth: f64,
}

/// A body's lowest point: a core of quadrilaterals, and shells around it.
struct Pole<S> {
    /// Elements along each side of the core.
    elements: usize,
    /// Parameter of the surface where the core ends.
    core: f64,
    /// The core's upper end on the axis.
    axis: [f64; 2],
    /// The core's corner inside the body.
    corner: [f64; 2],
    /// The surface over its parameter, from the pole at zero.
    surface: S,
}

impl<S: Fn(f64) -> [f64; 2]> Pole<S> {
    /// With shells at `parameters` (those of elements' ends and middles), where `shell` gives node k of 4m + 1 from the surface to
    /// the axis; boundaries without names.
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
        // Between the core's outer sides and the first shell.
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
        builder.build()
    }
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
        // The shells are nearer to the pole inside the ball than on its surface: on a fine mesh they would cut the corner.
        let [r, z] = shell(start, 2 * m);
        let corner = size.corner().min(r.hypot(z) - CORNER_ROOM * first);
        let pole = Pole {
            elements: m,
            core: size.inner / radius,
            axis: [0.0, size.inner],
            // The core's free corner lies inside the square's, which opens the angle there.
            corner: [core::f64::consts::FRAC_1_SQRT_2 * corner; 2],
            surface: |angle: f64| {
                let half = (0.5 * angle).sin();
                [radius * angle.sin(), 2.0 * radius * half * half]
            },
        };
        let mut mesh = pole.mesh(&angles, shell);
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

    /// A cylinder on z = 0, its lower end [`Boundary::Contact`], its upper end [`Boundary::Base`].
    pub(crate) fn cylinder(r_lines: &[f64], z_lines: &[f64]) -> Self {
        let mut builder = MeshBuilder::default();
        builder.rectangle(r_lines, z_lines, 0);
        let mut mesh = builder.build();
        let top = z_lines[z_lines.len() - 1];
        mesh.name_outer_edges(|[r, z]| {
            if r <= 0.0 {
                Boundary::Axis
            } else if z <= 0.0 {
                Boundary::Contact
            } else if z >= top {
                Boundary::Base
            } else {
                Boundary::Side
            }
        });
        mesh
    }

    /// A cone whose tip is at the origin: its side [`Boundary::Contact`], its flat end at z = `height` [`Boundary::Base`].
    ///
    /// Around a core of quadrilaterals at the tip lie shells that meet the axis at right angles and flatten towards the base.
    pub(crate) fn cone(half_angle: f64, height: f64, size: ContactMesh) -> Self {
        let m = size.count;
        let (sin, cos) = half_angle.sin_cos();
        let side = height / cos;
        let first = size.inner / m as f64;
        let start = size.inner + first;
        let largest = 1.6 * side / (2.0 * m as f64);
        let mut distances = vec![start];
        let mut step = first;
        loop {
            step = (step * size.growth).min(largest);
            let last = distances[distances.len() - 1];
            if side - last <= 1.5 * step {
                distances.push(side);
                break;
            }
            distances.push(last + step);
        }
        // Height on the axis of the shell at a distance along the side: the distance itself near the tip, the cone's at its end.
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
            // On the middle of the shell between the core's ends and the first.
            corner: shell(size.inner + 0.5 * first, 2 * m),
            surface: |s: f64| [s * sin, s * cos],
        };
        let mut mesh = pole.mesh(&with_middles(&distances), shell);
        mesh.name_outer_edges(|[r, z]| {
            if r <= 0.0 {
                Boundary::Axis
            } else if z >= height * (1.0 - 1e-12) {
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
