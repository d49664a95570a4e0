//! Blocks against linear scans.

use super::*;

#[test]
fn blocks_hold_every_point_once_and_keep_their_distance() {
    let points: Vec<[f64; 2]> = (0..101)
        .map(|i| [f64::from(i * 37 % 101), f64::from(i * 53 % 89)])
        .collect();
    let mut blocks = Blocks::default();
    blocks.build(&points);
    let mut sorted = blocks.order.clone();
    sorted.sort_unstable();
    assert_eq!(sorted, (0..101).collect::<Vec<_>>());
    let mut squared = Vec::new();
    box_distances(
        &[20.0, 30.0],
        (&blocks.levels[0].low, &blocks.levels[0].high),
        7,
        &mut squared,
    );
    for (place, &j) in blocks.order.iter().enumerate() {
        let distance = (points[j][0] - 20.0).powi(2) + (points[j][1] - 30.0).powi(2);
        // Integers below 2¹⁴ squared and summed are exact in single precision.
        assert!(f64::from(squared[place / LANES]) <= distance, "{place}");
    }
}

/// In a set of many groups, the hierarchical search finds the same blocks as a linear scan.
#[test]
fn groups_leave_out_no_block_in_reach() {
    let points: Vec<[f64; 2]> = (0..12_003)
        .map(|i| [f64::from(i * 37 % 12_001), f64::from(i * 53 % 11_987)])
        .collect();
    let mut blocks = Blocks::default();
    blocks.build(&points);
    let count = blocks.levels[0].low.len() / 2;
    let (mut scratch, mut found) = (Vec::new(), Vec::new());
    for cut in [0.0, 300.0, 90_000.0] {
        for y in [[700.0, 900.0], [-100.0, 4000.0]] {
            found.clear();
            blocks.within(&y, cut, &mut scratch, &mut found);
            box_distances(
                &y,
                (&blocks.levels[0].low, &blocks.levels[0].high),
                count,
                &mut scratch,
            );
            let near = (0..).zip(&scratch).filter(|&(_, &s)| s <= cut);
            assert_eq!(found, near.map(|(block, _)| block).collect::<Vec<u32>>());
        }
    }
}
