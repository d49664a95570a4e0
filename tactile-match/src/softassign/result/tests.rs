//! Tests of the building blocks.

use super::*;
use nalgebra::Point2;

fn lattice(step: f64) -> Vec<Point2<f64>> {
    let place = |i: usize| (i % 5) as f64 + 0.1 * ((i * i) as f64).sin();
    (0..25)
        .map(|i| Point2::new(place(i), (i / 5) as f64) * step)
        .collect()
}

#[test]
fn nothing_is_factorised_before_the_warp_is_asked_and_then_once() {
    let model = lattice(1e-3);
    let spline = ModelSpline::new(&model);
    let mut warped: Vec<_> = model.iter().map(|p| p * 1.2).collect();
    let [one, other] = [0, 1].map(|_| spline.through(&mut warped));
    assert!(spline.sources.system.get().is_none());
    assert!((one.apply(&model[3]) - warped[3]).norm() < 1e-15);
    let system: *const _ = spline.sources.system();
    assert!((other.jacobian(&model[7])[(0, 0)] - 1.2).abs() < 1e-9);
    assert!(std::ptr::eq(system, spline.sources.system()));
}

#[test]
fn points_that_nearly_coincide_or_sizes_out_of_all_range_are_fitted_at_once() {
    assert!(are_apart(&lattice(1.0)));
    let mut model = lattice(1.0);
    model.push(model[11] + nalgebra::Vector2::new(0.0, 0.01));
    assert!(!are_apart(&model));
    for step in [1e-200, 1e200] {
        assert!(!are_apart(&lattice(step)));
    }
    // The coincident points move apart, so the positions become those of a smoothed spline.
    let mut warped = model.clone();
    model[25] = model[11];
    warped[25].x += 0.5;
    let wanted = warped.clone();
    let warp = ModelSpline::new(&model).through(&mut warped);
    assert!((warped[25] - wanted[25]).norm() > 0.1);
    assert!((warp.apply(&model[25]) - warped[25]).norm() < 1e-9);
}
