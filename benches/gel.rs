//! Frames of gels: calibration, contacts and tracked markers.
#![allow(missing_docs)]

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use nalgebra::Point2;
use ndarray::{Array2, Array3, Axis};
use tactile_gel::simulate::{ColourGel, ElasticFace, HertzPress};
use tactile_gel::{BallPress, DarkModel, GelSensor, Marker, MarkerField};

/// A calibration of twenty presses: their frames and the frame without contact.
fn presses(shape: [usize; 2]) -> (Array3<u8>, Vec<Array3<u8>>) {
    let gel = ColourGel {
        shape,
        ..ColourGel::default()
    };
    let [rows, columns] = shape.map(|n| n as f64);
    let frame = |k: u32| {
        let along = |share: f64| 0.2 + 0.6 * (f64::from(k) * share).fract();
        let at = [along(0.618) * columns, along(0.414) * rows];
        let press = HertzPress::ball(at, 40.0, 12.0 + f64::from(k));
        gel.frame(
            &ElasticFace::HALF_SPACE.depth_px(shape, &[press]),
            u64::from(k),
        )
    };
    let flat = gel.frame(&Array2::zeros((shape[0], shape[1])), 90);
    (flat, (0..20).map(frame).collect())
}

fn read(criterion: &mut Criterion) {
    for (name, shape) in [("320 x 240", [240, 320]), ("640 x 480", [480, 640])] {
        let (flat, frames) = presses(shape);
        let presses = frames.iter().map(|frame| BallPress::new(frame, 2e-3));
        let presses: Vec<_> = presses.collect();
        let calibrate = || {
            GelSensor::calibrate(&flat, 5e-5, &presses)
                .expect("presses")
                .0
        };
        let sensor = calibrate();
        let mut group = criterion.benchmark_group("gel");
        group.sample_size(10);
        group.bench_function(format!("calibrate, {name}"), |b| b.iter(calibrate));
        group.sample_size(50);
        group.bench_function(format!("read, {name}"), |b| {
            b.iter(|| sensor.read(black_box(&frames[15])));
        });
        let grey = |frame: &Array3<u8>| frame.index_axis(Axis(2), 0).to_owned();
        let model = DarkModel::new(5e-5, vec![[0.0, 0.0], [100.0, 1e-3]]);
        let dark = GelSensor::new(model, &grey(&flat)).expect("a table");
        let frame = grey(&frames[15]);
        group.bench_function(format!("read of a gel that darkens, {name}"), |b| {
            b.iter(|| dark.read(black_box(&frame)));
        });
    }
}

fn follow(criterion: &mut Criterion) {
    let frame = |step: f64, hidden: usize| -> Vec<Marker> {
        let place = |k: usize| Point2::new(20.0 * (k % 14) as f64, 20.0 * (k / 14) as f64);
        let moved = |p: Point2<f64>| Point2::new(p.x + step * (-p.y / 80.0).exp(), p.y);
        (hidden..140)
            .map(|k| Marker::new(moved(place(k)), 0.05, 60.0))
            .collect()
    };
    let rest = MarkerField::at_rest(&frame(0.0, 0));
    for hidden in [0, 20] {
        let next = frame(2.0, hidden);
        criterion.bench_function(&format!("markers, 140, {hidden} hidden"), |b| {
            b.iter(|| rest.followed(black_box(&next)));
        });
    }
}

criterion_group!(benches, read, follow);
criterion_main!(benches);
