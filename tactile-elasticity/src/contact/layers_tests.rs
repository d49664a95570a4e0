use super::*;

#[test]
fn without_a_share_the_layer_does_not_matter() {
    let equation = LayerEquation::new(Bond::Bonded, 0.5)
        .unwrap()
        .with_share(0.0);
    assert!((equation.solve(3.0).unwrap().force_ratio - 1.0).abs() < 1e-14);
}

#[test]
fn gauss_nodes_are_enough() {
    // The force on a layer 20 times thinner than the contact changes by less than 10⁻⁹ with one
    // more node. The test compares with the solution at nearly the same a/h, which has another
    // number of nodes.
    let equation = LayerEquation::new(Bond::Bonded, 0.3).unwrap();
    let (a, b) = (
        equation.solve(5.0 - 1e-9).unwrap(),
        equation.solve(5.0).unwrap(),
    );
    assert!((a.force_ratio / b.force_ratio - 1.0).abs() < 1e-8);
}

fn layer(thickness: f64, shear_modulus: f64, poisson_ratio: f64) -> StackLayer {
    StackLayer {
        thickness,
        shear_modulus,
        poisson_ratio,
    }
}

fn kernel(layers: &[StackLayer], bond: Bond) -> LayerKernel {
    let layers = layers.to_vec();
    LayerKernel { layers, bond }
}

/// 1 − L of one layer in closed form: with q = e^(−2s) bonded, k = 3 − 4ν, (2kq² + (1 + k² + 4s² +
/// 4s)q)/(k(1 + q²) + (1 + k² + 4s²)q), free 2q(2s + 1 − q)/(1 − q² + 4sq).
fn closed_form(s: f64, nu: f64, bond: Bond) -> f64 {
    let (k, q) = (3.0 - 4.0 * nu, (-2.0 * s).exp());
    let base = 1.0 + k * k + 4.0 * s * s;
    match bond {
        Bond::Bonded => (2.0 * k * q * q + (base + 4.0 * s) * q) / (k * (1.0 + q * q) + base * q),
        Bond::Free => 2.0 * q * (2.0 * s + 1.0 - q) / (1.0 - q * q + 4.0 * s * q),
    }
}

#[test]
fn one_layer_has_its_closed_form_and_may_be_cut() {
    for nu in [-0.3, 0.0, 0.3, 0.4999, 0.5] {
        for bond in [Bond::Bonded, Bond::Free] {
            let one = kernel(&[layer(1.0, 1.0, nu)], bond);
            let cut = [0.301, 0.001, 0.198, 0.5].map(|h| layer(h, 1.0, nu));
            let cut = kernel(&cut, bond);
            for s in [0.01, 0.3, 0.99, 1.01, 4.0, 11.0, 25.0] {
                let exact = closed_form(s, nu, bond);
                let whole = one.deficit(s) / exact - 1.0;
                assert!(whole.abs() < 1e-12, "{nu} {bond:?} {s}: {whole:e}");
                // Thin layers are stiff, and y = 10⁻⁵ costs several digits. The accuracy of a part
                // is that of the wave reflected by its lower face.
                let parts = cut.deficit(s) - exact;
                let tolerance = 1e-9 * exact + 1e-11 * (-2.0 * 0.301 * s).exp();
                assert!(parts.abs() < tolerance, "{nu} {bond:?} {s}: {parts:e}");
            }
        }
    }
}

#[test]
fn short_waves_see_the_top_and_a_stiff_base_is_rigid() {
    let soft_below = [layer(0.2, 1.0, 0.45), layer(0.8, 0.1, 0.5)];
    let soft_below = kernel(&soft_below, Bond::Bonded);
    assert!(soft_below.deficit(100.0).abs() < 1e-12);
    assert!(soft_below.deficit(1.0) < -0.1);
    let on_steel = [layer(0.2, 1.0, 0.45), layer(0.8, 1e9, 0.3)];
    let on_steel = kernel(&on_steel, Bond::Bonded);
    for s in [2.0, 7.0, 60.0] {
        let thin = closed_form(s * 0.2, 0.45, Bond::Bonded);
        // Steel is displaced by 10⁻⁹ of the layer's displacement.
        assert!((on_steel.deficit(s) / thin - 1.0).abs() < 1e-7, "{s}");
    }
}

use crate::contact::{Layer, Waveguide};

#[test]
fn shares_and_radii_between_the_nodes() {
    let layer = |thickness_m, youngs_modulus_pa| Layer {
        thickness_m,
        youngs_modulus_pa,
        poisson_ratio: 0.495,
    };
    let layers = vec![layer(2e-3, 1.36e5), layer(3e-3, 8e4), layer(5e-3, 3.4e4)];
    let guide = Waveguide::new(layers).unwrap();
    let stack = LayerEquation::of_layers(&guide, Bond::Bonded).unwrap();
    let single = LayerEquation::new(Bond::Bonded, 0.5).unwrap();
    for equation in [stack, single] {
        let table = SharedLayerTable::new(equation.kernel(), (0.01, 3.0)).unwrap();
        for (a, share) in [
            (0.004, 0.5),
            (0.05, 0.03),
            (0.33, 0.51),
            (1.1, 0.98),
            (2.6, 0.7),
        ] {
            let exact = equation.clone().with_share(share);
            let exact = exact.solve(a).unwrap();
            let found = table.at(a, share).unwrap();
            // Below the table the correction is assumed linear in a, and its square is neglected.
            let tolerance = if a < 0.01 { 3e-5 } else { 1e-5 };
            let force_gap = found.force[0] - exact.force_ratio_same_radius.ln();
            let indentation_gap = found.indentation[0] - exact.indentation_ratio.ln();
            let gap = force_gap.abs().max(indentation_gap.abs());
            assert!(gap < tolerance, "{a} {share}: {gap:e}");
        }
        assert!(table.at(4.0, 0.5).is_none());
    }
}
