//! Surfaces: dependence on the fraction of the frame, control points and depth tables.
//!
//! The bench `work_precision` compares the methods of shape from shading and of slope integration.

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use ndarray::Array2;
use tactile_imaging::sfs::{
    ControlPointSampler, DepthTable, Domain, Eikonal, EikonalBranch, EquallySpaced, Frame, Image,
    Lighting, Surface, SurfaceReconstruction, SurfaceWorkspace,
};

/// A contact that covers a fraction of the frame compared with one that fills it.
fn contact_share(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("sfs/share");
    let (rows, columns) = (1042, 1392);
    for percent in [5, 100] {
        // The same bump, scaled: its box covers this fraction of the frame's area.
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
        // The peak is known, because the rim is not visible in a full frame.
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
                        .reconstruct_with(&mut workspace, Image::new(frame, domain), &mut surface)
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
    let sample = || {
        EquallySpaced
            .sample(black_box(z.view()), &Domain::default(), 200)
            .unwrap()
    };
    assert_eq!(sample().len(), 200);
    group.bench_function(BenchmarkId::new("equal", "200/300x300"), |bencher| {
        bencher.iter(sample)
    });
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
                .reconstruct_with(&mut workspace, Image::new(frame, domain), &mut surface)
                .unwrap();
        });
    });
    group.finish();
}

criterion_group!(benches, contact_share, points, depth_table);
criterion_main!(benches);
