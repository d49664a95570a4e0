//! Refits and evaluations do not allocate once their memory has grown. Allocations are counted by
//! the allocator.

use crate::common::{Uniform, bend};
use nalgebra::{Matrix3, Point};
use tactile_tps::{Factorization, FitOptions, NegR, Smoothing, Spline, SplineWorkspace};

#[test]
fn refits_and_evaluation_allocate_nothing() {
    let mut random = Uniform(1);
    let sources = random.points::<3>(105);
    let targets: Vec<_> = sources.iter().map(bend).collect();
    let queries = random.points::<3>(333);
    let weights: Vec<f64> = (0..105).map(|i| f64::from(i % 5)).collect();
    let near: Vec<f64> = (0..105).map(|i| 1.0 + 1e-4 * f64::from(i % 5)).collect();
    let factorization = Factorization::new(&sources, &FitOptions::new(NegR)).expect("a factor");
    let (mut workspace, mut spline) = (SplineWorkspace::default(), Spline::<3, 3, _>::default());
    let (mut values, mut jacobians) = (vec![Point::origin(); 333], vec![Matrix3::zeros(); 333]);
    let mut hessian = [Matrix3::zeros(); 3];
    let mut round = |lambda: f64| {
        factorization
            .refit_with(&mut workspace, &targets, None, None, &mut spline)
            .expect("a fit");
        for weights in [None, Some(&weights[..]), Some(&near)] {
            for smoothing in [Smoothing::None, Smoothing::Lambda(lambda)] {
                factorization
                    .refit_with(
                        &mut workspace,
                        &targets,
                        weights,
                        Some(smoothing),
                        &mut spline,
                    )
                    .expect("a refit");
            }
        }
        spline
            .apply_into(&queries, &mut values)
            .expect("equal lengths");
        spline
            .apply_and_jacobian_into(&queries, &mut values, &mut jacobians)
            .expect("equal lengths");
        hessian = spline.hessian(&queries[0]);
        values[0] = spline.apply(&queries[0]);
    };
    round(0.5);
    let counted = allocation_counter::measure(|| round(0.25));
    assert_eq!(counted.count_total, 0);
}
