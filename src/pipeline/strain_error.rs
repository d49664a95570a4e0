//! How well control points know the mean strain.
//!
//! Three errors go beyond the spread of the strain over the points. Those of a reconstructed surface are shared by neighbours,
//! so that n points know less than n independent ones: residuals of the affine fit are added up over runs of neighbours,
//! and the sums taken as independent (cluster-robust errors: Liang & Zeger, Biometrika 73, 1986). And the contact's edge,
//! to which the points are tied, is known to a part of a pixel: the smaller contact is off by more, relatively. Third, errors of
//! the first surface's points make any fit to them too flat (regression dilution: Fuller, Measurement Error Models, 1987, §1.1).
use crate::tps::StrainSpline;
use nalgebra::{Matrix3, Point3, Vector3};

/// How far, in pixels of the surfaces, the edge of a mask lies from the contact's.
const EDGE_PX: f64 = 0.5;

/// Standard errors of the mean Green–Lagrange strain between matched points. `grid_m` is the surfaces' pixel.
pub(super) fn mean_strain_error(
    sources: &[Point3<f64>],
    targets: &[Point3<f64>],
    grid_m: f64,
) -> Matrix3<f64> {
    let [from, to] = [sources, targets].map(Disc::of);
    let offsets = || pairs_of(sources, targets, [&from, &to]);
    let spread: Matrix3<f64> = offsets().map(|(d, _)| d * d.transpose()).sum();
    // What the points do not span they know nothing of: a little of their size keeps the inverse finite.
    let inverse = (spread + Matrix3::identity() * (1e-12 * spread.trace())).try_inverse();
    let Some(inverse) = inverse else {
        return Matrix3::zeros();
    };
    let slope = offsets()
        .map(|(d, t)| t * d.transpose())
        .sum::<Matrix3<f64>>()
        * inverse;
    let gradient = clustered(offsets(), &slope, &inverse);
    let along = |k: usize| slope.column(k).norm();
    let edge = EDGE_PX * grid_m * (from.radius.recip() - to.radius.recip()).abs();
    let residual: Vector3<f64> = offsets()
        .map(|(d, t)| t - slope * d)
        .map(|r| r.component_mul(&r))
        .sum();
    // Both surfaces have the same errors, in the units of the first.
    let dilution = |k: usize| residual[k] * inverse[(k, k)] / (1.0 + along(k).powi(2));
    Matrix3::from_fn(|j, k| {
        if j == k {
            let square = along(j).powi(2);
            (along(j) * gradient[(j, j)])
                .hypot(square * edge)
                .hypot(square * dilution(j))
        } else {
            0.5 * (along(j) * gradient[(j, k)]).hypot(along(k) * gradient[(k, j)])
        }
    })
}

/// The disc in the image plane that has the points' centroid and spread.
struct Disc {
    centroid: Vector3<f64>,
    radius: f64,
}

impl Disc {
    fn of(points: &[Point3<f64>]) -> Self {
        let n = points.len() as f64;
        let centroid = points.iter().map(|p| p.coords).sum::<Vector3<f64>>() / n;
        let offsets = points.iter().map(|p| p.coords - centroid);
        let square = offsets.map(|d| d.xy().norm_squared()).sum::<f64>() / n;
        let radius = (2.0 * square).sqrt().max(f64::MIN_POSITIVE);
        Self { centroid, radius }
    }
}

/// The pairs' offsets from their centroids.
fn pairs_of<'a>(
    sources: &'a [Point3<f64>],
    targets: &'a [Point3<f64>],
    [from, to]: [&'a Disc; 2],
) -> impl ExactSizeIterator<Item = (Vector3<f64>, Vector3<f64>)> + 'a {
    let pairs = sources.iter().zip(targets);
    pairs.map(|(s, t)| (s.coords - from.centroid, t.coords - to.centroid))
}

/// Standard errors of the affine gradient's entries, runs of neighbours being independent.
fn clustered(
    mut offsets: impl ExactSizeIterator<Item = (Vector3<f64>, Vector3<f64>)>,
    slope: &Matrix3<f64>,
    inverse: &Matrix3<f64>,
) -> Matrix3<f64> {
    let runs = offsets.len().div_ceil(StrainSpline::RUN_LENGTH);
    let mut variance = Matrix3::zeros();
    for _ in 0..runs {
        let run = offsets.by_ref().take(StrainSpline::RUN_LENGTH);
        let sum: Matrix3<f64> = run.map(|(d, t)| (t - slope * d) * d.transpose()).sum();
        let share = sum * inverse;
        variance += share.component_mul(&share);
    }
    // The fit itself takes four of the runs' degrees of freedom.
    let runs = runs as f64;
    variance.map(|v| (v * runs / (runs - 4.0).max(1.0)).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn dome() -> Vec<Point3<f64>> {
        let point = |i: usize| {
            let (z, angle) = (1.0 - i as f64 / 200.0, 2.4 * i as f64);
            let r = (1.0 - z * z).sqrt();
            Point3::new(r * angle.cos(), r * angle.sin(), z)
        };
        (0..200).map(point).collect()
    }

    fn wave(i: usize) -> f64 {
        2.0 * ((i as f64 * 12.9898).sin() * 43_758.545_3).rem_euclid(1.0) - 1.0
    }

    #[test]
    fn exact_pairs_have_no_error_but_the_edges() {
        let sources = dome();
        let targets: Vec<_> = sources.iter().map(|p| p * 1.2).collect();
        // What is added to keep the inverse finite, 1e-12 of the trace, and rounding.
        assert!(mean_strain_error(&sources, &targets, 0.0).amax() < 1e-10);
        let edge = mean_strain_error(&sources, &targets, 0.1);
        let disc =
            (2.0 * sources.iter().map(|p| p.x * p.x + p.y * p.y).sum::<f64>() / 200.0).sqrt();
        let expected = 1.44 * EDGE_PX * 0.1 * (1.0 - 1.0 / 1.2) / disc;
        // The disc's centroid is not quite the origin.
        assert!((edge[(2, 2)] / expected - 1.0).abs() < 1e-3, "{edge}");
    }

    /// Monte Carlo: errors shared by runs of neighbours, the mean strain's true error beside the one told.
    #[test]
    fn errors_that_neighbours_share_are_told() {
        let sources = dome();
        let (mut told, mut true_square, trials) = (0.0, 0.0, 200);
        for trial in 0..trials {
            let off = |i: usize| 0.02 * wave(i / StrainSpline::RUN_LENGTH + 1000 * trial);
            let targets: Vec<_> = sources
                .iter()
                .enumerate()
                .map(|(i, p)| Point3::new(p.x, p.y, 1.2 * p.z + off(i)))
                .collect();
            let [from, to] = [&sources, &targets].map(|points| Disc::of(points));
            let offsets = || pairs_of(&sources, &targets, [&from, &to]);
            let spread: Matrix3<f64> = offsets().map(|(d, _)| d * d.transpose()).sum();
            let outer: Matrix3<f64> = offsets().map(|(d, t)| t * d.transpose()).sum();
            let slope = (outer * spread.try_inverse().unwrap())[(2, 2)];
            told += mean_strain_error(&sources, &targets, 0.0)[(2, 2)].powi(2);
            true_square += (0.5 * (slope * slope - 1.44)).powi(2);
        }
        let ratio = (told / true_square).sqrt();
        // Twenty runs of which the fit takes four: the mean variance over 200 trials is known to a tenth or so.
        assert!((0.8..1.3).contains(&ratio), "{ratio}");
    }

    #[test]
    fn points_that_span_no_volume_leave_a_finite_error() {
        let flat: Vec<_> = dome().iter().map(|p| Point3::new(p.x, p.y, 0.0)).collect();
        assert!(
            mean_strain_error(&flat, &flat, 1e-3)
                .iter()
                .all(|v| v.is_finite())
        );
        let one = vec![Point3::origin(); 20];
        assert!(
            mean_strain_error(&one, &one, 1e-3)
                .iter()
                .all(|v| v.is_finite())
        );
    }
}
