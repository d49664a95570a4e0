//! How far a contact's outline is from a circle.

use crate::contact::Run;

/// Elongation below which an outline counts as a circle: pixels that are not square by half a per cent change a ball's modulus by
/// less than one.
const ROUND: f64 = 5e-3;
/// Standard deviation of an outline's place in pixels: 1/√12 of a step of one pixel.
const STEP_SD: f64 = 0.29;
/// Standard errors by which an elongation must stand out.
const SIGNIFICANT: f64 = 4.0;

/// Ratio of the longer to the shorter half axis of the mask's ellipse of inertia, less one; `None` where it does not stand out of what
/// whole pixels leave. The Jacobian takes a step [x, y] in pixels to metres: [∂x, ∂y] in rows.
///
/// An outline whose N = 2πa places are off by σ each has a second harmonic of σ √(2/N), and an elongation of twice that over a.
/// O(rows of the mask).
pub(super) fn elongation(mask: &[Run], jacobian: [[f64; 2]; 2]) -> Option<f64> {
    let (mut n, mut x, mut y) = (0.0, 0.0, 0.0);
    for run in mask {
        let (len, middle) = pixels(run);
        n += len;
        x += len * middle;
        y += len * f64::from(run.row);
    }
    let (x, y) = (x / n, y / n);
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for run in mask {
        let (len, middle) = pixels(run);
        let (u, v) = (middle - x, f64::from(run.row) - y);
        xx += len * (u * u + len * len / 12.0);
        xy += len * u * v;
        yy += len * (v * v + 1.0 / 12.0);
    }
    let [[a, b], [c, d]] = jacobian;
    // J C Jᵀ, its trace and half the difference of its eigenvalues.
    let moved_xx = a * a * xx + 2.0 * a * b * xy + b * b * yy;
    let moved_yy = c * c * xx + 2.0 * c * d * xy + d * d * yy;
    let moved_xy = a * c * xx + (a * d + b * c) * xy + b * d * yy;
    let mean = 0.5 * (moved_xx + moved_yy);
    let half = (0.5 * (moved_xx - moved_yy)).hypot(moved_xy);
    let elongation = ((mean + half) / (mean - half)).sqrt() - 1.0;
    let radius_px = (n / std::f64::consts::PI).sqrt();
    let error = 2.0 * STEP_SD / (radius_px * (std::f64::consts::PI * radius_px).sqrt());
    (elongation > ROUND.max(SIGNIFICANT * error)).then_some(elongation)
}

/// Number of a run's pixels, and its middle.
fn pixels(run: &Run) -> (f64, f64) {
    (
        run.len() as f64,
        0.5 * (f64::from(run.start) + f64::from(run.end) - 1.0),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The mask of an ellipse with these half axes, turned by 30°.
    fn ellipse(half: [f64; 2]) -> Vec<Run> {
        let (sin, cos) = std::f64::consts::FRAC_PI_6.sin_cos();
        let inside = |u: f64, v: f64| {
            let place = [cos * u + sin * v, cos * v - sin * u];
            (place[0] / half[0]).hypot(place[1] / half[1]) <= 1.0
        };
        let row = |row: u32| {
            let v = f64::from(row) - 120.3;
            let columns = (0..240_u32).filter(move |x| inside(f64::from(*x) - 119.8, v));
            let (start, last) = (columns.clone().min()?, columns.max()?);
            Some(Run {
                row,
                start,
                end: last + 1,
            })
        };
        (0..240).filter_map(row).collect()
    }

    const SQUARE: [[f64; 2]; 2] = [[20e-6, 0.0], [0.0, 20e-6]];

    #[test]
    fn circles_of_every_size_are_round() {
        for k in 0..60 {
            let radius = 8.0 + 1.7 * f64::from(k);
            assert_eq!(
                elongation(&ellipse([radius; 2]), SQUARE),
                None,
                "{radius} px"
            );
        }
    }

    #[test]
    fn an_ellipse_is_found_with_its_axes_and_undone_by_its_pixels() {
        let found = elongation(&ellipse([92.0, 90.0]), SQUARE).unwrap();
        // A tenth of what whole pixels may leave at this size.
        assert!((found - 2.0 / 90.0).abs() < 1e-3, "{found}");
        // The Jacobian of pixels that squeeze the same ellipse to a circle.
        let (sin, cos) = std::f64::consts::FRAC_PI_6.sin_cos();
        let (p, q) = (1.0 / 92.0, 1.0 / 90.0);
        let jacobian = [
            [p * cos * cos + q * sin * sin, (p - q) * sin * cos],
            [(p - q) * sin * cos, p * sin * sin + q * cos * cos],
        ];
        assert_eq!(elongation(&ellipse([92.0, 90.0]), jacobian), None);
    }
}
