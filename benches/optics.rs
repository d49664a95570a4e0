//! Optics: closed forms per call, rays per second through the paper's waveguide, and error against
//! the number of rays.
//!
//! Every measured answer is asserted first; the error stands in the name of the tracer's benches.
use std::f64::consts::FRAC_PI_2;
use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use tactile_imaging::optics::surface::{Dimple, Flat, TopSurface};
use tactile_imaging::optics::trace::{Slab, SlabLayer, TraceOptions, trace};
use tactile_imaging::optics::{Geometry, Led, acceptance_angle, fresnel, normal_incidence};
use tactile_simulate::{Camera, PressOptions, PressScene};

fn closed_forms(c: &mut Criterion) {
    let mut group = c.benchmark_group("optics/closed form");
    let angle = acceptance_angle(1.38_f64, 1.0).unwrap();
    assert!((angle.radians.to_degrees() - 71.989_426_661_361_93).abs() < 1e-12);
    group.bench_function("acceptance angle", |b| {
        b.iter(|| acceptance_angle(black_box(1.38_f64), black_box(1.0)))
    });
    let glass = fresnel(1.0_f64, 1.5, 0.0).unwrap();
    assert!((glass.reflectance - 0.04).abs() < 1e-15);
    group.bench_function("fresnel", |b| {
        b.iter(|| fresnel(black_box(1.40_f64), black_box(1.0), black_box(0.5)))
    });
    let indices = [1.38_f64, 1.39, 1.40, 1.41];
    let stack = normal_incidence(&indices, 1.0).unwrap();
    assert!((stack.transmittance - 0.946_967_070_045_048_9).abs() < 1e-15);
    group.bench_function("stack of four at normal incidence", |b| {
        b.iter(|| normal_incidence(black_box(&indices), 1.0))
    });
    group.finish();
}

fn waveguide() -> [SlabLayer; 4] {
    // From the object's side to the glass, §3.3.
    [(1.38, 2e-3), (1.39, 3e-3), (1.40, 5e-3), (1.4737, 2e-3)]
        .map(|(index, thickness_m)| SlabLayer { index, thickness_m })
}

fn rays(c: &mut Criterion) {
    let layers = waveguide();
    let slab = Slab::new(&layers, 1.0, 30e-3).unwrap();
    let led = Led::new(1.0, 70_f64.to_radians()).unwrap();
    let dimple = Dimple::new([15e-3, 0.0], 5e-3, 1.5e-3).unwrap();
    let surfaces: [(&str, &dyn TopSurface); 2] = [("flat", &Flat), ("dimple", &dimple)];
    let mut group = c.benchmark_group("optics/rays");
    for geometry in [Geometry::Section, Geometry::Volume] {
        for (name, surface) in surfaces {
            let rays = 2048;
            let options = TraceOptions::default()
                .with_geometry(geometry)
                .with_rays(rays)
                .unwrap();
            let budget = trace(&slab, &led, surface, &options, &mut []).unwrap();
            let left = budget.above + budget.below + budget.camera + budget.absorbed;
            let total = budget.entry + budget.guided + budget.returned + left + budget.unresolved;
            assert!((total - 1.0).abs() < 1e-13);
            group.throughput(Throughput::Elements(u64::from(rays)));
            group.bench_function(BenchmarkId::new(name, format!("{geometry:?}")), |b| {
                b.iter(|| trace(&slab, &led, surface, black_box(&options), &mut []));
            });
        }
    }
    group.finish();
}

/// Guided share of a flat layer against unfolding (every reflection counted in closed form).
fn convergence(c: &mut Criterion) {
    let layers = [SlabLayer {
        index: 1.38_f64,
        thickness_m: 10e-3,
    }];
    let slab = Slab::new(&layers, 1.0, 30e-3).unwrap();
    let led = Led::default();
    let expected = unfolded(1.38, 3.0, 8000);
    let mut group = c.benchmark_group("optics/work against error");
    let mut before = f64::INFINITY;
    for rays in [256, 2048, 16384] {
        let options = TraceOptions::default()
            .with_geometry(Geometry::Section)
            .with_rays(rays)
            .unwrap();
        let guided = |seed| {
            trace(&slab, &led, &Flat, &options.with_seed(seed), &mut [])
                .unwrap()
                .guided
        };
        let rms = ((0..8)
            .map(|s| (guided(s) / expected - 1.0).powi(2))
            .sum::<f64>()
            / 8.0)
            .sqrt();
        assert!(
            rms < before,
            "more rays must not be worse: {rms} after {before}"
        );
        before = rms;
        group.bench_function(format!("{rays} rays, error {rms:.1e}"), |b| {
            b.iter(|| guided(black_box(1)))
        });
    }
    group.finish();
}

fn unfolded(n: f64, aspect: f64, steps: usize) -> f64 {
    let (mut guided, mut total) = (0.0, 0.0);
    for i in 0..steps {
        let theta = (i as f64 + 0.5) / steps as f64 * FRAC_PI_2;
        let inside = (theta.sin() / n).asin();
        let entry = fresnel(1.0, n, theta).unwrap().transmittance;
        let kept = fresnel(n, 1.0, FRAC_PI_2 - inside).unwrap().reflectance;
        for k in 0..64 {
            let unfolded = (f64::from(k) + 0.5) / 64.0 + aspect * inside.tan();
            guided += theta.cos() * entry * kept.powf(unfolded.floor());
        }
        total += 64.0 * theta.cos();
    }
    guided / total
}

/// The scene simulator at the paper's frame size.
fn frames(c: &mut Criterion) {
    let scene = PressScene::new(PressOptions::default()).unwrap();
    let light = scene.expected_frame(1);
    let camera = scene.options().camera;
    let quiet = PressScene::new(PressOptions {
        camera: Camera {
            vignetting: 0.0,
            ..camera
        },
        ..PressOptions::default()
    })
    .unwrap();
    let sum: f64 = quiet
        .expected_frame(1)
        .iter()
        .map(|v| v - camera.background_grey)
        .sum();
    assert!(
        (sum * camera.pixel_size_m.iter().product::<f64>() / quiet.truth(0).grey_per_pascal / 1.2
            - 1.0)
            .abs()
            < 1e-11
    );
    let mut group = c.benchmark_group("simulate/1392x1042");
    group
        .sample_size(20)
        .throughput(Throughput::Elements(light.len() as u64));
    group.bench_function("light of a press", |b| {
        b.iter(|| scene.expected_frame(black_box(1)))
    });
    group.bench_function("exposure with noise", |b| {
        b.iter(|| camera.expose(light.view(), 1, black_box(2)))
    });
    group.finish();
}

criterion_group!(benches, closed_forms, rays, convergence, frames);
criterion_main!(benches);
