use super::*;

fn paper() -> Vec<Layer> {
    let layer = |thickness_m, youngs_modulus_pa| Layer {
        thickness_m,
        youngs_modulus_pa,
        poisson_ratio: 0.495,
    };
    vec![layer(2e-3, 1.36e5), layer(3e-3, 8e4), layer(5e-3, 3.4e4)]
}

/// Scaling all moduli or all lengths together has a known effect.
#[test]
fn the_gradient_obeys_the_scaling_laws() {
    let layers = paper();
    let slopes = log_stiffness_gradient(&Waveguide::new(layers.clone()).unwrap(), 1.5e-3).unwrap();
    // Twice the moduli mean twice the stiffness.
    let moduli: f64 = slopes.rows(0, 3).sum();
    assert!((moduli - 1.0).abs() < 1e-6, "{moduli}");
    // Scaling the layers and the contact together changes nothing, so the slopes by ln h cancel
    // that by ln a.
    let [low, high] = [1.5e-3 / 1.001, 1.5e-3 * 1.001].map(|a| Layer::log_stiffness(&layers, a));
    let by_radius = (high.unwrap() - low.unwrap()) / (2.0 * 1.001_f64.ln());
    let by_thickness: f64 = slopes.rows(3, 3).sum();
    assert!((by_radius + by_thickness).abs() < 1e-5);
}

/// The gradient uses one solution of the integral equation. Here all are solved.
#[test]
fn the_gradient_is_the_limit_of_differences() {
    for (a, layers) in [0.05e-3, 1.5e-3, 12e-3].iter().flat_map(|a| {
        let gel = Layer {
            poisson_ratio: 0.3,
            ..paper()[1]
        };
        [(*a, paper()), (*a, vec![gel])]
    }) {
        let guide = Waveguide::new(layers.clone()).unwrap();
        let slopes = log_stiffness_gradient(&guide, a).unwrap();
        for k in 0..slopes.len() {
            let at = |value: f64| {
                let mut step = DVector::zeros(slopes.len());
                step[k] = value;
                Layer::log_stiffness(&Layer::stepped(&layers, &step), a).unwrap()
            };
            let difference = (at(1e-3) - at(-1e-3)) / 2e-3;
            // Differences have an error of about 1e-6. For ν the gradient uses negative steps: half
            // a step times a second derivative of up to ten times the first.
            let tolerance = if k < 2 * layers.len() {
                1e-5
            } else {
                1e-2 * difference.abs() + 1e-3
            };
            assert!(
                (slopes[k] - difference).abs() < tolerance,
                "{a} {k}: {} {difference}",
                slopes[k]
            );
        }
    }
}

/// Interpolation between rows agrees at every radius with the derivatives at that radius.
#[test]
fn errors_are_those_of_the_derivatives_at_every_radius() {
    let guide = Waveguide::new(paper()).unwrap();
    let variances = [1e-2, 4e-2, 9e-2, 1e-4, 4e-4, 1e-4, 1e-5, 1e-5, 1e-5];
    let covariance = DMatrix::from_diagonal(&variances.to_vec().into());
    let errors = GuideErrors::new(guide.clone(), covariance.clone(), None);
    let radii = (0..25).map(|k| 20e-6 * (0.33 * k as f64).exp());
    for a in radii {
        let slopes = log_stiffness_gradient(&guide, a).unwrap();
        let variance = (slopes.transpose() * &covariance * &slopes)[(0, 0)];
        let found = errors.compliance(a).unwrap().standard_error();
        let ratio = found / variance.sqrt();
        assert!((ratio - 1.0).abs() < 1e-4, "{a} {ratio}");
    }
    assert_eq!(errors, GuideErrors::new(guide, covariance, None));
}
