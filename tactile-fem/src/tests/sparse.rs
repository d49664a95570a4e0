use crate::sparse::{Pattern, Singular, Symmetric};
use std::sync::Arc;

#[test]
fn solves_an_indefinite_system() {
    let groups: [&[usize]; 4] = [&[0, 3], &[3, 1], &[1, 4], &[4, 2]];
    let pattern = Pattern::new(5, groups.into_iter()).unwrap();
    assert!(pattern.couples(&[1, 3]) && !pattern.couples(&[0, 1, 3]));
    let mut matrix = Symmetric::zero(Arc::new(pattern));
    let mut dense = nalgebra::DMatrix::<f64>::zeros(5, 5);
    for (k, group) in groups.iter().enumerate() {
        let (i, j) = (group[0], group[1]);
        for (r, c, v) in [(i, i, 3.0), (j, j, -2.0), (i, j, 0.5 + k as f64)] {
            matrix.add(r, c, v);
            dense[(r, c)] += v;
            if r != c {
                dense[(c, r)] += v;
            }
        }
    }
    let truth = nalgebra::DMatrix::from_fn(5, 2, |i, j| 1.0 + i as f64 - 3.0 * j as f64);
    let mut x: Vec<f64> = (&dense * &truth).iter().copied().collect();
    matrix.factorise().unwrap().solve(&mut x).unwrap();
    for (found, expected) in x.iter().zip(&truth) {
        // Five unknowns of order one: some rounding units.
        assert!((found - expected).abs() < 1e-12, "{found} {expected}");
    }
}

#[test]
fn a_singular_system_is_reported() {
    let groups: [&[usize]; 1] = [&[0, 1]];
    let pattern = Pattern::new(2, groups.into_iter()).unwrap();
    let mut matrix = Symmetric::zero(Arc::new(pattern));
    for (i, j, v) in [(0, 0, 1.0), (0, 1, 1.0), (1, 1, 1.0)] {
        matrix.add(i, j, v);
    }
    let solved = matrix
        .factorise()
        .and_then(|factors| factors.solve(&mut [1.0, 0.0]));
    assert_eq!(solved, Err(Singular));
}
