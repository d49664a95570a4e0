//! Control points of round bodies, whose slope has no end at the rim: they follow the body, not the
//! pixels of its rim.
use ndarray::Array2;
use tactile_sfs::{ControlPointSampler, Domain, EquallySpaced};

/// Root mean square distance of a hemisphere's control points from its axis, over its radius in
/// pixels.
fn spread(radius: f64, centre: [f64; 2], count: usize) -> f64 {
    let square =
        |r: usize, c: usize| (r as f64 - centre[0]).powi(2) + (c as f64 - centre[1]).powi(2);
    let n = 2 * (radius.ceil() as usize + 3);
    let z = Array2::from_shape_fn((n, n), |(r, c)| {
        (radius * radius - square(r, c)).max(0.0).sqrt()
    });
    let mask = Array2::from_shape_fn((n, n), |(r, c)| square(r, c) < radius * radius);
    let points = EquallySpaced
        .sample(z.view(), &Domain::default().with_mask(mask.view()), count)
        .unwrap();
    let middle = points
        .iter()
        .map(|p| p.coords.xy())
        .sum::<nalgebra::Vector2<f64>>()
        / count as f64;
    let squares: f64 = points
        .iter()
        .map(|p| (p.coords.xy() - middle).norm_squared())
        .sum();
    (squares / count as f64).sqrt() / radius
}

#[test]
fn a_larger_hemisphere_has_the_same_points() {
    for k in 0..12 {
        let shift = [0.13 * f64::from(k), 0.29 * f64::from(k)].map(f64::fract);
        let at = |radius: f64| spread(radius, shift.map(|s| radius.ceil() + 3.0 + s), 200);
        // Radii of 35 and 42 pixels, as a ball's contact at 0.7 N and 1.2 N: a pixel of 4000 is
        // 1.2e-4 of the radius, their ragged edge some ten times that. With all the area a rim's
        // pixels show it is 3e-3 more, always to one side.
        let apart = at(42.0) / at(35.1) - 1.0;
        assert!(apart.abs() < 2.5e-3, "{apart}");
    }
}
