//! Searches from the whole face: a lump off the axis, and what no single ball explains.

use super::guide;
use crate::forward::{Coordinate, Forward, LumpParameters, Parameters};
use crate::picture::{Cells, Place};
use crate::{InclusionEstimate, InclusionSearch, InclusionWarning};
use crate::{PressureProfile, Specimen, Verdict};
use core::ops::ControlFlow;
use tactile_fem::{Interface, Kinematics};

const APPROACHES_M: [f64; 2] = [1.5e-3, 3e-3];
/// White error over the pressure, which is not drawn: what is left of a fit is the departure alone.
const NOISE: f64 = 1e-3;

/// Cells of 1.5 mm within three quarters of the face's radius.
fn positions() -> Vec<[f64; 2]> {
    let grid = (-8..8).flat_map(|i| (-8..8).map(move |k| [i, k]));
    grid.map(|at| at.map(|index| 1.5e-3 * (f64::from(index) + 0.5)))
        .filter(|[x, y]| x.hypot(*y) < 12e-3)
        .collect()
}

fn forward(fineness: usize) -> Forward {
    let positions = positions();
    Forward {
        guide: guide(1.0),
        block_radius_m: 40e-3,
        interface: Interface::Bonded,
        approaches_m: APPROACHES_M.to_vec(),
        radii_m: positions.iter().map(|[x, y]| x.hypot(*y)).collect(),
        cells: Some(Cells {
            positions_m: positions.into(),
            plain: None,
            squeezed: APPROACHES_M.map(|approach| approach / 30e-3).to_vec(),
            reach_m: 12e-3,
        }),
        fineness,
        kinematics: Kinematics::Finite,
    }
}

fn block(centre_m: [f64; 2]) -> Parameters {
    Parameters {
        block_modulus_pa: 5e3,
        lump: Some(LumpParameters {
            diameter_m: 10e-3,
            depth_m: 4e-3,
            youngs_modulus_pa: 30e3,
            aspect: 1.0,
        }),
        place: Place {
            centre_m,
            elongation: [0.05, -0.03],
            carried: 0.75,
        },
        zero_m: 0.0,
        height_m: 30e-3,
        poisson_ratio: 0.495,
    }
}

#[test]
fn derivatives_by_the_place_are_those_of_the_pressure() {
    let parameters = block([3e-3, -2e-3]);
    let forward = forward(2).with_plain(&parameters).unwrap();
    let coordinates = [
        Coordinate::Centre(0),
        Coordinate::Centre(1),
        Coordinate::Elongation(0),
        Coordinate::Elongation(1),
        Coordinate::Carried,
        Coordinate::Diameter,
    ];
    let (_, solved) = forward.predict_near(&parameters, None).unwrap();
    let columns = forward
        .derivatives(&parameters, &coordinates, &solved)
        .unwrap();
    for (coordinate, column) in coordinates.into_iter().zip(columns) {
        // A place has no error of the elements, but kinks where the ratio ends.
        let part = if coordinate == Coordinate::Diameter {
            1e-3
        } else {
            1e-5
        };
        let step = part * coordinate.unit();
        let at = |step: f64| {
            let moved = parameters.moved(coordinate, step);
            forward
                .predict_near(&moved, Some(&solved))
                .unwrap()
                .0
                .values
        };
        let (high, low) = (at(step), at(-step));
        let largest = column.iter().fold(0.0f64, |most, d| most.max(d.abs()));
        for ((high, low), derivative) in high.iter().zip(&low).zip(&column) {
            let difference = (high - low) / (2.0 * step);
            // Forward differences of 1e-5 err by as much, central ones by their step's square.
            let error = (difference - derivative).abs() / largest;
            assert!(error < 1e-2, "{coordinate:?}: {difference} {derivative}");
        }
    }
}

#[test]
fn under_the_axis_the_picture_is_the_axial_pressure() {
    let mut parameters = block([0.0; 2]);
    parameters.place = Place::default();
    let picture = forward(2).with_plain(&parameters).unwrap();
    let axial = Forward {
        cells: None,
        ..picture.clone()
    };
    let both = [&picture, &axial].map(|forward| forward.predict(&parameters).unwrap().values);
    for (a, b) in both[0].iter().zip(&both[1]) {
        assert!((a - b).abs() < 1e-12 * b.abs());
    }
}

/// What is found from these pressures of all frames.
fn searched(values: &[f64]) -> InclusionEstimate {
    let positions = positions();
    let frames = values.chunks(positions.len()).zip(APPROACHES_M);
    let frames: Vec<PressureProfile> = frames
        .map(|(pressures, approach_m)| PressureProfile {
            approach_m,
            force_n: None,
            pressure_pa: pressures.to_vec(),
            standard_error_pa: pressures.iter().map(|p| NOISE * p).collect(),
        })
        .collect();
    let specimen = Specimen::new(30e-3, 40e-3).unwrap();
    let search =
        InclusionSearch::new(specimen.with_interface(Interface::Bonded), guide(1.0)).unwrap();
    let progress = &mut |_| ControlFlow::Continue(());
    search
        .search_picture(&positions, &frames, progress)
        .unwrap()
}

#[test]
fn a_ball_off_the_axis_is_found_where_it_is_and_two_are_not_taken_for_one() {
    let mut parameters = block([5e-3, -2e-3]);
    parameters.place.elongation = [0.0; 2];
    let forward = forward(5).with_plain(&parameters).unwrap();
    let one = forward.predict(&parameters).unwrap().values;
    let count = 2 * positions().len();
    let found = searched(&one[..count]);
    let inclusion = found.inclusion.expect("a ball alone is explained");
    let [x, y] = inclusion.position_m.unwrap();
    // The search's mesh differs by 0.1 % of the pressure, which rises by 10 % a millimetre.
    assert!((x.value - 5e-3).abs() < 0.1e-3 && (y.value + 2e-3).abs() < 0.1e-3);
    for (told, truth) in [
        (inclusion.diameter_m, 10e-3),
        (inclusion.depth_m, 4e-3),
        (inclusion.youngs_modulus_pa, 30e3),
    ] {
        let [low, high] = told.estimate().interval;
        assert!((low..high).contains(&truth), "{told:?}");
    }

    // A second one on the other side, each lifting the pressure as if alone.
    parameters.place.centre_m = [-5e-3, 2e-3];
    let other = forward.predict(&parameters).unwrap().values;
    parameters.lump = None;
    let plain = forward.predict(&parameters).unwrap().values;
    let both: Vec<f64> = (one.iter().zip(&other).zip(&plain))
        .map(|((a, b), p)| a * b / p)
        .collect();
    let found = searched(&both[..count]);
    let is_poor = |warning: &InclusionWarning| matches!(warning, InclusionWarning::PoorFit { .. });
    assert!(
        found.inclusion.is_none() && found.warnings.iter().any(is_poor),
        "{found:?}"
    );
    assert_ne!(found.verdict(), Verdict::Absent);

    // A plain block under a tilted face.
    let tilted = plain[..count].iter().enumerate().map(|(k, pressure)| {
        let (frame, cell) = (k / positions().len(), k % positions().len());
        let slope = 2.0 * 0.02 / APPROACHES_M[frame];
        pressure * (1.0 + slope * positions()[cell][0])
    });
    let tilted: Vec<f64> = tilted.collect();
    assert_eq!(searched(&tilted).verdict(), Verdict::Absent);
}
