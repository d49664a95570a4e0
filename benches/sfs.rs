//! Surfaces: shape from shading, slope integration and control points, with the error printed
//! beside the time.
#![allow(clippy::print_stderr)]

use std::{hint::black_box, path::PathBuf};

use criterion::measurement::WallTime;
use criterion::{
    BenchmarkGroup, BenchmarkId, Criterion, Throughput, criterion_group, criterion_main,
};
use ndarray::Array2;
use tactile_imaging::sfs::{
    Alignment, BoundaryCondition, BrooksHorn, ControlPointSampler, CosinePoisson,
    CurvatureAdaptive, DepthTable, Domain, Eikonal, EikonalBranch, EquallySpaced, Frame,
    FrankotChellappa, Lighting, MaskedLeastSquares, PixelScalar, Random, SlopeIntegrator, Surface,
    SurfaceReconstruction, SurfaceWorkspace, TsaiShah, height_error, slopes,
};

type Method = Box<dyn SurfaceReconstruction<f64>>;

/// A surface with its mask and its slopes.
struct Case {
    name: &'static str,
    z: Array2<f64>,
    mask: Array2<bool>,
    p: Array2<f64>,
    q: Array2<f64>,
}

/// The vase of the shape-from-shading survey, z = √(f(y)² − x²), 128 pixels a unit.
fn vase(n: usize) -> Case {
    let f = |y: f64| 0.15 - 0.1 * y * (6.0 * y + 1.0).powi(2) * (y - 1.0).powi(2) * (3.0 * y - 2.0);
    let slope = |y: f64| (f(y + 1e-6) - f(y - 1e-6)) / 2e-6;
    let at = |r: usize, c: usize| (c as f64 / n as f64 - 0.5075, r as f64 / n as f64);
    let square = |r: usize, c: usize| f(at(r, c).1).powi(2) - at(r, c).0.powi(2);
    let over = |r, c, value: f64| {
        if square(r, c) > 0.0 {
            value / square(r, c).sqrt()
        } else {
            0.0
        }
    };
    Case {
        name: "vase",
        z: Array2::from_shape_fn((n, n), |(r, c)| square(r, c).max(0.0).sqrt() * n as f64),
        mask: Array2::from_shape_fn((n, n), |(r, c)| square(r, c) > 0.0),
        p: Array2::from_shape_fn((n, n), |(r, c)| over(r, c, -at(r, c).0)),
        q: Array2::from_shape_fn((n, n), |(r, c)| {
            over(r, c, f(at(r, c).1) * slope(at(r, c).1))
        }),
    }
}

fn data() -> PathBuf {
    std::env::var_os("TACTILE_DATA").map_or_else(
        || PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data")),
        PathBuf::from,
    )
}

/// Mozart's bust at half size (means of 2×2), if the data are there.
fn mozart() -> Option<Case> {
    let path = data().join("sfs/mozart_256_depth.csv");
    let Ok(full) = tactile_imaging::io::read_grid(&path) else {
        eprintln!("skipped: {} is not there", path.display());
        return None;
    };
    let z = Array2::from_shape_fn((128, 128), |(r, c)| {
        (0..4)
            .map(|k| full[[2 * r + k / 2, 2 * c + k % 2]])
            .sum::<f64>()
            / 8.0
    });
    let (p, q) = slopes(z.view(), [1.0, 1.0]);
    Some(Case {
        name: "mozart",
        mask: z.mapv(|z| z > 0.0),
        z,
        p,
        q,
    })
}

/// Height 0 outside the object, and the height where the surface faces the light: the maxima,
/// minima and saddles of z + (s_x x + s_y y)/s_z.
fn knowledge(case: &Case, [x, y, z]: [f64; 3]) -> Array2<f64> {
    let (rows, columns) = case.z.dim();
    let tilted = Array2::from_shape_fn((rows, columns), |(r, c)| {
        case.z[[r, c]] + (x * c as f64 + y * r as f64) / z
    });
    const RING: [(usize, usize); 8] = [
        (0, 0),
        (0, 1),
        (0, 2),
        (1, 2),
        (2, 2),
        (2, 1),
        (2, 0),
        (1, 0),
    ];
    Array2::from_shape_fn((rows, columns), |(r, c)| {
        if !case.mask[[r, c]] {
            return 0.0;
        }
        let ring = RING.map(|(dr, dc)| ((r + dr).wrapping_sub(1), (c + dc).wrapping_sub(1)));
        if !ring
            .iter()
            .all(|&at| case.mask.get(at).copied().unwrap_or(false))
        {
            return f64::NAN;
        }
        let above = ring.map(|at| tilted[at] > tilted[[r, c]]);
        let changes = (0..8).filter(|&i| above[i] != above[(i + 1) % 8]).count();
        if changes == 0 || changes >= 4 {
            case.z[[r, c]]
        } else {
            f64::NAN
        }
    })
}

fn survey(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("sfs");
    for case in [Some(vase(128)), mozart()].into_iter().flatten() {
        for light in [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [5.0, 5.0, 7.0]] {
            survey_light(&mut group, &case, light);
        }
    }
    group.finish();
}

/// One surface under one light, by every method that takes it.
fn survey_light(group: &mut BenchmarkGroup<'_, WallTime>, case: &Case, light: [f64; 3]) {
    let lighting = Lighting::new(light).unwrap();
    let image = Array2::from_shape_fn(case.z.dim(), |at| lighting.shade(case.p[at], case.q[at]));
    let known = knowledge(case, light);
    let masked = Domain::default().with_mask(case.mask.view());
    let informed = masked.with_known_heights(known.view());
    let eikonal = Eikonal::new(lighting);
    let rim = eikonal
        .with_boundary(BoundaryCondition::Height(0.0))
        .unwrap()
        .with_branch(EikonalBranch::Convex);
    let mut methods: Vec<(&str, Method, &Domain<'_, f64>, Alignment)> = vec![
        (
            "eikonal-known",
            Box::new(eikonal),
            &informed,
            Alignment::None,
        ),
        (
            "tsai-shah",
            Box::new(TsaiShah::new(lighting)),
            &masked,
            Alignment::Offset,
        ),
        (
            "brooks-horn",
            Box::new(BrooksHorn::new(lighting)),
            &masked,
            Alignment::Offset,
        ),
    ];
    if lighting.direction() == [0.0, 0.0, 1.0] {
        methods.push(("eikonal-rim", Box::new(rim), &masked, Alignment::None));
    }
    for (name, method, domain, alignment) in methods {
        let id = format!("{name}/{}/{:?}", case.name, light.map(|v| v as i32)).replace(' ', "");
        let (mut workspace, mut surface) = (SurfaceWorkspace::default(), Surface::default());
        let frame = Frame::Real(image.view());
        method
            .reconstruct_with(&mut workspace, frame, domain, &mut surface)
            .unwrap();
        let error = survey_error(case, &id, &surface, alignment);
        check_survey(case, name, &lighting, error);
        group.bench_function(BenchmarkId::new(id, 128), |bencher| {
            bencher.iter(|| {
                method
                    .reconstruct_with(&mut workspace, black_box(frame), domain, &mut surface)
                    .unwrap();
            });
        });
    }
}

/// Prints the errors of a surface; returns the mean absolute one, in pixels.
fn survey_error(case: &Case, id: &str, surface: &Surface<f64>, alignment: Alignment) -> f64 {
    let error = height_error(
        surface.heights.view(),
        case.z.view(),
        Some(case.mask.view()),
        alignment,
    )
    .unwrap();
    eprintln!(
        "{id}: mean |error| {:.3} px ({alignment:?}), constant guess {:.2} px, range {:.1} px",
        error.error.mean_absolute, error.constant_guess, error.range
    );
    error.error.mean_absolute
}

fn check_survey(case: &Case, method: &str, lighting: &Lighting<f64>, error: f64) {
    match (lighting.direction() == [0.0, 0.0, 1.0], case.name, method) {
        (true, "vase", "eikonal-rim") => assert!(error < 0.6),
        (true, "mozart", "eikonal-known") => assert!(error < 1.15),
        _ => {}
    }
}

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

criterion_group!(
    benches,
    survey,
    contact_share,
    points,
    depth_table,
    integrate
);
criterion_main!(benches);
