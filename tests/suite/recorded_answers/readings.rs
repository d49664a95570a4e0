//! The recorded results of a press: readings, moduli, surfaces, matches and strains.
use super::Answers;
use nalgebra::{Matrix3, Point3};
use tactile_imaging::elasticity::modulus::ModulusEstimate;
use tactile_imaging::force::{Estimate, Source};
use tactile_imaging::pipeline::{ContactReading, Press};

pub(super) fn contact(answers: &mut Answers, name: &str, reading: &ContactReading) {
    let both = |e: Estimate| [e.value, e.standard_error];
    let force_n = reading.force_n.unwrap_or_default();
    let force = both(force_n.total());
    answers.add(format!("{name}/force"), force);
    let common = force_n.without(Source::Noise).standard_error();
    let errors = [force_n.part(Source::Noise).abs(), common];
    answers.add(format!("{name}/force errors"), errors);
    answers.add(
        format!("{name}/radius"),
        both(reading.contact_radius_m.total()),
    );
    let centroid = reading.centroid_px.map(both).concat();
    answers.add(format!("{name}/centroid"), centroid);
    answers.add(format!("{name}/area"), [reading.area_m2]);
    answers.add(format!("{name}/peak"), [reading.peak_grey]);
    if let Some(depth) = reading.indentation_m {
        answers.add(format!("{name}/indentation"), both(depth));
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

/// Contacts, surfaces, control points, matches and strains of all frames.
pub(super) fn press(answers: &mut Answers, name: &str, press: &mut Press<'_>) {
    for frame in 0..press.frames() {
        let name = format!("{name}frame {frame}");
        let reading = press.contact(frame).expect("a measurement");
        contact(answers, &name, reading.expect("a contact"));
        let mut add = |what: &str, numbers: Vec<f64>| {
            answers.add(format!("{name}/{what}"), numbers);
        };
        let some = |points: &[Point3<f64>]| {
            let some = points.iter().step_by(13);
            some.flat_map(|p| [p.x, p.y, p.z]).collect()
        };
        let heights = &press.surface(frame).expect("a surface").surface.heights;
        let heights: Vec<f64> = heights.iter().copied().filter(|h| h.is_finite()).collect();
        let sums = [heights.iter().sum(), heights.iter().map(|h| h.abs()).sum()];
        add("height sums", sums.into());
        add("heights", heights.into_iter().step_by(151).collect());
        let points = press.control_points(frame).expect("control points");
        add("control points", vec![points.len() as f64]);
        add("some control points", some(points));
        if frame == 0 {
            continue;
        }
        let matching = press.matching(frame).expect("a match");
        let partners = matching.assignment.iter();
        let partners = partners.map(|a| a.map_or(-1.0, |j| j as f64));
        add("partners", partners.collect());
        let confidence = matching.confidence.iter().copied();
        add("confidence", confidence.step_by(7).collect());
        add("warped", some(&matching.warped));
        add("residual", vec![matching.report.residual]);
        add("iterations", vec![matching.report.iterations as f64]);
        let summary = &press.strain(frame).expect("a strain").summary;
        add("strain", tensor(&summary.mean).collect());
        add("strain error", tensor(&summary.standard_error).collect());
        add("strain spread", tensor(&summary.spread).collect());
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
