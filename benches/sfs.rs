//! Surfaces: a contact's share of the frame, control points, depth tables and slope integration.
//!
//! The bench `work_precision` compares the methods of shape from shading.
#![allow(clippy::print_stderr)]

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use ndarray::Array2;
use tactile_imaging::sfs::{
    ControlPointSampler, CosinePoisson, CurvatureAdaptive, DepthTable, Domain, Eikonal,
    EikonalBranch, EquallySpaced, Frame, FrankotChellappa, Lighting, MaskedLeastSquares,
    PixelScalar, Random, SlopeIntegrator, Surface, SurfaceReconstruction, SurfaceWorkspace,
};

/// A contact of a given share of the frame against one that fills it.
fn contact_share(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("sfs/share");
    let (rows, columns) = (1042, 1392);
    for percent in [5, 100] {
        // The same bump, scaled; its box has the share of the frame's area.
        let share = (percent as f64 / 100.0).sqrt();
        let [a, b] = [share * 0.5 * columns as f64, share * 0.5 * rows as f64];
        let coordinates = |r: usize, c: usize| ((c as f64 - 695.5) / a, (r as f64 - 520.5) / b);
        let mask = Array2::from_shape_fn((rows, columns), |(r, c)| {
            let (x, y) = coordinates(r, c);
            x.abs() < 1.0 && y.abs() < 1.0
        });
        let height = 0.2 * b;
        let image = Array2::from_shape_fn((rows, columns), |(r, c)| {
            let (x, y) = coordinates(r, c);
            let (fx, fy) = (1.0 - x * x, 1.0 - y * y);
            let (p, q) = (-2.0 * height * x * fy / a, -2.0 * height * y * fx / b);
            (255.0 / (1.0 + p * p + q * q).sqrt()) as u8
        });
        let lighting = Lighting::default().with_normal_intensity(255.0).unwrap();
        // The peak is known, for where the frame is full no rim is in sight.
        let mut known = Array2::from_elem((rows, columns), f64::NAN);
        known[[520, 695]] = height;
        let domain = Domain::default()
            .with_mask(mask.view())
            .with_known_heights(known.view());
        let method = Eikonal::new(lighting).with_branch(EikonalBranch::Concave);
        let (mut workspace, mut surface) = (SurfaceWorkspace::default(), Surface::default());
        group.bench_function(
            BenchmarkId::new("eikonal", format!("{percent}%/{columns}x{rows}")),
            |bencher| {
                bencher.iter(|| {
                    let frame = Frame::Bytes(black_box(image.view()));
                    method
                        .reconstruct_with(&mut workspace, frame, &domain, &mut surface)
                        .unwrap();
                });
            },
        );
    }
    group.finish();
}

fn points(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("sfs/points");
    let z = Array2::from_shape_fn((300, 300), |(r, c)| {
        40.0 * (-((r as f64 - 150.0).powi(2) + (c as f64 - 140.0).powi(2)) / 8e3).exp()
    });
    let samplers: [(&str, Box<dyn ControlPointSampler<f64>>); 3] = [
        ("equal", Box::new(EquallySpaced)),
        ("random", Box::new(Random { seed: 1 })),
        ("adaptive", Box::new(CurvatureAdaptive::new(2.0).unwrap())),
    ];
    for (name, sampler) in samplers {
        assert_eq!(
            sampler
                .sample(z.view(), &Domain::default(), 200)
                .unwrap()
                .len(),
            200
        );
        group.bench_function(BenchmarkId::new(name, "200/300x300"), |bencher| {
            bencher.iter(|| {
                sampler
                    .sample(black_box(z.view()), &Domain::default(), 200)
                    .unwrap()
            });
        });
    }
    group.finish();
}

fn depth_table(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("sfs");
    let entries: Vec<(f32, f32)> = (0..60).map(|i| (i as f32, 3e-5 * i as f32)).collect();
    let table = DepthTable::new(&entries).unwrap();
    let image = Array2::from_shape_fn((1042, 1392), |(r, c)| ((r * 7 + c * 3) % 61) as u8);
    let domain = Domain::new([5e-5, 5e-5]).unwrap();
    let (mut workspace, mut surface) = (SurfaceWorkspace::default(), Surface::default());
    group.throughput(Throughput::Elements(1042 * 1392));
    group.bench_function(BenchmarkId::new("depth-table", "1392x1042"), |bencher| {
        bencher.iter(|| {
            let frame = Frame::Bytes(black_box(image.view()));
            table
                .reconstruct_with(&mut workspace, frame, &domain, &mut surface)
                .unwrap();
        });
    });
    group.finish();
}

/// Eight Gaussian bumps in the inner half of the frame, heights and slopes in closed form, mean 0.
fn bumps(rows: usize, columns: usize) -> [Array2<f64>; 3] {
    let mut state = 20u64;
    let mut uniform = move || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 53) as f64
    };
    let least = rows.min(columns) as f64;
    let [mut z, mut p, mut q] = [0, 1, 2].map(|_| Array2::zeros((rows, columns)));
    for _ in 0..8 {
        let (cx, cy) = (
            columns as f64 * (0.25 + 0.5 * uniform()),
            rows as f64 * (0.25 + 0.5 * uniform()),
        );
        let (sigma, height) = (
            least * (0.04 + 0.08 * uniform()),
            least * 0.04 * (uniform() - 0.5),
        );
        for ((r, c), z) in z.indexed_iter_mut() {
            let (x, y) = (c as f64 - cx, r as f64 - cy);
            let bump = height * (-(x * x + y * y) / (2.0 * sigma * sigma)).exp();
            *z += bump;
            p[[r, c]] -= bump * x / (sigma * sigma);
            q[[r, c]] -= bump * y / (sigma * sigma);
        }
    }
    let mean = z.mean().unwrap_or(0.0);
    z.mapv_inplace(|z| z - mean);
    [z, p, q]
}

fn integrate_as<T: PixelScalar>(
    criterion: &mut Criterion,
    scalar: &str,
    rows: usize,
    columns: usize,
) {
    let [z, p, q] = bumps(rows, columns);
    let (p, q) = (p.mapv(T::of), q.mapv(T::of));
    let mut group = criterion.benchmark_group("integrate");
    group
        .throughput(Throughput::Elements((rows * columns) as u64))
        .sample_size(10);
    let methods: [(&str, Box<dyn SlopeIntegrator<T>>, f64); 3] = [
        ("cosine-poisson", Box::new(CosinePoisson), 1e-3),
        ("frankot-chellappa", Box::new(FrankotChellappa), 0.2),
        (
            "least-squares",
            Box::new(MaskedLeastSquares::default()),
            1e-3,
        ),
    ];
    for (name, method, bound) in methods {
        let (mut workspace, mut surface) = (SurfaceWorkspace::default(), Surface::default());
        let domain = Domain::default();
        method
            .integrate_with(&mut workspace, p.view(), q.view(), &domain, &mut surface)
            .unwrap();
        let norm =
            |values: &mut dyn Iterator<Item = f64>| values.map(|v| v * v).sum::<f64>().sqrt();
        let difference = norm(&mut surface.heights.iter().zip(&z).map(|(a, b)| a.as_f64() - b));
        let relative = difference / norm(&mut z.iter().copied());
        eprintln!("integrate/{name}/{columns}x{rows}/{scalar}: relative error {relative:.3e}");
        assert!(relative < bound);
        group.bench_function(
            BenchmarkId::new(name, format!("{columns}x{rows}/{scalar}")),
            |bencher| {
                bencher.iter(|| {
                    let (p, q) = (black_box(p.view()), q.view());
                    method
                        .integrate_with(&mut workspace, p, q, &domain, &mut surface)
                        .unwrap();
                });
            },
        );
    }
    group.finish();
}

fn integrate(criterion: &mut Criterion) {
    for (rows, columns) in [(480, 640), (1042, 1392)] {
        integrate_as::<f64>(criterion, "f64", rows, columns);
        integrate_as::<f32>(criterion, "f32", rows, columns);
    }
}

criterion_group!(benches, contact_share, points, depth_table, integrate);
criterion_main!(benches);
