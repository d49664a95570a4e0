use super::*;
use nalgebra::Vector3;
use proptest::prelude::*;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn compatibilities_lie_between_zero_and_one_and_are_symmetric(
        u in prop::array::uniform3(-5.0..5.0_f64), v in prop::array::uniform3(-5.0..5.0_f64), s in 0.01..100.0_f64,
    ) {
        let (u, v) = (Vector3::from(u), Vector3::from(v));
        let (a, b) = (alpha(u.norm(), v.norm()), beta(&u, &v));
        prop_assert!((0.0..=1.0).contains(&a) && (0.0..=1.0).contains(&b));
        prop_assert_eq!((a, b), (alpha(v.norm(), u.norm()), beta(&v, &u)));
        prop_assert!((beta(&(u * s), &v) - b).abs() <= 1e-14);
        prop_assert!((beta(&-u, &v) - (1.0 - b)).abs() <= 1e-14 || u.norm() * v.norm() == 0.0);
        let longest = u.norm().max(v.norm());
        prop_assert!((0.0..=1.0).contains(&gamma(u.norm(), longest)));
    }
}

#[test]
fn the_ties_of_a_grid_do_not_depend_on_where_it_lies() {
    let grid = crate::common::grid::<2>(5);
    let count = |shift: f64, step: f64| {
        let moved: Vec<_> = grid
            .iter()
            .map(|p| [p.x * step + shift, p.y * step - shift])
            .collect();
        NeighbourGraph::new(&moved, Neighbourhood::MedianRadius)
            .edges
            .len()
    };
    for (shift, step) in [(0.1, 0.1), (1.0 / 3.0, 0.7), (1e5, 0.1), (-7e3, 1e-2)] {
        assert_eq!(
            count(shift, step),
            count(0.0, 1.0),
            "grid of step {step} at {shift}"
        );
    }
}
