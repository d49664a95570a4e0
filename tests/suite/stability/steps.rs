//! Very small load steps: the strain tends to zero with them.
use super::press::{Images, SI, answer, camera, pipeline, trial};
use super::table::{STRAIN, Table};
use ndarray::Array2;

/// Without noise a fraction p of the pixels has a different grey value. The same fraction of points
/// has a different position, and independent errors of a fraction p add up as √p. Frames without
/// any such pixel are equal and have no strain at all, although the step is δ/3.
pub(crate) fn small(table: &mut Table) {
    let steps = [0.0, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2];
    for (what, camera) in [("without noise", camera().ideal()), ("noise", camera())] {
        let trial = trial(camera, 200.0, &steps.map(|step| 0.7 * (1.0 + step)));
        let (pipeline, images) = (pipeline(&trial, SI), Images::of(&trial));
        for (k, step) in steps.into_iter().enumerate().skip(1) {
            let frames = vec![images.frames[0].clone(), images.frames[k].clone()];
            let share = changed_share(&frames).sqrt();
            let references = images.references.clone();
            let found = answer(&pipeline, &Images { references, frames });
            // A mean strain of the apparent surfaces, which grow as the cube root of the force.
            let truth = 0.5 * ((2.0 / 3.0) * step.ln_1p()).exp_m1();
            for (k, name) in ["xx", "yy", "zz"].into_iter().enumerate() {
                let case = format!("step {step:.0e}, {what}: strain e_{name}");
                // The values agree within the rounding error of 1.
                let tolerance = STRAIN[k] * share + truth + 4.0 * f64::EPSILON;
                table.enter(&case, (found.strain[(k, k)] - truth).abs(), tolerance);
            }
            let errors = found.strain_error;
            let finite = errors.iter().all(|e| e.is_finite() && *e >= 0.0);
            assert!(finite, "step {step}, {what}: {errors}");
        }
    }
}

/// Fraction of the pixels of the first frame's contact that differ in the second frame.
fn changed_share(frames: &[Array2<u8>]) -> f64 {
    let both = frames[0].iter().zip(&frames[1]);
    let changed = both.filter(|(a, b)| a != b).count();
    let contact = frames[0].iter().filter(|v| **v > 20).count();
    (changed as f64 / contact as f64).min(1.0)
}
