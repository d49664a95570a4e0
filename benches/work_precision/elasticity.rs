//! How many repetitions a standard error needs.

use crate::study::Study;
use tactile_imaging::elasticity::modulus::Bootstrap;

/// A cube of a normal number, as the modulus is of the contact radius: E ∝ a⁻³ with 1 % in a, whose spread is known by a long run.
fn cube(normal: &mut dyn FnMut() -> f64) -> Option<f64> {
    Some((1.0 + 0.01 * normal()).powi(-3))
}

/// Standard deviation of (1 + 0.01 z)⁻³: by series 3σ√(1 + 22σ² + …), σ = 0.01.
fn spread() -> f64 {
    let s2 = 1e-4_f64;
    // Moments of (1 + σz)^k to σ⁶: mean of k = −3 is 1 + 6σ² + 45σ⁴ + 420σ⁶, of k = −6 it is 1 + 21σ² + 378σ⁴ + 6930σ⁶.
    let mean = 1.0 + 6.0 * s2 + 45.0 * s2 * s2 + 420.0 * s2.powi(3);
    let square = 1.0 + 21.0 * s2 + 378.0 * s2 * s2 + 6930.0 * s2.powi(3);
    (square - mean * mean).sqrt()
}

pub(crate) fn bootstrap(study: &mut Study) {
    study.error_label = "rms error of the standard error, relative";
    const RUNS: u64 = 20;
    let expected = spread();
    for replicates in [30, 100, 300, 1000, 3000, 10_000] {
        let job = || {
            let run = |seed| {
                Bootstrap { replicates, seed }
                    .run(cube)
                    .expect("an answer")
                    .standard_error
            };
            (0..RUNS).map(run).collect::<Vec<f64>>()
        };
        let is_default = replicates == Bootstrap::default().replicates;
        study.run("replicates", replicates, is_default, job, |found| {
            (found
                .iter()
                .map(|s| (s / expected - 1.0).powi(2))
                .sum::<f64>()
                / RUNS as f64)
                .sqrt()
        });
        study.entries.last_mut().expect("an entry").seconds /= RUNS as f64;
    }
}
