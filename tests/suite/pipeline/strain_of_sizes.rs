//! The stated error of the strain is correct for frames of every size, or the result has a flag.
#![allow(clippy::print_stdout)]
use std::collections::BTreeMap;
use tactile_imaging::pipeline::Flag;
use tactile_simulate::Trial;
use tactile_simulate::{CalibrationRun, Camera, PressOptions};

/// Widths and heights of frames that show the same 30 mm × 22.5 mm.
const SIZES: [[usize; 2]; 5] = [[174, 130], [348, 260], [464, 347], [696, 521], [1392, 1042]];

/// The paper's press with a camera of this size. Every seed has different noise and another
/// position relative to the pixels.
fn trial([width, height]: [usize; 2], seed: u64) -> Trial {
    let fraction = |step: f64| (step * seed as f64).fract() - 0.5;
    let camera = Camera {
        shape: [height, width],
        pixel_size_m: [30e-3 / width as f64; 2],
        ..Camera::default()
    };
    let options = PressOptions {
        camera,
        seed,
        centre_px: Some([
            0.5 * width as f64 + fraction(0.618),
            0.5 * height as f64 + fraction(0.414),
        ]),
        ..PressOptions::default()
    };
    Trial::new(options, &CalibrationRun::default()).unwrap()
}

/// Whether the flags of the measurement warn that its strain may be wrong.
fn cautions(flags: &[Flag]) -> bool {
    flags.iter().any(|flag| {
        matches!(
            flag,
            Flag::CoarseStrain { .. } | Flag::MatchNotConverged | Flag::Folded { .. }
        )
    })
}

/// Every mean strain lies within three stated standard errors of the true value, or a caution warns
/// that it may not. One of 370 normally distributed values exceeds three, and the errors are stated
/// for the worst size. `STRAIN_SEEDS` sets the number of draws per size (two by default).
#[test]
fn strains_are_within_their_errors_at_every_size_or_flagged() {
    let seeds = test_support::draws("STRAIN_SEEDS", 2);
    let mut failures = Vec::new();
    for size in SIZES {
        let mut worst: BTreeMap<&str, f64> = BTreeMap::new();
        let mut errors: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
        let mut flagged = 0;
        for seed in 0..seeds {
            let trial = trial(size, seed);
            let pipeline = trial.pipeline().unwrap();
            let measurement = trial.press(&pipeline).unwrap().measure();
            let Ok(strain) = &measurement.strain else {
                continue;
            };
            let frames = &trial.simulation.truth;
            let map = frames[0].scaling_to(&frames[frames.len() - 1]);
            let truth = map.green_lagrange_strain();
            let caution = cautions(&measurement.flags);
            flagged += usize::from(caution);
            for (k, name) in ["e_xx", "e_yy", "e_zz"].into_iter().enumerate() {
                let z = (strain.mean[k][k] - truth[(k, k)]) / strain.standard_error[k][k];
                errors
                    .entry(name)
                    .or_default()
                    .push(strain.mean[k][k] / truth[(k, k)] - 1.0);
                let entry = worst.entry(name).or_default();
                if z.abs() > entry.abs() {
                    *entry = z;
                }
                if !(z.abs() <= 3.0 || caution) {
                    failures.push(format!(
                        "{size:?}, seed {seed}: {name} {:.4} ± {:.4}, true {:.4}",
                        strain.mean[k][k],
                        strain.standard_error[k][k],
                        truth[(k, k)]
                    ));
                }
            }
        }
        println!(
            "{size:?}: {flagged} of {} flagged, greatest z {worst:.2?}",
            seeds
        );
        for (name, errors) in &errors {
            let n = errors.len() as f64;
            let mean = errors.iter().sum::<f64>() / n;
            let square = errors.iter().map(|e| (e - mean).powi(2)).sum::<f64>() / n;
            println!(
                "  {name} {:+.1} % ± {:.1} %",
                100.0 * mean,
                100.0 * square.sqrt()
            );
        }
    }
    assert!(failures.is_empty(), "{failures:#?}");
}
