//! A refit with other weights gives what a fit with them gives, whichever way it goes.

use crate::common::{Uniform, bend, largest};
use nalgebra::{Point, Point3};
use tactile_tps::{
    Factorization, FitOptions, Kernel, NegR, R2LogR, R3, Smoothing, Spline, ThinPlateSpline,
    TpsError, Workspace,
};

const POINTS: usize = 150;

/// Largest difference at queries between refit and fit, and the steps the refit took.
fn compare<const D: usize, K: Kernel + Default>(
    kernel: K,
    weights: &[f64],
    smoothing: Smoothing<f64>,
) -> (f64, usize) {
    let mut random = Uniform(17);
    let sources = random.points::<D>(weights.len());
    let targets: Vec<_> = sources.iter().map(bend).collect();
    let options = FitOptions::new(kernel.clone());
    let factorization = Factorization::new(&sources, &options).expect("a factor");
    let (mut workspace, mut refitted) = (Workspace::default(), Spline::default());
    factorization
        .refit_with(
            &mut workspace,
            &targets,
            Some(weights),
            Some(smoothing),
            &mut refitted,
        )
        .expect("a refit");
    let fitted = ThinPlateSpline::fit(
        &sources,
        &targets,
        &crate::common::options(kernel, smoothing, Some(weights)),
    )
    .expect("a fit");
    let queries: [Point<f64, D>; 50] = core::array::from_fn(|_| random.point());
    let values = largest(
        queries
            .iter()
            .map(|q| (fitted.apply(q) - refitted.apply(q)).norm()),
    );
    let slopes = largest(
        queries
            .iter()
            .map(|q| (fitted.jacobian(q) - refitted.jacobian(q)).norm()),
    );
    (values.max(1e-2 * slopes), refitted.report.iterations)
}

fn weights(weight: impl FnMut(usize) -> f64) -> Vec<f64> {
    (0..POINTS).map(weight).collect()
}

/// Weights alike are met by iteration, few that differ by equations of their own; the tolerance of the iteration is 1e-13 of the targets, the
/// direct solution's own rounding 1e-15 times a condition number of at most some 1e4 in the eigenvectors at hand.
#[test]
fn weights_that_differ_little_are_no_new_factorisation() {
    let near = weights(|i| 1.0 + 0.003 * (i as f64).sin());
    let few = weights(|i| {
        if i % 12 == 7 {
            [0.01, 1e-6, 30.0][i / 12 % 3]
        } else {
            1.0
        }
    });
    for lambda in [1e-3, 0.1, 10.0] {
        for weights in [&near, &few] {
            let smoothing = Smoothing::Lambda(lambda);
            let range = if std::ptr::eq(weights, &few) {
                0..=0
            } else {
                1..=POINTS / 18
            };
            for (difference, steps) in [
                compare::<2, _>(R2LogR, weights, smoothing),
                compare::<3, _>(R2LogR, weights, smoothing),
                compare::<3, _>(NegR, weights, smoothing),
                compare::<2, _>(R3, weights, smoothing),
                compare::<3, _>(R3, weights, smoothing),
            ] {
                assert!(difference < 1e-11, "λ = {lambda}: {difference:e}");
                assert!(range.contains(&steps), "λ = {lambda}: {steps} steps");
            }
        }
    }
}

/// Where iteration would be slow or unsafe the refit factors: weights over decades, weights of zero.
#[test]
fn weights_that_differ_much_are_factored() {
    let wild = weights(|i| 10f64.powi((i % 9) as i32 - 4));
    let gaps = weights(|i| f64::from(i % 5 != 0));
    for weights in [&wild, &gaps] {
        let (difference, steps) = compare::<3, _>(NegR, weights, Smoothing::Lambda(0.1));
        assert!(
            difference < 1e-12 && steps == 0,
            "{difference:e} after {steps} steps"
        );
    }
}

/// An interpolating spline does not depend on positive weights, and its refit not at all on how it is reached.
#[test]
fn positive_weights_leave_interpolation_alone() {
    let wild = weights(|i| 10f64.powi((i % 9) as i32 - 4));
    assert_eq!(compare::<3, _>(NegR, &wild, Smoothing::None), (0.0, 0));
}

/// The shortcut must not swallow what interpolation refuses.
#[test]
fn conflicts_are_found_whatever_the_weights() {
    let mut sources = Uniform(2).points::<3>(20);
    let mut targets: Vec<_> = sources.iter().map(bend).collect();
    sources.push(sources[4]);
    targets.push(Point3::origin());
    let factorization = Factorization::new(&sources, &FitOptions::new(NegR)).expect("a factor");
    let (mut workspace, mut spline) = (Workspace::default(), Spline::default());
    let mut refit = |weight: f64| {
        let weights: Vec<f64> = (0..21)
            .map(|i| if i == 20 { weight } else { 2.0 })
            .collect();
        factorization.refit_with(
            &mut workspace,
            &targets,
            Some(&weights),
            Some(Smoothing::None),
            &mut spline,
        )
    };
    assert_eq!(
        refit(0.5),
        Err(TpsError::Conflict {
            first: 4,
            second: 20
        })
    );
    assert_eq!(refit(0.0), Ok(()));
}
