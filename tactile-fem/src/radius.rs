//! Smooth pressures and the contact radius from the forces at a contact's nodes.
//!
//! Pressures of neighbouring nodes, the ends and the middles of quadratic edges, alternate about the true ones, by some percent near the
//! contact's edge. What they carry by the hat functions of the edges' ends, displacements that the elements can make, is in equilibrium
//! with the bodies and does not: these are means of the true pressure, whose squares lie nearly on a straight line over r².

use super::element::GAUSS3;
use super::pressure::{ContactRadius, PressurePoint};
use core::f64::consts::{PI, TAU};

/// Outermost edge ends left out of the fit: the contact's edge lies somewhere within the last element, whose pressures and half of its
/// neighbour's are bent by it.
const LEFT_OUT: usize = 2;
/// Where the fit begins, over the outermost node's radius: further in, p² bends more than a parabola.
const FIT_FROM: f64 = 0.35;
/// Fewest means that two constants are fitted to.
const FEWEST: usize = 4;

/// Pressures of a contact and its radius.
pub(crate) struct ContactProfile {
    pub(crate) points: Vec<PressurePoint>,
    pub(crate) radius: Option<ContactRadius>,
}

impl ContactProfile {
    /// From the pressures at all nodes in contact, from the axis outwards, and the force they carry.
    pub(crate) fn new(points: Vec<PressurePoint>, force: f64) -> Self {
        // A contact of few nodes, or one that does not reach the axis, keeps its pressures.
        if points.len() < 5 || points[0].r_m != 0.0 {
            return Self {
                points,
                radius: None,
            };
        }
        let means = means(&points);
        let fit = |left_out| Fit::new(&points, force, &means, left_out);
        let fine = fit(LEFT_OUT);
        let radius = fine.as_ref().map(|fine| ContactRadius {
            radius_m: fine.square.sqrt(),
            uncertainty_m: match fit(LEFT_OUT + 1) {
                Some(coarse) => (fine.square.sqrt() - coarse.square.sqrt()).abs(),
                // Nothing to compare with: half the distance between the outermost nodes.
                None => 0.5 * (points[points.len() - 1].r_m - points[points.len() - 2].r_m),
            },
        });
        Self {
            points: smooth(&points, &means, fine.as_ref()),
            radius,
        }
    }
}

/// Mean pressure over the hat function of an edge's end, with mean and variance of r² there.
struct Mean {
    square: f64,
    variance: f64,
    pressure: f64,
}

impl Mean {
    /// p² at the mean of r². Where p² falls linearly to zero at a², the mean of p is less than p there by var(r²)/8(a² − r²)² of it.
    fn pressure_squared(&self, edge: Option<f64>) -> f64 {
        let to_edge = edge.map_or(f64::INFINITY, |square| square - self.square);
        self.pressure * self.pressure * (1.0 + 0.25 * self.variance / (to_edge * to_edge))
    }
}

/// Integrals over 2πr dr of a weight N that is linear between nodes: of N, N r², N r⁴ and N p.
#[derive(Default)]
struct Moments {
    area: f64,
    first: f64,
    second: f64,
    force: f64,
}

impl Moments {
    /// Adds the stretch between two nodes; N falls or grows linearly between its values there, and so does the pressure.
    fn add(&mut self, nodes: [&PressurePoint; 2], weights: [f64; 2]) {
        let between = |values: [f64; 2], t: f64| values[0] + t * (values[1] - values[0]);
        let radii = nodes.map(|node| node.r_m);
        let pressures = nodes.map(|node| node.pressure_pa);
        for (x, gauss) in GAUSS3 {
            let t = 0.5 * (1.0 + x);
            let r = between(radii, t);
            let part = 0.5 * gauss * between(weights, t) * TAU * r * (radii[1] - radii[0]);
            self.area += part;
            self.first += part * r * r;
            self.second += part * r.powi(4);
            self.force += part * between(pressures, t);
        }
    }
}

/// Means of the edge ends, every second node, whose neighbours on both sides are in contact.
fn means(points: &[PressurePoint]) -> Vec<Mean> {
    (0..points.len() - 2)
        .step_by(2)
        .map(|k| {
            let mut hat = Moments::default();
            if k > 0 {
                hat.add([&points[k - 2], &points[k - 1]], [0.0, 0.5]);
                hat.add([&points[k - 1], &points[k]], [0.5, 1.0]);
            }
            hat.add([&points[k], &points[k + 1]], [1.0, 0.5]);
            hat.add([&points[k + 1], &points[k + 2]], [0.5, 0.0]);
            let square = hat.first / hat.area;
            Mean {
                square,
                variance: hat.second / hat.area - square * square,
                pressure: hat.force / hat.area,
            }
        })
        .collect()
}

/// p² = c₀ t + c₁ t² with t = 1 − r²/a², near the contact's edge.
struct Fit {
    /// a².
    square: f64,
    constants: [f64; 2],
    /// The outermost mean of the fit, which stands for the pressure from there on.
    from: usize,
}

impl Fit {
    /// The constants fit the means inside the contact's outermost elements; a is where the fit carries the same force outside as the
    /// elements do, which equilibrium makes accurate although their pressures are not. `None` with too few nodes in contact.
    fn new(points: &[PressurePoint], force: f64, means: &[Mean], left_out: usize) -> Option<Self> {
        let last_end = (points.len() - 1) / 2;
        let from = last_end.checked_sub(left_out)?.min(means.len() - 1);
        let outermost = points[points.len() - 1].r_m;
        let fitted: Vec<&Mean> = (means[..=from].iter())
            .filter(|mean| mean.square >= (FIT_FROM * outermost).powi(2))
            .collect();
        if fitted.len() < FEWEST {
            return None;
        }
        // What the function carries that grows from zero at the end before to one at this end and beyond.
        let (inner, start) = (points[2 * from - 2].r_m, points[2 * from].r_m);
        let mut within = Moments::default();
        for k in 0..2 * from {
            let weight = |node: usize| (0.5 * (2 * from - node) as f64).min(1.0);
            within.add([&points[k], &points[k + 1]], [weight(k), weight(k + 1)]);
        }
        let outside = force - within.force;
        let at = |square: f64| {
            let constants = constants(&fitted, square)?;
            let fit = Self {
                square,
                constants,
                from,
            };
            let excess = fit.ramp_force(inner, start) + fit.outer_force(start) - outside;
            Some((fit, excess))
        };
        let (mut low, mut high) = (start * start * 1.0001, (1.5 * outermost).powi(2));
        if !(at(low)?.1 < 0.0 && at(high)?.1 > 0.0) {
            return None;
        }
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if at(middle)?.1 < 0.0 {
                low = middle;
            } else {
                high = middle;
            }
        }
        Some(at(0.5 * (low + high))?.0)
    }

    /// p² at r².
    fn pressure_squared(&self, square: f64) -> f64 {
        let t = 1.0 - square / self.square;
        t * (self.constants[0] + self.constants[1] * t)
    }

    /// ∫ N p 2πr dr with N growing from zero at one radius to one at the other.
    fn ramp_force(&self, inner: f64, outer: f64) -> f64 {
        let mut force = 0.0;
        for (x, weight) in GAUSS3 {
            let t = 0.5 * (1.0 + x);
            let r = inner + t * (outer - inner);
            let pressure = self.pressure_squared(r * r).max(0.0).sqrt();
            force += 0.5 * weight * t * pressure * TAU * r * (outer - inner);
        }
        force
    }

    /// π ∫ p ds from `start` squared to a².
    fn outer_force(&self, start: f64) -> f64 {
        // With t = t₀ x², √(c₀ t + c₁ t²) dt = 2 t₀^{3/2} x² √(c₀ + c₁ t₀ x²) dx, smooth in x: Simpson's rule on 16 intervals is exact to
        // rounding nearly.
        let t0 = 1.0 - start * start / self.square;
        let [c0, c1] = self.constants;
        let value = |x: f64| x * x * (c0 + c1 * t0 * x * x).max(0.0).sqrt();
        let intervals = 16;
        let sum: f64 = (0..=intervals)
            .map(|k| {
                let weight = match k {
                    0 => 1.0,
                    k if k == intervals => 1.0,
                    k if k % 2 == 1 => 4.0,
                    _ => 2.0,
                };
                weight * value(f64::from(k) / f64::from(intervals))
            })
            .sum();
        PI * self.square * 2.0 * t0.powf(1.5) * sum / (3.0 * f64::from(intervals))
    }
}

/// c₀ and c₁ by least squares for a given a².
fn constants(fitted: &[&Mean], square: f64) -> Option<[f64; 2]> {
    let mut normal = nalgebra::Matrix2::<f64>::zeros();
    let mut right = nalgebra::Vector2::<f64>::zeros();
    for mean in fitted {
        let t = 1.0 - mean.square / square;
        let row = nalgebra::Vector2::new(t, t * t);
        normal += row * row.transpose();
        right += row * mean.pressure_squared(Some(square));
    }
    Some((normal.try_inverse()? * right).into())
}

/// Pressures at the edge ends: p² linear in r² between the means, and the fit's where these end.
fn smooth(points: &[PressurePoint], means: &[Mean], fit: Option<&Fit>) -> Vec<PressurePoint> {
    let edge = fit.map(|fit| fit.square);
    let between_means = |end: usize, square: f64| {
        let next = end.clamp(1, means.len() - 1);
        let [a, b] = [&means[next - 1], &means[next]];
        let t = (square - a.square) / (b.square - a.square);
        let [p, q] = [a, b].map(|mean| mean.pressure_squared(edge));
        p + t * (q - p)
    };
    let mut smooth = Vec::with_capacity(points.len() / 2 + 1);
    for (end, point) in points.iter().step_by(2).enumerate() {
        let square = point.r_m * point.r_m;
        let pressure_squared = match fit {
            Some(fit) if end > fit.from => fit.pressure_squared(square),
            _ if end < means.len() && means.len() > 1 => between_means(end, square),
            _ => point.pressure_pa * point.pressure_pa,
        };
        if pressure_squared > 0.0 {
            smooth.push(PressurePoint {
                pressure_pa: pressure_squared.sqrt(),
                ..*point
            });
        }
    }
    smooth
}
