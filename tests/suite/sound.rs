//! What must hold of every press and stream, whatever its frames are: a typed error, a finite
//! answer, or a flag that says what is wrong; never a panic, never a silent NaN.
use ndarray::Array2;
use tactile_imaging::Pipeline;
use tactile_imaging::elasticity::modulus::ModulusEstimate;
use tactile_imaging::pipeline::{
    ContactReading, Flag, Measurement, PipelineError, Press, Session, SessionStrain,
};

fn all_finite<'a>(numbers: impl IntoIterator<Item = &'a f64>) -> bool {
    numbers.into_iter().all(|v| v.is_finite())
}

/// Whether a contact's numbers that are no numbers are owned up to: by a flag that says what is
/// wrong with that contact. A flag about the law (a/R beyond Hertz's range stands on most of these
/// scenes) or about another frame excuses nothing.
fn excuses_contact(flag: &Flag, in_frame: usize) -> bool {
    matches!(flag,
        Flag::Saturated { frame, .. }
        | Flag::OutOfCalibration { frame }
        | Flag::TouchesEdge { frame }
        | Flag::ProfileNotConverged { frame } if *frame == in_frame)
}

fn contact(case: &str, contact: &ContactReading) {
    let [x, y] = contact.centroid_px;
    let estimates = [contact.contact_radius_m, x, y]
        .into_iter()
        .chain(contact.force_n);
    let mut numbers = vec![contact.area_m2, contact.peak_grey, contact.saturated_share];
    numbers.extend(estimates.flat_map(|e| [e.value, e.standard_error]));
    let excused = contact.flags(0).any(|flag| excuses_contact(&flag, 0));
    assert!(all_finite(&numbers) || excused, "{case}: {contact:?}");
}

fn modulus(case: &str, found: &ModulusEstimate) {
    // Without a number there is nothing that a broken assumption could be a caution about.
    let finite = all_finite(&[found.youngs_modulus_pa, found.standard_error_pa]);
    assert!(finite, "{case}: {found:?}");
}

/// Every stage of a frame on its own, whatever became of the one before.
fn stages(case: &str, press: &Press<'_>, frame: usize) {
    if let Ok(Some(reading)) = press.contact(frame) {
        contact(case, reading);
    }
    if let Ok(found) = press.surface(frame) {
        let mut heights = found.surface.heights.iter().zip(&found.surface.mask);
        assert!(
            heights.all(|(h, inside)| !inside || h.is_finite()),
            "{case}"
        );
    }
    if let Ok(points) = press.control_points(frame) {
        assert!(points.iter().all(|p| all_finite(p.iter())), "{case}");
    }
    if let Ok(matching) = press.matching(frame) {
        assert!(all_finite(&matching.confidence), "{case}");
        assert!(
            matching.warped.iter().all(|p| all_finite(p.iter())),
            "{case}"
        );
    }
    if let Ok(strain) = press.strain(frame) {
        let numbers = strain
            .summary
            .mean
            .iter()
            .chain(&strain.summary.standard_error);
        assert!(all_finite(numbers), "{case}: {:?}", strain.summary);
    }
}

fn measured(case: &str, m: &Measurement) {
    for (k, f) in m.frames.iter().enumerate() {
        let Ok(f) = f else { continue };
        let radius = f.contact_radius_m;
        let mut numbers = vec![radius.value, radius.standard_error, f.contact_area_m2];
        numbers.extend(
            f.force_n
                .iter()
                .flat_map(|force| [force.value, force.standard_error]),
        );
        numbers.extend(
            f.centroid_px
                .map(|c| [c.value, c.standard_error])
                .as_flattened(),
        );
        numbers.extend(f.surface_height_m.iter().map(|height| height.value));
        let excused = m.flags.iter().any(|flag| excuses_contact(flag, k));
        assert!(all_finite(&numbers) || excused, "{case}, frame {k}: {m:?}");
    }
    if let Ok(strain) = &m.strain {
        let numbers = strain
            .mean
            .iter()
            .chain(&strain.standard_error)
            .chain(&strain.spread);
        let excuses = |f: &Flag| matches!(f, Flag::Folded { .. } | Flag::Unmatched { .. });
        let sound = all_finite(numbers.flatten()) || m.flags.iter().any(excuses);
        assert!(sound, "{case}: {m:?}");
    }
    if let Ok(found) = &m.matching {
        let numbers = [
            found.mean_confidence,
            found.residual_m,
            found.mean_displacement_m,
        ];
        assert!(all_finite(&numbers), "{case}: {m:?}");
    }
    match &m.youngs_modulus_pa {
        Ok(found) => {
            let numbers = [found.value, found.standard_error, found.interval_95.0];
            assert!(all_finite(&numbers), "{case}: {m:?}");
        }
        Err(error) => assert!(!error.to_string().is_empty(), "{case}"),
    }
}

/// The modulus alone, without surfaces where it can.
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

/// A stream of the same frames, twice, in which no error may stick: a sound frame pushed after an
/// error is measured as ever.
pub(crate) fn stream(
    case: &str,
    pipeline: &Pipeline,
    reference: &Array2<u8>,
    frames: [&Array2<u8>; 2],
) {
    let Ok(mut session) = Session::new(pipeline, &[reference.view()]) else {
        return;
    };
    let finite = |s: &SessionStrain| {
        let summary = &s.strain.summary;
        all_finite(summary.mean.iter().chain(&summary.standard_error))
    };
    for frame in frames.into_iter().chain(frames) {
        let Ok(update) = session.push(frame.view()) else {
            continue;
        };
        if let Some(reading) = &update.contact {
            contact(case, reading);
        }
        match session.strain() {
            Ok(strain) => assert!(strain.is_none_or(finite), "{case}"),
            Err(error) => assert!(
                update.contact.is_some() || matches!(error, PipelineError::NoContact { .. }),
                "{case}: {error}"
            ),
        }
        if let Ok(found) = session.modulus() {
            modulus(case, &found);
        }
    }
    let drift = session.drift();
    assert!(
        all_finite(&[drift.last_grey, drift.greatest_grey]),
        "{case}: {drift:?}"
    );
}
