//! The default matcher on tracked particles of a stretched volume and plane (data of
//! FranckLab/SerialTrack, MIT, Jin Yang 2022). Some particles leave the field of view and others
//! enter. At least 99 % of the true pairs must be found, and less than half a per cent of the pairs
//! may be wrong.
#![allow(clippy::print_stdout)] // what was found, beside the bars

use crate::common::{Stream, reordered};
use nalgebra::Point;
use tactile_match::{AnnealedSoftassign, PointMatcher};

/// Rows of `C` numbers, without the header line. `None` if the file is absent.
fn read<const C: usize>(file: &str) -> Option<Vec<[f64; C]>> {
    let path = test_support::published(&format!("serialtrack/{file}"))?;
    let text = std::fs::read_to_string(path).expect("readable");
    let row = |line: &str| {
        let mut fields = line.split(',').map(|field| field.trim().parse::<f64>());
        let mut row = [0.0; C];
        for value in &mut row {
            *value = fields.next()?.ok()?;
        }
        Some(row)
    };
    Some(text.lines().filter_map(row).collect())
}

/// Matches frame 0 to frame `k`. Checks the fraction of the true pairs that are found and the
/// fraction of found pairs that are wrong.
fn check<const D: usize>(kind: &str, k: usize) {
    let files = (
        read::<D>(&format!("{kind}_frame00.csv")),
        read::<D>(&format!("{kind}_frame{k:02}.csv")),
        read::<1>(&format!("{kind}_truth{k:02}.csv")),
    );
    let (Some(model), Some(target), Some(truth)) = files else {
        return;
    };
    let points = |rows: &[[f64; D]]| {
        rows.iter()
            .map(|row| Point::from(*row))
            .collect::<Vec<Point<f64, D>>>()
    };
    let (model, target) = (points(&model), points(&target));
    let order = Stream::new(1).permutation(target.len()); // the file keeps the order of frame 0
    let matching = AnnealedSoftassign::default()
        .match_points(&model, &reordered(&target, &order))
        .expect("good points");
    let partner = |i: usize| matching.assignment[i].map(|j| order[j] as f64);
    let pairs = truth.iter().filter(|t| t[0] >= 0.0).count();
    let found = (0..model.len()).filter(|&i| partner(i).is_some()).count();
    let right = (0..model.len())
        .filter(|&i| partner(i) == Some(truth[i][0]))
        .count();
    let (recall, wrong) = (
        right as f64 / pairs as f64,
        (found - right) as f64 / found.max(1) as f64,
    );
    println!(
        "{kind} 0→{k}: {:.2} % of {pairs} pairs found, {:.2} % of {found} wrong",
        100.0 * recall,
        100.0 * wrong
    );
    assert!(
        recall >= 0.99 && wrong < 0.005,
        "{kind} 0→{k}: {recall} found, {wrong} wrong"
    );
}

/// Frames stretched by 5, 10 and, in the volume, 25 per cent.
#[test]
fn stretched_particles_are_matched() {
    for k in [1, 2, 5] {
        check::<3>("stretch3d", k);
    }
    for k in [1, 2] {
        check::<2>("stretch2d", k);
    }
}
