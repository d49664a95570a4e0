//! Force: what a frame costs, with the error beside the time. The bench `work_precision` varies how
//! the profile is fitted.
//!
//! Everything runs on the paper's frame, 1392 × 1042 pixels of 8 bits; the yardstick is adding up
//! its bytes.
#![allow(missing_docs, clippy::print_stderr)]

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use ndarray::Array2;
use tactile_imaging::force::{
    CalibrationOptions, CalibrationPair, ContactDetector, ContactOptions, DetectorWorkspace,
    ForceMeter, ForceOptions, ForceWorkspace, LinearCalibration, ReferenceFrame,
};
use tactile_simulate::{PressLoad, PressOptions, PressScene};

struct Scene {
    scene: PressScene,
    reference: ReferenceFrame,
    quiet: Array2<u8>,
    pressed: Array2<u8>,
}

fn scene() -> Scene {
    scene_of(1.0)
}

/// A contact so many times as wide as the default ball's: a ∝ R^⅓ under the same force.
fn scene_of(wider: f64) -> Scene {
    let mut options = PressOptions {
        loads: vec![PressLoad::normal(0.7)],
        ..PressOptions::default()
    };
    options.object.radius_m *= wider.powi(3);
    let scene = PressScene::new(options).expect("a valid scene");
    let reference = ReferenceFrame::new(scene.reference(0).view()).expect("a valid frame");
    let (quiet, pressed) = (scene.reference(1), scene.frame(0, 0));
    Scene {
        scene,
        reference,
        quiet,
        pressed,
    }
}

/// The sum as one writes it, and with a 32-bit sum for every 64 KiB, which the compiler turns into
/// wide instructions.
fn add_up(bytes: &[u8]) -> u64 {
    bytes.iter().map(|&b| u64::from(b)).sum()
}

fn add_up_blocks(bytes: &[u8]) -> u64 {
    bytes
        .chunks(1 << 16)
        .map(|c| u64::from(c.iter().map(|&b| u32::from(b)).sum::<u32>()))
        .sum()
}

fn pass(c: &mut Criterion) {
    let s = scene();
    let bytes = s.quiet.as_slice().expect("contiguous");
    let mut group = c.benchmark_group("force/pass");
    group.bench_function("add up the bytes", |b| b.iter(|| add_up(black_box(bytes))));
    group.bench_function("add up the bytes, blocked", |b| {
        b.iter(|| add_up_blocks(black_box(bytes)))
    });
    let statistics = s.reference.compare(s.quiet.view(), 10).expect("same size");
    let reference: u64 = add_up(s.reference.image().as_slice().expect("contiguous"));
    assert_eq!(
        statistics.sum,
        add_up(bytes) as i64 - reference as i64,
        "the pass is exact"
    );
    group.bench_function("the pass alone", |b| {
        b.iter(|| s.reference.compare(black_box(s.quiet.view()), 10))
    });
    let detector = ContactDetector::new(ContactOptions::default());
    let mut workspace = DetectorWorkspace::default();
    let mut detect = |frame: &Array2<u8>| {
        detector
            .detect_with(&mut workspace, frame.view(), &s.reference)
            .expect("valid")
            .contact
            .is_some()
    };
    assert!(!detect(&s.quiet) && detect(&s.pressed));
    group.bench_function("frame without contact", |b| {
        b.iter(|| detect(black_box(&s.quiet)))
    });
    group.finish();
}

fn contact(c: &mut Criterion) {
    for (wider, name) in [(1.0, "5 % of the frame"), (1.73, "15 % of the frame")] {
        let s = scene_of(wider);
        let detector = ContactDetector::new(ContactOptions::default());
        let mut workspace = DetectorWorkspace::default();
        let mut detect =
            || detector.detect_with(&mut workspace, black_box(s.pressed.view()), &s.reference);
        let (contact, truth) = (
            detect().expect("valid").contact.expect("contact"),
            s.scene.truth(0),
        );
        let error = (0..2)
            .map(|k| (contact.centroid_px[k].value - truth.centroid_px[k]).abs())
            .fold(0.0, f64::max);
        assert!(error < 0.02, "centroid off by {error} px");
        eprintln!(
            "force/contact: radius {:.0} px, {:.1} % of the frame, centroid off by {error:.4} px, \
             stated {:.4} px",
            contact.equivalent_radius_px,
            100.0 * contact.area_px as f64 / s.pressed.len() as f64,
            contact.centroid_px[0].standard_error
        );
        let meter = ForceMeter::new([1.0, 1.0], &ForceOptions::default()).expect("valid");
        let mut workspace = ForceWorkspace::default();
        let unit: Vec<_> = (0..5)
            .map(|k| 1e6 * f64::from(k))
            .map(|v| CalibrationPair::loading(v, v))
            .collect();
        let unit =
            LinearCalibration::fit(&unit, &CalibrationOptions::default()).expect("enough pairs");
        c.bench_function(&format!("force/contact/detect, {name}"), |b| {
            b.iter(&mut detect)
        });
        c.bench_function(
            &format!("force/contact/detect and fit the profile, {name}"),
            |b| {
                b.iter(|| {
                    meter.measure_with(
                        &mut workspace,
                        black_box(s.pressed.view()),
                        &s.reference,
                        &unit,
                    )
                })
            },
        );
    }
}

criterion_group!(benches, pass, contact);
criterion_main!(benches);
