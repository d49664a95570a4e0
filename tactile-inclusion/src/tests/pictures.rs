//! Searches from the whole face: an off-axis lump, and pictures that no single ball explains.

use super::{cells, is_poor, lump, search};
use crate::forward::Forward;
use crate::parameters::{Coordinate, LumpParameters, Parameters, Place};
use crate::{
    Estimated, Inclusion, InclusionEstimate, InclusionWarning, PressureProfile, Progress, Scan,
    ScanPress, SearchVerdict,
};
use core::ops::ControlFlow;
use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};
use rand_distr::StandardNormal;
use std::sync::Arc;

const APPROACHES_M: [f64; 2] = [1.5e-3, 3e-3];
/// White error relative to the pressure. No noise is drawn, so the residuals of a fit come only
/// from the violated assumption.
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
        approaches_m: APPROACHES_M.to_vec(),
        radii_m: positions.iter().map(|[x, y]| x.hypot(*y)).collect(),
        cells: Some(cells(positions, &APPROACHES_M)),
        ..super::forward(fineness)
    }
}

fn block(centre_m: [f64; 2]) -> Parameters {
    Parameters {
        lump: Some(lump(10e-3, 4e-3, 30e3)),
        place: Place {
            centre_m,
            elongation: [0.05, -0.03],
            carried: 0.6,
            spread: 0.2,
        },
        poisson_ratio: 0.495,
        ..super::block()
    }
}

/// A block with a ball, or a plain one.
fn with_ball(centre_m: [f64; 2], ball: impl Into<Option<LumpParameters>>) -> Parameters {
    let mut parameters = block(centre_m);
    parameters.place.elongation = [0.0; 2];
    parameters.lump = ball.into();
    parameters
}

#[test]
fn derivatives_by_the_place_are_those_of_the_pressure() {
    let mut parameters = block([3e-3, -2e-3]);
    let other = block([-6e-3, 1e-3]);
    parameters.second = other.lump.map(|lump| (lump, other.place));
    let forward = forward(2).with_plain(&parameters).unwrap();
    let mut coordinates = vec![
        Coordinate::Centre(0),
        Coordinate::Centre(1),
        Coordinate::Elongation(0),
        Coordinate::Elongation(1),
        Coordinate::Carried,
        Coordinate::Spread,
        Coordinate::Depth,
        Coordinate::Diameter,
    ];
    let of_second: Vec<Coordinate> = coordinates.iter().filter_map(|c| c.of_second()).collect();
    assert_eq!(of_second.len(), coordinates.len());
    coordinates.extend(of_second);
    coordinates.push(Coordinate::Height);
    let (_, solved) = forward.predict_near(&parameters, None).unwrap();
    let columns = forward
        .derivatives(&parameters, &coordinates, &solved)
        .unwrap();
    for (coordinate, column) in coordinates.into_iter().zip(columns) {
        // A position has no element error, but there are kinks where the ratio ends.
        let part = match coordinate {
            Coordinate::Diameter
            | Coordinate::Depth
            | Coordinate::OfSecond(Coordinate::Diameter | Coordinate::Depth)
            | Coordinate::Height => 1e-3,
            _ => 1e-5,
        };
        let step = part * coordinate.unit();
        let at = |step: f64| {
            let moved = parameters.moved(coordinate, step);
            let near = forward.predict_near(&moved, Some(&solved));
            near.unwrap().0
        };
        let (high, low) = (at(step), at(-step));
        let largest = column.iter().fold(0.0f64, |most, d| most.max(d.abs()));
        for ((high, low), derivative) in high.iter().zip(&low).zip(&column) {
            let difference = (high - low) / (2.0 * step);
            // Forward differences have an error of 1e-5, and central ones an error of second order
            // in their step.
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
    let both = [&picture, &axial].map(|forward| forward.predict(&parameters).unwrap());
    for (a, b) in both[0].iter().zip(&both[1]) {
        assert!((a - b).abs() < 1e-12 * b.abs());
    }
}

/// Frames with these pressures, frame by frame.
fn frames(values: &[f64]) -> Vec<PressureProfile> {
    let frames = values.chunks(positions().len()).zip(APPROACHES_M);
    frames
        .map(|(pressures, approach_m)| PressureProfile {
            approach_m,
            force_n: None,
            pressure_pa: pressures.to_vec(),
            standard_error_pa: pressures.iter().map(|p| NOISE * p).collect(),
        })
        .collect()
}

fn go_on(_: Progress) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

/// Result of a search with these pressures of all frames.
fn searched(values: &[f64]) -> InclusionEstimate {
    let press = ScanPress {
        axis_m: [0.0; 2],
        positions_m: positions(),
        frames: frames(values),
    };
    let scan = Scan {
        presses: vec![press],
        position_error_m: 0.0,
    };
    search().search_scan(&scan, &mut go_on).unwrap()
}

/// Result of a search of a block.
fn found_in(parameters: &Parameters) -> InclusionEstimate {
    let forward = forward(5).with_plain(parameters).unwrap();
    searched(&forward.predict(parameters).unwrap()[..2 * positions().len()])
}

/// Draws errors of a standard deviation.
fn errors(seed: u64) -> impl FnMut(f64) -> f64 {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    move |error| error * rng.sample::<f64, _>(StandardNormal)
}

/// A press of a block. The position and the first touch deviate from the stated values, and the
/// pressures are noisy.
fn press(
    parameters: &Parameters,
    axis_m: [f64; 2],
    position_error_m: f64,
    normal: &mut impl FnMut(f64) -> f64,
) -> ScanPress {
    let parameters = Parameters {
        zero_m: normal(20e-6),
        ..parameters.clone()
    };
    let mut forward = forward(5);
    if let Some(cells) = &mut forward.cells {
        let axis = axis_m.map(|x| x + normal(position_error_m));
        Arc::make_mut(&mut cells.positions).axes_m = vec![axis];
    }
    let forward = forward.with_plain(&parameters).unwrap();
    let mut values = forward.predict(&parameters).unwrap();
    for value in &mut values {
        *value *= 1.0 + normal(NOISE);
    }
    ScanPress {
        axis_m,
        positions_m: positions(),
        frames: frames(&values[..2 * positions().len()]),
    }
}

/// A scan of a block with an inclusion, the first two presses above it and the third far from it.
fn scan(parameters: &Parameters, position_error_m: f64, seed: u64) -> Scan {
    let mut normal = errors(seed);
    let said = [[14e-3, 6e-3], [3e-3, 2e-3], [-30e-3, 0.0]];
    Scan {
        presses: (said.iter())
            .map(|axis_m| press(parameters, *axis_m, position_error_m, &mut normal))
            .collect(),
        position_error_m,
    }
}

const POSITION_ERROR_M: f64 = 0.2e-3;

/// Estimates of the block's inclusion with their true values, those of the position last.
fn told(inclusion: &Inclusion, [true_x, true_y]: [f64; 2]) -> [(Estimated, f64); 5] {
    let [x, y] = inclusion.position_m.unwrap();
    [
        (*inclusion.diameter_m.estimate(), 10e-3),
        (*inclusion.depth_m.estimate(), 4e-3),
        (*inclusion.youngs_modulus_pa.estimate(), 30e3),
        (x, true_x),
        (y, true_y),
    ]
}

fn holds(told: &Estimated, truth: f64) -> bool {
    (told.interval[0]..told.interval[1]).contains(&truth)
}

#[test]
fn a_scan_finds_an_inclusion_between_its_presses() {
    let parameters = with_ball([9e-3, 5e-3], lump(10e-3, 4e-3, 30e3));
    let (mut missed, mut squares) = (0, 0.0);
    // The last scan is by hand.
    for (seed, error_m) in [(1, POSITION_ERROR_M), (2, POSITION_ERROR_M), (3, 2e-3)] {
        let found = search()
            .search_scan(&scan(&parameters, error_m, seed), &mut go_on)
            .unwrap();
        assert!(found.warnings.is_empty(), "{:?}", found.warnings);
        let inclusion = found.inclusion.expect("one inclusion explains all presses");
        let told = told(&inclusion, [9e-3, 5e-3]);
        missed += told
            .iter()
            .filter(|(told, truth)| !holds(told, *truth))
            .count();
        for (told, truth) in &told[3..] {
            squares += ((told.value - truth) / told.standard_error).powi(2);
            // The mean of two presses, and up to a tenth of a millimetre by the model.
            let error = told.standard_error / (error_m / 2f64.sqrt());
            assert!((error - 1.0).abs() < 0.2, "{told:?}");
        }
    }
    // Of 15 intervals of 95 %, three or more miss in 4 of 100 draws, and χ² with six degrees of
    // freedom exceeds 16.8 in one of 100.
    assert!(missed < 3 && squares < 16.8, "{missed} {squares}");

    // The press far from the inclusion alone shows nothing.
    let whole = scan(&parameters, POSITION_ERROR_M, 1);
    let with = |presses: &[ScanPress], position_error_m| Scan {
        presses: presses.to_vec(),
        position_error_m,
    };
    let alone = search().search_scan(&with(&whole.presses[2..], 0.2e-3), &mut go_on);
    assert_eq!(alone.unwrap().verdict(), SearchVerdict::Absent);

    // Different approaches, and a position that is not a number, are rejected.
    let refused = |scan: &Scan| assert!(search().search_scan(scan, &mut go_on).is_err());
    let mut other = whole.clone();
    other.presses[1].frames[0].approach_m = 1.4e-3;
    refused(&other);
    let mut nowhere = whole.clone();
    nowhere.presses[0].axis_m[1] = f64::NAN;
    refused(&nowhere);
    refused(&with(&whole.presses, f64::NAN));
    refused(&with(&[], 0.0));
}

/// Asserts that this is the block's inclusion, at this position.
fn assert_found(inclusion: &Inclusion, place_m: [f64; 2]) {
    let told = told(inclusion, place_m);
    let [x, y] = [3, 4].map(|k| told[k].0.value - told[k].1);
    // Between two lumps the pressures of both rise.
    assert!(x.hypot(y) < 0.3e-3, "{x} {y}");
    for (told, truth) in told {
        assert!(holds(&told, truth), "{told:?}");
    }
}

#[test]
fn two_balls_off_the_axis_are_told_apart_and_three_are_not_explained() {
    let mut parameters = with_ball([5e-3, -2e-3], lump(10e-3, 4e-3, 30e3));
    let forward = forward(5).with_plain(&parameters).unwrap();
    let one = forward.predict(&parameters).unwrap();
    let count = 2 * positions().len();
    // A second inclusion on the other side, 1.3 diameters away. Each raises the pressure as if it
    // were alone.
    parameters.place.centre_m = [-7.5e-3, 2.5e-3];
    let other = forward.predict(&parameters).unwrap();
    let plain = forward.predict(&with_ball([0.0; 2], None)).unwrap();
    let joined = |a: &[f64], b: &[f64]| -> Vec<f64> {
        let pairs = a.iter().zip(b).zip(&plain);
        pairs.map(|((a, b), p)| a * b / p).collect()
    };
    let both = joined(&one, &other);
    let found = searched(&both[..count]);
    let mut two = found.inclusions();
    let x = |one: &Inclusion| one.position_m.unwrap()[0].value;
    two.sort_by(|a, b| x(b).total_cmp(&x(a)));
    assert!(found.warnings.is_empty() && two.len() == 2, "{found:?}");
    assert_found(&two[0], [5e-3, -2e-3]);
    assert_found(&two[1], [-7.5e-3, 2.5e-3]);

    // Three inclusions are neither one nor two.
    parameters.place.centre_m = [3e-3, 9e-3];
    let third = forward.predict(&parameters).unwrap();
    let found = searched(&joined(&both, &third)[..count]);
    assert!(
        found.inclusions().is_empty() && is_poor(&found),
        "{found:?}"
    );
    assert_ne!(found.verdict(), SearchVerdict::Absent);

    // A plain block under a tilted face.
    let tilted = plain[..count].iter().enumerate().map(|(k, pressure)| {
        let (frame, cell) = (k / positions().len(), k % positions().len());
        let slope = 2.0 * 0.02 / APPROACHES_M[frame];
        pressure * (1.0 + slope * positions()[cell][0])
    });
    let tilted: Vec<f64> = tilted.collect();
    assert_eq!(searched(&tilted).verdict(), SearchVerdict::Absent);
}

#[test]
fn a_ball_under_the_rim_has_a_place_and_no_size() {
    let parameters = with_ball([6e-3, -8e-3], lump(10e-3, 4e-3, 30e3));
    let found = found_in(&parameters);
    assert!(
        found.warnings.contains(&InclusionWarning::AtRim),
        "{found:?}"
    );
    let inclusion = found.inclusion.unwrap();
    let [x, y] = inclusion.position_m.unwrap();
    let away = (x.value - 6e-3).hypot(y.value + 8e-3);
    assert!(away < 0.2e-3, "{away}");
    // The position is less well known than the pressures suggest.
    let [low, high] = x.interval;
    assert!(high - low > 2.0 * 1.96 * 0.03 * 16e-3, "{x:?}");
    assert!(inclusion.diameter_m.value().is_none(), "{found:?}");
}

/// Far aside a deep ball seems too close to the axis.
#[test]
fn the_place_of_a_deep_ball_far_aside_is_less_well_known() {
    let errors = [5e-3, 7.5e-3].map(|aside_m| {
        let parameters = with_ball([aside_m, 0.0], lump(12e-3, 6e-3, 30e3));
        found_in(&parameters).inclusion.unwrap().position_m.unwrap()[0].standard_error
    });
    // A tenth and a half of a millimetre are errors of the model.
    assert!(errors[1] > 0.55e-3 && errors[0] < 0.35e-3, "{errors:?}");
}

#[test]
fn balls_above_the_detection_limit_are_found_and_those_below_are_not() {
    let (place, contrast, depth_m) = ([5e-3, -2e-3], 2.5, 8e-3);
    let mut normal = errors(5);
    let mut pressed = |lump: Option<LumpParameters>| Scan {
        presses: vec![press(&with_ball(place, lump), [0.0; 2], 0.0, &mut normal)],
        position_error_m: 0.0,
    };
    let plain = pressed(None);
    let places = [place, [10e-3, 0.0], [13e-3, 0.0]];
    let limits = |scan: &Scan, contrast: f64| {
        let depths = [depth_m, 1.5 * depth_m];
        search().detection_limits(scan, contrast, &places, &depths, &mut go_on)
    };
    let found = limits(&plain, contrast).unwrap();
    let limit = found[0][0];
    // A deeper ball must be larger. Balls outside the used part are not searched.
    assert!(
        found[1][0] > limit && found[0][1].is_finite() && found[0][2].is_infinite(),
        "{found:?}"
    );
    let nothing = search().search_scan(&plain, &mut go_on).unwrap();
    // The next press is beside this one and not at the same position. There it searches as much as
    // at any other position, and it is the nearest such position.
    let next = |candidates: &[[f64; 2]]| {
        let nowhere = vec![vec![f64::INFINITY; places.len()]];
        search().next_position(&plain, &nothing, &places, &nowhere, candidates)
    };
    let aside = [10e-3, 1e-3];
    assert_eq!(next(&[[25e-3, 0.0], aside, [20e-3, 0.0]]), Some(aside));
    assert_eq!(next(&[[90e-3, 0.0]]), None);
    let seen = search().next_position(&plain, &nothing, &places, &found, &[[0.0; 2], [13e-3, 0.0]]);
    assert_eq!(seen, Some([13e-3, 0.0]));
    // Stiffer balls are easier to detect.
    assert!(limits(&plain, 2.0 * contrast).unwrap()[0][0] < limit);
    // The fall of χ² grows with the sixth power of the diameter: at 1.1 times the limit it is 266,
    // far above the threshold of searches, and at 0.65 times it is 11, far below.
    for (part, verdict) in [(1.1, SearchVerdict::Found), (0.65, SearchVerdict::Absent)] {
        let ball = lump(part * limit, depth_m, contrast * 5e3);
        for _ in 0..2 {
            let found = search()
                .search_scan(&pressed(Some(ball)), &mut go_on)
                .unwrap();
            assert_eq!(found.verdict(), verdict, "{part} {found:?}");
        }
    }
    for wrong in [0.0, -1.0, f64::NAN] {
        assert!(limits(&plain, wrong).is_err());
    }
}

#[test]
fn the_next_press_leads_to_an_inclusion_between_presses() {
    let line = || (-5..=5).map(|k| 4e-3 * f64::from(k));
    let places: Vec<[f64; 2]> = line().flat_map(|x| line().map(move |y| [x, y])).collect();
    // The second ball is found under the rims of two presses, and the first leaves a poor fit.
    for (half, ball) in [
        (13e-3, lump(10e-3, 4e-3, 30e3)),
        (11e-3, lump(12e-3, 6e-3, 30e3)),
    ] {
        let parameters = with_ball([2e-3, -1e-3], ball);
        let mut normal = errors(7);
        let mut pressed = |axis_m| press(&parameters, axis_m, POSITION_ERROR_M, &mut normal);
        let corners = [[half, half], [-half, half], [half, -half], [-half, -half]];
        let mut scan = Scan {
            presses: corners.map(&mut pressed).to_vec(),
            position_error_m: POSITION_ERROR_M,
        };
        let sizes =
            |told: &InclusionEstimate| told.inclusion.and_then(|one| one.diameter_m.value());
        let told = search().search_scan(&scan, &mut go_on).unwrap();
        assert!(
            told.verdict() != SearchVerdict::Absent && sizes(&told).is_none(),
            "{told:?}"
        );
        let limits = search().detection_limits(&scan, 6.0, &places, &[4e-3], &mut go_on);
        let next = search().next_position(&scan, &told, &places, &limits.unwrap(), &places);
        scan.presses.push(pressed(next.unwrap()));
        let told = search().search_scan(&scan, &mut go_on).unwrap();
        assert!(sizes(&told).is_some(), "{next:?} {told:?}");
        // The first presses are no reason to doubt the place.
        let place = told.inclusion.and_then(|one| one.position_m).unwrap();
        let known = place.map(|told| told.standard_error);
        assert!(known.into_iter().all(|error| error < 0.4e-3), "{place:?}");
    }
}
