//! What is pressed, and the modulus estimators that fit it.
use crate::elasticity::ElasticityError;
use crate::elasticity::contact::Waveguide;
use crate::elasticity::modulus::{
    Evidence, FlatPunch, HertzSphere, LoadState, ModulusEstimate, ModulusEstimator, PaperRatio,
    StrainReference, StressStrainRegression,
};

/// The pressed object, as far as it is known.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "shape", rename_all = "snake_case"))]
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
    /// Nothing is known of its shape: stress over strain is all there is.
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
        Self::Sphere { radius_m, poisson_ratio: Self::DEFAULT_POISSON_RATIO }
    }

    /// The radius of a ball.
    pub fn sphere_radius_m(&self) -> Option<f64> {
        if let Self::Sphere { radius_m, .. } = self { Some(*radius_m) } else { None }
    }

    /// Whether the estimator that fits this object best looks at strain; a ball's looks at the contact alone.
    pub fn needs_strain(&self) -> bool {
        !matches!(self, Self::Sphere { .. })
    }
}

/// Relative errors that all loads share.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct SharedErrors {
    /// Of the forces: the calibration's own.
    pub force: f64,
    /// Of the lengths: the pixel size's.
    pub length: f64,
}

type Attempt = Result<ModulusEstimate<f64>, ElasticityError>;

/// The estimate that fits the object best.
pub(crate) fn best_estimate(
    object: &Object,
    waveguide: Option<&Waveguide<f64>>,
    loads: &[LoadState<f64>],
    shared: SharedErrors,
) -> Attempt {
    match *object {
        Object::Sphere { radius_m, poisson_ratio } => {
            hertz(radius_m, poisson_ratio, waveguide, shared, Evidence::All)?.estimate(loads)
        }
        _ => paper_ratio(object, shared)?.estimate(loads),
    }
}

/// Every estimate that the loads allow: the paper's ratio first, then the others that make sense for the object. What an
/// estimator cannot do with these loads is left out.
pub(crate) fn all_estimates(
    object: &Object,
    waveguide: Option<&Waveguide<f64>>,
    loads: &[LoadState<f64>],
    shared: SharedErrors,
) -> Vec<ModulusEstimate<f64>> {
    let mut attempts: Vec<Attempt> = vec![paper_ratio(object, shared).and_then(|e| e.estimate(loads))];
    match *object {
        Object::Sphere { radius_m, poisson_ratio } => {
            let both = hertz(radius_m, poisson_ratio, waveguide, shared, Evidence::All);
            attempts.push(both.and_then(|e| e.estimate(loads)));
        }
        Object::FlatPunch { radius_m, poisson_ratio } => {
            let punch =
                FlatPunch::new(radius_m, poisson_ratio).and_then(|p| p.with_force_scale_error(shared.force));
            let punch = punch.map(|p| match waveguide {
                Some(w) => p.with_waveguide(w),
                None => p,
            });
            attempts.push(punch.and_then(|e| e.estimate(loads)));
        }
        Object::Unknown { .. } => {}
    }
    let regression = StressStrainRegression::new().with_stress_scale_error(shared.force);
    attempts.push(regression.and_then(|e| e.estimate(loads)));
    attempts.into_iter().filter_map(Result::ok).collect()
}

fn hertz(
    radius_m: f64,
    poisson_ratio: f64,
    waveguide: Option<&Waveguide<f64>>,
    shared: SharedErrors,
    evidence: Evidence,
) -> Result<HertzSphere, ElasticityError> {
    let estimator = HertzSphere::new(radius_m, poisson_ratio)?
        .with_evidence(evidence)
        .with_force_scale_error(shared.force)?
        .with_length_scale_error(shared.length)?;
    Ok(match waveguide {
        Some(waveguide) => estimator.with_waveguide(waveguide),
        None => estimator,
    })
}

/// Stress over strain, counted from the first load, as the paper matches two pressed frames.
fn paper_ratio(object: &Object, shared: SharedErrors) -> Result<PaperRatio, ElasticityError> {
    let ratio = PaperRatio::new().with_reference(StrainReference::FirstLoad);
    let ratio = ratio.with_stress_scale_error(shared.force)?;
    match object.sphere_radius_m() {
        Some(radius_m) => ratio.with_sphere_radius(radius_m),
        None => Ok(ratio),
    }
}
