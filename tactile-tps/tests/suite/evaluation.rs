//! Values and derivatives: correct, bit-identical alone, in batches and in threads, near and far.

use crate::common::{Uniform, bend, fit, for_all};
use nalgebra::{Point, Point2, SMatrix, SVector};
use proptest::prelude::*;
use tactile_tps::{FitOptions, Kernel, NegR, R2LogR, R3};

fn has_the_derivatives_it_says<const D: usize, K: Kernel>(kernel: K, seed: u64) {
    let mut random = Uniform(seed);
    let sources = random.points::<D>(20);
    let targets: Vec<_> = sources.iter().map(bend).collect();
    let spline = fit(&sources, &targets, &FitOptions::new(kernel));
    // Away from the centres, so that −r is smooth within the step.
    let query = (0..)
        .map(|_| random.point::<D>())
        .find(|q| sources.iter().all(|x| (x - q).norm() > 0.05));
    let query = query.expect("a gap");
    let (jacobian, hessian) = (spline.jacobian(&query), spline.hessian(&query));
    const STEP: f64 = 1e-4;
    for k in 0..D {
        let mut step = SVector::<f64, D>::zeros();
        step[k] = STEP;
        let slope = (spline.apply(&(query + step)) - spline.apply(&(query - step))) / (2.0 * STEP);
        let bend =
            (spline.jacobian(&(query + step)) - spline.jacobian(&(query - step))) / (2.0 * STEP);
        for m in 0..D {
            // Central differences: h² times third derivatives, which are at most w/0.05² with
            // weights below 10.
            assert!((slope[m] - jacobian[(m, k)]).abs() < 1e-4);
            for l in 0..D {
                assert!((bend[(m, l)] - hessian[m][(l, k)]).abs() < 1e-2);
            }
        }
    }
}

/// The bits of the value of a point do not depend on the other points of the batch.
fn gives_the_same_bits_in_batches<const D: usize, K: Kernel>(kernel: K, seed: u64) {
    let mut random = Uniform(seed);
    let sources = random.points::<D>(33);
    let targets: Vec<_> = sources.iter().map(bend).collect();
    let spline = fit(&sources, &targets, &FitOptions::new(kernel));
    let queries = random.points::<D>(77);
    let (mut values, mut jacobians) = (vec![Point::origin(); 77], vec![SMatrix::zeros(); 77]);
    spline
        .apply_and_jacobian_into(&queries, &mut values, &mut jacobians)
        .expect("equal lengths");
    let mut alone = values.clone();
    spline
        .apply_into(&queries, &mut alone)
        .expect("equal lengths");
    assert_eq!(values, alone);
    for (i, query) in queries.iter().enumerate() {
        assert_eq!(
            (spline.apply(query), spline.jacobian(query)),
            (values[i], jacobians[i])
        );
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]

    #[test]
    fn derivatives_agree_with_differences(seed in 1u64..u64::MAX) {
        for_all!(has_the_derivatives_it_says, seed);
    }

    #[test]
    fn batches_agree_with_single_points(seed in 1u64..u64::MAX) {
        for_all!(gives_the_same_bits_in_batches, seed);
    }
}

/// Far from the points the terms cancel. The reported digits bound the distance from the asymptotic
/// law.
#[test]
fn far_values_report_their_digits() {
    let sources = Uniform(21).points::<2>(40);
    let targets: Vec<_> = sources.iter().map(bend).collect();
    let spline = fit(&sources, &targets, &FitOptions::new(R3));
    let place = |distance: f64| Point2::new(distance, 0.5 * distance);
    assert!(spline.digits(&place(1e7)) < 2.0 && spline.digits(&sources[0]) > 8.0);
    // Moments of degree 0 and 1 vanish: in a fixed direction the value is proportional to the
    // distance, with a correction of 1/r.
    let slope = |distance: f64| spline.apply(&place(distance)).coords / distance;
    let far = slope(1e3);
    for distance in [3e3, 1e4] {
        let lost = 10_f64.powf(-spline.digits(&place(distance)));
        // 3/r: the extent of sources of size one.
        assert!((slope(distance) - far).norm() < (lost + 3e-3) * far.norm());
    }
}

#[cfg(feature = "rayon")]
#[test]
fn threads_do_not_change_a_bit() {
    let mut random = Uniform(31);
    let sources = random.points::<3>(40);
    let targets: Vec<_> = sources.iter().map(bend).collect();
    let spline = fit(&sources, &targets, &FitOptions::new(NegR));
    let queries = random.points::<3>(2000);
    let (mut serial, mut parallel) = (vec![Point::origin(); 2000], vec![Point::origin(); 2000]);
    let (mut jacobians, mut others) = (vec![SMatrix::zeros(); 2000], vec![SMatrix::zeros(); 2000]);
    spline
        .apply_and_jacobian_into(&queries, &mut serial, &mut jacobians)
        .expect("equal lengths");
    spline
        .par_apply_and_jacobian_into(&queries, &mut parallel, &mut others)
        .expect("equal lengths");
    assert_eq!((&serial, jacobians), (&parallel, others));
    parallel.fill(Point::origin());
    spline
        .par_apply_into(&queries, &mut parallel)
        .expect("equal lengths");
    assert_eq!(serial, parallel);
}
