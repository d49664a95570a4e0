//! The iterative solver compared with the direct one, its progress reports and its difficult
//! inputs.

use core::ops::ControlFlow;

use crate::common::{Uniform, bend, largest, options};
use nalgebra::{Point, Point3};
use tactile_tps::{
    Factorization, FitOptions, Kernel, NegR, R2LogR, R3, Smoothing, Solver, Spline,
    SplineWorkspace, ThinPlateSpline, TpsError,
};

const POINTS: usize = 900;

/// Largest difference between the values of the iterative and the direct spline, and the number of
/// steps.
fn compare<const D: usize, K: Kernel>(
    sources: &[Point<f64, D>],
    options: &FitOptions<K>,
) -> (f64, usize) {
    let targets: Vec<_> = sources.iter().map(bend).collect();
    let fit = |solver| {
        ThinPlateSpline::fit(sources, &targets, &options.clone().with_solver(solver))
            .expect("a fit")
    };
    let (direct, iterative) = (fit(Solver::Direct), fit(Solver::Iterative));
    let report = &iterative.report;
    assert!(
        report.converged() && report.residual <= Some(1e-10),
        "{report:?}"
    );
    assert_eq!(report.rank, direct.report.rank);
    let mut random = Uniform(31);
    let queries: [Point<f64, D>; 60] = core::array::from_fn(|_| random.point());
    (
        largest(
            queries
                .iter()
                .map(|q| (direct.apply(q) - iterative.apply(q)).norm()),
        ),
        report.iterations,
    )
}

/// The residual is at most 1e-10 of targets of size one, and errors between the points are not much
/// larger. The number of steps grows slowly with the number of points. An ineffective
/// preconditioner needs hundreds.
#[test]
fn iteration_finds_the_direct_solution() {
    let (plane, space) = (
        Uniform(7).points::<2>(POINTS),
        Uniform(8).points::<3>(POINTS),
    );
    let weights: Vec<f64> = (0..POINTS).map(|i| f64::from(i as u32 % 5) * 0.7).collect();
    for smoothing in [Smoothing::None, Smoothing::Lambda(0.01)] {
        for weights in [vec![1.0; POINTS], weights.clone()] {
            let found = [
                compare(&plane, &options(R2LogR, smoothing, Some(&weights))),
                compare(&space, &options(R2LogR, smoothing, Some(&weights))),
                compare(&plane, &options(NegR, smoothing, Some(&weights))),
                compare(&space, &options(NegR, smoothing, Some(&weights))),
                compare(&space, &options(R3, smoothing, Some(&weights))),
            ];
            assert!(
                found
                    .iter()
                    .all(|&(difference, steps)| difference < 1e-9 && steps < 20),
                "{found:?}"
            );
        }
    }
}

/// Points in a plane of space, on a lattice with equal distances, and in dense clusters.
#[test]
fn awkward_points_are_no_obstacle() {
    let flat: Vec<_> = Uniform(9)
        .points::<2>(POINTS)
        .iter()
        .map(|p| Point3::new(p.x, p.y, 0.0))
        .collect();
    let lattice: Vec<_> = (0..POINTS as u32)
        .map(|i| Point3::from([i % 10, i / 10 % 10, i / 100].map(|x| f64::from(x) / 5.0 - 1.0)))
        .collect();
    let clump = |(i, p): (usize, &Point3<f64>)| {
        p * 0.02 + nalgebra::Vector3::from([i % 3, i % 7, i % 2].map(|x| x as f64 / 4.0))
    };
    let clumps: Vec<_> = Uniform(10)
        .points::<3>(POINTS)
        .iter()
        .enumerate()
        .map(clump)
        .collect();
    for sources in [flat, lattice, clumps] {
        let (difference, steps) = compare(&sources, &FitOptions::new(NegR));
        assert!(
            difference < 1e-9 && steps < 20,
            "{difference:e} after {steps} steps"
        );
    }
}

/// Results for new targets, weights and λ are those of a new fit, and need no memory after the
/// first.
#[test]
fn refits_are_fits() {
    let sources = Uniform(11).points::<3>(POINTS);
    let targets: Vec<_> = sources.iter().map(bend).collect();
    let weights: Vec<f64> = (0..POINTS).map(|i| 0.5 + f64::from(i as u32 % 3)).collect();
    let iterative = FitOptions::new(NegR).with_solver(Solver::Iterative);
    let factorization = Factorization::new(&sources, &iterative).expect("a preconditioner");
    let (mut workspace, mut spline) = (SplineWorkspace::default(), Spline::default());
    let query = Point3::new(0.1, 0.2, 0.3);
    for (weights, smoothing) in [
        (None, Smoothing::None),
        (Some(&weights), Smoothing::None),
        (None, Smoothing::Lambda(0.1)),
        (Some(&weights), Smoothing::Lambda(0.1)),
    ] {
        let refit = weights.map(|w| &w[..]);
        factorization
            .refit_with(
                &mut workspace,
                &targets,
                refit,
                Some(smoothing),
                &mut spline,
            )
            .expect("a refit");
        let direct = options(NegR, smoothing, refit).with_solver(Solver::Direct);
        let fitted = ThinPlateSpline::fit(&sources, &targets, &direct).expect("a fit");
        assert!((spline.apply(&query) - fitted.apply(&query)).norm() < 1e-9);
    }
    let again = allocation_counter::measure(|| {
        factorization
            .refit_with(&mut workspace, &targets, None, None, &mut spline)
            .expect("a refit");
    });
    assert_eq!(again.count_total, 0);
}

/// The callback is called in both stages and can stop either.
#[test]
fn a_watch_stops_the_fit() {
    let sources = Uniform(12).points::<2>(POINTS);
    let targets: Vec<_> = sources.iter().map(bend).collect();
    let options = FitOptions::default().with_solver(Solver::Iterative);
    let mut heard = 0;
    let stopped = ThinPlateSpline::fit_watched(&sources, &targets, &options, |progress| {
        heard += 1;
        assert!(progress.residual.is_none() && progress.done < progress.total);
        ControlFlow::Break(())
    });
    assert!(matches!(stopped, Err(TpsError::Stopped)) && heard == 1);
    let mut residuals = Vec::new();
    let early = ThinPlateSpline::fit_watched(&sources, &targets, &options, |progress| {
        residuals.extend(progress.residual);
        if progress.residual.is_some() && progress.done == 3 {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    });
    let early = early.expect("the best so far");
    assert!(early.report.iterations == 3 && !early.report.converged());
    // The last progress report agrees with the final report: the updated and the recomputed
    // residual differ by rounding.
    let (told, reported) = (residuals[3], early.report.residual.expect("measured"));
    assert!(
        (told / reported - 1.0).abs() < 1e-6 && reported < 0.01 * residuals[0],
        "{told:e} {reported:e}"
    );
}
