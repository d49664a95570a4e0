//! Results of frames that are repeated, cut by the border, or do not belong to their reference.
use super::trial;
use crate::common::press_of;
use ndarray::{Array2, Axis, s};
use tactile_imaging::elasticity::modulus::{ModulusEstimator, PaperRatio};
use tactile_imaging::force::CalibrationPair;
use tactile_imaging::pipeline::{Flag, Object, Pipeline, PipelineError, Session};

#[test]
fn a_frame_that_is_given_twice_counts_once() {
    let trial = trial(&[0.7, 1.2], 6);
    let pipeline = trial.pipeline().unwrap();
    let once = trial.press(&pipeline).unwrap().modulus().unwrap();
    let again = trial.simulation.frames.iter().cycle().take(102).cloned();
    let press = press_of(&pipeline, trial.simulation.reference.view(), again);
    let often = press.modulus().unwrap();
    assert_eq!(often.youngs_modulus_pa, once.youngs_modulus_pa);
    assert_eq!(often.standard_error_pa, once.standard_error_pa);
    assert_eq!(often.loads.len(), 102);
    assert_eq!(often.loads.iter().filter(|load| load.used).count(), 2);
    // The estimators that use strain also count it once.
    let series = press.load_series().unwrap();
    let loads = series.loads().iter();
    assert_eq!(loads.filter(|load| load.mean_strain.is_some()).count(), 1);
    let ratio = PaperRatio::default().estimate(&series).unwrap();
    assert_eq!(ratio.fit.observations, 1);
    // A session also counts it once.
    let mut session = Session::new(&pipeline, &[trial.simulation.reference.view()]).unwrap();
    for frame in trial.simulation.frames.iter().cycle().take(7) {
        session.push(frame.view()).unwrap();
    }
    assert_eq!(session.loads(), 2);
    let streamed = session.modulus().unwrap();
    assert_eq!(streamed.loads.len(), 2);
}

#[test]
fn a_swapped_reference_is_told_from_a_frame_without_contact() {
    let trial = trial(&[0.7, 1.2], 6);
    let pipeline = trial.pipeline().unwrap();
    let [pressed, reference] = [&trial.simulation.frames[1], &trial.simulation.reference];
    let press = press_of(&pipeline, pressed.view(), [reference.clone()]);
    let error = press.modulus().unwrap_err();
    assert!(
        matches!(error, PipelineError::OppositeSignal { frame: 0, grey } if grey < -20.0),
        "{error}"
    );
    assert!(error.to_string().contains("were the two swapped"));
}

#[test]
fn darker_frames_are_flagged() {
    let trial = trial(&[0.7, 1.2], 6);
    let pipeline = trial.pipeline().unwrap();
    let drift = |step: u8| {
        let darker = |frame: &Array2<u8>| frame.mapv(|v| v.saturating_sub(step));
        let darker = trial.simulation.frames.iter().map(darker);
        let press = press_of(&pipeline, trial.simulation.reference.view(), darker);
        let measurement = press.measure();
        let found = measurement.flags.iter().find_map(|flag| match flag {
            Flag::LightDrifted { grey } => Some(*grey),
            _ => None,
        });
        (found, measurement.to_string())
    };
    let (none, text) = drift(0);
    assert_eq!(none, None, "{text}");
    let (found, text) = drift(3);
    // Within the noise of the median.
    assert!(found.is_some_and(|grey| (grey + 3.0).abs() < 0.1), "{text}");
}

/// One of two contacts is cut by the border: its force and radius are wrong, and the modulus is
/// that of the other.
#[test]
fn a_contact_that_the_border_cuts_is_left_out() {
    let trial = trial(&[0.7, 1.2], 6);
    let pipeline = trial.pipeline().unwrap();
    // The centre of the contacts is (174, 130), and their radii are about 38 and 45 pixels.
    let cut = |left: usize, frames: &[usize]| {
        let cut = |image: &Array2<u8>| image.slice(s![.., left..]).to_owned();
        let reference = cut(&trial.simulation.reference);
        let frames = frames.iter().map(|&k| cut(&trial.simulation.frames[k]));
        press_of(&pipeline, reference.view(), frames)
    };
    let measurement = cut(130, &[0, 1]).measure();
    let edge = Flag::TouchesEdge { frame: 1 };
    assert!(measurement.flags.contains(&edge), "{measurement}");
    let alone = cut(130, &[0]).modulus().unwrap();
    let modulus = measurement.youngs_modulus_pa.unwrap();
    // The loads of a series have new weights: rounding.
    let relative = modulus.value / alone.youngs_modulus_pa - 1.0;
    assert!(relative.abs() < 1e-12, "{relative:e}");
    // If every contact is cut, there is no modulus.
    let measurement = cut(150, &[1]).measure();
    assert!(measurement.flags.contains(&Flag::TouchesEdge { frame: 0 }));
    let modulus = measurement.youngs_modulus_pa;
    assert_eq!(modulus.unwrap_err(), PipelineError::NoWholeContact);
}

/// Pixels a fifth wider than stated: the contact appears longer than wide. The modulus is wrong by
/// 30 %, and its interval is wider by the same amount.
#[test]
fn a_caution_about_the_shape_widens_the_interval() {
    let trial = trial(&[0.7, 1.2], 6);
    let pipeline = trial.pipeline().unwrap();
    let narrow = |image: &Array2<u8>| {
        let kept: Vec<usize> = (0..image.ncols()).filter(|c| c % 6 != 5).collect();
        image.select(Axis(1), &kept)
    };
    let reference = narrow(&trial.simulation.reference);
    let frames = trial.simulation.frames.iter().map(narrow);
    let measurement = press_of(&pipeline, reference.view(), frames).measure();
    let elongated = |flag: &Flag| match flag {
        Flag::NotRound { elongation, .. } => (elongation - 0.2).abs() < 0.02,
        _ => false,
    };
    assert!(measurement.flags.iter().any(elongated), "{measurement}");
    let modulus = measurement.youngs_modulus_pa.unwrap();
    let (low, high) = modulus.interval_95;
    assert!(modulus.value > 1.2 * 103e3, "{modulus:?}");
    let holds = low < 103e3 && high.is_none_or(|high| high > modulus.value);
    assert!(holds, "{modulus:?}");
}

/// A punch touches with its whole face. The contact of a ball, stated to be that of a wider punch,
/// has a caution, and its radius and stress are undetermined.
#[test]
fn a_contact_that_is_not_the_punchs_has_no_sure_stress() {
    let trial = trial(&[0.7], 6);
    let punch = |radius_m| {
        let poisson_ratio = 0.5;
        let pipeline = trial.pipeline().unwrap().with_settings(|settings| {
            settings.object = Object::FlatPunch {
                radius_m,
                poisson_ratio,
            };
        });
        let press = trial.press(&pipeline.unwrap()).unwrap();
        let flags = press.cautions(0).unwrap();
        let said = |flag: &Flag| matches!(flag, Flag::NotThePunch { .. });
        let said = flags.iter().any(said);
        let radius = press.contact(0).unwrap().unwrap().contact_radius_m;
        (said, radius.relative_error(), radius.value)
    };
    let (said, relative, radius_m) = punch(9e-3);
    // ln(9 mm / 2.7 mm)
    assert!(said && relative > 1.0, "{relative}");
    let (said, relative, _) = punch(radius_m);
    assert!(!said && relative < 0.05, "{relative}");
}

#[test]
fn a_black_frame_is_left_out_and_named() {
    let trial = trial(&[0.7, 1.2], 6);
    let pipeline = trial.pipeline().unwrap();
    let (reference, frames) = (&trial.simulation.reference, &trial.simulation.frames);
    let run = |with_black: bool| {
        let mut session = Session::new(&pipeline, &[reference.view()]).unwrap();
        session.push(frames[0].view()).unwrap();
        if with_black {
            let black = Array2::zeros(reference.dim());
            assert!(session.push(black.view()).unwrap().contact.is_none());
            assert_eq!(session.cautions(), [Flag::BlackFrame { frame: 1 }]);
            assert_eq!(session.drift().caution, None, "dropped, not drifted");
        }
        session.push(frames[1].view()).unwrap();
        session.modulus().unwrap()
    };
    assert_eq!(run(true), run(false));
    // Lamps that lose a third are a drift.
    let mut session = Session::new(&pipeline, &[reference.view()]).unwrap();
    session
        .push(reference.mapv(|grey| grey - grey / 3).view())
        .unwrap();
    assert!(matches!(
        session.drift().caution,
        Some(Flag::LightDrifted { .. })
    ));
}

/// Rising forces alone do not calibrate the way back: its force has an error that says so.
#[test]
fn the_way_back_has_the_hysteresis_that_the_calibration_does_not_show() {
    let trial = trial(&[0.7, 1.2], 6);
    let (reference, frames) = (&trial.simulation.reference, &trial.simulation.frames);
    let largest = (trial.pairs.iter())
        .max_by(|a, b| a.force_n.total_cmp(&b.force_n))
        .unwrap();
    let at = trial.pairs.iter().position(|pair| pair == largest).unwrap();
    let size = trial.simulation.pixel_size_m;
    let cautions = |pairs: &[CalibrationPair], order: [usize; 2], count: usize| {
        let pipeline = Pipeline::from_pairs(pairs, size, Object::sphere(3e-3)).unwrap();
        let mut session = Session::new(&pipeline, &[reference.view()]).unwrap();
        let mut errors = Vec::new();
        for k in order {
            let contact = session.push(frames[k].view()).unwrap().contact.unwrap();
            errors.push(contact.force_n.unwrap().relative_error());
        }
        let press = press_of(
            &pipeline,
            reference.view(),
            order.map(|k| frames[k].clone()),
        );
        for (k, error) in errors.iter().enumerate() {
            let reading = press.contact(k).unwrap().unwrap();
            assert_eq!(reading.force_n.unwrap().relative_error(), *error);
        }
        let flag = Flag::UnknownHysteresis { frame: 1 };
        assert_eq!(session.cautions().contains(&flag), count == 1);
        assert_eq!(press.cautions(1).unwrap().contains(&flag), count == 1);
        errors
    };
    let (rising, both) = (&trial.pairs[..=at], &trial.pairs[..]);
    let there = cautions(rising, [0, 1], 0);
    let back = cautions(rising, [1, 0], 1);
    cautions(both, [1, 0], 0);
    assert_eq!(
        back[0], there[1],
        "the largest force is where the branches meet"
    );
    // Five per cent to either side, evenly distributed.
    assert!((back[1].powi(2) - there[0].powi(2)).sqrt() > 0.05 / 3_f64.sqrt() - 1e-3);
}
