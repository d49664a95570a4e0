//! Tests of the building blocks.

mod gated {
    use super::super::*;
    use proptest::prelude::*;

    proptest! {
        /// Against every point looked at, negative coordinates and crowded cells included.
        #[test]
        fn the_nearest_within_the_gate_is_found(
            points in prop::collection::vec(prop::array::uniform3(-3.0..3.0_f64), 1..60),
            place in prop::array::uniform3(-3.0..3.0_f64),
            gate in 0.01..2.0_f64,
        ) {
            let mut gated = GatedNearest::default();
            gated.build(&points, gate);
            let squares = points.iter().map(|p| squared_distance(p, &place));
            let expected = squares.filter(|&s| s <= gate * gate).min_by(f64::total_cmp);
            let found = gated.find(&place).map(|i| squared_distance(&points[i], &place));
            prop_assert_eq!(found, expected);
        }
    }

    /// A place whose gate ends on a cell's face, where rounding could leave out the cell beyond.
    #[test]
    fn places_at_the_gate_itself_are_found() {
        for gate in [0.1, 0.25, 1.0 / 3.0] {
            for k in -20..20 {
                let point = [f64::from(k) * gate, 0.0];
                let mut gated = GatedNearest::default();
                gated.build(&[point], gate);
                // Within a rounding error of the gate.
                let place = [point[0] + gate * (1.0 - 1e-12), 0.0];
                assert_eq!(gated.find(&place), Some(0), "gate {gate}, point {point:?}");
            }
        }
    }
}

mod cells {
    use super::super::*;
    use proptest::prelude::*;

    proptest! {
        /// Against every point looked at, negative coordinates and crowded cells included.
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
}
