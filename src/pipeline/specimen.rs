//! The pressed object, and the decision that follows from it: a curved specimen or one with a flat
//! face.
use super::contact::ContactReading;
use super::error::PipelineError;
use super::flag::Flag;
use super::strain::PairStrain;
use crate::elasticity::field::StrainField;
use crate::elasticity::modulus::{
    Cone, Estimate, HertzSphere, LoadSeries, LoadState, UniaxialLoads,
};
use crate::elasticity::strain::StrainMeasure;
use crate::force::{FaceReading, ShapeProblem};
use nalgebra::Matrix3;

/// The pressed object, as far as it is known.
///
/// ```
/// use tactile_imaging::Object;
/// let ball = Object::sphere(3e-3);
/// assert_eq!(
///     ball,
///     Object::Sphere {
///         radius_m: 3e-3,
///         poisson_ratio: Object::DEFAULT_POISSON_RATIO
///     }
/// );
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize),
    serde(tag = "shape", rename_all = "snake_case")
)]
#[non_exhaustive]
pub enum Object {
    /// A ball.
    Sphere {
        /// Its radius in metres.
        radius_m: f64,
        /// Its Poisson ratio.
        poisson_ratio: f64,
    },
    /// A flat-ended cylinder: loaded uniaxially.
    FlatPunch {
        /// Its radius in metres.
        radius_m: f64,
        /// Its Poisson ratio.
        poisson_ratio: f64,
    },
    /// A block with a flat face of any outline, squeezed between the sensor and a plate: loaded
    /// uniaxially.
    Block {
        /// Its Poisson ratio.
        poisson_ratio: f64,
    },
    /// A cylinder standing on its flat face, squeezed between the sensor and a plate: loaded
    /// uniaxially.
    Cylinder {
        /// Its Poisson ratio.
        poisson_ratio: f64,
    },
    /// A thin flat sample, bonded to a rigid base and pressed by a rigid ball: the sensor's own
    /// gel, for instance.
    Layer {
        /// The ball's radius in metres.
        indenter_radius_m: f64,
        /// The sample's thickness in metres.
        thickness_m: f64,
        /// The sample's Poisson ratio.
        poisson_ratio: f64,
    },
    /// A deep sample, pressed by a rigid cone.
    Cone {
        /// Half of the cone's opening angle, from its axis, in radians.
        half_angle_rad: f64,
        /// The sample's Poisson ratio.
        poisson_ratio: f64,
    },
    /// Nothing is known of its shape: it is read as a block where its contacts are those of a flat
    /// face, and refused where not.
    Unknown {
        /// Its Poisson ratio.
        poisson_ratio: f64,
    },
}

impl Object {
    /// Poisson's ratio where none is given: rubber, incompressible.
    pub const DEFAULT_POISSON_RATIO: f64 = 0.5;

    /// A rubber ball of this radius in metres.
    pub fn sphere(radius_m: f64) -> Self {
        Self::Sphere {
            radius_m,
            poisson_ratio: Self::DEFAULT_POISSON_RATIO,
        }
    }

    /// The radius of a ball.
    pub(crate) fn sphere_radius_m(&self) -> Option<f64> {
        if let Self::Sphere { radius_m, .. } = self {
            Some(*radius_m)
        } else {
            None
        }
    }

    /// Its Poisson ratio.
    pub(super) fn poisson_ratio(&self) -> f64 {
        match self {
            Self::Sphere { poisson_ratio, .. }
            | Self::FlatPunch { poisson_ratio, .. }
            | Self::Layer { poisson_ratio, .. }
            | Self::Cone { poisson_ratio, .. }
            | Self::Block { poisson_ratio }
            | Self::Cylinder { poisson_ratio }
            | Self::Unknown { poisson_ratio } => *poisson_ratio,
        }
    }

    /// How the object is read.
    pub(super) fn specimen(self) -> Specimen {
        match self {
            Self::Block { poisson_ratio }
            | Self::Cylinder { poisson_ratio }
            | Self::Unknown { poisson_ratio } => {
                let stated = !matches!(self, Self::Unknown { .. });
                Specimen::Flat(FlatSpecimen {
                    poisson_ratio,
                    stated,
                })
            }
            _ => Specimen::Curved,
        }
    }

    /// Refuses what is not physical.
    pub(super) fn checked(self) -> Result<Self, PipelineError> {
        let nu = self.poisson_ratio();
        let with_length = |length_m| HertzSphere::new(length_m, nu).map(drop);
        let checked = match self {
            Self::Sphere { radius_m, .. } | Self::FlatPunch { radius_m, .. } => {
                with_length(radius_m)
            }
            Self::Layer {
                indenter_radius_m,
                thickness_m,
                ..
            } => with_length(indenter_radius_m).and_then(|()| with_length(thickness_m)),
            Self::Cone { half_angle_rad, .. } => Cone::new(half_angle_rad, nu).map(drop),
            Self::Block { .. } | Self::Cylinder { .. } | Self::Unknown { .. } => with_length(1.0),
        };
        checked.map(|()| self).map_err(PipelineError::Material)
    }
}

/// How an object is read, decided once where a press or a session begins.
#[derive(Clone, Copy, Debug)]
pub enum Specimen {
    /// Strain is that of the surface reconstructed from the light.
    Curved,
    /// Strain is that of the face's area.
    Flat(FlatSpecimen),
}

/// A specimen with a flat face under uniaxial load.
#[derive(Clone, Copy, Debug)]
pub struct FlatSpecimen {
    pub poisson_ratio: f64,
    /// Whether the user has stated that its face is flat. The statement is believed as far as the
    /// frame does not contradict it.
    pub stated: bool,
}

impl FlatSpecimen {
    /// What hinders reading a contact as a flat face.
    fn face_of(self, contact: &ContactReading) -> Result<FaceReading, ShapeProblem> {
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
        if face.sticks() && !self.stated {
            return Err(ShapeProblem::RaisedEdge { edge_ratio });
        }
        Ok(face)
    }

    /// Refuses contacts that are not those of one flat face under uniaxial load. `frame` numbers go
    /// with the contacts.
    ///
    /// # Errors
    /// [`PipelineError::NotUniaxial`] of the first contact that is not.
    pub fn check<'a>(
        self,
        contacts: impl IntoIterator<Item = (usize, &'a ContactReading)>,
    ) -> Result<(), PipelineError> {
        let mut first: Option<FaceReading> = None;
        for (frame, contact) in contacts {
            let not = |problem| PipelineError::NotUniaxial { frame, problem };
            let face = self.face_of(contact).map_err(not)?;
            face.check_against(first.get_or_insert(face)).map_err(not)?;
        }
        Ok(())
    }

    /// The strain between two loads: the same everywhere, from the growth of the face's area.
    pub fn strain(
        self,
        [from, to]: [usize; 2],
        contacts: [&ContactReading; 2],
        measure: &dyn StrainMeasure,
    ) -> Result<PairStrain, PipelineError> {
        let nu = self.poisson_ratio;
        self.check([from, to].into_iter().zip(contacts))?;
        let mut loads = [LoadState::new(Estimate::exact(0.0)); 2];
        for ((load, contact), frame) in loads.iter_mut().zip(contacts).zip([from, to]) {
            let force = contact.force_n.ok_or(PipelineError::NoForce { frame })?;
            load.force_n = force;
            load.contact_area_m2 = contact.face.map(|face| face.area_m2);
        }
        let failed = |source| PipelineError::Strain { from, to, source };
        let uniaxial = UniaxialLoads::new(&LoadSeries::new(loads), nu, measure).map_err(failed)?;
        let [first, last] = [0, 1].map(|k| uniaxial.stretches[k]);
        let [lateral, axial] = [0, 1].map(|k| last[k] / first[k] - 1.0);
        let gradient = Matrix3::from_diagonal(&[lateral, lateral, axial].into());
        let field = StrainField::from_gradients(&[gradient], None, measure).map_err(failed)?;
        let mut summary = field.summary();
        let strains = uniaxial.series.loads().iter().map(|load| load.mean_strain);
        let error = strains
            .flatten()
            .fold(0.0, |sum: f64, strain| sum.hypot(strain.standard_error));
        summary.standard_error = Matrix3::from_diagonal(&[nu * error, nu * error, error].into());
        Ok(PairStrain {
            measure: measure.name(),
            field,
            summary,
        })
    }

    /// Loads whose areas are turned into strains since the unloaded state.
    pub fn strained(
        self,
        series: &LoadSeries,
        measure: &dyn StrainMeasure,
    ) -> Result<LoadSeries, PipelineError> {
        let uniaxial = UniaxialLoads::new(series, self.poisson_ratio, measure);
        Ok(uniaxial.map_err(PipelineError::Modulus)?.series)
    }
}

/// A caution where a rubber-like sample, squeezed to this strain of the measure of this name, would
/// give a ratio that is off by more than 2.5 %, or a slope by 5 %.
///
/// An incompressible neo-Hookean solid has the nominal stress P = E (λ − λ⁻²)/3, its conjugate
/// stress to a measure e(λ) is S = P dλ/de, and S/e is E at small strain alone: at e = −9 % it is
/// 1.25 E for Green–Lagrange's measure, 0.96 E for Hencky's.
pub fn material_law(measure: &str, strain: f64) -> Option<Flag> {
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
    // With S = E (e + c e²) the ratio S/e is off by c e and the slope of a line with an intercept
    // of its own by up to twice that: 5 %, the error that the paper reports.
    (excess.abs() > 0.025).then_some(Flag::MaterialLaw { strain, excess })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_strains_and_logarithmic_ones_give_the_modulus() {
        for strain in [-1e-3, 1e-3, -0.008] {
            assert_eq!(material_law("Green-Lagrange", strain), None);
        }
        assert_eq!(material_law("Hencky", -0.04), None);
        for strain in [f64::NAN, 0.0] {
            assert_eq!(material_law("Green-Lagrange", strain), None);
        }
    }

    #[test]
    fn the_excess_is_that_of_the_expansion() {
        // S/e = E (1 − 5e/2 + …) for Green–Lagrange, E (1 + e/2 + …) for Hencky: the next terms are
        // of some e².
        let excess = |measure, strain| match material_law(measure, strain) {
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
