//! Surfaces over blocks of pixels, as large as the control points allow, agree with those over
//! single pixels.
#![allow(clippy::print_stdout)]
use nalgebra::Matrix3;
use tactile_imaging::pipeline::{Binning, ContactSurface};
use tactile_simulate::Trial;
use tactile_simulate::{CalibrationRun, Camera, PressOptions};

/// Half of the paper's resolution: contacts of about 80 pixels' radius, with blocks of 4 × 4 for 60
/// points.
fn trial() -> Trial {
    let camera = Camera {
        shape: [521, 696],
        pixel_size_m: [43.1e-6; 2],
        ..Camera::default()
    };
    let options = PressOptions {
        camera,
        ..PressOptions::default()
    };
    Trial::new(options, &CalibrationRun::default()).unwrap()
}

/// Radius of Hertz's contact at 0.7 N.
const RADIUS_M: f64 = 3.27e-3;

struct Answer {
    surface: ContactSurface,
    strain: Matrix3<f64>,
    standard_error: Matrix3<f64>,
}

fn answer(trial: &Trial, binning: Binning) -> Answer {
    let pipeline = trial.pipeline().unwrap().with_control_points(60);
    let pipeline = pipeline
        .with_settings(|settings| settings.binning = binning)
        .unwrap();
    let press = trial.press(&pipeline).unwrap();
    let surface = press.surface(0).unwrap().clone();
    let found = press.strain(1).unwrap();
    Answer {
        surface,
        strain: found.summary.mean,
        standard_error: found.summary.standard_error,
    }
}

/// Largest difference of heights above the rim between the blocks and the means of their pixels, as
/// a fraction of the largest height.
fn largest_difference(blocks: &ContactSurface, pixels: &ContactSurface) -> f64 {
    let side = blocks.binning;
    let top = pixels.surface.heights.iter().copied().fold(0.0, f64::max);
    let mut largest = 0.0_f64;
    for ((row, column), height) in blocks.surface.heights.indexed_iter() {
        if !blocks.surface.mask[[row, column]] {
            continue;
        }
        let first_row = blocks.region.row_start + side * row - pixels.region.row_start;
        let first_column = blocks.region.column_start + side * column - pixels.region.column_start;
        let inside = (0..side * side).map(|k| [first_row + k / side, first_column + k % side]);
        let seen = |at: &[usize; 2]| pixels.surface.mask.get(*at) == Some(&true);
        if !inside.clone().all(|at| seen(&at)) {
            continue;
        }
        let mean = inside.map(|at| pixels.surface.heights[at]).sum::<f64>() / (side * side) as f64;
        largest = largest.max((height - mean).abs() / top);
    }
    largest
}

#[test]
fn automatic_blocks_leave_heights_and_strain_as_they_are() {
    let trial = trial();
    let [blocks, pixels] = [Binning::Auto, Binning::Blocks(1)].map(|b| answer(&trial, b));
    assert!(blocks.surface.binning >= 3 && pixels.surface.binning == 1);
    let height = largest_difference(&blocks.surface, &pixels.surface);
    let error = blocks.standard_error + pixels.standard_error;
    println!(
        "{} pixels a side: heights {height:.4}, strains {} {} ± {error}",
        blocks.surface.binning, blocks.strain, pixels.strain
    );
    // The rim, at which the surface is steepest, is accurate to the width of a block.
    let radius = RADIUS_M / blocks.surface.pixel_size_m[0];
    assert!(height < 1.0 / radius, "{height}");
    for (k, (a, b)) in blocks.strain.iter().zip(&pixels.strain).enumerate() {
        assert!((a - b).abs() < error[k], "{k}: {a} {b} ± {}", error[k]);
    }
}
