//! Strain in a stream: it agrees with the truth and with that of a press, and needs less work.
#![allow(clippy::print_stdout)]
use super::trial;
use nalgebra::Matrix3;
use tactile_imaging::elasticity::field::StrainSummary;
use tactile_imaging::elasticity::modulus::EstimatorKind;
use tactile_imaging::pipeline::{
    EstimatorChoice, Pipeline, PipelineError, Session, SkipReason, Stage, StagesConfig,
};
use tactile_simulate::Trial;

fn session(trial: &Trial, pipeline: &Pipeline) -> Session {
    Session::new(pipeline, &[trial.simulation.reference.view()]).unwrap()
}

/// The strains of all frames relative to the first, and the cost of the matches.
struct Followed {
    means: Vec<Matrix3<f64>>,
    iterations: usize,
    session: Session,
}

fn follow(trial: &Trial) -> Followed {
    let mut session = session(trial, &trial.pipeline().unwrap());
    let (mut means, mut iterations) = (Vec::new(), 0);
    for frame in &trial.simulation.frames {
        session.push(frame.view()).unwrap();
        if let Some(found) = session.strain().unwrap() {
            means.push(found.strain.summary.mean);
            iterations += found.report.iterations;
        }
    }
    Followed {
        means,
        iterations,
        session,
    }
}

#[test]
fn two_frames_of_a_stream_strain_as_two_of_a_press() {
    let trial = trial(&[0.7, 1.2], 4);
    let Followed { means, session, .. } = follow(&trial);
    let pipeline = trial.pipeline().unwrap();
    let press = trial.press(&pipeline).unwrap();
    assert_eq!(means, [press.strain(1).unwrap().summary.mean]);
    let runs = Stage::ALL.map(|stage| session.report().work(stage).runs);
    assert_eq!(runs, [2, 2, 2, 1, 1, 0]);
}

/// The apparent surface is scaled by (F/F₀)^⅓ about its centre, so that e_xx = e_yy = ½((F/F₀)^⅔ −
/// 1).
#[test]
fn a_streams_strain_is_that_of_the_scene() {
    let forces = [0.7, 0.8, 0.9, 1.0, 1.1, 1.2];
    let Followed { means, .. } = follow(&trial(&forces, 5));
    assert_eq!(means.len(), forces.len() - 1);
    for (mean, force) in means.iter().zip(&forces[1..]) {
        let truth = 0.5 * ((force / forces[0]).powf(2.0 / 3.0) - 1.0);
        for k in 0..2 {
            println!("{force} N: {} against {truth}", mean[(k, k)]);
            // With 200 points on so few pixels the mean strain is accurate to about 4 %.
            assert!(
                (mean[(k, k)] / truth - 1.0).abs() < 0.06,
                "{mean} against {truth}"
            );
        }
    }
}

/// A match may end in a different pairing with an equally good fit.
fn agree(expected: &StrainSummary, mean: &Matrix3<f64>) {
    let gap = (mean - expected.mean).abs();
    let allowed = 0.5 * expected.standard_error;
    let mut both = gap.iter().zip(&allowed);
    assert!(both.all(|(gap, allowed)| gap <= allowed), "{gap} {allowed}");
}

#[test]
fn matches_that_go_on_from_the_last_one_strain_as_those_made_anew() {
    let trial = trial(&[0.7, 0.8, 0.9, 1.0, 1.1, 1.2], 5);
    let on = follow(&trial);
    let pipeline = trial.pipeline().unwrap();
    let press = trial.press(&pipeline).unwrap();
    let mut anew = 0;
    for (k, mean) in on.means.iter().enumerate() {
        let expected = &press.strain(k + 1).unwrap().summary;
        anew += press.matching(k + 1).unwrap().report.iterations;
        agree(expected, mean);
    }
    assert!(
        on.iterations < anew,
        "{} iterations, {anew} without",
        on.iterations
    );
    let report = on.session.report();
    let skipped = |reason| {
        let skips = report.skips.iter().filter(|skip| skip.reason == reason);
        skips.map(|skip| skip.frames).sum::<usize>()
    };
    assert_eq!(skipped(SkipReason::NearLastAnswer), 4);
    // The surface of the first load is not computed again for the five that follow.
    assert_eq!(skipped(SkipReason::KeptFromBefore), 5);
    assert_eq!(on.session.report().work(Stage::Surface).runs, 6);
}

#[test]
fn an_estimator_that_needs_strain_gets_its_modulus_from_the_stream() {
    let trial = trial(&[0.7, 0.9, 1.2], 6);
    let config = StagesConfig {
        estimator: EstimatorChoice::PaperRatio,
        ..StagesConfig::default()
    };
    let pipeline = trial.pipeline().unwrap().with_stages(&config).unwrap();
    let press = trial.press(&pipeline).unwrap();
    let expected = press.modulus().unwrap();
    let mut session = session(&trial, &pipeline);
    // There is no strain yet.
    assert!(matches!(session.modulus(), Err(PipelineError::Modulus(_))));
    for frame in &trial.simulation.frames {
        session.push(frame.view()).unwrap();
        session.strain().unwrap();
    }
    let found = session.modulus().unwrap();
    assert_eq!(found.estimator, expected.estimator);
    // The same loads and, up to the difference between two equally good matches, the same strains.
    let ratio = found.youngs_modulus_pa / expected.youngs_modulus_pa;
    assert!((ratio - 1.0).abs() < 0.01, "{ratio}");
}

#[test]
fn strain_is_measured_once_a_frame_and_starts_anew_when_told() {
    let trial = trial(&[0.7, 1.2], 7);
    let mut session = session(&trial, &trial.pipeline().unwrap());
    let none = PipelineError::NoContact { frame: 0 };
    assert_eq!(session.strain().unwrap_err(), none);
    session.push(trial.scene.reference(9).view()).unwrap();
    assert_eq!(session.strain().unwrap_err(), none);
    let [low, high] = [0, 1].map(|k| trial.simulation.frames[k].view());
    session.push(low).unwrap();
    assert!(session.strain().unwrap().is_none() && session.strain().unwrap().is_none());
    session.push(high).unwrap();
    let to = |session: &mut Session| session.strain().unwrap().map(|s| (s.from, s.to));
    assert_eq!([to(&mut session), to(&mut session)], [Some((1, 2)); 2]);
    assert_eq!(session.report().work(Stage::Strain).runs, 1);
    session.restart_strain();
    assert_eq!(to(&mut session), None);
    session.push(low).unwrap();
    assert_eq!(to(&mut session), Some((2, 3)));
    let eased = session.strain().unwrap().unwrap().strain.summary.mean[(0, 0)];
    assert!(
        eased < 0.0,
        "the surface shrinks when the load falls: {eased}"
    );
    let loads = session.loads();
    session.push(low).unwrap();
    assert_eq!(session.loads(), loads, "an equal frame is no further load");
}

#[test]
fn an_estimator_can_be_chosen_and_a_wrong_one_says_what_it_needs() {
    let trial = trial(&[0.7, 0.9, 1.2], 8);
    let modulus = |choice| {
        let config = StagesConfig {
            estimator: choice,
            ..StagesConfig::default()
        };
        let pipeline = trial.pipeline().unwrap().with_stages(&config).unwrap();
        let press = trial.press(&pipeline).unwrap();
        let found = press.modulus().map(|m| m.estimator);
        (found, press.report().work(Stage::Surface).runs)
    };
    use EstimatorChoice::*;
    assert_eq!(modulus(Best), modulus(SphereOnWaveguide));
    // A ball needs no surface.
    assert_eq!(modulus(Sphere).1, 0);
    let laws = [
        (PaperRatio, EstimatorKind::PaperRatio, 3),
        (Regression, EstimatorKind::StressStrainRegression, 3),
        (SphereOnWaveguide, EstimatorKind::SphereOnWaveguide, 0),
    ];
    for (choice, kind, surfaces) in laws {
        assert_eq!(modulus(choice), (Ok(kind), surfaces), "{choice}");
    }
    for choice in [BondedLayer, Cone, TabulatedContact] {
        let error = modulus(choice).0.unwrap_err();
        assert!(
            matches!(error, PipelineError::WrongEstimator { .. }),
            "{error}"
        );
    }
    let error = modulus(FlatPunch).0.unwrap_err().to_string();
    assert_eq!(
        error,
        "the estimator \"flat-punch\" needs a flat punch as the object"
    );
}

/// A frame leaves no trace in the working memory of the next, except the result from which the next
/// match starts.
#[test]
fn frames_in_between_leave_no_trace() {
    let trial = trial(&[0.7, 1.2, 0.4, 1.0], 5);
    let pipeline = trial.pipeline().unwrap();
    let last = |frames: &[usize]| {
        let mut session = session(&trial, &pipeline);
        let mut found = None;
        for &frame in frames {
            session.push(trial.simulation.frames[frame].view()).unwrap();
            found = session.strain().unwrap().cloned();
        }
        found.expect("a strain").strain.summary
    };
    let (alone, after_others) = (last(&[0, 3]), last(&[0, 1, 2, 1, 3]));
    agree(&alone, &after_others.mean);
}
