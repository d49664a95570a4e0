//! From two sets of control points to match, displacement and strain.
use super::composition::Pipeline;
use super::error::PipelineError;
use super::strain_error::mean_strain_error;
use super::surface::ControlPoints;
use crate::elasticity::field::{StrainField, StrainSummary};
use crate::elasticity::modulus::Estimate;
use crate::matching::Matching;
use nalgebra::{Matrix3, Point3};

/// Fewest matches from which a strain is worked out: twice the four affine terms of a spline in space.
pub(crate) const LEAST_MATCHES: usize = 8;

/// The strain between two frames.
///
/// ```
/// # use tactile_imaging::{pipeline::Trial, simulate::{CalibrationOptions, Camera, PressOptions}};
/// # let camera = Camera { shape: [130, 174], pixel_size_m: [172.4e-6; 2], ..Camera::default() };
/// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationOptions::default())?;
/// use tactile_imaging::pipeline::PairStrain;
/// let pipeline = trial.pipeline()?.with_control_points(60);
/// let mut press = trial.press(&pipeline)?;
/// let strain: &PairStrain = press.strain(1)?;
/// assert_eq!(strain.field.strains().len(), 60, "one at every control point of the first frame");
/// let found = strain.summary.mean[(0, 0)];
/// assert!((found - trial.truth().strain.expect("two frames")[0][0]).abs() < 0.03);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct PairStrain {
    /// Name of the measure.
    pub measure: &'static str,
    /// Strain at every control point of the first frame.
    pub field: StrainField<f64>,
    /// Mean, spread and standard error.
    pub summary: StrainSummary<f64>,
}

impl PairStrain {
    /// The strain of a load for equation (31), which takes the size of the mean e_zz: the sign says whether the load rose from the first
    /// frame to the second, by `force_step_n`.
    pub(super) fn of_load(&self, force_step_n: f64) -> Estimate<f64> {
        let size = self.summary.mean[(2, 2)].abs();
        let error = self.summary.standard_error[(2, 2)];
        Estimate::new(size.copysign(force_step_n), error)
    }
}

/// Strain, at the first frame's control points, of the warp through the matches, weighted by their confidence.
///
/// The matcher's own warp follows every point; its gradient across a surface, where no two points lie behind each other,
/// would be noise. The warp fitted here is smooth.
pub(super) fn strain(
    pipeline: &Pipeline,
    frames: [usize; 2],
    model: &ControlPoints,
    target: &[Point3<f64>],
    matching: &Matching<f64, 3>,
) -> Result<PairStrain, PipelineError> {
    let [from, to] = frames;
    let ControlPoints {
        points: model,
        grid_m,
    } = model;
    let pairs = matching
        .assignment
        .iter()
        .enumerate()
        .filter_map(|(i, a)| a.map(|j| (i, j)));
    let pairs: Vec<_> = pairs
        .filter(|&(i, _)| matching.confidence[i] > 0.0)
        .collect();
    if pairs.len() < LEAST_MATCHES {
        return Err(PipelineError::TooFewMatches {
            from,
            to,
            expected: LEAST_MATCHES,
            found: pairs.len(),
        });
    }
    let sources: Vec<_> = pairs.iter().map(|&(i, _)| model[i]).collect();
    let targets: Vec<_> = pairs.iter().map(|&(_, j)| target[j]).collect();
    let weights: Vec<_> = pairs.iter().map(|&(i, _)| matching.confidence[i]).collect();
    let warp = pipeline
        .warp()
        .fit(&sources, &targets, Some(&weights))
        .map_err(|source| PipelineError::Warp { from, to, source })?;
    let mut gradients = vec![Matrix3::zeros(); model.len()];
    warp.jacobian_into(model, &mut gradients)
        .map_err(|source| PipelineError::Warp { from, to, source })?;
    gradients.iter_mut().for_each(|g| *g -= Matrix3::identity());
    let measure = pipeline.strain();
    let field = StrainField::from_gradients(&gradients, None, measure)
        .map_err(|source| PipelineError::Strain { from, to, source })?;
    let mut summary = field.summary();
    let noise = mean_strain_error(&sources, &targets, *grid_m);
    summary
        .standard_error
        .zip_apply(&noise, |error, noise| *error = error.hypot(noise));
    Ok(PairStrain {
        measure: measure.name(),
        summary,
        field,
    })
}
