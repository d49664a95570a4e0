//! Streams of frames.
use criterion::BenchmarkGroup;
use criterion::measurement::WallTime;
use std::hint::black_box;
use tactile_imaging::pipeline::Session;
use tactile_simulate::Trial;

/// Time per frame of a stream, for different contents.
pub(crate) fn stream(group: &mut BenchmarkGroup<'_, WallTime>, trial: &Trial) {
    let (one, two) = (&trial.simulation.frames[0], &trial.simulation.frames[1]);
    let empty = trial.scene.reference(9);
    let pipeline = trial.pipeline().expect("a calibrated sensor");
    let session =
        || Session::new(&pipeline, &[trial.simulation.reference.view()]).expect("a session");
    let mut turn = session();
    let mut side = false;
    group.bench_function("force_of_a_frame", |b| {
        b.iter(|| {
            side = !side;
            turn.push(black_box(if side { one } else { two }).view())
                .expect("a contact")
        });
    });
    let mut strained = session();
    for frame in [one, two] {
        strained
            .push(frame.view())
            .and_then(|_| strained.strain().map(drop))
            .expect("a strain");
    }
    let third = trial.scene.frame(1, 11);
    group.bench_function("strain_of_a_frame", |b| {
        b.iter(|| {
            side = !side;
            strained
                .push(black_box(if side { &third } else { two }).view())
                .expect("a contact");
            strained
                .strain()
                .expect("a strain")
                .map(|found| found.strain.summary.mean)
        });
    });
    let (mut quiet, other) = (session(), trial.scene.reference(10));
    group.bench_function("frame_without_contact", |b| {
        b.iter(|| {
            side = !side;
            quiet
                .push(black_box(if side { &empty } else { &other }).view())
                .expect("no contact")
        });
    });
}
