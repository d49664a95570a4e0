use super::*;

/// ∫ √(z + n)₊ φ(n) dn with u = √(z + n): 2 u² φ(u² − z), smooth, by the trapezoidal rule.
fn by_quadrature(z: f64) -> f64 {
    let step = 1e-3;
    let phi = |n: f64| (-0.5 * n * n).exp() / (2.0 * std::f64::consts::PI).sqrt();
    (1..8000)
        .map(|k| step * f64::from(k))
        .map(|u| 2.0 * u * u * phi(u * u - z) * step)
        .sum()
}

#[test]
fn agrees_with_the_integral() {
    let edge = BlurredEdge::new();
    for k in -90..400 {
        let z = 0.1 * f64::from(k) + 0.013;
        // Table: Taylor remainder 0.125⁹. Series at 16: 1e-9.
        assert!(
            (edge.derivatives(z)[0] - by_quadrature(z)).abs() < 3e-9,
            "z = {z}"
        );
    }
}

#[test]
fn derivatives_of_the_edge_agree_with_differences() {
    let edge = BlurredEdge::new();
    for z in [-3.3, -0.4, 0.7, 2.9, 9.1, 15.6, 40.0] {
        let e = 1e-4;
        let (above, below, here) = (
            edge.derivatives(z + e),
            edge.derivatives(z - e),
            edge.derivatives(z),
        );
        for k in 0..5 {
            // Differences: e² h⁽ᵏ⁺³⁾/6. Asymptotic series: its last term.
            let slope = (above[k] - below[k]) / (2.0 * e);
            assert!(
                (slope - here[k + 1]).abs() < 2e-6,
                "z = {z}, order {k}: {slope} {}",
                here[k + 1]
            );
        }
    }
}

#[test]
fn derivatives_agree_with_differences() {
    let edge = BlurredEdge::new();
    for bend in [0.0, 0.15, -0.3] {
        let shape = Shape {
            peak: 120.0,
            radius: 40.0,
            blur: 0.6,
            bend,
        };
        for r in [0.0, 11.0, 33.0, 38.9, 39.8, 40.4, 42.0] {
            let at = |shape: Shape, r2: f64| level(&edge, &shape, r2, 0.02);
            let here = at(shape, r * r);
            let e = 1e-4;
            let central = |change: &dyn Fn(f64) -> f64| (change(e) - change(-e)) / (2.0 * e);
            let along = |change: fn(&mut Shape, f64)| {
                central(&|e| {
                    let mut moved = shape;
                    change(&mut moved, e);
                    at(moved, r * r).value
                })
            };
            let slopes = [
                (here.by_peak, along(|shape, e| shape.peak += e)),
                (here.by_radius, along(|shape, e| shape.radius += e)),
                (here.by_blur, along(|shape, e| shape.blur += e)),
                (here.by_bend, along(|shape, e| shape.bend += e)),
                (here.by_r2, central(&|e| at(shape, r * r + e).value)),
            ];
            for (k, (slope, difference)) in slopes.into_iter().enumerate() {
                // Differences: e² times a third derivative of several hundred, over six.
                assert!(
                    (slope - difference).abs() < 2e-6 * (1.0 + slope.abs()),
                    "r {r}, bend {bend}, {k}: {slope} {difference}"
                );
            }
        }
    }
}

/// The mean over the blur, by sums over a fine grid of displacements.
#[test]
fn level_is_the_blurred_profile() {
    let edge = BlurredEdge::new();
    let (radius, blur, bend) = (40.0_f64, 0.6_f64, 0.2);
    let shape = Shape {
        peak: 1.0,
        radius,
        blur,
        bend,
    };
    let profile = |x: f64, y: f64| {
        let rho2 = (x * x + y * y) / (radius * radius);
        (1.0 - rho2).max(0.0).sqrt() * (1.0 - bend * rho2)
    };
    let step = 0.02;
    for r in [0.0, 20.0, 39.0, 40.0, 41.0] {
        let (mut sum, mut weights) = (0.0, 0.0);
        for i in -200_i32..=200 {
            for j in -200_i32..=200 {
                let (x, y) = (step * f64::from(i), step * f64::from(j));
                let weight = (-0.5 * (x * x + y * y) / blur).exp();
                sum += weight * profile(r + x, y);
                weights += weight;
            }
        }
        // The Edgeworth series has an error of (blur/a)² at the edge.
        assert!(
            (level(&edge, &shape, r * r, 0.0).value - sum / weights).abs() < 5e-4,
            "r = {r}"
        );
    }
}
