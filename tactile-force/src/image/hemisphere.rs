//! Hertz's pressure profile.

use ndarray::Array2;

use super::quadrature::Gauss;
use super::{PixelGrid, ProfileMoments};
use crate::error::{ForceError, Requirement};
use crate::estimate::Real;

/// A √(1 − |x − c|²/a²) inside the radius a, zero outside; lengths in any unit.
///
/// ```
/// use tactile_force::{HertzProfile, PixelGrid};
/// let blob = HertzProfile::new([7.2_f64, 8.1], 5.5, 100.0)?;
/// let image = blob.image(&PixelGrid { rows: 16, columns: 16, size: [1.0; 2], first: [0.0; 2] });
/// assert!((image.sum() / blob.whole().integral - 1.0).abs() < 1e-14);
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct HertzProfile<T> {
    centre: [T; 2],
    radius: T,
    peak: T,
}

impl<T: Real> HertzProfile<T> {
    /// A profile with centre [x, y], contact radius and height at the centre.
    ///
    /// # Errors
    /// A centre or height that is not finite, a radius that is not positive.
    pub fn new(centre: [T; 2], radius: T, peak: T) -> Result<Self, ForceError> {
        for c in centre {
            Requirement::Finite.check("centre", c.as_f64())?;
        }
        Requirement::Positive.check("radius", radius.as_f64())?;
        Requirement::Finite.check("peak", peak.as_f64())?;
        Ok(Self {
            centre,
            radius,
            peak,
        })
    }

    /// Moments over the whole plane: ⅔πa²A, the centre, a√(2/5).
    pub fn whole(&self) -> ProfileMoments<T> {
        let a = self.radius.as_f64();
        ProfileMoments {
            integral: T::nearest(2.0 / 3.0 * std::f64::consts::PI * a * a * self.peak.as_f64()),
            centroid: self.centre,
            radius_of_gyration: T::nearest(a * 0.4_f64.sqrt()),
        }
    }

    /// Moments over the rectangle of these ranges [from, to] along x and along y; `None` if it does not meet the contact.
    ///
    /// ```
    /// use tactile_force::HertzProfile;
    ///
    /// let contact = HertzProfile::new([0.0_f64, 0.0], 2.0, 1.0)?;
    /// let half = contact.within([[0.0, 5.0], [-5.0, 5.0]]).expect("they meet");
    /// assert!((half.integral - 0.5 * contact.whole().integral).abs() < 1e-13);
    /// assert!(contact.within([[3.0, 5.0], [-5.0, 5.0]]).is_none());
    /// # Ok::<(), tactile_force::ForceError>(())
    /// ```
    pub fn within(&self, [x_range, y_range]: [[T; 2]; 2]) -> Option<ProfileMoments<T>> {
        let gauss = Gauss::new();
        let (c, a) = (self.centre.map(T::as_f64), self.radius.as_f64());
        let scaled = |ends: [T; 2], c: f64| ends.map(|e| (e.as_f64() - c) / a);
        let (x, y) = (scaled(x_range, c[0]), scaled(y_range, c[1]));
        let along = |x: [f64; 2], y: [f64; 2], origin: f64, about: f64| {
            strip(&gauss, x, y, [origin, about])
        };
        // Moments about the rectangle's own first corner, then about the centroid: no sum cancels.
        let [volume, mx, _] = along(x, y, x[0], 0.0);
        let [_, my, _] = along(y, x, y[0], 0.0);
        if volume == 0.0 {
            return None;
        }
        let local = [mx / volume, my / volume];
        let square = along(x, y, x[0], x[0] + local[0])[2] + along(y, x, y[0], y[0] + local[1])[2];
        let corner = [x_range[0].as_f64(), y_range[0].as_f64()];
        Some(ProfileMoments {
            integral: T::nearest(volume * a * a * self.peak.as_f64()),
            centroid: std::array::from_fn(|k| T::nearest(corner[k] + a * local[k])),
            radius_of_gyration: T::nearest(a * (square / volume).sqrt()),
        })
    }

    /// Averages over the pixels of a grid, [row, column]. Some microseconds a pixel.
    pub fn image(&self, grid: &PixelGrid<T>) -> Array2<T> {
        let gauss = Gauss::new();
        let (c, a) = (self.centre.map(T::as_f64), self.radius.as_f64());
        Array2::from_shape_fn((grid.rows, grid.columns), |(row, column)| {
            let [x, y] = grid.pixel(row, column);
            let (x, y) = (x.map(|e| (e - c[0]) / a), y.map(|e| (e - c[1]) / a));
            let volume = strip(&gauss, x, y, [0.0; 2])[0];
            T::nearest(self.peak.as_f64() * volume / ((x[1] - x[0]) * (y[1] - y[0])))
        })
    }
}

/// ∫∫ √(1 − x² − y²)₊ times 1, x − origin and (x − about)² over a rectangle, for the unit disc.
///
/// Along y in closed form; along x by quadrature between the special places where a side meets the edge, with x = m + h sin φ, which
/// turns the powers 3/2 at those places into whole ones.
fn strip(gauss: &Gauss<32>, x: [f64; 2], y: [f64; 2], [origin, about]: [f64; 2]) -> [f64; 3] {
    let ends = x.map(|x| x.clamp(-1.0, 1.0));
    let meets = y.map(|side| ((1.0 - side) * (1.0 + side)).max(0.0).sqrt());
    let mut special = [-1.0, 1.0, -meets[0], meets[0], -meets[1], meets[1]];
    special.sort_by(f64::total_cmp);
    let mut total = [0.0; 3];
    let mut from = ends[0];
    while from < ends[1] {
        let next = special.iter().copied().find(|s| *s > from).unwrap_or(1.0);
        let to = graded(from, next.min(ends[1]), &special);
        let part = piece(gauss, [from, to], y, [origin, about]);
        total.iter_mut().zip(part).for_each(|(t, p)| *t += p);
        from = to;
    }
    total
}

/// How far a piece that starts at `from` may go towards `end`: three times as far as the special place behind it (or behind
/// the end) lies away, so that pieces shrink towards places where the integrand is not smooth.
fn graded(from: f64, end: f64, special: &[f64; 6]) -> f64 {
    let away = |d: f64| if d > 0.0 { d } else { f64::INFINITY };
    let behind = special
        .iter()
        .map(|s| away(from - s))
        .fold(f64::INFINITY, f64::min);
    let beyond = special
        .iter()
        .map(|s| away(s - end))
        .fold(f64::INFINITY, f64::min);
    let length = end - from;
    let reach = length.min(3.0 * behind);
    // From the far end: keep a quarter of what is left until that is thrice the distance beyond.
    let reach = if length > 3.0 * beyond {
        reach.min(0.75 * length)
    } else {
        reach
    };
    if reach >= length || from + reach <= from {
        end
    } else {
        from + reach
    }
}

/// The same over a piece without special places inside, with x = m + h sin φ.
fn piece(gauss: &Gauss<32>, ends: [f64; 2], y: [f64; 2], [origin, about]: [f64; 2]) -> [f64; 3] {
    let (middle, half) = (0.5 * (ends[0] + ends[1]), 0.5 * (ends[1] - ends[0]));
    let quarter = std::f64::consts::FRAC_PI_2;
    gauss.integrate(-quarter, quarter, |phi| {
        let at = middle + half * phi.sin();
        let f = chord(((1.0 - at) * (1.0 + at)).max(0.0), y) * half * phi.cos();
        [f, (at - origin) * f, (at - about).powi(2) * f]
    })
}

/// ∫ √(w² − y²) dy between two limits, cut to |y| ≤ w, as ½w²[(Δ − sin Δ) + sin Δ (1 + cos Σ)] with y = w sin θ, Δ and Σ the difference
/// and sum of the two θ. Nothing cancels, neither for limits close together nor near the edge.
fn chord(w2: f64, y: [f64; 2]) -> f64 {
    let w = w2.sqrt();
    let [p, q] = y.map(|y| y.clamp(-w, w));
    if q <= p {
        return 0.0;
    }
    // The half with the larger |y| on the positive side; the integrand is even.
    let (p, q) = if p + q < 0.0 { (-q, -p) } else { (p, q) };
    let [sp, sq] = [p, q].map(|y| ((w - y) * (w + y)).max(0.0).sqrt());
    let sine = if p > 0.0 {
        (q - p) * (q + p) / (q * sp + p * sq)
    } else {
        (q * sp - p * sq) / w2
    };
    let cosine = (sp * sq + p * q) / w2;
    let delta = sine.atan2(cosine);
    let cos_sum = (sp * sq - p * q) / w2;
    let one_plus = if cos_sum < 0.0 {
        let sin_sum = (q * sp + p * sq) / w2;
        sin_sum * sin_sum / (1.0 - cos_sum)
    } else {
        1.0 + cos_sum
    };
    0.5 * w2 * (minus_sine(delta) + sine * one_plus)
}

/// Δ − sin Δ.
fn minus_sine(delta: f64) -> f64 {
    if delta > 0.5 {
        return delta - delta.sin();
    }
    let d2 = delta * delta;
    let mut term = delta * d2 / 6.0;
    let mut sum = 0.0;
    for k in 2..12 {
        sum += term;
        term *= -d2 / f64::from((2 * k) * (2 * k + 1));
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chord_agrees_with_the_antiderivative() {
        let area = |w: f64, y: f64| 0.5 * (y * (w * w - y * y).sqrt() + w * w * (y / w).asin());
        for (w, p, q) in [
            (1.0, -0.3, 0.8),
            (0.7, 0.1, 0.2),
            (2.0, -1.9, -0.5),
            (1.0, -1.0, 1.0),
            (0.9, 0.6, 0.9),
        ] {
            // The antiderivative's rounding is some ulps of w².
            assert!(
                (chord(w * w, [p, q]) - (area(w, q) - area(w, p))).abs() < 1e-15 * 4.0,
                "{w} {p} {q}"
            );
        }
    }
}
