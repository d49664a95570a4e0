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
    assert_eq!(close_pairs(&lattice(1.0)), Some(vec![]));
    let mut model = lattice(1.0);
    model.push(model[11] + nalgebra::Vector2::new(0.0, 0.01));
    assert_eq!(close_pairs(&model).map(|close| close.len()), Some(1));
    for step in [1e-200, 1e200] {
        assert_eq!(close_pairs(&lattice(step)), None);
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

/// Random points, of which some nearly coincide, that move as a smooth field and noise does.
#[test]
fn a_spline_that_is_fitted_later_interpolates_what_it_promised() {
    let mut state = 7_u64;
    let mut draw = || {
        state = state * 16_807 % 2_147_483_647; // Lehmer's generator
        state as f64 / 2_147_483_647.0
    };
    for (roughness, decades) in [(0.0, 3.0), (0.0, 8.0), (1e-4, 3.0), (1e-3, 4.0), (0.1, 2.0)] {
        let count = 400;
        let mut model: Vec<_> = (0..count).map(|_| Point2::new(draw(), draw())).collect();
        for k in 0..count / 10 {
            let near = 10.0_f64.powf(-decades * draw());
            model[k] = model[count - 1 - k] + nalgebra::Vector2::new(near * draw(), near);
        }
        let mut warped: Vec<_> = model
            .iter()
            .map(|p| p + nalgebra::Vector2::new((3.0 * p.y).sin(), p.x * p.y) * 0.1)
            .collect();
        warped.iter_mut().for_each(|p| p.x += roughness * draw());
        let wanted = warped.clone();
        let spline = ModelSpline::new(&model);
        let promised = spline.sources.interpolates(&warped);
        let warp = spline.through(&mut warped);
        assert_eq!(promised, spline.sources.system.get().is_none());
        assert!(promised || roughness > 0.0 || decades > 3.0);
        if promised {
            assert!(follows(
                &*warp,
                &model,
                &wanted,
                (0.5 * f64::EPSILON).sqrt()
            ));
        }
    }
}
