//! One Gauss–Seidel sweep of the oblique equation R √(1 + |∇z|²) + s_x p + s_y q = s_z.

use super::grid::{EikonalBuffers, Node};
use crate::Scalar;

/// Sweeps in one of four orders; returns the largest change.
pub(super) fn sweep<T: Scalar>(
    grid: &mut EikonalBuffers<T>,
    [x, y, z]: [T; 3],
    convex: bool,
    order: usize,
    tolerance: T,
) -> T {
    // The concave branch is the convex one of −z, which the mirrored light shades alike.
    let light = if convex { [x, y, z] } else { [-x, -y, z] };
    let width = grid.width;
    let rows = grid.node.len() / width;
    let mut change = T::zero();
    for r in 1..rows - 1 {
        let r = if order & 1 == 1 { rows - 1 - r } else { r };
        for c in 1..width - 1 {
            let c = if order == 0 || order == 3 {
                c
            } else {
                width - 1 - c
            };
            let i = r * width + c;
            if grid.active[i] {
                change = change.max(visit(grid, i, light, tolerance));
            }
        }
    }
    change
}

/// Updates a node, and wakes its neighbours if it has improved.
fn visit<T: Scalar>(grid: &mut EikonalBuffers<T>, i: usize, light: [T; 3], tolerance: T) -> T {
    grid.active[i] = false;
    let (old, new) = (grid.value[i], update(grid, i, light));
    if new >= old {
        return T::zero();
    }
    grid.value[i] = new;
    let change = old - new;
    if change > tolerance {
        for j in [i - 1, i + 1, i - grid.width, i + grid.width] {
            grid.active[j] |= grid.node[j] == Node::Unknown;
        }
    }
    change
}

/// Least height the four neighbours and the four triangles between them give a node.
fn update<T: Scalar>(grid: &EikonalBuffers<T>, i: usize, light: [T; 3]) -> T {
    let width = grid.width;
    let mut least = grid.value[i];
    for (jx, sx) in [(i - 1, T::one()), (i + 1, -T::one())] {
        let ex = Edge {
            value: grid.value[jx],
            step: sx,
            reflectance: middle(grid, i, jx),
        };
        least = least.min(ex.value + straight(ex.reflectance, light, [sx, T::zero()]));
        for (jy, sy) in [(i - width, T::one()), (i + width, -T::one())] {
            let ey = Edge {
                value: grid.value[jy],
                step: sy * grid.aspect,
                reflectance: middle(grid, i, jy),
            };
            least = least
                .min(ey.value + straight(ey.reflectance, light, [T::zero(), sy]) * grid.aspect);
            if ex.value.is_finite() && ey.value.is_finite() {
                least = least.min(triangle(light, ex, ey));
            }
        }
    }
    least
}

/// A neighbour: its value, the signed step from it to the node, and the reflectance half way.
#[derive(Clone, Copy)]
struct Edge<T> {
    value: T,
    step: T,
    reflectance: T,
}

/// Reflectance half way between two nodes: the cosine of the mean angle to the light.
#[inline(always)]
fn middle<T: Scalar>(grid: &EikonalBuffers<T>, i: usize, j: usize) -> T {
    if grid.node[j] == Node::Outside {
        return grid.cosine[i];
    }
    let (c, s) = (grid.cosine[i] + grid.cosine[j], grid.sine[i] + grid.sine[j]);
    c / (c * c + s * s).sqrt()
}

/// Steepest ascent the reflectance allows along the unit direction d; +∞ if it allows any.
///
/// The tangent (d, μ) makes with the light an angle of at least 90° − α, cos α = R:
/// s·d + s_z μ ≤ √(1 − R²) √(1 + μ²), whose largest μ is returned.
#[inline(always)]
fn straight<T: Scalar>(reflectance: T, [x, y, z]: [T; 3], d: [T; 2]) -> T {
    let (along, across) = (x * d[0] + y * d[1], x * d[1] - y * d[0]);
    let sine2 = T::one() - reflectance * reflectance;
    let discriminant = reflectance * reflectance - across * across;
    if discriminant < T::zero() {
        return T::infinity();
    }
    let root = (sine2 * discriminant).sqrt();
    if along >= T::zero() {
        let denominator = along * z + root;
        return if denominator > T::zero() {
            (sine2 - along * along) / denominator
        } else {
            T::zero()
        };
    }
    let denominator = z * z - sine2;
    if denominator > T::zero() {
        (root - along * z) / denominator
    } else {
        T::infinity()
    }
}

/// Solves the equation on the triangle of two neighbours; +∞ if the characteristic does not come from within it.
#[inline(always)]
fn triangle<T: Scalar>([x, y, z]: [T; 3], ex: Edge<T>, ey: Edge<T>) -> T {
    let two = T::of(2.0);
    let r = (ex.reflectance + ey.reflectance) / two;
    let (px, qy) = (ex.step.recip(), ey.step.recip());
    let d = ey.value - ex.value;
    // With u = z − a: p = px u, q = qy (u − d); R² (1 + p² + q²) = (z − x p − y q)².
    let m = x * px + y * qy;
    let k = z + y * qy * d;
    let r2 = r * r;
    let qa = r2 * (px * px + qy * qy) - m * m;
    let qb = r2 * qy * qy * d - k * m;
    let qc = r2 * (T::one() + qy * qy * d * d) - k * k;
    let mut best = T::infinity();
    for u in roots(qa, qb, qc) {
        let (p, q) = (px * u, qy * (u - d));
        let w = (T::one() + p * p + q * q).sqrt();
        let upwind_x = (r * p / w + x) * ex.step >= T::zero();
        let upwind_y = (r * q / w + y) * ey.step >= T::zero();
        if u.is_finite() && z - x * p - y * q >= T::zero() && upwind_x && upwind_y {
            best = best.min(ex.value + u);
        }
    }
    best
}

/// Both roots of a u² − 2 b u + c without cancellation, infinite where there are none.
#[inline(always)]
fn roots<T: Scalar>(a: T, b: T, c: T) -> [T; 2] {
    let discriminant = b * b - a * c;
    if discriminant < T::zero() {
        return [T::infinity(); 2];
    }
    let root = discriminant.sqrt();
    let far = if b >= T::zero() { b + root } else { b - root };
    [
        far / a,
        if far == T::zero() {
            T::infinity()
        } else {
            c / far
        },
    ]
}
