//! From two sets of control points to match, displacement and strain.
use super::composition::Pipeline;
use super::contact::ContactReading;
use super::error::PipelineError;
use super::face;
use super::surface::ControlPoints;
use crate::elasticity::field::{StrainField, StrainSummary, mean_strain_error};
use crate::elasticity::modulus::{Estimate, LoadSeries, LoadState, UniaxialLoads};
use crate::tps::{Pairs, SeriesMemory, StrainSpline};
use nalgebra::{Matrix3, Point3};

/// Fewest matches from which a strain is worked out: twice the four affine terms of a spline in space.
pub(crate) const LEAST_MATCHES: usize = 8;

/// The strain between two frames.
///
/// ```
/// # use tactile_simulate::{Trial, CalibrationRun, Camera, PressOptions};
/// # let camera = Camera::default().coarser(8);
/// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationRun::default())?;
/// use tactile_imaging::pipeline::PairStrain;
/// let pipeline = trial.pipeline()?.with_control_points(60);
/// let mut press = trial.press(&pipeline)?;
/// let strain: &PairStrain = press.strain(1)?;
/// assert_eq!(strain.field.strains.len(), 60, "one at every control point of the first frame");
/// let found = strain.summary.mean[(0, 0)];
/// let [first, last] = [&trial.simulation.truth[0], &trial.simulation.truth[1]];
/// assert!((found - first.scaling_to(last).green_lagrange_strain()[(0, 0)]).abs() < 0.03);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct PairStrain {
    /// Name of the measure.
    pub measure: &'static str,
    /// Strain at every control point of the first frame.
    pub field: StrainField,
    /// Mean, spread and standard error.
    pub summary: StrainSummary,
}

impl PairStrain {
    /// No strain yet, to be filled.
    pub(super) fn empty() -> Self {
        let field = StrainField::default();
        Self {
            measure: "",
            summary: field.summary(),
            field,
        }
    }

    /// The apparent strain of a ball's load for equation (31). The surface that its pressure is read as swells where the load rises, in all directions,
    /// so that (31) takes the size of the mean e_zz, with the sign of `force_step_n`, the step of the load from the first frame to the second.
    /// (Specimens with a flat face have signed strains, from [`of_faces`].)
    pub(super) fn of_load(&self, force_step_n: f64) -> Estimate {
        let size = self.summary.mean[(2, 2)].abs();
        let error = self.summary.standard_error[(2, 2)];
        Estimate::new(size.copysign(force_step_n), error)
    }
}

/// The strain between two loads of a specimen with a flat face: the same everywhere, from the growth of its area.
pub(super) fn of_faces(
    pipeline: &Pipeline,
    [from, to]: [usize; 2],
    readings: [&ContactReading; 2],
    poisson_ratio: f64,
) -> Result<PairStrain, PipelineError> {
    let numbered = [from, to].into_iter().zip(readings);
    face::check(numbered, pipeline.settings().object)?;
    let mut loads = [LoadState::new(Estimate::exact(0.0)); 2];
    for ((load, reading), frame) in loads.iter_mut().zip(readings).zip([from, to]) {
        let force = reading.force_n.ok_or(PipelineError::NoForce { frame })?;
        load.force_n = force;
        load.contact_area_m2 = reading
            .face
            .map(|face| Estimate::new(face.area_m2.value, face.area_m2.standard_error));
    }
    let failed = |source| PipelineError::Strain { from, to, source };
    let measure = pipeline.strain();
    let series = LoadSeries::new(loads);
    let uniaxial = UniaxialLoads::new(&series, poisson_ratio, measure).map_err(failed)?;
    let [first, last] = [0, 1].map(|k| uniaxial.stretches[k]);
    let [lateral, axial] = [0, 1].map(|k| last[k] / first[k] - 1.0);
    let gradient = Matrix3::from_diagonal(&[lateral, lateral, axial].into());
    let field = StrainField::from_gradients(&[gradient], None, measure).map_err(failed)?;
    let mut summary = field.summary();
    let strains = uniaxial.series.loads().iter().map(|load| load.mean_strain);
    let error = strains
        .flatten()
        .fold(0.0, |sum: f64, strain| sum.hypot(strain.standard_error));
    let errors = [poisson_ratio * error, poisson_ratio * error, error];
    summary.standard_error = Matrix3::from_diagonal(&errors.into());
    Ok(PairStrain {
        measure: measure.name(),
        field,
        summary,
    })
}

/// The pairs of a match between the control points of two frames.
#[derive(Clone, Copy)]
pub(super) struct MatchedPoints<'a> {
    pub(super) model: &'a ControlPoints,
    pub(super) target: &'a [Point3<f64>],
    /// For every point of the model.
    pub(super) assignment: &'a [Option<usize>],
    pub(super) confidence: &'a [f64],
}

/// What strains reuse from pair to pair.
#[derive(Default)]
pub(super) struct StrainWorkspace {
    warp: SeriesMemory,
    sources: Vec<Point3<f64>>,
    targets: Vec<Point3<f64>>,
    weights: Vec<f64>,
    gradients: Vec<Matrix3<f64>>,
}

impl StrainWorkspace {
    /// Takes the pairs of a match.
    fn take(&mut self, matched: &MatchedPoints<'_>) {
        self.sources.clear();
        self.targets.clear();
        self.weights.clear();
        let points = matched.model.points.iter().zip(matched.assignment);
        for ((source, partner), &weight) in points.zip(matched.confidence) {
            let partner = partner.and_then(|partner| matched.target.get(partner));
            if let Some(target) = partner.filter(|_| weight > 0.0) {
                self.sources.push(*source);
                self.targets.push(*target);
                self.weights.push(weight);
            }
        }
    }

    /// Strain, at the first frame's control points, of the warp through the matches, weighted by their confidence.
    ///
    /// The matcher's own warp follows every point; its gradient across a surface, where no two points lie behind each other,
    /// would be noise. The warp fitted here is smooth.
    pub(super) fn strain(
        &mut self,
        pipeline: &Pipeline,
        [from, to]: [usize; 2],
        matched: &MatchedPoints<'_>,
        strain: &mut PairStrain,
    ) -> Result<(), PipelineError> {
        self.take(matched);
        if self.sources.len() < LEAST_MATCHES {
            return Err(PipelineError::TooFewMatches {
                from,
                to,
                expected: LEAST_MATCHES,
                found: self.sources.len(),
            });
        }
        let model = &matched.model.points;
        self.gradients.clear();
        self.gradients.resize(model.len(), Matrix3::zeros());
        let pairs = Pairs {
            sources: &self.sources,
            targets: &self.targets,
            weights: Some(&self.weights),
        };
        pipeline
            .warp()
            .jacobians_through(&mut self.warp, pairs, model, &mut self.gradients)
            .map_err(|source| PipelineError::Warp { from, to, source })?;
        let gradients = self.gradients.iter_mut();
        gradients.for_each(|g| *g -= Matrix3::identity());
        let measure = pipeline.strain();
        strain
            .field
            .set_gradients(&self.gradients, None, measure)
            .map_err(|source| PipelineError::Strain { from, to, source })?;
        strain.measure = measure.name();
        strain.summary = strain.field.summary();
        let noise = mean_strain_error(
            &self.sources,
            &self.targets,
            matched.model.grid_m,
            StrainSpline::RUN_LENGTH,
        );
        let errors = &mut strain.summary.standard_error;
        errors.zip_apply(&noise, |error, noise| *error = error.hypot(noise));
        Ok(())
    }
}
