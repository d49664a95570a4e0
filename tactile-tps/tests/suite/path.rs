//! Values for many λ against one fit after the other.

use crate::common::{Uniform, bend};
use nalgebra::Point3;
use tactile_tps::{
    Factorization, FitOptions, Kernel, LambdaPath, NegR, Smoothing, Solver, Spline,
    SplineWorkspace, TpsError,
};

const LAMBDAS: [f64; 4] = [1e-4, 0.02, 1.0, 300.0];

/// Points in space, flattened towards a plane by `height`.
fn cloud(n: usize, height: f64) -> Vec<Point3<f64>> {
    let points = Uniform(n as u64).points::<3>(n);
    let flatten = |p: &Point3<f64>| Point3::new(p.x, p.y, height * p.z);
    points.iter().map(flatten).collect()
}

fn moved(points: &[Point3<f64>]) -> Vec<Point3<f64>> {
    points.iter().map(bend).collect()
}

/// Greatest distance of the values from those of one fit for each λ, relative to the targets.
fn worst<const D: usize, const M: usize, K: Kernel>(
    sources: &[nalgebra::Point<f64, D>],
    targets: &[nalgebra::Point<f64, M>],
    options: &FitOptions<K>,
    points: &[nalgebra::Point<f64, D>],
) -> f64 {
    let mut path = LambdaPath::fit(sources, targets, options, &LAMBDAS).unwrap();
    let size = targets.iter().map(|t| t.coords.amax()).fold(0.0, f64::max);
    let mut worst = 0.0_f64;
    for (l, lambda) in LAMBDAS.into_iter().enumerate() {
        let options = options
            .clone()
            .with_smoothing(Smoothing::Lambda(lambda))
            .unwrap();
        let spline = Spline::fit(sources, targets, &options).unwrap();
        for point in points {
            worst = worst.max((spline.apply(point) - path.values(point)[l]).amax() / size);
        }
    }
    worst
}

/// Rounding times the condition number of the stiffest system, some 1e6 at the least λ.
const ROUNDING: f64 = 1e-10;

#[test]
fn values_are_those_of_one_fit_after_the_other() {
    let sources = cloud(60, 1.0);
    let targets = moved(&sources);
    let points = cloud(37, 0.9);
    let plain = FitOptions::new(NegR);
    assert!(worst(&sources, &targets, &plain, &points) < ROUNDING);
    let weights = (0..60).map(|i| f64::from(i % 4) * 0.3).collect();
    let weighted = plain.clone().with_weights(weights).unwrap();
    assert!(worst(&sources, &targets, &weighted, &points) < ROUNDING);
    // Coplanar points: the spline has no direction across.
    let (flat, plane) = (cloud(60, 0.0), cloud(5, 0.0));
    assert!(worst(&flat, &moved(&flat), &plain, &plane) < ROUNDING);
    // Points given twice, with targets that differ.
    let (mut twice, mut both) = (sources.clone(), targets.clone());
    twice.extend_from_slice(&sources[..7]);
    both.extend(targets[..7].iter().map(|t| t * 1.1));
    assert!(worst(&twice, &both, &plain, &points) < ROUNDING);
}

#[test]
fn what_cannot_be_fitted_is_refused() {
    let sources = cloud(20, 1.0);
    let (targets, options) = (moved(&sources), FitOptions::new(NegR));
    let fit = |lambda: f64, targets: &[Point3<f64>]| {
        LambdaPath::fit(&sources, targets, &options, &[lambda])
    };
    for lambda in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let error = fit(lambda, &targets);
        assert!(matches!(error, Err(TpsError::Lambda { .. })), "{lambda}");
    }
    for few in [&targets[1..], &[Point3::new(f64::NAN, 0.0, 0.0)]] {
        assert!(matches!(fit(1.0, few), Err(TpsError::Length { .. })));
    }
    let mut none = targets.clone();
    none[3].y = f64::NAN;
    assert!(matches!(fit(1.0, &none), Err(TpsError::NotFinite { .. })));
    let nowhere = Point3::new(f64::NAN, 0.0, 0.0);
    let values = fit(1.0, &targets).unwrap().values(&nowhere)[0];
    assert!(values.coords.iter().all(|x| x.is_nan()), "as a spline's");
}

/// In the memory of other splines, of more or fewer points, with or without weights, the values are
/// those of a new fit.
#[test]
fn what_was_fitted_before_leaves_no_trace() {
    let query = Point3::new(0.2, 0.1, 0.7);
    let weights = |n: usize| (0..n).map(|i| f64::from(i as u32 % 3)).collect::<Vec<_>>();
    let plain = FitOptions::new(NegR);
    let path = |n: usize, lambdas: &[f64], options: &FitOptions<NegR>| {
        let sources = cloud(n, 1.0);
        LambdaPath::fit(&sources, &moved(&sources), options, lambdas).unwrap()
    };
    let mut kept = path(70, &LAMBDAS, &plain);
    for (n, weighted, twice) in [
        (40, true, false),
        (90, false, true),
        (12, true, true),
        (91, false, false),
    ] {
        let mut sources = cloud(n, 1.0);
        if twice {
            sources[5] = sources[2];
        }
        let targets = moved(&sources);
        let mut options = plain.clone();
        if weighted {
            options.set_weights(&weights(n)).unwrap();
        }
        let lambdas = &LAMBDAS[..1 + n % 3];
        kept = kept.refit(&sources, &targets, &options, lambdas).unwrap();
        let mut new = LambdaPath::fit(&sources, &targets, &options, lambdas).unwrap();
        assert_eq!(kept.values(&query), new.values(&query), "{n}");
        let smooth = options.with_smoothing(Smoothing::Lambda(0.02)).unwrap();
        let factored = Factorization::new(
            &cloud(33, 1.0),
            &plain.clone().with_smoothing(Smoothing::Gcv).unwrap(),
        );
        let again = factored.unwrap().refactor(&sources, &smooth).unwrap();
        let spline: Spline<3, 3, _> = again.fit(&targets).unwrap();
        let fresh: Spline<3, 3, _> = Spline::fit(&sources, &targets, &smooth).unwrap();
        assert_eq!(spline.apply(&query), fresh.apply(&query), "{n}");
        let gcv = plain.clone().with_smoothing(Smoothing::Gcv).unwrap();
        let validated: Spline<3, 3, _> = again
            .refactor(&sources, &gcv)
            .unwrap()
            .fit(&targets)
            .unwrap();
        let fresh: Spline<3, 3, _> = Spline::fit(&sources, &targets, &gcv).unwrap();
        assert_eq!(validated.apply(&query), fresh.apply(&query), "{n}");
    }
}

/// A factor of the last points is not taken for one of these: what has none, by its smoothing or
/// its number of points, is solved anew.
#[test]
fn a_factor_of_other_points_is_not_used() {
    let (old, sources) = (cloud(40, 0.7), cloud(40, 1.0));
    let targets = moved(&sources);
    let weights: Vec<_> = (0..40).map(|i| 1.0 + f64::from(i % 3)).collect();
    let query = Point3::new(0.2, 0.1, 0.7);
    let plain = FitOptions::new(NegR);
    for options in [
        plain.clone().with_smoothing(Smoothing::Gcv).unwrap(),
        plain.clone().with_solver(Solver::Iterative),
    ] {
        let refitted = |factorization: Factorization<3, NegR>| {
            let mut spline = Spline::<3, 3, NegR>::default();
            let (weights, none) = (Some(&weights[..]), Some(Smoothing::None));
            factorization
                .refit_with(
                    &mut SplineWorkspace::default(),
                    &targets,
                    weights,
                    none,
                    &mut spline,
                )
                .unwrap();
            spline.apply(&query)
        };
        let kept = Factorization::new(&old, &plain).unwrap();
        let kept = refitted(kept.refactor(&sources, &options).unwrap());
        assert_eq!(
            kept,
            refitted(Factorization::new(&sources, &options).unwrap())
        );
    }
}
