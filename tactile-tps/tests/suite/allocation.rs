//! Refits and evaluation allocate nothing once their memory has grown, counted by the allocator.

use crate::common::{Uniform, bend};
use nalgebra::{Matrix3, Point, SVector};
use tactile_tps::{
    Factorization, FitOptions, LambdaPath, NegR, Smoothing, Spline, SplineWorkspace,
};

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
    let mut slopes = vec![SVector::zeros(); 7 * 105];
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
        factorization
            .jacobian_influence_into(&mut workspace, &queries[..7], &mut slopes)
            .expect("a linear map");
    };
    round(0.5);
    let counted = allocation_counter::measure(|| round(0.25));
    assert_eq!(counted.count_total, 0);
}

#[test]
fn factors_of_other_points_allocate_nothing() {
    let mut random = Uniform(2);
    let sets: Vec<_> = [205, 97, 205, 101].map(|n| random.points::<3>(n)).to_vec();
    let options = FitOptions::new(NegR)
        .with_smoothing(Smoothing::Lambda(0.1))
        .expect("a λ");
    let mut options = options.with_weights(vec![1.0; 205]).expect("weights");
    let lambdas = [0.01, 1.0, 100.0];
    let mut kept = Factorization::new(&sets[0], &options).ok();
    let mut path = LambdaPath::fit(&sets[0], &sets[0], &options, &lambdas).ok();
    let (mut workspace, mut spline) = (SplineWorkspace::default(), Spline::<3, 3, _>::default());
    let mut sum = 0.0;
    let mut round = |sources: &[nalgebra::Point3<f64>]| {
        let weights: [f64; 205] = core::array::from_fn(|i| 0.1 + f64::from(i as u32 % 5));
        options
            .set_weights(&weights[..sources.len()])
            .expect("weights");
        let factorization = kept.take().expect("kept").refactor(sources, &options);
        let factorization = kept.insert(factorization.expect("a factor"));
        factorization
            .refit_with(&mut workspace, sources, None, None, &mut spline)
            .expect("a fit");
        let splines = path
            .take()
            .expect("kept")
            .refit(sources, sources, &options, &lambdas);
        let splines = path.insert(splines.expect("fits"));
        sum += splines.values(&sources[3])[1].x + spline.apply(&sources[3]).x;
    };
    round(&sets[0]);
    let counted = allocation_counter::measure(|| sets.iter().for_each(|set| round(set)));
    assert_eq!(counted.count_total, 0);
}
