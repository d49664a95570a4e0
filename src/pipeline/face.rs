//! Flat faces in a pipeline: whether a contact is one, and how far its material's law matters.
use super::contact::ContactReading;
use super::error::PipelineError;
use super::flag::Flag;
use super::object::Object;
use crate::force::{FaceReading, ShapeProblem};

/// The face of a contact, or the reason why it is none. A stated shape is believed as far as the
/// frame does not contradict it.
fn face_of(contact: &ContactReading, object: Object) -> Result<FaceReading, ShapeProblem> {
    if contact.touches_edge {
        return Err(ShapeProblem::Cut);
    }
    if contact.other_contacts > 0 {
        let others = contact.other_contacts;
        return Err(ShapeProblem::Several { others });
    }
    let face = contact.face.ok_or(ShapeProblem::TooSmall)?;
    let edge_ratio = face.edge_ratio;
    if !face.has_edge() {
        return Err(ShapeProblem::NoEdge { edge_ratio });
    }
    if face.sticks() && matches!(object, Object::Unknown { .. }) {
        return Err(ShapeProblem::RaisedEdge { edge_ratio });
    }
    Ok(face)
}

/// Whether the contacts are those of one flat face under uniaxial load. `frame` numbers go with the
/// contacts.
///
/// # Errors
/// [`PipelineError::NotUniaxial`] of the first contact that is not.
pub(super) fn check<'a>(
    contacts: impl Iterator<Item = (usize, &'a ContactReading)>,
    object: Object,
) -> Result<(), PipelineError> {
    let mut first: Option<FaceReading> = None;
    for (frame, contact) in contacts {
        let not = |problem| PipelineError::NotUniaxial { frame, problem };
        let face = face_of(contact, object).map_err(not)?;
        face.check_against(first.get_or_insert(face)).map_err(not)?;
    }
    Ok(())
}

/// Difference from which on it is a caution. With S = E (e + c e²) the ratio S/e is off by c e and the slope of a line with an intercept of its own by up to twice
/// that: 5 %, the error that the paper reports.
const DIFFERENCE: f64 = 0.025;

/// A caution where a rubber-like sample, squeezed to this strain of the measure of this name, would give a ratio that is off by more than 2.5 %, or a slope by 5 %.
///
/// An incompressible neo-Hookean solid has the nominal stress P = E (λ − λ⁻²)/3, its conjugate stress to a measure e(λ) is S = P dλ/de, and
/// S/e is E at small strain alone: at e = −9 % it is 1.25 E for Green–Lagrange's measure, 0.96 E for Hencky's.
pub(super) fn material_law_caution(measure: &str, strain: f64) -> Option<Flag> {
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
            assert_eq!(material_law_caution("Green-Lagrange", strain), None);
        }
        assert_eq!(material_law_caution("Hencky", -0.04), None);
        for strain in [f64::NAN, 0.0] {
            assert_eq!(material_law_caution("Green-Lagrange", strain), None);
        }
    }

    #[test]
    fn the_excess_is_that_of_the_expansion() {
        // S/e = E (1 − 5e/2 + …) for Green–Lagrange, E (1 + e/2 + …) for Hencky: the next terms are of some e².
        let excess = |measure, strain| match material_law_caution(measure, strain) {
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
