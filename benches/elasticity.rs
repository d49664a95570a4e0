//! Strain of many gradients and contacts on layers: times and errors. For the laws of a ball see
//! the bench `work_precision`.
#![allow(clippy::print_stdout, missing_docs)]

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use nalgebra::{Matrix3, Rotation3, Vector3};
use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};
use std::hint::black_box;
use tactile_imaging::elasticity::contact::{Bond, LayerEquation};
use tactile_imaging::elasticity::strain::{
    Biot, EulerAlmansi, GreenLagrange, Hencky, StrainMeasure,
};

const GRADIENTS: usize = 100_000;

/// Gradients of up to 20 % with a small rotation.
fn gradients() -> Vec<Matrix3<f64>> {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    (0..GRADIENTS)
        .map(|_| {
            let turn = Rotation3::from_scaled_axis(Vector3::from(
                [(); 3].map(|()| 0.1 * rng.random::<f64>()),
            ));
            let h = Matrix3::from_fn(|_, _| 0.4 * rng.random::<f64>() - 0.2);
            turn.matrix() * (Matrix3::identity() + h) - Matrix3::identity()
        })
        .collect()
}

fn strain(c: &mut Criterion) {
    let gradients = gradients();
    let strain = |h| GreenLagrange.strain(h).unwrap();
    let mut strains: Vec<_> = gradients.iter().map(strain).collect();
    // The direct but slow form, E = (FᵀF − I)/2.
    let error = (gradients.iter().zip(&strains))
        .map(|(h, e)| {
            let f = h + Matrix3::identity();
            (e - (f.transpose() * f - Matrix3::identity()) * 0.5).amax()
        })
        .fold(0.0, f64::max);
    assert!(error < 1e-15);
    println!(
        "Green-Lagrange of {GRADIENTS} gradients: largest difference to (F'F - I)/2 {error:.1e}"
    );
    let mut group = c.benchmark_group("strain_100000");
    group.throughput(Throughput::Elements(GRADIENTS as u64));
    let measures: [&dyn StrainMeasure; 4] = [&GreenLagrange, &EulerAlmansi, &Hencky, &Biot];
    for measure in measures {
        group
            .sample_size(10)
            .bench_function(format!("one at a time, {}", measure.name()), |b| {
                b.iter(|| {
                    for (h, e) in black_box(&gradients).iter().zip(&mut strains) {
                        *e = measure.strain(h).unwrap();
                    }
                });
            });
    }
    group.finish();
}

fn layers(c: &mut Criterion) {
    let equation = LayerEquation::new(Bond::Bonded, 0.5).unwrap();
    let error = equation.solve(1.0).unwrap().force_ratio - 3.371_098_31;
    assert!(error.abs() < 1e-8);
    println!("sphere on a bonded layer, a/h = 1: force ratio off by {error:.1e}");
    c.bench_function("layer integral equation, a/h = 1", |b| {
        b.iter(|| equation.solve(black_box(1.0)))
    });
}

criterion_group!(benches, strain, layers);
criterion_main!(benches);
