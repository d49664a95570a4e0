//! Irregular input: coinciding, flat and invalid points.

use crate::common::{Uniform, bend, fit, options};
use nalgebra::{Point2, Point3, SVector};
use tactile_tps::{FitOptions, NegR, R2LogR, Smoothing, ThinPlateSpline, TpsError};

/// Two sources at one position with the same value are one point. With two values they are their
/// weighted mean, smoothed.
#[test]
fn coinciding_points_are_merged() {
    let mut random = Uniform(11);
    let mut sources = random.points::<2>(12);
    let mut targets: Vec<_> = sources.iter().map(bend).collect();
    let apart = fit(&sources, &targets, &FitOptions::default());
    sources.push(sources[3]);
    targets.push(targets[3]);
    let merged = fit(&sources, &targets, &FitOptions::default());
    let query = random.point();
    assert_eq!(
        (merged.report.merged, merged.apply(&query)),
        (1, apart.apply(&query))
    );
    targets[12].x += 0.2;
    let conflict = ThinPlateSpline::fit(&sources, &targets, &FitOptions::default());
    assert_eq!(
        conflict.err(),
        Some(TpsError::Conflict {
            first: 3,
            second: 12
        })
    );
    let options = options(R2LogR, Smoothing::Lambda(0.1), None);
    let smoothed = fit(&sources, &targets, &options);
    // One point of weight two at the mean is the same problem.
    targets[3].x += 0.1;
    let weights = (0..12).map(|i| if i == 3 { 2.0 } else { 1.0 }).collect();
    let single = fit(
        &sources[..12],
        &targets[..12],
        &options.with_weights(weights).expect("weights"),
    );
    assert!((smoothed.apply(&query) - single.apply(&query)).norm() < 1e-12);
}

/// A flat set in space is warped only along itself. A tolerance decides what is flat.
#[test]
fn directions_that_are_not_spanned_are_dropped() {
    let mut random = Uniform(5);
    let flat = |thickness: f64, random: &mut Uniform| {
        let points = random.points::<3>(25);
        points
            .iter()
            .map(|p| Point3::new(p.x, p.y, 0.5 * p.x - 0.25 * p.y + thickness * p.z))
            .collect::<Vec<_>>()
    };
    let exact = flat(0.0, &mut random);
    let targets: Vec<_> = exact.iter().map(bend).collect();
    let spline = fit(&exact, &targets, &FitOptions::new(NegR));
    assert_eq!(spline.report.rank, 3);
    let normal = SVector::<f64, 3>::new(0.5, -0.25, -1.0).normalize();
    // The identity is kept across it.
    assert!((spline.jacobian(&exact[0]) * normal - normal).norm() < 1e-10);
    let thin = flat(1e-4, &mut random);
    assert_eq!(fit(&thin, &targets, &FitOptions::new(NegR)).report.rank, 4);
    let dropped = fit(
        &thin,
        &targets,
        &FitOptions::new(NegR)
            .with_rank_tolerance(1e-2)
            .expect("a tolerance"),
    );
    assert_eq!(dropped.report.rank, 3);
    assert!(dropped.report.extents[2] < 1e-3);
    for scale in [1e-9, 1.0, 1e9] {
        let line: Vec<_> = (0..25)
            .map(|i| Point3::from([scale * f64::from(i); 3]))
            .collect();
        let spline = fit(&line, &targets, &FitOptions::new(NegR));
        assert_eq!(spline.report.rank, 2, "one direction at scale {scale}");
    }
    let report = fit(&[exact[0]; 5], &[targets[0]; 5], &FitOptions::new(NegR)).report;
    assert_eq!((report.rank, report.merged), (1, 4));
}

#[test]
fn bad_input_is_named() {
    let points = Uniform(3).points::<2>(6);
    let fit = |sources: &[Point2<f64>], targets: &[Point2<f64>], options| {
        ThinPlateSpline::fit(sources, targets, &options)
            .expect_err("an error")
            .to_string()
    };
    let plain = FitOptions::default;
    assert_eq!(fit(&[], &[], plain()), "no source points to fit");
    let mut bad = points.clone();
    bad[4].y = f64::NAN;
    assert_eq!(
        fit(&bad, &points, plain()),
        "source points: number 4 (from zero) is not finite"
    );
    assert_eq!(
        fit(&points, &bad, plain()),
        "target points: number 4 (from zero) is not finite"
    );
    assert_eq!(
        fit(&points, &points[1..], plain()),
        "target points: expected 6 of them, found 5"
    );
    for lambda in [-1.0, f64::NAN, f64::INFINITY] {
        let refused = plain().with_smoothing(Smoothing::Lambda(lambda));
        assert!(matches!(refused, Err(TpsError::Lambda { .. })), "{lambda}");
    }
    for tolerance in [-0.1, 1.0, f64::NAN] {
        let refused = plain().with_rank_tolerance(tolerance);
        assert!(
            matches!(refused, Err(TpsError::RankTolerance { .. })),
            "{tolerance}"
        );
    }
    for tolerance in [0.0, 1.0, -1.0, f64::NAN] {
        let refused = plain().with_tolerance(tolerance);
        assert!(
            matches!(refused, Err(TpsError::Tolerance { .. })),
            "{tolerance}"
        );
    }
    let weights = |bad| vec![1.0, 1.0, bad, 1.0, 1.0, 1.0];
    for weight in [-1.0, f64::NAN, f64::INFINITY] {
        let refused = plain().with_weights(weights(weight));
        assert!(
            matches!(refused, Err(TpsError::Weight { index: 2, .. })),
            "{weight}"
        );
    }
    assert_eq!(
        plain().with_weights(vec![0.0; 6]),
        Err(TpsError::Empty("weights"))
    );
    let five = plain().with_weights(vec![1.0; 5]).expect("weights");
    assert!(fit(&points, &points, five).starts_with("weights: expected 6"));
    let few = fit(
        &points[..3],
        &points[..3],
        options(R2LogR, Smoothing::Gcv, None),
    );
    assert!(few.starts_with("cross-validation needs more than 3"));
}
