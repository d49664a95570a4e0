//! The modulus estimators: the default one, and those behind the names of a configuration.
use super::error::PipelineError;
use super::named::EstimatorChoice;
use super::specimen::Object;
use crate::elasticity::ElasticityError;
use crate::elasticity::contact::{Body, Bond, Waveguide};
use crate::elasticity::modulus::{
    BondedLayer, Cone, FlatPunch, HertzSphere, ModulusEstimator, PaperRatio, SphereOnWaveguide,
    StrainReference, StressStrainRegression,
};
use std::sync::{Arc, OnceLock};

/// An estimator that pipelines and their clones share.
pub type SharedEstimator = Arc<dyn ModulusEstimator + Send + Sync>;

/// The estimator where none is chosen. This is the place to change the default.
///
/// A ball: the linear contact with the waveguide's layers, or with a rigid flat, corrected for
/// finite strain. A sample on a rigid base, a cone: their own laws. Else stress over strain,
/// equation (31). Of a flat face regressed over all loads.
fn default_of(
    object: Object,
    waveguide: Option<&Waveguide>,
) -> Result<SharedEstimator, ElasticityError> {
    let nu = object.poisson_ratio();
    match object {
        Object::Sphere { radius_m, .. } => shared(on_waveguide(radius_m, nu, waveguide)?),
        Object::Layer {
            indenter_radius_m,
            thickness_m,
            ..
        } => BondedLayer::new(indenter_radius_m, thickness_m, nu, Bond::Bonded).and_then(shared),
        Object::Cone { half_angle_rad, .. } => shared(Cone::new(half_angle_rad, nu)?),
        Object::Block { .. } | Object::Cylinder { .. } | Object::Unknown { .. } => {
            shared(StressStrainRegression::default())
        }
        Object::FlatPunch { .. } => shared(paper_ratio(object)?),
    }
}

/// Estimators to lay beside the chosen one, the paper's ratio first. For a ball Hertz with the
/// layers in series.
pub fn that_fit(
    object: Object,
    waveguide: Option<&Waveguide>,
) -> Result<Vec<SharedEstimator>, PipelineError> {
    let nu = object.poisson_ratio();
    let build = || {
        let mut estimators = vec![shared(paper_ratio(object)?)?];
        match object {
            Object::FlatPunch { radius_m, .. } => {
                let punch = FlatPunch::new(radius_m, nu)?;
                estimators.push(shared(punch.with_other_body(pressed_on(waveguide)))?);
            }
            Object::Sphere { radius_m, .. } => {
                let ball = HertzSphere::new(radius_m, nu)?;
                estimators.push(shared(ball.with_other_body(pressed_on(waveguide)))?);
            }
            Object::Layer { .. } | Object::Cone { .. } => {
                estimators.push(default_of(object, waveguide)?);
            }
            Object::Block { .. } | Object::Cylinder { .. } | Object::Unknown { .. } => {}
        }
        estimators.push(shared(StressStrainRegression::default())?);
        Ok(estimators)
    };
    build().map_err(PipelineError::Material)
}

/// The estimator of a name.
fn named(
    choice: EstimatorChoice,
    object: Object,
    waveguide: Option<&Waveguide>,
) -> Result<SharedEstimator, PipelineError> {
    let needs = |needs| PipelineError::WrongEstimator {
        estimator: choice.name(),
        needs,
    };
    let nu = object.poisson_ratio();
    let radius = || {
        object
            .sphere_radius_m()
            .ok_or(needs("a ball as the object"))
    };
    let guide = pressed_on(waveguide);
    let built = match choice {
        EstimatorChoice::Best => default_of(object, waveguide),
        EstimatorChoice::PaperRatio => paper_ratio(object).and_then(shared),
        EstimatorChoice::Regression => shared(StressStrainRegression::default()),
        EstimatorChoice::Sphere => {
            HertzSphere::new(radius()?, nu).and_then(|e| shared(e.with_other_body(guide)))
        }
        EstimatorChoice::SphereOnWaveguide => {
            on_waveguide(radius()?, nu, waveguide).and_then(shared)
        }
        EstimatorChoice::TabulatedContact => {
            return Err(needs("a table of the ball's contacts"));
        }
        EstimatorChoice::FlatPunch => match object {
            Object::FlatPunch { radius_m, .. } => {
                FlatPunch::new(radius_m, nu).and_then(|e| shared(e.with_other_body(guide)))
            }
            _ => return Err(needs("a flat punch as the object")),
        },
        EstimatorChoice::Cone => match object {
            Object::Cone { .. } => default_of(object, waveguide),
            _ => return Err(needs("a cone as the object")),
        },
        EstimatorChoice::BondedLayer => match object {
            Object::Layer { .. } => default_of(object, waveguide),
            _ => return Err(needs("a layer as the object")),
        },
    };
    built.map_err(PipelineError::Material)
}

/// A ball on the layers of a waveguide. On a rigid flat where they are not known.
fn on_waveguide(
    radius_m: f64,
    poisson_ratio: f64,
    waveguide: Option<&Waveguide>,
) -> Result<SphereOnWaveguide, ElasticityError> {
    let rigid = Waveguide::rigid();
    let guide = waveguide.unwrap_or(&rigid);
    SphereOnWaveguide::new(radius_m, poisson_ratio, guide, Bond::Bonded)
}

/// Stress over strain, counted from the first load, as the paper matches two pressed frames.
fn paper_ratio(object: Object) -> Result<PaperRatio, ElasticityError> {
    let ratio = PaperRatio::default().with_reference(StrainReference::FirstLoad);
    match object.sphere_radius_m() {
        Some(radius_m) => ratio.with_sphere_radius(radius_m),
        None => Ok(ratio),
    }
}

/// What the sample is pressed on: the waveguide's layers in series, rigid without layers.
fn pressed_on(waveguide: Option<&Waveguide>) -> Body {
    waveguide.map_or_else(Body::rigid, Waveguide::as_body)
}

fn shared(
    estimator: impl ModulusEstimator + Send + Sync + 'static,
) -> Result<SharedEstimator, ElasticityError> {
    Ok(Arc::new(estimator))
}

/// A pipeline's estimator: given as a value, or by a name and then built from object and waveguide
/// when it is first needed.
#[derive(Clone)]
pub enum EstimatorStage {
    Given(SharedEstimator),
    Named {
        choice: EstimatorChoice,
        /// Clones share what is built: a law may hold tables.
        built: Arc<OnceLock<Result<SharedEstimator, PipelineError>>>,
    },
}

impl EstimatorStage {
    pub fn named(choice: EstimatorChoice) -> Self {
        Self::Named {
            choice,
            built: Arc::default(),
        }
    }

    /// The object or the waveguide has changed: a named estimator is built anew.
    pub fn renew(&mut self) {
        if let Self::Named { choice, .. } = *self {
            *self = Self::named(choice);
        }
    }

    pub fn get(
        &self,
        object: Object,
        waveguide: Option<&Waveguide>,
    ) -> Result<SharedEstimator, PipelineError> {
        match self {
            Self::Given(estimator) => Ok(Arc::clone(estimator)),
            Self::Named { choice, built } => built
                .get_or_init(|| named(*choice, object, waveguide))
                .clone(),
        }
    }
}
