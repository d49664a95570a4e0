use super::*;

#[test]
fn slopes_are_derivatives() {
    // A contact in which the effect of the layers is a power of a.
    let contact = |a: f64| LinearContact {
        ratio: a,
        ball: 0.6 * a.powf(-0.3),
        layer_ratio: 0.7 * a,
        log_force: [-0.3 * a.ln() - 0.1, -0.3],
        log_indentation: [0.2 * a.ln() + 0.3, 0.2],
    };
    let strain = FiniteStrain::new(0.48);
    for a in [0.4, 0.9, 1.19] {
        for of in [FiniteStrain::force, FiniteStrain::indentation] {
            let h: f64 = 1e-5;
            let [low, high] = [-h, h].map(|h| of(&strain, &contact(a * h.exp())).value);
            let slope = (high - low) / (2.0 * h);
            let found = of(&strain, &contact(a));
            assert!(
                (slope - found.slope).abs() < 1e-8,
                "{a}: {slope} {}",
                found.slope
            );
            // The slope in ln x alone.
            let [low, high] = [-h, h].map(|h| {
                let moved = LinearContact {
                    ratio: a * h.exp(),
                    ..contact(a)
                };
                of(&strain, &moved).value
            });
            let slope = (high - low) / (2.0 * h);
            assert!((slope - found.ratio_slope).abs() < 1e-8, "{a}: {slope}");
        }
    }
}

#[test]
fn small_contacts_need_no_correction() {
    let contact = LinearContact {
        ratio: 1e-4,
        ball: 0.5,
        layer_ratio: 1e-3,
        log_force: [1e-3, 1e-3],
        log_indentation: [-1e-3, -1e-3],
    };
    assert!(FiniteStrain::new(0.495).force(&contact).value.abs() < 1e-4);
}
