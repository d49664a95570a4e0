//! The pipeline on frames of 1392 × 1042 pixels with 200 control points: the paper's press, both results asserted.
#![allow(clippy::print_stdout)]
use criterion::{Criterion, criterion_group, criterion_main};
use std::hint::black_box;
use std::sync::Arc;
use tactile_imaging::pipeline::{Session, Trial};
use tactile_imaging::simulate::{CalibrationOptions, PressOptions};

fn press(c: &mut Criterion) {
    let trial = Trial::new(PressOptions::default(), &CalibrationOptions::default()).expect("default options");
    let pipeline = trial.pipeline().expect("a calibrated sensor");
    let truth = trial.truth().youngs_modulus_pa;
    let measured = trial.press(&pipeline).and_then(|mut p| p.measure()).expect("a measurement");
    let error = 100.0 * (measured.youngs_modulus_pa.value / truth - 1.0);
    assert!(error.abs() < 5.38, "modulus error {error} %");
    println!("modulus error {error:+.3} %");

    let mut group = c.benchmark_group("pipeline");
    group.sample_size(10);
    group.bench_function("modulus_of_two_frames", |b| {
        b.iter(|| trial.press(&pipeline).and_then(|mut p| p.modulus()).expect("a modulus"));
    });
    group.bench_function("everything_of_two_frames", |b| {
        b.iter(|| trial.press(&pipeline).and_then(|mut p| p.measure()).expect("a measurement"));
    });
    let (one, two) = (&trial.simulation.frames[0], &trial.simulation.frames[1]);
    let empty = trial.scene.reference(9);
    let stages = Arc::new(trial.pipeline().expect("a calibrated sensor"));
    let session = || Session::new(stages.clone(), trial.simulation.reference.view()).expect("a session");
    let mut turn = session();
    let mut side = false;
    group.bench_function("force_of_a_frame", |b| {
        b.iter(|| {
            side = !side;
            turn.push(black_box(if side { one } else { two }).view()).expect("a contact")
        });
    });
    let mut same = session();
    group.bench_function("force_of_an_equal_frame", |b| {
        b.iter(|| same.push(black_box(one).view()).expect("a contact"));
    });
    let (mut quiet, other) = (session(), trial.scene.reference(10));
    group.bench_function("frame_without_contact", |b| {
        b.iter(|| {
            side = !side;
            quiet.push(black_box(if side { &empty } else { &other }).view()).expect("no contact")
        });
    });
    group.finish();
}

criterion_group!(benches, press);
criterion_main!(benches);
