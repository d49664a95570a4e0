//! How long the stages take, measured again and again.
use crate::context::Context;
use crate::progress::Progress;
use serde::Serialize;
use std::time::{Duration, Instant};
use tactile_imaging::pipeline::{Press, Stage};

/// Median and 99th centile of a stage in milliseconds.
#[derive(Serialize)]
pub struct Timing {
    pub stage: String,
    pub median_ms: f64,
    pub centile_99_ms: f64,
}

/// Measures `n` times from the frames, the reference being known; nothing where `n` is one.
pub fn repeated(first: &Press<'_>, n: u32, context: &Context) -> Vec<Timing> {
    if n < 2 {
        return Vec::new();
    }
    let mut times: Vec<Vec<Duration>> = vec![Vec::new(); Stage::ALL.len() + 1];
    let mut bar = Progress::of(n as usize, "measuring");
    context.interrupt.hear(true);
    for k in 0..n {
        if context.interrupt.requested() {
            break;
        }
        let start = Instant::now();
        let press = first.renewed();
        // A stage without an answer takes its time as well.
        let _ = press.measure();
        let whole = start.elapsed();
        for (list, stage) in times.iter_mut().zip(Stage::ALL) {
            list.push(press.report().work(stage).time);
        }
        times[Stage::ALL.len()].push(whole);
        bar.done(k as usize + 1);
    }
    let stages = Stage::ALL.map(|stage| stage.to_string());
    let names = stages.into_iter().chain(["whole".to_owned()]);
    names
        .zip(times)
        .map(|(stage, list)| timing(stage, list))
        .collect()
}

fn timing(stage: String, mut list: Vec<Duration>) -> Timing {
    list.sort_unstable();
    let at = |share: f64| {
        let last = list.len().saturating_sub(1) as f64;
        let time = list.get((last * share).ceil() as usize);
        time.map_or(0.0, |time| time.as_secs_f64() * 1e3)
    };
    Timing {
        stage,
        median_ms: at(0.5),
        centile_99_ms: at(0.99),
    }
}
