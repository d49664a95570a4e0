//! The forward model and its derivatives, and the input that a search rejects.

use crate::forward::Forward;
use crate::parameters::{Coordinate, LARGEST_POISSON_RATIO, LumpParameters, Parameters, Place};
use crate::picture::{CellPositions, Cells};
use crate::{
    AssumedInclusion, Identifiable, InclusionEstimate, InclusionSearch, InclusionWarning,
    PressureProfile, SearchVerdict, TissueBlock,
};
use core::ops::ControlFlow;
use std::sync::Arc;
use tactile_elasticity::ElasticityError;
use tactile_fem::{Guide, GuideLayer, Interface, Kinematics, Material};

mod against_calculix;
mod departures;
mod fits;
mod marginal;
mod pictures;

fn guide() -> Guide {
    let layer = |thickness_m, modulus: f64| GuideLayer {
        thickness_m,
        material: Material::new(modulus, 0.495).unwrap(),
    };
    Guide::new(vec![layer(4e-3, 120e3), layer(6e-3, 40e3)], 16e-3).unwrap()
}

fn specimen() -> TissueBlock {
    TissueBlock::new(30e-3, 40e-3).unwrap()
}

/// A search of a block bonded to the face.
fn search() -> InclusionSearch {
    InclusionSearch::new(specimen().with_interface(Interface::Bonded), guide()).unwrap()
}

fn forward(fineness: usize) -> Forward {
    Forward {
        guide: guide(),
        block_radius_m: 40e-3,
        interface: Interface::Bonded,
        approaches_m: vec![1.2e-3, 2.4e-3],
        radii_m: (0..16).map(|k| (f64::from(k) + 0.5) * 0.75e-3).collect(),
        cells: None,
        fineness,
        kinematics: Kinematics::Finite,
    }
}

/// Cells of one press.
fn cells(positions_m: Vec<[f64; 2]>, approaches_m: &[f64]) -> Cells {
    Cells {
        positions: Arc::new(CellPositions {
            presses: vec![0; positions_m.len()],
            axes_m: vec![[0.0; 2]],
            positions_m,
        }),
        plain: None,
        squeezed: approaches_m.iter().map(|a| a / 30e-3).collect(),
        face_radius_m: 16e-3,
        reach_m: 12e-3,
    }
}

fn block() -> Parameters {
    Parameters {
        block_modulus_pa: 5e3,
        lump: Some(lump(12e-3, 4e-3, 30e3)),
        place: Place::default(),
        second: None,
        strayed_m: vec![],
        pressed: vec![],
        zero_m: 0.0,
        height_m: 30e-3,
        poisson_ratio: 0.49,
    }
}

fn lump(diameter_m: f64, depth_m: f64, youngs_modulus_pa: f64) -> LumpParameters {
    LumpParameters::ball(diameter_m, depth_m, youngs_modulus_pa)
}

fn is_poor(estimate: &InclusionEstimate) -> bool {
    let poor = |warning: &InclusionWarning| matches!(warning, InclusionWarning::PoorFit { .. });
    estimate.warnings.iter().any(poor)
}

/// Largest difference relative to the largest value.
fn distance(a: &[f64], b: &[f64]) -> f64 {
    let largest = b.iter().fold(0.0f64, |m, x| m.max(x.abs()));
    let differences = a.iter().zip(b).map(|(a, b)| (a - b).abs());
    differences.fold(0.0, f64::max) / largest
}

const COORDINATES: [Coordinate; 8] = [
    Coordinate::BlockModulus,
    Coordinate::LumpModulus,
    Coordinate::Zero,
    Coordinate::PoissonRatio,
    Coordinate::Diameter,
    Coordinate::Depth,
    Coordinate::Aspect,
    Coordinate::Height,
];

/// Deviations of the derivatives from difference quotients of solutions on the same moved mesh.
fn derivative_errors(model: &Forward, here: &Parameters) -> Vec<(Coordinate, f64)> {
    let (_, solved) = model.predict_near(here, None).unwrap();
    let columns = model.derivatives(here, &COORDINATES, &solved).unwrap();
    let error = |column: &[f64], coordinate| {
        // The truncation error of a central quotient is of second order in the step. The tolerance
        // of the solutions is a hundred times below the difference.
        let step = 200.0 * here.small_step(coordinate).abs();
        let at = |by| {
            let moved = here.moved(coordinate, by);
            model.predict_near(&moved, Some(&solved)).unwrap().0
        };
        let (low, high) = (at(-step), at(step));
        let quotient: Vec<f64> = (low.iter().zip(&high))
            .map(|(low, high)| (high - low) / (2.0 * step))
            .collect();
        distance(column, &quotient)
    };
    (columns.iter().zip(COORDINATES))
        .map(|(column, coordinate)| (coordinate, error(column, coordinate)))
        .collect()
}

#[test]
fn derivatives_are_those_of_solutions_at_changed_parameters() {
    // Near the limit of ν the bulk modulus is 160 times Young's modulus, and the second-order error
    // of a difference quotient grows with it.
    for (poisson_ratio, tolerance) in [(0.45, 2e-4), (0.495, 1e-3), (0.498, 2e-3)] {
        let here = Parameters {
            poisson_ratio,
            ..block()
        };
        for (coordinate, error) in derivative_errors(&forward(2), &here) {
            assert!(
                error < tolerance,
                "ν {poisson_ratio}, {coordinate:?}: {error}"
            );
        }
    }
}

#[test]
fn derivatives_without_friction_know_how_the_face_slides() {
    let model = Forward {
        interface: Interface::Frictionless,
        ..forward(2)
    };
    for (coordinate, error) in derivative_errors(&model, &block()) {
        // The faces of the solutions meet within 2e-6 of the radius, which appears as one per cent
        // in a quotient by ν, whose step is the smallest. Without the sliding, the derivative by ν
        // would change by 8 %.
        let tolerance = match coordinate {
            Coordinate::PoissonRatio => 0.02,
            _ => 0.004,
        };
        assert!(error < tolerance, "{coordinate:?}: {error}");
    }
}

/// On a coarse mesh under a deep press the nodes of the rim cannot meet.
#[test]
fn a_sliding_face_settles_alike_from_any_start() {
    let model = Forward {
        interface: Interface::Frictionless,
        approaches_m: vec![1.2e-3, 2.4e-3, 3.6e-3],
        ..forward(3)
    };
    let here = Parameters {
        lump: Some(lump(16.3e-3, 2.5e-3, 80e3)),
        block_modulus_pa: 3.6e3,
        height_m: 27e-3,
        ..block()
    };
    let (_, solved) = model.predict_near(&here, None).unwrap();
    let again = |by: f64| {
        let there = here.moved(Coordinate::LumpModulus, by);
        let (_, there) = model.predict_near(&there, Some(&solved)).unwrap();
        model.predict_near(&here, Some(&there)).unwrap().0
    };
    // The tolerance of the faces is 2e-6 of the radius. If rounds end early, it is 2.5e-5.
    let off = distance(&again(0.3)[..48], &again(-0.3)[..48]);
    assert!(off < 4e-6, "{off}");
}

#[test]
fn a_moved_mesh_is_as_good_as_a_new_one() {
    let model = forward(3);
    let here = block();
    let (_, solved) = model.predict_near(&here, None).unwrap();
    for coordinate in [
        Coordinate::Diameter,
        Coordinate::Depth,
        Coordinate::Aspect,
        Coordinate::Height,
    ] {
        for by in [-0.2, 0.2] {
            let there = here.moved(coordinate, by);
            let moved = model.predict_near(&there, Some(&solved)).unwrap().0;
            let new = model.predict(&there).unwrap();
            // The roughness included in the errors of first fits.
            let off = distance(&moved[..32], &new[..32]);
            assert!(off < 8e-3, "{coordinate:?} by {by}: {off}");
            assert!(moved != new, "{coordinate:?}: the mesh was built anew");
        }
    }
}

#[test]
fn the_answers_mesh_is_fine_enough() {
    let answers = forward(5).predict(&block()).unwrap();
    let finer = forward(8).predict(&block()).unwrap();
    // The model error included in the fit: 0.2 % of scale, 0.07 % of shape.
    assert!(distance(&answers[..32], &finer[..32]) < 2e-3);
    // Half of the force error, from the singular traction at the rim.
    assert!(distance(&answers[32..], &finer[32..]) < 3e-3);
}

#[test]
fn a_block_said_to_be_incompressible_is_fitted_at_the_limit() {
    // A prior above the limit would oppose every step if it were narrow compared with its distance
    // from the limit.
    let specimen = specimen().with_poisson_ratio(0.4999, 1e-4).unwrap();
    let search = InclusionSearch::new(specimen, guide()).unwrap();
    let start = search.known_block(5e3);
    assert_eq!(start.poisson_ratio, LARGEST_POISSON_RATIO);
    for prior in search.block_priors(5e3) {
        if prior.coordinate == Coordinate::PoissonRatio {
            assert_eq!(prior.mean, LARGEST_POISSON_RATIO);
        }
    }
}

fn frame(approach_m: f64) -> PressureProfile {
    PressureProfile {
        approach_m,
        force_n: Some(0.5),
        pressure_pa: vec![300.0; 16],
        standard_error_pa: vec![0.5; 16],
    }
}

#[test]
fn frames_that_cannot_be_searched_are_refused() {
    let radii = forward(2).radii_m;
    let refused = |frames: &[PressureProfile]| search().search(&radii, frames).unwrap_err();
    assert!(matches!(refused(&[]), ElasticityError::TooFewLoads { .. }));
    let backwards = refused(&[frame(2e-3), frame(1e-3)]);
    assert!(matches!(backwards, ElasticityError::OutOfRange { .. }));
    let nowhere = refused(&[frame(f64::NAN)]);
    assert!(matches!(nowhere, ElasticityError::NotPositive { .. }));
    let mut dark = frame(1e-3);
    dark.pressure_pa[3] = f64::NAN;
    let dark = refused(&[dark]);
    assert!(matches!(dark, ElasticityError::NotFinite { .. }));
    let mut short = frame(1e-3);
    short.pressure_pa.pop();
    let short = refused(&[short]);
    assert!(matches!(short, ElasticityError::LengthMismatch { .. }));
    let narrow: Vec<f64> = (1..=16).map(|k| f64::from(k) * 1.6e-3).collect();
    let few = search().search(&narrow, &[frame(1e-3)]).unwrap_err();
    // Seven of the rings lie within three quarters of 16 mm.
    assert_eq!(few.to_string(), "samples: expected 8 entries, found 7");
}

#[test]
fn a_search_ends_when_told_to() {
    let radii = forward(2).radii_m;
    let mut heard = 0;
    let ended = search().search_with_progress(&radii, &[frame(1e-3)], &mut |_| {
        heard += 1;
        ControlFlow::Break(())
    });
    assert_eq!((ended, heard), (Err(ElasticityError::Cancelled), 1));
}

#[test]
fn more_frames_tell_more_of_an_inclusion() {
    let radii = forward(2).radii_m;
    let assumed = AssumedInclusion {
        diameter_m: 12e-3,
        depth_m: 4e-3,
        youngs_modulus_pa: 30e3,
        block_modulus_pa: 5e3,
    };
    let expected =
        |approaches: &[f64]| search().expected_errors(&assumed, approaches, &radii, &[0.5; 16]);
    let one = expected(&[2.4e-3]).unwrap();
    let two = expected(&[1.2e-3, 2.4e-3]).unwrap();
    assert!(two.diameter < one.diameter && two.youngs_modulus < one.youngs_modulus);
    let none = expected(&[]);
    assert!(matches!(none, Err(ElasticityError::TooFewLoads { .. })));
}

#[test]
fn what_is_not_known_within_a_quarter_both_ways_is_not_told() {
    let within = |down, up| crate::Estimated::within(2f64.ln(), [2f64.ln() - down, 2f64.ln() + up]);
    let estimated = |error: f64| within(1.96 * error, 1.96 * error);
    // The last interval is equally wide, but only upwards.
    for (estimated, is_reliable, is_told) in [
        (estimated(0.1), true, true),
        (estimated(0.1), false, false),
        (estimated(0.26), true, false),
        (within(0.1, 0.6), true, false),
    ] {
        let told = Identifiable::new(estimated, is_reliable);
        assert_eq!(told.value().is_some(), is_told, "{told:?}");
    }
    let [low, high] = estimated(0.1).interval;
    assert!(
        (low * high - 4.0).abs() < 1e-12,
        "symmetric in the logarithm"
    );
}

#[test]
fn that_there_is_none_is_certain_only_where_the_model_explains_the_frames() {
    let known = crate::Estimated::within(5e3f64.ln(), [5e3f64.ln() - 0.1, 5e3f64.ln() + 0.1]);
    let estimate = |probability: f64, warnings: &[InclusionWarning]| InclusionEstimate {
        probability,
        found: false,
        block_modulus_pa: known,
        inclusion: None,
        second: None,
        interface: Interface::Bonded,
        misfit: 1.0,
        warnings: warnings.to_vec(),
        radii_m: vec![],
        fitted_pa: vec![],
        homogeneous_pa: vec![],
    };
    assert_eq!(estimate(1e-3, &[]).verdict(), SearchVerdict::Absent);
    assert_eq!(estimate(0.7, &[]).verdict(), SearchVerdict::Uncertain);
    let poor = InclusionWarning::PoorFit { excess: 9.0 };
    assert_eq!(estimate(1e-3, &[poor]).verdict(), SearchVerdict::Uncertain);
}
