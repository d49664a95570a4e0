//! Compares parts of the simulator with closed forms and brute force.

use crate::uniaxial::disc_below;

mod contact;
mod pixel_average;

#[test]
fn the_area_of_a_part_of_a_disc_is_that_of_a_fine_grid() {
    let n = 2000;
    let at = |k: usize| (k as f64 + 0.5) / f64::from(n) * 2.0 - 1.0;
    for (x, y) in [
        (1.0, 1.0),
        (0.3, 0.6),
        (-0.4, 0.7),
        (0.9, -0.8),
        (-0.2, -0.1),
        (2.0, 0.0),
    ] {
        let mut count = 0_u32;
        for (i, j) in ndarray::indices((n as usize, n as usize)) {
            let (u, v) = (at(i), at(j));
            count += u32::from(u <= x && v <= y && u * u + v * v <= 1.0);
        }
        let counted = f64::from(count) * 4.0 / f64::from(n).powi(2);
        // A grid of 2000² counts areas to about 1e-3 of the cells on its boundary.
        assert!((disc_below(x, y) - counted).abs() < 2e-3, "{x} {y}");
    }
}
