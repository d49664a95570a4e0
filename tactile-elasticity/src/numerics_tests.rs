use super::*;

#[test]
fn the_minimum_of_a_parabola_and_of_a_kink() {
    for minimum in [-0.3, 0.2, 0.7] {
        let smooth = golden_section(-1.0, 1.0, 60, |x| (x - minimum).powi(2));
        // Where a parabola rises by one rounding.
        assert!((smooth - minimum).abs() < 1e-7, "{smooth}");
        let kink = golden_section(-1.0, 1.0, 60, |x: f64| (x - minimum).abs());
        assert!((kink - minimum).abs() < 1e-11, "{kink}");
    }
    // At an end of the bracket.
    assert!((golden_section(0.0, 1.0, 60, |x| x)) < 1e-11);
}

#[test]
fn exact_for_polynomials_of_degree_2n_minus_1() {
    let rule = gauss_legendre(5);
    for degree in 0..10 {
        let sum: f64 = rule.iter().map(|(x, w)| w * x.powi(degree)).sum();
        // Five terms of order one: a few roundings.
        assert!(
            (sum - 1.0 / f64::from(degree + 1)).abs() < 1e-15,
            "{degree}"
        );
    }
}

#[test]
fn polynomials_are_interpolated_exactly() {
    let cube = |x: f64| 2.0 * x * x * x - x + 0.5;
    let points = [0.1, 0.4, 0.5, 0.9].map(|x| (x, cube(x)));
    let (value, slope) = cubic(points, 0.7);
    assert!((value - cube(0.7)).abs() < 1e-14);
    assert!((slope - (6.0 * 0.49 - 1.0)).abs() < 1e-13);
    let chebyshev = Chebyshev::<4>::through(&Chebyshev::<4>::nodes().map(cube));
    for x in [0.0, 0.3, 1.0] {
        assert!((chebyshev.value(x) - cube(x)).abs() < 1e-14);
    }
}
