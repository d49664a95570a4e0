//! Requirements for every press and stream with any frames: a typed error, a finite result, or a
//! flag that names the cause; never a panic, never a silent NaN.
use nalgebra::Point3;
use ndarray::Array2;
use std::fmt::Debug;
use tactile_imaging::Pipeline;
use tactile_imaging::elasticity::field::StrainSummary;
use tactile_imaging::elasticity::modulus::ModulusEstimate;
use tactile_imaging::force::Estimate;
use tactile_imaging::pipeline::{ContactReading, Flag, Measurement, PipelineError, Press, Session};

fn all_finite<'a>(numbers: impl IntoIterator<Item = &'a f64>) -> bool {
    numbers.into_iter().all(|v| v.is_finite())
}

/// Whether a flag about this contact explains its NaN values. A flag about the law (most of these
/// scenes have an a/R beyond Hertz's range) or about another frame is no explanation.
fn excuses_contact(flag: &Flag, in_frame: usize) -> bool {
    matches!(flag,
        Flag::Saturated { frame, .. }
        | Flag::OutOfCalibration { frame }
        | Flag::TouchesEdge { frame }
        | Flag::ProfileNotConverged { frame } if *frame == in_frame)
}

/// Checks that all numbers are finite, or that a flag explains them.
fn check(case: &str, numbers: &[f64], excused: bool, of: &dyn Debug) {
    assert!(all_finite(numbers) || excused, "{case}: {of:?}");
}

fn numbers<const N: usize>(estimates: [Estimate; N]) -> Vec<f64> {
    let numbers = |e: Estimate| [e.value, e.standard_error];
    estimates.into_iter().flat_map(numbers).collect()
}

fn contact(case: &str, contact: &ContactReading) {
    let [x, y] = contact.centroid_px;
    let mut all = numbers([contact.contact_radius_m.total(), x, y]);
    all.extend(
        contact
            .force_n
            .map(|force| numbers([force.total()]))
            .into_iter()
            .flatten(),
    );
    all.extend([contact.area_m2, contact.peak_grey, contact.saturated_share]);
    let excused = contact.flags(0).any(|flag| excuses_contact(&flag, 0));
    check(case, &all, excused, contact);
}

/// Without a number there can be no caution about a violated assumption.
fn modulus(case: &str, found: &ModulusEstimate) {
    let numbers = [found.youngs_modulus_pa, found.standard_error_pa];
    check(case, &numbers, false, found);
}

/// Every stage of a frame, regardless of the result of the previous stage.
fn stages(case: &str, press: &Press<'_>, frame: usize) {
    if let Ok(Some(reading)) = press.contact(frame) {
        contact(case, reading);
    }
    if let Ok(found) = press.surface(frame) {
        let mut heights = found.surface.heights.iter().zip(&found.surface.mask);
        let finite = heights.all(|(h, inside)| !inside || h.is_finite());
        assert!(finite, "{case}");
    }
    let points = |points: &[Point3<f64>]| points.iter().all(|p| all_finite(p.iter()));
    if let Ok(found) = press.control_points(frame) {
        assert!(points(found), "{case}");
    }
    if let Ok(matching) = press.matching(frame) {
        let sound = all_finite(&matching.confidence) && points(&matching.warped);
        assert!(sound, "{case}");
    }
    if let Ok(strain) = press.strain(frame) {
        strained(case, &strain.summary);
    }
}

fn strained(case: &str, summary: &StrainSummary) {
    let numbers = summary.mean.iter().chain(&summary.standard_error);
    assert!(all_finite(numbers), "{case}: {summary:?}");
}

fn measured(case: &str, m: &Measurement) {
    for (k, f) in m.frames.iter().enumerate() {
        let Ok(f) = f else { continue };
        let [x, y] = f.centroid_px;
        let mut all = numbers([f.contact_radius_m, x, y]);
        all.extend(f.force_n.iter().flat_map(|force| numbers([*force])));
        all.push(f.contact_area_m2);
        all.extend(f.surface_height_m.iter().map(|height| height.value));
        let excused = m.flags.iter().any(|flag| excuses_contact(flag, k));
        check(case, &all, excused, m);
    }
    if let Ok(strain) = &m.strain {
        let all = [strain.mean, strain.standard_error, strain.spread];
        let excuses = |f: &Flag| matches!(f, Flag::Folded { .. } | Flag::Unmatched { .. });
        let excused = m.flags.iter().any(excuses);
        check(case, all.as_flattened().as_flattened(), excused, m);
    }
    if let Ok(found) = &m.matching {
        let (residual, displacement) = (found.residual_m, found.mean_displacement_m);
        check(
            case,
            &[found.mean_confidence, residual, displacement],
            false,
            m,
        );
    }
    match &m.youngs_modulus_pa {
        Ok(found) => {
            let numbers = [found.value, found.standard_error, found.interval_95.0];
            check(case, &numbers, false, m);
        }
        Err(error) => assert!(!error.to_string().is_empty(), "{case}"),
    }
}

/// Only the modulus, without surfaces if possible.
pub(crate) fn modulus_alone(case: &str, press: &Press<'_>) {
    if let Ok(found) = press.modulus() {
        modulus(case, &found);
    }
}

/// Every stage, every estimator and the whole measurement, which is returned.
pub(crate) fn press(case: &str, press: &Press<'_>) -> Measurement {
    (0..press.frames()).for_each(|frame| stages(case, press, frame));
    let all = press.modulus().into_iter();
    all.chain(press.estimates().into_iter().flatten())
        .for_each(|found| modulus(case, &found));
    let all = press.measure();
    measured(case, &all);
    all
}

/// A stream of the same frames, twice. No error may persist: a valid frame after an error is
/// measured as usual.
pub(crate) fn stream(
    case: &str,
    pipeline: &Pipeline,
    reference: &Array2<u8>,
    frames: [&Array2<u8>; 2],
) {
    let Ok(mut session) = Session::new(pipeline, &[reference.view()]) else {
        return;
    };
    for frame in frames.into_iter().chain(frames) {
        let Ok(update) = session.push(frame.view()) else {
            continue;
        };
        if let Some(reading) = &update.contact {
            contact(case, reading);
        }
        match session.strain() {
            Ok(strain) => strain
                .iter()
                .for_each(|s| strained(case, &s.strain.summary)),
            Err(PipelineError::NoContact { .. }) => {}
            Err(error) => assert!(update.contact.is_some(), "{case}: {error}"),
        }
        if let Ok(found) = session.modulus() {
            modulus(case, &found);
        }
    }
    let drift = session.drift();
    check(case, &[drift.last_grey, drift.greatest_grey], false, &drift);
}
