use super::*;

/// The mask of an ellipse with these half axes, rotated by 30°.
fn ellipse(half: [f64; 2]) -> Vec<Run> {
    let (sin, cos) = std::f64::consts::FRAC_PI_6.sin_cos();
    let inside = |u: f64, v: f64| {
        let place = [cos * u + sin * v, cos * v - sin * u];
        (place[0] / half[0]).hypot(place[1] / half[1]) <= 1.0
    };
    let row = |row: u32| {
        let v = f64::from(row) - 120.3;
        let columns = (0..240_u32).filter(move |x| inside(f64::from(*x) - 119.8, v));
        let (start, last) = (columns.clone().min()?, columns.max()?);
        Some(Run {
            row,
            start,
            end: last + 1,
        })
    };
    (0..240).filter_map(row).collect()
}

const SQUARE: [[f64; 2]; 2] = [[20e-6, 0.0], [0.0, 20e-6]];

#[test]
fn circles_of_every_size_are_round() {
    for k in 0..60 {
        let radius = 8.0 + 1.7 * f64::from(k);
        assert_eq!(
            elongation(&ellipse([radius; 2]), SQUARE),
            None,
            "{radius} px"
        );
    }
}

#[test]
fn an_ellipse_is_found_with_its_axes_and_undone_by_its_pixels() {
    let found = elongation(&ellipse([92.0, 90.0]), SQUARE).unwrap();
    // A tenth of the discretisation effect at this size.
    assert!((found - 2.0 / 90.0).abs() < 1e-3, "{found}");
    // The Jacobian of pixels that map the same ellipse to a circle.
    let (sin, cos) = std::f64::consts::FRAC_PI_6.sin_cos();
    let (p, q) = (1.0 / 92.0, 1.0 / 90.0);
    let jacobian = [
        [p * cos * cos + q * sin * sin, (p - q) * sin * cos],
        [(p - q) * sin * cos, p * sin * sin + q * cos * cos],
    ];
    assert_eq!(elongation(&ellipse([92.0, 90.0]), jacobian), None);
}
