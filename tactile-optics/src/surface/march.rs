//! Intersection of a ray with the deformed top.

use super::TopSurface;
use crate::real::real;
use num_traits::{Float, FloatConst};

/// The first intersection of a ray with the surface inside its support, at a distance along the ray between `from` and `to`.
///
/// g = height − z is the gap above the ray. It closes no faster than u_z + L·√(u_x² + u_y²) with L the steepest slope, so
/// a step of gap over that rate never jumps a crossing; steps are taken until the gap is below `tolerance`.
pub(crate) fn march<T: Float + FloatConst, S: TopSurface<T> + ?Sized>(
    surface: &S,
    position: &[T; 3],
    direction: &[T; 3],
    [from, to]: [T; 2],
    tolerance: T,
) -> Meeting<T> {
    let at = |t: T| -> [T; 3] { core::array::from_fn(|k| position[k] + t * direction[k]) };
    let gap = |t: T| {
        let [x, y, z] = at(t);
        surface.height(x, y) - z
    };
    let closing = direction[2] + surface.steepest() * direction[0].hypot(direction[1]);
    if closing <= T::zero() {
        return Meeting::Missed;
    }
    let (mut t, mut g) = (from, gap(from));
    if g <= tolerance {
        // On the surface: it has just been left, or is met here unless the gap opens.
        let [x, y, _] = at(t);
        let [gx, gy] = surface.gradient(x, y);
        let opening = gx * direction[0] + gy * direction[1] - direction[2];
        if opening <= T::zero() {
            return Meeting::At(t);
        }
        t = t + (tolerance + tolerance) / opening;
        g = gap(t);
    }
    approach(gap, [t, g], to, closing, tolerance)
}

/// Steps from the distance t, where the gap is g, until the gap is below `tolerance`; it closes no faster than `closing`.
#[inline]
fn approach<T: Float + FloatConst>(
    gap: impl Fn(T) -> T,
    [mut t, mut g]: [T; 2],
    to: T,
    closing: T,
    tolerance: T,
) -> Meeting<T> {
    for _ in 0..MAX_STEPS {
        if t > to {
            return Meeting::Missed;
        }
        if g <= tolerance {
            return Meeting::At(t);
        }
        t = t + g / closing;
        g = gap(t);
    }
    Meeting::Undecided
}

/// Steps after which a ray creeping along the surface is given up.
const MAX_STEPS: usize = 20_000;

/// Outcome of [`march`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Meeting<T> {
    /// The ray meets the surface here.
    At(T),
    /// The ray does not meet the surface.
    Missed,
    /// The steps ran out while the ray creeps along the surface.
    Undecided,
}

/// Gap taken for contact: far below any length that matters, far above rounding.
pub(crate) fn contact_gap<T: Float + FloatConst>(thickness: T) -> T {
    thickness * T::epsilon().powf(real(0.6))
}

#[cfg(test)]
mod tests {
    use super::super::Dimple;
    use super::*;

    /// The first crossing by scanning in small steps and bisecting.
    fn scanned(surface: &Dimple<f64>, p: &[f64; 3], u: &[f64; 3], to: f64) -> Option<f64> {
        let gap = |t: f64| surface.height(p[0] + t * u[0], p[1] + t * u[1]) - (p[2] + t * u[2]);
        let steps = 20_000;
        let first = (1..=steps).find(|&k| gap(to * f64::from(k) / f64::from(steps)) <= 0.0)?;
        let (mut a, mut b) = (
            to * f64::from(first - 1) / f64::from(steps),
            to * f64::from(first) / f64::from(steps),
        );
        for _ in 0..60 {
            let middle = 0.5 * (a + b);
            if gap(middle) > 0.0 {
                a = middle
            } else {
                b = middle
            }
        }
        Some(b)
    }

    #[test]
    fn marching_finds_the_first_crossing_and_no_other() {
        let dimple = Dimple::new([0.5, 0.1], 0.4, 0.2).unwrap();
        let tolerance = 1e-9;
        let (mut met, mut missed) = (0, 0);
        for i in 0..40 {
            for j in 0..10 {
                let angle = -0.3 + 0.02 * f64::from(i);
                let turn = 0.03 * f64::from(j);
                let u = [
                    angle.cos() * turn.cos(),
                    angle.cos() * turn.sin(),
                    angle.sin(),
                ];
                let p = [0.0, -0.05, -0.05 - 0.02 * f64::from(j)];
                let found = march(&dimple, &p, &u, [0.0, 1.2], tolerance);
                match (found, scanned(&dimple, &p, &u, 1.2)) {
                    (Meeting::At(t), Some(expected)) => {
                        // Stopping at a gap of the tolerance is early by it over the closing speed, which is small where
                        // the ray grazes.
                        assert!((t - expected).abs() < 1e-5, "{i} {j}: {t} {expected}");
                        met += 1;
                    }
                    (Meeting::Missed, None) => missed += 1,
                    other => panic!("{i} {j}: {other:?}"),
                }
            }
        }
        assert!(met > 50 && missed > 50, "{met} {missed}");
    }
}
