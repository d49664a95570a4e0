//! Whether a contact is one that the uniaxial law describes.
use super::FaceReading;
use crate::pipeline::contact::ContactReading;
use crate::pipeline::error::PipelineError;
use crate::pipeline::object::Object;
use std::fmt;

/// Light just inside the outline over that further inside below which the outline is no edge of a flat face: between the 1 of an even pressure, lowered by
/// texture to 0.9, and a ball's 0.65 to 0.75.
const LEAST_EDGE_RATIO: f64 = 0.85;
/// Likewise above: an edge that presses harder than the middle is that of a stiff punch on a soft layer, or of friction.
const GREATEST_EDGE_RATIO: f64 = 1.18;
/// Change of the outline's second moment between loads, relative. The area is good to 1e-4; a face that grows on one side, or by its corners alone, changes it by
/// a third of the growth.
const OUTLINE_CHANGE: f64 = 4e-3;
/// Change of the light's second moment between loads, relative; noise changes it by 1e-3.
const LIGHT_CHANGE: f64 = 1e-2;

/// Growth of the area between loads, relative, beyond which no uniaxial load of moderate strain explains it: a squeeze of a quarter at ν = ½.
const GREATEST_GROWTH: f64 = 0.25;

/// Why a contact is not that of one flat face under uniaxial load.
///
/// ```
/// use tactile_imaging::pipeline::ShapeProblem;
/// let problem = ShapeProblem::NoEdge { edge_ratio: 0.7 };
/// assert!(problem.to_string().contains("shape = \"sphere\""), "it says what to tell the program");
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize),
    serde(rename_all = "snake_case")
)]
#[non_exhaustive]
pub enum ShapeProblem {
    /// The pressure falls to zero at the outline, as a ball's does.
    NoEdge {
        /// Light just inside the outline over that further inside.
        edge_ratio: f64,
    },
    /// The pressure rises to the outline.
    RaisedEdge {
        /// Light just inside the outline over that further inside.
        edge_ratio: f64,
    },
    /// The frame's edge cuts the contact.
    Cut,
    /// There is more than one contact.
    Several {
        /// How many beside the largest.
        others: usize,
    },
    /// The contact is too small, or too irregular, to have an inside.
    TooSmall,
    /// The contact grows by more than a squeezed specimen's face.
    Grows {
        /// Relative growth of the area since the first load.
        growth: f64,
    },
    /// The outline does not keep its shape from load to load.
    OutlineChanges {
        /// Relative change of its second moment since the first load.
        change: f64,
    },
    /// The pressure does not keep its distribution from load to load.
    PressureChanges {
        /// Relative change of its second moment since the first load.
        change: f64,
    },
}

impl fmt::Display for ShapeProblem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoEdge { edge_ratio } => write!(
                f,
                "the pressure falls off towards the outline ({edge_ratio:.2} of that further inside), as under a ball: give shape = \"sphere\" with its radius_m"
            ),
            Self::RaisedEdge { edge_ratio } => write!(
                f,
                "the pressure rises towards the outline ({edge_ratio:.2} of that further inside), as under a stiff punch or a face that sticks: give shape = \"flat_punch\", or press with less friction"
            ),
            Self::Cut => write!(
                f,
                "the frame's edge cuts the contact: move the object, or give its shape and size if it is a ball"
            ),
            Self::Several { others } => write!(
                f,
                "there are {} contacts: press one face at a time, or give the shape if the others are not the object's",
                others + 1
            ),
            Self::TooSmall => write!(
                f,
                "the contact is too small for its outline to be told from its inside: it takes some 20 pixels across"
            ),
            Self::Grows { growth } => write!(
                f,
                "the contact grows by {:.0} % since the first load, more than a squeezed face: a round object; give its shape",
                100.0 * growth
            ),
            Self::OutlineChanges { change } => write!(
                f,
                "the outline does not keep its shape ({:+.1} % in second moment since the first load): no uniaxial load; give the object's shape",
                100.0 * change
            ),
            Self::PressureChanges { change } => write!(
                f,
                "the pressure does not keep its distribution ({:+.1} % in second moment since the first load): friction, tilt or an object of another shape",
                100.0 * change
            ),
        }
    }
}

/// What hinders reading a contact as a flat face. What the user has said of the shape is believed as far as the frame does not contradict it.
fn problem(contact: &ContactReading, object: Object) -> Result<FaceReading, ShapeProblem> {
    if contact.touches_edge {
        return Err(ShapeProblem::Cut);
    }
    if contact.other_contacts > 0 {
        let others = contact.other_contacts;
        return Err(ShapeProblem::Several { others });
    }
    let face = contact.face.ok_or(ShapeProblem::TooSmall)?;
    let edge_ratio = face.edge_ratio;
    if !has_edge(&face) {
        return Err(ShapeProblem::NoEdge { edge_ratio });
    }
    if sticks(&face) && matches!(object, Object::Unknown { .. }) {
        return Err(ShapeProblem::RaisedEdge { edge_ratio });
    }
    Ok(face)
}

/// Whether the outline is an edge, as that of a flat face, and no ball's.
pub(in crate::pipeline) fn has_edge(face: &FaceReading) -> bool {
    face.edge_ratio >= LEAST_EDGE_RATIO
}

/// Whether the pressure rises to the outline of a face that was said to be flat, as where it sticks to what it is pressed on.
pub(in crate::pipeline) fn sticks(face: &FaceReading) -> bool {
    face.edge_ratio > GREATEST_EDGE_RATIO
}

/// Whether the contacts are those of one flat face under uniaxial load; `frame` numbers go with the contacts.
///
/// # Errors
/// [`PipelineError::NotUniaxial`] of the first contact that is not.
pub(in crate::pipeline) fn check<'a>(
    contacts: impl Iterator<Item = (usize, &'a ContactReading)>,
    object: Object,
) -> Result<(), PipelineError> {
    let mut first: Option<FaceReading> = None;
    for (frame, contact) in contacts {
        let not = |problem| PipelineError::NotUniaxial { frame, problem };
        let face = problem(contact, object).map_err(not)?;
        let Some(first) = first else {
            first = Some(face);
            continue;
        };
        let growth = face.area_m2.value / first.area_m2.value - 1.0;
        if growth.abs() > GREATEST_GROWTH {
            return Err(not(ShapeProblem::Grows { growth }));
        }
        let change = face.outline_moment / first.outline_moment - 1.0;
        if change.abs() > OUTLINE_CHANGE {
            return Err(not(ShapeProblem::OutlineChanges { change }));
        }
        let change = face.light_moment / first.light_moment - 1.0;
        if change.abs() > LIGHT_CHANGE {
            return Err(not(ShapeProblem::PressureChanges { change }));
        }
    }
    Ok(())
}
