use super::*;

fn paper() -> Vec<Layer> {
    let layer = |thickness_m, youngs_modulus_pa| Layer {
        thickness_m,
        youngs_modulus_pa,
        poisson_ratio: 0.495,
    };
    vec![layer(2e-3, 1.36e5), layer(3e-3, 8e4), layer(5e-3, 3.4e4)]
}

/// All moduli and all lengths scaled together leave a known trace.
#[test]
fn the_gradient_obeys_the_scaling_laws() {
    let layers = paper();
    let slopes = log_stiffness_gradient(&layers, 1.5e-3).unwrap();
    // Twice the moduli, twice the stiffness.
    let moduli: f64 = slopes.rows(0, 3).sum();
    assert!((moduli - 1.0).abs() < 1e-6, "{moduli}");
    // Thicker layers under a contact as much larger: no change. So the slopes by ln h undo that by
    // ln a.
    let [low, high] = [1.5e-3 / 1.001, 1.5e-3 * 1.001].map(|a| guide_log_stiffness(&layers, a));
    let by_radius = (high.unwrap() - low.unwrap()) / (2.0 * 1.001_f64.ln());
    let by_thickness: f64 = slopes.rows(3, 3).sum();
    assert!((by_radius + by_thickness).abs() < 1e-5);
}
