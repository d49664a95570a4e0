//! Cells against a linear scan.

use super::*;
use proptest::prelude::*;

proptest! {
    /// Compares with a linear scan over all points, including negative coordinates and crowded
    /// cells.
    #[test]
    fn what_is_near_is_found(
        points in prop::collection::vec(prop::array::uniform3(-3.0..3.0_f64), 1..60),
        place in prop::array::uniform3(-3.0..3.0_f64),
        radius in 0.01..2.0_f64,
        side in 0.05..5.0_f64,
    ) {
        let mut cells = Cells::default();
        cells.build(&points, side);
        let mut found = Vec::new();
        cells.within(&place, radius, |row, _| found.push(row));
        found.sort_unstable();
        found.dedup();
        let near = |&i: &usize| squared_distance(&points[i], &place) <= radius * radius;
        let expected: Vec<usize> = (0..points.len()).filter(near).collect();
        prop_assert_eq!(&found, &expected);
        let least = expected.iter().map(|&i| squared_distance(&points[i], &place)).fold(f64::INFINITY, f64::min);
        let nearest = cells.nearest(&place, radius);
        prop_assert_eq!(nearest.map(|i| squared_distance(&points[i], &place)), expected.first().map(|_| least));
    }
}
