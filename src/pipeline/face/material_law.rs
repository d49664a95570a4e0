//! How much a modulus at finite strain depends on the law between stress and strain.
use crate::pipeline::flag::Flag;

/// Difference from which on it is a caution. With S = E (e + c e²) the ratio S/e is off by c e and the slope of a line with an intercept of its own by up to twice
/// that: 5 %, the error that the paper reports.
const DIFFERENCE: f64 = 0.025;

/// A caution where a rubber-like sample, squeezed to this strain of the measure of this name, would give a ratio that is off by more than 2.5 %, or a slope by 5 %.
///
/// An incompressible neo-Hookean solid has the nominal stress P = E (λ − λ⁻²)/3, its conjugate stress to a measure e(λ) is S = P dλ/de, and
/// S/e is E at small strain alone: at e = −9 % it is 1.25 E for Green–Lagrange's measure, 0.96 E for Hencky's.
pub(in crate::pipeline) fn caution(measure: &str, strain: f64) -> Option<Flag> {
    // Stretch, and de/dλ.
    let (stretch, slope) = match measure {
        "Hencky" => (strain.exp(), (-strain).exp()),
        "Biot" | "infinitesimal" => (1.0 + strain, 1.0),
        "Euler-Almansi" => {
            let square = 1.0 / (1.0 - 2.0 * strain);
            (square.sqrt(), square.powf(-1.5))
        }
        _ => {
            let stretch = (1.0 + 2.0 * strain).sqrt();
            (stretch, stretch)
        }
    };
    let nominal = (stretch - stretch.powi(-2)) / 3.0;
    let excess = nominal / (slope * strain) - 1.0;
    (excess.abs() > DIFFERENCE).then_some(Flag::MaterialLaw { strain, excess })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_strains_and_logarithmic_ones_give_the_modulus() {
        for strain in [-1e-3, 1e-3, -0.008] {
            assert_eq!(caution("Green-Lagrange", strain), None);
        }
        assert_eq!(caution("Hencky", -0.04), None);
        for strain in [f64::NAN, 0.0] {
            assert_eq!(caution("Green-Lagrange", strain), None);
        }
    }

    #[test]
    fn the_excess_is_that_of_the_expansion() {
        // S/e = E (1 − 5e/2 + …) for Green–Lagrange, E (1 + e/2 + …) for Hencky: the next terms are of some e².
        let excess = |measure, strain| match caution(measure, strain) {
            Some(Flag::MaterialLaw { excess, .. }) => excess,
            other => panic!("{other:?}"),
        };
        for strain in [-0.03, -0.06] {
            let error = excess("Green-Lagrange", strain) + 2.5 * strain;
            assert!(error.abs() < 10.0 * strain * strain, "{error}");
        }
        let error = excess("Hencky", -0.12) + 0.06;
        assert!(error.abs() < 0.12 * 0.12, "{error}");
    }
}
