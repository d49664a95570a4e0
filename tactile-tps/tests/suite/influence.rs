//! The influence of targets on a spline, against refits and with merged points.

use crate::common::{Uniform, bend, options};
use nalgebra::{Matrix3, Point, Point1, SVector};
use tactile_tps::{
    Factorization, FitOptions, Kernel, NegR, R2LogR, R3, Smoothing, Spline, SplineWorkspace,
    TpsError,
};

/// Largest difference between influences and the values and Jacobians of refits with unit targets.
fn against_unit_targets<const D: usize, K: Kernel + Default>(
    kernel: K,
    smoothing: Smoothing,
    weights: Option<&[f64]>,
) -> f64 {
    let n = 40;
    let options = options(kernel.clone(), smoothing, weights);
    let mut random = Uniform(5);
    let sources = random.points::<D>(n);
    let queries: [Point<f64, D>; 7] = core::array::from_fn(|_| random.point::<D>() * 1.3);
    let factorization = Factorization::new(&sources, &options).expect("a factor");
    let (mut workspace, mut unit) = (SplineWorkspace::default(), Spline::default());
    let mut slopes = vec![SVector::zeros(); 7 * n];
    factorization
        .jacobian_influence_into(&mut workspace, &queries, &mut slopes)
        .expect("a linear map");
    let mut worst: f64 = 0.0;
    for j in 0..n {
        let targets: Vec<_> = (0..n)
            .map(|i| Point1::new(if i == j { 1.0 } else { 0.0 }))
            .collect();
        factorization
            .refit_with(&mut workspace, &targets, None, None, &mut unit)
            .expect("a fit");
        for (q, query) in queries.iter().enumerate() {
            let slope = (slopes[q * n + j].transpose() - unit.jacobian(query)).norm();
            worst = worst.max(slope);
        }
    }
    worst
}

/// Both solve the same system, of condition at most 1e5 here: eleven digits.
#[test]
fn influences_are_fits_to_unit_targets() {
    let weights: Vec<f64> = (0..40).map(|i| f64::from(i % 5) * 0.3).collect();
    for smoothing in [Smoothing::None, Smoothing::Lambda(0.05)] {
        for weights in [None, Some(&weights[..])] {
            let found = [
                against_unit_targets::<2, _>(R2LogR, smoothing, weights),
                against_unit_targets::<3, _>(R2LogR, smoothing, weights),
                against_unit_targets::<3, _>(NegR, smoothing, weights),
                against_unit_targets::<3, _>(R3, smoothing, weights),
            ];
            assert!(
                found.iter().all(|&worst| worst < 1e-11),
                "{smoothing:?}: {found:?}"
            );
        }
    }
}

/// In metres and in micrometres, for many outputs, with points merged, in space and in a plane of
/// it: the sums are the spline to rounding.
#[test]
fn influences_sum_to_the_spline() {
    let mut random = Uniform(9);
    let mut sources = random.points::<3>(30);
    sources.extend_from_within(3..6);
    let targets: Vec<_> = sources.iter().map(bend).collect();
    let weights: Vec<f64> = (0..33).map(|i| 0.2 + f64::from(i % 4)).collect();
    for (unit, height) in [(1.0, 1.0), (1e-6, 1.0), (1.0, 0.0)] {
        let place = |p: &Point<f64, 3>| Point::from([p.x, p.y, height * p.z]) * unit;
        let sources: Vec<_> = sources.iter().map(place).collect();
        let options = options(NegR, Smoothing::Lambda(0.1 * unit), Some(&weights));
        let factorization = Factorization::new(&sources, &options).expect("a factor");
        let spline = factorization.fit(&targets).expect("a fit");
        let x = Point::from(random.point::<3>().coords * unit);
        let mut influence = vec![SVector::zeros(); 33];
        factorization
            .jacobian_influence_into(&mut SplineWorkspace::default(), &[x], &mut influence)
            .expect("a linear map");
        let slope: Matrix3<f64> = influence
            .iter()
            .zip(&targets)
            .map(|(b, y)| y.coords * b.transpose())
            .sum();
        // Across a plane of space stands the identity, which no target changes.
        let across = if height == 0.0 { 1.0 } else { 0.0 };
        let slope = slope + Matrix3::from_diagonal(&[0.0, 0.0, across].into());
        assert!((slope - spline.jacobian(&x)).norm() * unit < 1e-13);
    }
}

#[test]
fn what_is_no_linear_map_is_refused() {
    let sources = Uniform(6).points::<2>(12);
    let x = Point::from([0.1, 0.2]);
    let chosen = Factorization::<2>::new(&sources, &options(R2LogR, Smoothing::Gcv, None));
    let chosen = chosen.expect("a factor").jacobian_influence_into(
        &mut SplineWorkspace::default(),
        &[x],
        &mut [SVector::zeros(); 12],
    );
    assert_eq!(chosen, Err(TpsError::DependsOnTargets));
    let factorization =
        Factorization::<2>::new(&sources, &FitOptions::default()).expect("a factor");
    let (mut workspace, mut short) = (SplineWorkspace::default(), [SVector::zeros(); 11]);
    let found = factorization.jacobian_influence_into(&mut workspace, &[x], &mut short);
    assert_eq!(
        found,
        Err(TpsError::Length {
            input: "output slice",
            expected: 12,
            found: 11
        })
    );
}
