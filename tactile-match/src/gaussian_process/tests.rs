//! Tests of the regression.

use super::*;

fn scene() -> (Prior, Vec<f64>, Axes<2>) {
    let points: Vec<[f64; 2]> = (0..19)
        .map(|i| [f64::from(i % 5) * 0.4, f64::from(i / 5) * 0.3])
        .collect();
    let mut prior = Prior::default();
    prior.build(
        &points,
        PriorScales {
            length: 1.2,
            bending: 0.35,
            affine: 0.5,
        },
    );
    let pad = |f: &dyn Fn(usize) -> f64| {
        (0..prior.stride)
            .map(|i| if i < 19 { f(i) } else { 0.0 })
            .collect()
    };
    let weights: Vec<f64> = pad(&|i| 0.2 + 0.04 * i as f64);
    let targets = Axes([
        pad(&|i| (i as f64).sin() * 0.2),
        pad(&|i| 0.1 * (i % 3) as f64),
    ]);
    (prior, weights, targets)
}

/// The leverage formula gives the same prediction as a fit without the point.
#[test]
fn leverage_gives_the_prediction_without_the_point() {
    let (prior, mut weights, targets) = scene();
    let mut regression = Regression::default();
    regression.fit(&prior, &weights, &targets, 0.01);
    regression.variances(&prior, true);
    let leverage = weights[7] * regression.variance[7] / 0.01;
    let predicted: [f64; 2] = std::array::from_fn(|k| {
        (regression.displacement.0[k][7] - leverage * targets.0[k][7]) / (1.0 - leverage)
    });
    weights[7] = 0.0;
    regression.fit(&prior, &weights, &targets, 0.01);
    for k in 0..2 {
        // The condition number of the Gram matrix is below 1e4 here, so rounding stays under 1e-11.
        assert!((predicted[k] - regression.displacement.0[k][7]).abs() < 1e-11);
    }
}

/// A fit omits modes that the noise hides. Compared with the fit of the whole covariance,
/// `u = K (K + σ² W⁻¹)⁻¹ z`, each displacement changes by less than the standard deviation
/// neglected at its point, √0.01 σ.
#[test]
fn modes_left_out_move_the_warp_by_less_than_a_tenth_of_the_noise() {
    let n = 160;
    let points: Vec<[f64; 2]> = (0..n)
        .map(|i| {
            let (r, angle) = (((i as f64 + 0.5) / n as f64).sqrt(), 2.4 * i as f64);
            [r * angle.cos(), r * angle.sin()]
        })
        .collect();
    let scales = PriorScales {
        length: 0.5,
        bending: 0.35,
        affine: 0.5,
    };
    let covariance = nalgebra::DMatrix::from_fn(n, n, |i, j| {
        let (a, b) = (points[i], points[j]);
        let square = (a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2);
        let bending = scales.bending.powi(2) * (-0.5 * square / scales.length.powi(2)).exp();
        bending + scales.affine.powi(2) * (1.0 + a[0] * b[0] + a[1] * b[1])
    });
    let mut prior = Prior::default();
    prior.build(&points, scales);
    let pad = |f: &dyn Fn(usize) -> f64| -> Vec<f64> {
        (0..prior.stride)
            .map(|i| if i < n { f(i) } else { 0.0 })
            .collect()
    };
    let weights = pad(&|i| 0.3 + 0.7 * (i % 4) as f64 / 3.0);
    let smooth = |i: usize| 0.2 * (2.0 * points[i][0] - points[i][1]).sin();
    let mut ranks = Vec::new();
    for sigma in [0.3, 0.1, 0.03] {
        let off = |i: usize| sigma * (((i * i) as f64 * 0.618_033_988_75).fract() - 0.5);
        let targets = Axes([pad(&|i| smooth(i) + off(i)), pad(&|i| off(3 * i + 1))]);
        let mut regression = Regression::default();
        regression.fit(&prior, &weights, &targets, sigma * sigma);
        ranks.push(regression.rank);
        let mut noisy = covariance.clone();
        for i in 0..n {
            noisy[(i, i)] += sigma * sigma / weights[i];
        }
        let solver = noisy.cholesky().expect("positive definite");
        for axis in 0..2 {
            let z = nalgebra::DVector::from_fn(n, |i, _| targets.0[axis][i]);
            let whole = &covariance * solver.solve(&z);
            for i in 0..n {
                let apart = regression.displacement.0[axis][i] - whole[i];
                assert!(apart.abs() < 0.1 * sigma, "σ {sigma}, point {i}: {apart}");
            }
        }
    }
    // The ranks are truncated more strongly for larger noise.
    assert!(
        ranks[0] < ranks[1] && ranks[1] < ranks[2] && ranks[2] < 64,
        "{ranks:?}"
    );
}
