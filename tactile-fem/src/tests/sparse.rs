use crate::sparse::{Pattern, Singular, Symmetric};
use std::sync::Arc;

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
