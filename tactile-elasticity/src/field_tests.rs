use super::*;

const RUN_LENGTH: usize = 10;

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
    // The term that keeps the inverse finite is 1e-12 of the trace; the rest is rounding.
    assert!(StrainField::mean_error(&sources, &targets, 0.0, RUN_LENGTH).amax() < 1e-10);
    let edge = StrainField::mean_error(&sources, &targets, 0.1, RUN_LENGTH);
    let disc = (2.0 * sources.iter().map(|p| p.x * p.x + p.y * p.y).sum::<f64>() / 200.0).sqrt();
    let expected = 1.44 * EDGE_PX * 0.1 * (1.0 - 1.0 / 1.2) / disc;
    // The centroid of the disc is close to the origin, but not exactly there.
    assert!((edge[(2, 2)] / expected - 1.0).abs() < 1e-3, "{edge}");
}

/// Monte Carlo test with errors shared by runs of neighbours: compares the true error of the mean
/// strain with the stated one.
#[test]
fn errors_that_neighbours_share_are_told() {
    let sources = dome();
    let (mut told, mut true_square, trials) = (0.0, 0.0, 200);
    for trial in 0..trials {
        let off = |i: usize| 0.02 * wave(i / RUN_LENGTH + 1000 * trial);
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
        told += StrainField::mean_error(&sources, &targets, 0.0, RUN_LENGTH)[(2, 2)].powi(2);
        true_square += (0.5 * (slope * slope - 1.44)).powi(2);
    }
    let ratio = (told / true_square).sqrt();
    // There are twenty runs, of which the fit uses four: the mean variance over 200 trials is known
    // to about a tenth.
    assert!((0.8..1.3).contains(&ratio), "{ratio}");
}

#[test]
fn points_that_span_no_volume_leave_a_finite_error() {
    let flat = dome().iter().map(|p| Point3::new(p.x, p.y, 0.0)).collect();
    for points in [flat, vec![Point3::origin(); 20]] {
        let error = StrainField::mean_error(&points, &points, 1e-3, RUN_LENGTH);
        assert!(error.iter().all(|v| v.is_finite()));
    }
}
