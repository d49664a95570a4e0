//! Tests of the average over scales.

use super::*;
use nalgebra::{DMatrix, DVector};

/// The energy from the low-rank factors equals that of the dense covariance:
/// `½ zᵀ(K + σ²W⁻¹)⁻¹z + ½ ln det(1 + K W/σ²)` per axis.
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
    // Each truncated mode is a hundredth of the noise.
    assert!(
        (found - expected).abs() < 0.02 * expected.abs(),
        "{found} {expected}"
    );
}
