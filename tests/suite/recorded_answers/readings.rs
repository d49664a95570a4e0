//! What of a press is recorded: readings, moduli, surfaces, matches, strains.
use super::Answers;
use nalgebra::Matrix3;
use tactile_imaging::elasticity::modulus::ModulusEstimate;
use tactile_imaging::pipeline::{ContactReading, Press};

pub(super) fn contact(answers: &mut Answers, name: &str, reading: &ContactReading) {
    let force = reading
        .force_n
        .map_or([0.0; 2], |f| [f.value, f.standard_error]);
    let radius = reading.contact_radius_m;
    answers.add(format!("{name}/force"), force);
    answers.add(
        format!("{name}/force errors"),
        [reading.force_noise_n, reading.force_calibration_n],
    );
    answers.add(
        format!("{name}/radius"),
        [radius.value, radius.standard_error],
    );
    answers.add(
        format!("{name}/centroid"),
        reading
            .centroid_px
            .iter()
            .flat_map(|c| [c.value, c.standard_error]),
    );
    answers.add(format!("{name}/area"), [reading.area_m2]);
    answers.add(format!("{name}/peak"), [reading.peak_grey]);
    if let Some(depth) = reading.indentation_m {
        answers.add(
            format!("{name}/indentation"),
            [depth.value, depth.standard_error],
        );
    }
}

pub(super) fn modulus(answers: &mut Answers, name: &str, found: &ModulusEstimate) {
    let interval = [Some(found.interval_95.lower), found.interval_95.upper];
    answers.add(name, [found.youngs_modulus_pa, found.standard_error_pa]);
    answers.add(format!("{name}/interval"), interval.into_iter().flatten());
    answers.add(format!("{name}/chi squared"), [found.fit.chi_squared]);
    answers.add(format!("{name}/warnings"), [found.warnings.len() as f64]);
}

pub(super) fn tensor(m: &Matrix3<f64>) -> impl Iterator<Item = f64> + '_ {
    (0..3).flat_map(move |row| (row..3).map(move |column| m[(row, column)]))
}

/// Contacts, surfaces, control points, matches, strains of all frames.
pub(super) fn press(answers: &mut Answers, name: &str, press: &mut Press<'_>) {
    for frame in 0..press.frames() {
        let name = format!("{name}frame {frame}");
        let reading = *press
            .contact(frame)
            .expect("a measurement")
            .expect("a contact");
        contact(answers, &name, &reading);
        let heights = &press.surface(frame).expect("a surface").surface.heights;
        let finite = || heights.iter().copied().filter(|h| h.is_finite());
        answers.add(
            format!("{name}/height sums"),
            [finite().sum::<f64>(), finite().map(f64::abs).sum()],
        );
        answers.add(format!("{name}/heights"), finite().step_by(151));
        let points = press.control_points(frame).expect("control points");
        answers.add(format!("{name}/control points"), [points.len() as f64]);
        answers.add(
            format!("{name}/some control points"),
            points.iter().step_by(13).flat_map(|p| [p.x, p.y, p.z]),
        );
        if frame == 0 {
            continue;
        }
        let matching = press.matching(frame).expect("a match");
        answers.add(
            format!("{name}/partners"),
            matching
                .assignment
                .iter()
                .map(|a| a.map_or(-1.0, |j| j as f64)),
        );
        answers.add(
            format!("{name}/confidence"),
            matching.confidence.iter().copied().step_by(7),
        );
        answers.add(
            format!("{name}/warped"),
            matching
                .warped
                .iter()
                .step_by(13)
                .flat_map(|p| [p.x, p.y, p.z]),
        );
        answers.add(format!("{name}/residual"), [matching.report.residual]);
        answers.add(
            format!("{name}/iterations"),
            [matching.report.iterations as f64],
        );
        let summary = &press.strain(frame).expect("a strain").summary;
        answers.add(format!("{name}/strain"), tensor(&summary.mean));
        answers.add(
            format!("{name}/strain error"),
            tensor(&summary.standard_error),
        );
        answers.add(format!("{name}/strain spread"), tensor(&summary.spread));
    }
}

pub(super) fn estimates(answers: &mut Answers, press: &mut Press<'_>) {
    let best = press.modulus().expect("a modulus");
    modulus(answers, "modulus", &best);
    for estimate in press.estimates().expect("estimates") {
        let name = format!("modulus ({})", estimate.estimator);
        modulus(answers, &name, &estimate);
    }
}
