//! Tests of the building blocks.

mod regression {
    use super::super::*;

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

    /// Leaving a point out by formula is leaving it out in fact.
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
            // Conditioning of the Gram matrix is below 1e4 here: rounding stays under 1e-11.
            assert!((predicted[k] - regression.displacement.0[k][7]).abs() < 1e-11);
        }
    }

    /// Modes that the noise hides are left out of a fit. Against the fit with the whole covariance,
    /// `u = K (K + σ² W⁻¹)⁻¹ z`, a displacement moves by less than the deviation of what is left
    /// out at its point, √0.01 σ.
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
        // All are cut, the noisier the more.
        assert!(
            ranks[0] < ranks[1] && ranks[1] < ranks[2] && ranks[2] < 64,
            "{ranks:?}"
        );
    }
}

mod scales {
    use super::super::*;
    use nalgebra::{DMatrix, DVector};

    /// The energy from the low-rank factors is that of the dense covariance:
    /// `½ zᵀ(K + σ²W⁻¹)⁻¹z + ½ ln det(1 + K W/σ²)` an axis.
    #[test]
    fn the_evidence_is_that_of_the_dense_covariance() {
        const N: usize = 24; // a multiple of the padding
        let points: Vec<[f64; 2]> = (0..N)
            .map(|i| [(i % 5) as f64 * 0.5 - 1.0, (i / 5) as f64 * 0.4 - 0.8])
            .collect();
        let weights: Vec<f64> = (0..N).map(|i| 0.3 + 0.02 * i as f64).collect();
        let wanted = Axes([
            (0..N).map(|i| 0.1 * (0.7 * i as f64).sin()).collect(),
            (0..N).map(|i| 0.02 * (i % 4) as f64).collect::<Vec<f64>>(),
        ]);
        let request = Request {
            weights: &weights,
            displacements: &wanted,
        };
        let (bending, affine, noise) = (0.1, 0.5, 4e-4);
        let length = LENGTHS[1];
        let mut scales = ScaleAverage::default();
        scales.prepare(request, &points, 1, noise);
        let found = scales.fit(request, bending, affine, noise);

        let kernel = DMatrix::from_fn(N, N, |a, b| {
            let (p, q) = (points[a], points[b]);
            let square = (p[0] - q[0]).powi(2) + (p[1] - q[1]).powi(2);
            bending * bending * (-0.5 * square / (length * length)).exp()
                + affine * affine * (1.0 + p[0] * q[0] + p[1] * q[1])
        });
        let noises = DMatrix::from_diagonal(&DVector::from_fn(N, |i, _| noise / weights[i]));
        let covariance = kernel + noises;
        let factor = covariance.cholesky().expect("positive definite");
        let log_det: f64 = (0..N)
            .map(|i| 2.0 * factor.l()[(i, i)].ln() - (noise / weights[i]).ln())
            .sum();
        let square = |z: &[f64]| {
            let z = DVector::from_column_slice(z);
            z.dot(&factor.solve(&z))
        };
        let expected = 0.5 * (square(&wanted.0[0]) + square(&wanted.0[1])) + log_det;
        // The modes left out are a hundredth of the noise each.
        assert!(
            (found - expected).abs() < 0.02 * expected.abs(),
            "{found} {expected}"
        );
    }
}
