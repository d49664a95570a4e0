//! The contact radius from the pressure.

use super::pressure::{ContactRadius, PressurePoint};

/// Outermost nodes left out of the fit: the contact's edge lies somewhere within the last element,
/// whose pressures and half of its neighbour's are bent by it.
const LEFT_OUT: usize = 3;
/// Where the fit begins, over the outermost node's radius: further in, p² bends more than a parabola.
const FIT_FROM: f64 = 0.35;

/// The radius at which $p^2 = c_0 (a^2 - r^2) + c_1 (a^2 - r^2)^2$ vanishes.
///
/// The constants fit the pressures inside the contact's outermost elements; a is where the fit carries
/// the same force there as the elements do, which equilibrium makes accurate although their
/// pressures are not. `forces` are the axial nodal forces. `None` with too few nodes in contact.
pub(crate) fn contact_radius(points: &[PressurePoint], forces: &[f64]) -> Option<ContactRadius> {
    let fine = estimate(points, forces, LEFT_OUT)?;
    let uncertainty_m = match estimate(points, forces, LEFT_OUT + 2) {
        Some(coarse) => (fine - coarse).abs(),
        // Nothing to compare with: half the distance between the outermost nodes.
        None => 0.5 * (points[points.len() - 1].r_m - points[points.len() - 2].r_m),
    };
    Some(ContactRadius {
        radius_m: fine,
        uncertainty_m,
    })
}

fn estimate(points: &[PressurePoint], forces: &[f64], left_out: usize) -> Option<f64> {
    let last = points.len().checked_sub(left_out + 1)?;
    let outermost = points[points.len() - 1].r_m;
    let fitted: Vec<(f64, f64)> = points[..=last]
        .iter()
        .filter(|point| point.r_m >= FIT_FROM * outermost)
        .map(|point| (point.r_m * point.r_m, point.pressure_pa * point.pressure_pa))
        .collect();
    if fitted.len() < 4 {
        return None;
    }
    // The hat function of the innermost node outside reaches inwards: its share outside by its
    // integral over 2π r dr.
    let (r, inner, outer) = (points[last].r_m, points[last - 1].r_m, points[last + 1].r_m);
    let (before, after) = (r - inner, outer - r);
    let share_out = after * (0.5 * r + after / 6.0);
    let share_in = before * (0.5 * r - before / 6.0);
    let force =
        forces[last] * share_out / (share_out + share_in) + forces[last + 1..].iter().sum::<f64>();
    let start = r * r;
    let excess = |square: f64| outer_force(&fitted, square, start).map(|found| found - force);
    let (mut low, mut high) = (start * 1.0001, (1.5 * outermost).powi(2));
    if !(excess(low)? < 0.0 && excess(high)? > 0.0) {
        return None;
    }
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if excess(middle)? < 0.0 {
            low = middle;
        } else {
            high = middle;
        }
    }
    Some((0.5 * (low + high)).sqrt())
}

/// π ∫ √(c₀ (A − s) + c₁ (A − s)²) ds from `start` to A, with the constants fitted for that A.
fn outer_force(fitted: &[(f64, f64)], square: f64, start: f64) -> Option<f64> {
    let mut normal = nalgebra::Matrix2::<f64>::zeros();
    let mut right = nalgebra::Vector2::<f64>::zeros();
    for &(s, pressure_squared) in fitted {
        let t = (square - s) / square;
        let row = nalgebra::Vector2::new(t, t * t);
        normal += row * row.transpose();
        right += row * pressure_squared;
    }
    let constants = normal.try_inverse()? * right;
    // With t = (A − s)/A = t₀ x², √(c₀ t + c₁ t²) dt = 2 t₀^{3/2} x² √(c₀ + c₁ t₀ x²) dx, smooth in x:
    // Simpson's rule on 16 intervals is exact to rounding nearly.
    let t0 = (square - start) / square;
    let value = |x: f64| x * x * (constants[0] + constants[1] * t0 * x * x).max(0.0).sqrt();
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
    let integral = sum / (3.0 * f64::from(intervals));
    Some(core::f64::consts::PI * square * 2.0 * t0.powf(1.5) * integral)
}
