//! Gauss–Seidel sweeps of the frontal equation p²/n_x² + q²/n_y² = k, with n_x and n_y the slopes
//! of the upwind edges, and of the oblique equation R √(1 + |∇z|²) + s_x p + s_y q = s_z.
//!
//! With k = 1 the frontal equation is of first order, because p and n_x belong to the middle of the
//! edge in x, but q and n_y to that of the edge in y. With the direction φ of the gradient,
//! p²/n_x² + q²/n_y² = cos²φ_x + sin²φ_y, with φ_x and φ_y at those two positions. A second
//! solution with k = 1 + cos²φ_x − cos²φ_y, and φ from the first, removes that error (deferred
//! correction). A profile fitted to the light gives φ before the first solution.

use super::profile::Profile;
use super::{EikonalBuffers, Node};
use crate::{BoundingBox, PixelScalar};

impl<T: PixelScalar> EikonalBuffers<T> {
    /// Sweeps in one of four orders, under `light`, or under frontal light if `None`. Returns the
    /// largest change.
    pub(super) fn sweep(&mut self, light: Option<[T; 3]>, order: usize, tolerance: T) -> T {
        let width = self.width;
        let rows = self.node.len() / width;
        let mut change = T::zero();
        for r in 1..rows - 1 {
            let r = if order & 1 == 1 { rows - 1 - r } else { r };
            for c in 1..width - 1 {
                // The four orders together cover every direction of a front (Zhao 2005).
                let forwards = order == 0 || order == 3;
                let i = r * width + if forwards { c } else { width - 1 - c };
                if self.active[i] {
                    change = change.max(self.visit(i, light, tolerance));
                }
            }
        }
        change
    }

    /// Visits the nodes in the order of the front. Returns whether a node can still improve.
    pub(super) fn march(&mut self, tolerance: T) -> bool {
        for k in 0..self.front.len() {
            let i = self.front[k] as u32 as usize;
            if self.active[i] {
                self.visit(i, None, tolerance);
            }
        }
        self.active.contains(&true)
    }

    /// Determines the order of the unknown nodes from the rim to the top, and the directions of the
    /// gradient, from a profile fitted to the pixels of the mask. Valid if only the rim is known
    /// and lines of equal light are lines of equal height.
    pub(super) fn follow(&mut self, profile: &Profile, area: BoundingBox) {
        let aspect2 = self.aspect.as_f64().powi(2);
        let pixel = |i: usize| {
            // The grid has a border of one node around the box.
            let row = area.row_start + i / self.width - 1;
            [row, area.column_start + i % self.width - 1]
        };
        let unknown = |i: &usize| self.node[*i] == Node::Unknown;
        let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
        for i in (0..self.node.len()).filter(unknown) {
            let (quadratic, [p, q]) = profile.quadratic_and_gradient(pixel(i));
            let (pp, qq) = (p * p, q * q / aspect2);
            self.along_x[i] = T::of(pp / (pp + qq));
            (least, most) = (least.min(-quadratic), most.max(-quadratic));
        }
        // 4096 levels are a sufficiently fine order. Nodes of one level keep their order.
        let scale = 4095.0 / (most - least).max(f64::MIN_POSITIVE);
        self.front.reserve(self.node.len());
        for i in (0..self.node.len()).filter(unknown) {
            let level = ((-profile.quadratic(pixel(i)) - least) * scale) as u64;
            self.front.push(level.min(4095) << 32 | i as u64);
        }
        self.front.sort_unstable();
        self.directed = true;
    }

    /// Stores cos²φ of the gradient of the solution for the second solution. Next to the boundary,
    /// the height may rise like a square root, and one-sided differences do not determine its
    /// direction. The direction of ∇ sin θ is used there: both are normal to the boundary.
    pub(super) fn measure_directions(&mut self) {
        let width = self.width;
        for i in width..self.node.len() - width {
            if self.node[i] == Node::Outside {
                continue;
            }
            let value = &self.value;
            let p = value[i + 1] - value[i - 1];
            let q = (value[i + width] - value[i - width]) / self.aspect;
            // NaN if a neighbour is not reached or the surface is flat.
            let along_x = p * p / (p * p + q * q);
            self.along_x[i] = if along_x.is_nan() && !self.offset[i].is_nan() {
                self.boundary_along_x(i)
            } else {
                along_x
            };
        }
    }

    /// Updates a node and activates the neighbours that its new value can lower. Returns the
    /// change.
    #[inline(always)]
    fn visit(&mut self, i: usize, light: Option<[T; 3]>, tolerance: T) -> T {
        // Cleared before the update. A neighbour that improves later sets it again.
        self.active[i] = false;
        let old = self.value[i];
        let new = match light {
            None => self.frontal(i),
            Some(light) => self.oblique(i, light),
        };
        // Values start at infinity or at given heights, and only decrease.
        if new >= old {
            return T::zero();
        }
        self.value[i] = new;
        let change = old - new;
        // Smaller changes are kept but not propagated, which ends the sweeps.
        if change > tolerance {
            for j in [i - 1, i + 1, i - self.width, i + self.width] {
                // Under oblique light a surface may fall in the direction of the front.
                let lowered = light.is_some() || self.value[j] > new;
                self.active[j] |= lowered && self.node[j] == Node::Unknown;
            }
        }
        change
    }

    /// The frontal update of a node from its upwind neighbours.
    #[inline(always)]
    fn frontal(&self, i: usize) -> T {
        let width = self.width;
        let edge = |at: usize, metric: T| UpwindEdge {
            value: self.value[at],
            metric,
            along_x: self.along_x[at],
        };
        let [right, down] = self.edges[i];
        let x = upwind(edge(i - 1, self.edges[i - 1][0]), edge(i + 1, right));
        let y = upwind(
            edge(i - width, self.edges[i - width][1]),
            edge(i + width, down),
        );
        let k = if self.corrected {
            correction(x, y)
        } else {
            T::one()
        };
        update(x, y, k)
    }

    /// Least height of a node from the four neighbours and the four triangles between them.
    fn oblique(&self, i: usize, light: [T; 3]) -> T {
        let width = self.width;
        let mut least = self.value[i];
        for (jx, sx) in [(i - 1, T::one()), (i + 1, -T::one())] {
            let ex = Edge {
                value: self.value[jx],
                step: sx,
                reflectance: self.middle(i, jx),
            };
            least = least.min(ex.value + straight(ex.reflectance, light, [sx, T::zero()]));
            for (jy, sy) in [(i - width, T::one()), (i + width, -T::one())] {
                let ey = Edge {
                    value: self.value[jy],
                    step: sy * self.aspect,
                    reflectance: self.middle(i, jy),
                };
                least = least
                    .min(ey.value + straight(ey.reflectance, light, [T::zero(), sy]) * self.aspect);
                if ex.value.is_finite() && ey.value.is_finite() {
                    least = least.min(triangle(light, ex, ey));
                }
            }
        }
        least
    }

    /// Reflectance half way between two nodes: the cosine of the mean angle to the light.
    #[inline(always)]
    fn middle(&self, i: usize, j: usize) -> T {
        if self.node[j] == Node::Outside {
            return self.cosine[i];
        }
        let (c, s) = (self.cosine[i] + self.cosine[j], self.sine[i] + self.sine[j]);
        c / (c * c + s * s).sqrt()
    }
}

/// An upwind neighbour: its value, 1/(slope · step)² of the edge to it, and its cos²φ.
#[derive(Clone, Copy)]
struct UpwindEdge<T> {
    value: T,
    metric: T,
    along_x: T,
}

/// k of the second solution, from means of the node and its neighbours, which leaves half of the
/// difference between the neighbours. If the direction changes within a pixel (along ridges), such
/// means are wrong, and first order is better.
#[inline(always)]
fn correction<T: PixelScalar>(x: UpwindEdge<T>, y: UpwindEdge<T>) -> T {
    let turn = T::of(0.5) * (x.along_x - y.along_x);
    if turn.abs() < T::of(0.1) {
        T::one() + turn
    } else {
        T::one()
    }
}

#[inline(always)]
fn upwind<T: PixelScalar>(before: UpwindEdge<T>, after: UpwindEdge<T>) -> UpwindEdge<T> {
    if before.value < after.value {
        before
    } else {
        after
    }
}

/// Solves A (u − a)² + B (u − b)² = k for the larger root. If that is not upwind of both
/// neighbours, only one edge is used.
#[inline(always)]
fn update<T: PixelScalar>(x: UpwindEdge<T>, y: UpwindEdge<T>, k: T) -> T {
    let d = x.value - y.value;
    let sum = x.metric + y.metric;
    // Upwind of both if u > max(a, b), that is, if their difference is less than the rise along one
    // edge.
    let lower = if d > T::zero() { y } else { x };
    if lower.metric * d * d < k {
        let root = (k * sum - x.metric * y.metric * d * d)
            .max(T::zero())
            .sqrt();
        return (x.metric * x.value + y.metric * y.value + root) / sum;
    }
    // The front arrives along one axis only.
    lower.value + (k / lower.metric).sqrt()
}

/// A neighbour: its value, the signed step from it to the node, and the reflectance half way.
#[derive(Clone, Copy)]
struct Edge<T> {
    value: T,
    step: T,
    reflectance: T,
}

/// Steepest ascent along the unit direction d that is compatible with the reflectance. +∞ if every
/// ascent is.
///
/// The tangent (d, μ) forms an angle of at least 90° − α with the light, with cos α = R. Hence
/// s·d + s_z μ ≤ √(1 − R²) √(1 + μ²), and the largest such μ is returned.
#[inline(always)]
fn straight<T: PixelScalar>(reflectance: T, [x, y, z]: [T; 3], d: [T; 2]) -> T {
    let (along, across) = (x * d[0] + y * d[1], x * d[1] - y * d[0]);
    let sine2 = T::one() - reflectance * reflectance;
    let discriminant = reflectance * reflectance - across * across;
    // The light is so far from the vertical plane of the direction that every ascent satisfies the
    // bound.
    if discriminant < T::zero() {
        return T::infinity();
    }
    let root = (sine2 * discriminant).sqrt();
    // Two forms of the same root, each without cancellation for its sign.
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

/// Solves the equation on the triangle of two neighbours. Returns +∞ if the characteristic does not
/// arrive through the triangle.
#[inline(always)]
fn triangle<T: PixelScalar>([x, y, z]: [T; 3], ex: Edge<T>, ey: Edge<T>) -> T {
    let two = T::of(2.0);
    let r = (ex.reflectance + ey.reflectance) / two;
    let (px, qy) = (ex.step.recip(), ey.step.recip());
    let d = ey.value - ex.value;
    // With u = z − a: p = px u and q = qy (u − d). The squared equation is R² (1 + p² + q²) = (z −
    // x p − y q)².
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
        // The characteristic has the direction R ∇z/√(1 + |∇z|²) + (s_x, s_y). It must come from
        // the neighbours.
        let upwind_x = (r * p / w + x) * ex.step >= T::zero();
        let upwind_y = (r * q / w + y) * ey.step >= T::zero();
        if u.is_finite() && z - x * p - y * q >= T::zero() && upwind_x && upwind_y {
            best = best.min(ex.value + u);
        }
    }
    best
}

/// Both roots of a u² − 2 b u + c without cancellation, infinite if there are none.
#[inline(always)]
fn roots<T: PixelScalar>(a: T, b: T, c: T) -> [T; 2] {
    let discriminant = b * b - a * c;
    if discriminant < T::zero() {
        return [T::infinity(); 2];
    }
    let root = discriminant.sqrt();
    // First the root without cancellation. The other follows from their product c/a.
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
