use super::*;

#[test]
fn the_slope_is_the_derivative_and_the_radius_the_inverse() {
    let squeeze = Squeeze::new(3e-3, 0.47, 0.8);
    for a in [1e-5, 5e-4, 1.5e-3, 2.2e-3] {
        let h = 1e-6 * a;
        let slope = (squeeze.indentation(a + h) - squeeze.indentation(a - h)) / (2.0 * h);
        assert!((slope / squeeze.slope(a) - 1.0).abs() < 1e-8); // central difference, h² and ε/h
        let back = squeeze.contact_radius(squeeze.indentation(a)).unwrap();
        assert!((back / a - 1.0).abs() < 1e-12);
    }
}
