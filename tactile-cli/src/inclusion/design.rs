//! `tactile inclusion --design`: which approaches would tell most.
use crate::context::Context;
use crate::failure::{Exit, Failure};
use crate::progress::Progress;
use serde_json::json;
use std::path::Path;
use tactile_imaging::inclusion::{AssumedInclusion, ExpectedErrors, InclusionSearch};

/// Largest approaches over the block's height that are compared.
const LARGEST: [f64; 3] = [0.03, 0.06, 0.1];
/// Numbers of frames, at even approaches.
const FRAMES: [usize; 3] = [1, 2, 3];
/// White error of a ring's mean over the mean pressure: some thousand pixels with 1 % noise.
const RING_NOISE: f64 = 3e-4;

/// Prints the errors that scans of this block would leave, were the assumed lump in it.
pub fn run(
    search: &InclusionSearch,
    (height_m, face_radius_m): (f64, f64),
    assumed: &AssumedInclusion,
    file: Option<&Path>,
    context: &mut Context,
) -> Result<Exit, Failure> {
    let width = face_radius_m / 60.0;
    let radii: Vec<f64> = (0..45).map(|k| (f64::from(k) + 0.5) * width).collect();
    let mut bar = Progress::of(LARGEST.len() * FRAMES.len(), "comparing scans");
    let mut rows = Vec::new();
    for largest in LARGEST {
        for frames in FRAMES {
            let approaches: Vec<f64> = (1..=frames)
                .map(|k| largest * height_m * k as f64 / frames as f64)
                .collect();
            let pressure = assumed.block_modulus_pa * largest;
            let white = vec![RING_NOISE * pressure; radii.len()];
            let errors = search.expected_errors(assumed, &approaches, &radii, &white);
            let errors = errors.map_err(|error| match file {
                Some(file) => Failure::input(format!("{}: {error}", file.display())),
                None => Failure::input(error),
            })?;
            rows.push((approaches, errors));
            bar.done(rows.len());
        }
    }
    drop(bar);
    context.console.line(format!(
        "expected standard errors for a lump of {:.1} mm, {:.1} mm deep, {:.0} kPa in tissue of {:.1} kPa",
        1e3 * assumed.diameter_m,
        1e3 * assumed.depth_m,
        1e-3 * assumed.youngs_modulus_pa,
        1e-3 * assumed.block_modulus_pa,
    ));
    context
        .console
        .line("approaches (mm)           diameter    depth  modulus".to_owned());
    for (approaches, errors) in &rows {
        let list: Vec<String> = approaches
            .iter()
            .map(|a| format!("{:.2}", 1e3 * a))
            .collect();
        let [diameter, depth, modulus] = percents(errors);
        context.console.line(format!(
            "{:<24} {diameter:>8.1} % {depth:>6.1} % {modulus:>6.1} %",
            list.join(", ")
        ));
    }
    context.console.line(
        "above 25 % a parameter cannot be told; a contact that slips or tissue that tears is not in the model".to_owned(),
    );
    let rows: Vec<_> = (rows.iter())
        .map(
            |(approaches, errors)| json!({ "approaches_m": approaches, "expected_errors": errors }),
        )
        .collect();
    context.console.value(&json!({ "design": rows }));
    Ok(Exit::Complete)
}

fn percents(errors: &ExpectedErrors) -> [f64; 3] {
    [errors.diameter, errors.depth, errors.youngs_modulus].map(|error| 100.0 * error)
}
