//! The kind of specimen: curved, or with a flat face.
use super::contact::ContactReading;
use super::error::PipelineError;
use super::flag::Flag;
use super::strain::PairStrain;
use crate::elasticity::field::StrainField;
pub use crate::elasticity::modulus::Object;
use crate::elasticity::modulus::{Estimate, LoadSeries, LoadState, UniaxialLoads};
use crate::elasticity::strain::StrainMeasure;
use crate::force::{FaceReading, ShapeProblem};
use nalgebra::Matrix3;

/// The kind of specimen, decided once at the start of a press or a session.
#[derive(Clone, Copy, Debug)]
pub(super) enum Specimen {
    /// Strain follows from the surface reconstructed from the light.
    Curved,
    /// Strain follows from the area of the face.
    Flat(FlatSpecimen),
}

impl Specimen {
    pub(super) fn of(object: Object) -> Self {
        match object {
            Object::Block { poisson_ratio }
            | Object::Cylinder { poisson_ratio }
            | Object::Unknown { poisson_ratio } => Self::Flat(FlatSpecimen {
                poisson_ratio,
                stated: !matches!(object, Object::Unknown { .. }),
            }),
            _ => Self::Curved,
        }
    }
}

/// A specimen with a flat face under uniaxial load.
#[derive(Clone, Copy, Debug)]
pub(super) struct FlatSpecimen {
    pub poisson_ratio: f64,
    /// Whether the user stated that the face is flat. The statement is accepted unless the frame
    /// contradicts it.
    pub stated: bool,
}

impl FlatSpecimen {
    /// The contact as a flat face, or the reason why it cannot be one.
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

    /// Rejects contacts that are not those of one flat face under uniaxial load. The contacts come
    /// with their frame numbers.
    ///
    /// # Errors
    /// [`PipelineError::NotUniaxial`] for the first contact that is not.
    pub(super) fn check<'a>(
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

    /// The strain between two loads, uniform and derived from the growth of the face's area.
    pub(super) fn strain(
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
            load.contact_area_m2 = contact.face.map(|face| face.area_m2.into());
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
            .fold(0.0, |sum: f64, strain| sum.hypot(strain.standard_error()));
        summary.standard_error = Matrix3::from_diagonal(&[nu * error, nu * error, error].into());
        Ok(PairStrain {
            measure: measure.name(),
            field,
            summary,
        })
    }

    /// The loads, with areas converted to strains since the unloaded state.
    pub(super) fn strained(
        self,
        series: &LoadSeries,
        measure: &dyn StrainMeasure,
    ) -> Result<LoadSeries, PipelineError> {
        let uniaxial = UniaxialLoads::new(series, self.poisson_ratio, measure);
        Ok(uniaxial.map_err(PipelineError::Modulus)?.series)
    }
}

// Relative excess of the conjugate stress over E e at which the law of a sample matters. With S = E
// (e + c e²), the ratio S/e is off by c e, and the slope of a line with a free intercept by up to
// twice this: 5 %, the error that the paper reports.
const LARGEST_EXCESS: f64 = 0.025;

/// A caution if the ratio of a rubber-like sample at this strain would be off by more than 2.5 %,
/// or a slope by 5 %. Also a caution if the measure has no conjugate stress, so that this cannot be
/// assessed.
pub(super) fn material_law(measure: &dyn StrainMeasure, strain: f64) -> Option<Flag> {
    // Without strain there is no division by it.
    if strain == 0.0 || strain.is_nan() {
        return None;
    }
    match UniaxialLoads::neo_hookean_excess(measure, strain) {
        Ok(excess) if excess.abs() > LARGEST_EXCESS => Some(Flag::MaterialLaw { strain, excess }),
        Ok(_) => None,
        Err(_) => Some(Flag::MaterialLawNotJudged { strain }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::elasticity::ElasticityError;
    use crate::elasticity::strain::{Biot, Deformation, GreenLagrange, Hencky};

    #[test]
    fn small_strains_and_logarithmic_ones_give_the_modulus() {
        for strain in [-1e-3, 1e-3, -0.008, f64::NAN, 0.0] {
            assert_eq!(material_law(&GreenLagrange, strain), None);
        }
        assert_eq!(material_law(&Hencky, -0.04), None);
    }

    fn excess(measure: &dyn StrainMeasure, strain: f64) -> f64 {
        match material_law(measure, strain) {
            Some(Flag::MaterialLaw { excess, .. }) => excess,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn the_excess_is_that_of_the_expansion() {
        // S/e = E (1 − 5e/2 + …) for Green–Lagrange and E (1 + e/2 + …) for Hencky. The next terms
        // are of order e².
        for strain in [-0.03, -0.06] {
            let error = excess(&GreenLagrange, strain) + 2.5 * strain;
            assert!(error.abs() < 10.0 * strain * strain, "{error}");
        }
        let error = excess(&Hencky, -0.12) + 0.06;
        assert!(error.abs() < 0.12 * 0.12, "{error}");
    }

    /// A user-defined measure: a multiple of another one, or mixed across the axes.
    struct Own {
        across: f64,
    }

    impl StrainMeasure for Own {
        fn of(&self, deformation: &Deformation) -> Result<Matrix3<f64>, ElasticityError> {
            let biot = Biot.of(deformation)?;
            Ok(biot + Matrix3::identity() * (self.across * biot.trace()))
        }

        fn name(&self) -> &'static str {
            "own"
        }
    }

    #[test]
    fn a_measure_of_ones_own_is_judged_by_its_conjugate_or_not_at_all() {
        let [own, biot] = [&Own { across: 0.0 } as &dyn StrainMeasure, &Biot];
        assert_eq!(excess(own, -0.06), excess(biot, -0.06));
        assert!(excess(biot, -0.06) < 0.5 * excess(&GreenLagrange, -0.06));
        let strain = -0.06;
        let mixed = material_law(&Own { across: 0.1 }, strain);
        assert_eq!(mixed, Some(Flag::MaterialLawNotJudged { strain }));
    }
}
