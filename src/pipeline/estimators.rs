//! The modulus estimators: the default, and those selected by name in a configuration.
use super::error::PipelineError;
use super::specimen::Object;
use super::stage_names::EstimatorChoice;
use crate::elasticity::ElasticityError;
use crate::elasticity::contact::{Bond, Waveguide};
use crate::elasticity::modulus::{
    Bodies, BondedLayer, Cone, EstimatorKind, FlatPunch, HertzSphere, LoadSeries, ModulusEstimate,
    ModulusEstimator, PaperRatio, SphereOnWaveguide, StrainReference, StressStrainRegression,
    Warning,
};
use std::sync::{Arc, OnceLock};

/// An estimator, shared by pipelines and their clones.
pub(super) type SharedEstimator = Arc<dyn ModulusEstimator + Send + Sync>;

/// The default estimator. To change the default, change it here.
///
/// For a ball it is the linear contact with the waveguide's layers, or with a rigid flat, corrected
/// for finite strain. A sample on a rigid base and a cone have their own laws. For any other object
/// it is stress over strain, equation (31); for a flat face, this ratio regressed over all loads.
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
        Object::FlatPunch { .. } => shared(paper_ratio(object)?),
        _ => shared(StressStrainRegression),
    }
}

/// Estimators shown next to the chosen one, the paper's ratio first. For a ball Hertz's law with
/// the layers in series is included.
pub(super) fn that_fit(
    object: Object,
    waveguide: Option<&Waveguide>,
) -> Result<Vec<SharedEstimator>, PipelineError> {
    let nu = object.poisson_ratio();
    let build = || {
        let mut estimators = vec![shared(paper_ratio(object)?)?];
        match object {
            Object::FlatPunch { radius_m, .. } => {
                estimators.push(shared(FlatPunch::new(radius_m, nu)?)?);
            }
            Object::Sphere { radius_m, .. } => {
                estimators.push(shared(HertzSphere::new(radius_m, nu)?)?);
            }
            Object::Layer { .. } | Object::Cone { .. } => {
                estimators.push(default_of(object, waveguide)?);
            }
            _ => {}
        }
        estimators.push(shared(StressStrainRegression)?);
        Ok(estimators)
    };
    let bodies = Arc::new(Bodies::new(object, waveguide.cloned()));
    let estimators = build().map_err(PipelineError::Material)?;
    let completed = |estimator| Completed::of(estimator, Arc::clone(&bodies));
    Ok(estimators.into_iter().map(completed).collect())
}

/// The estimator with a given name.
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
    let built = match choice {
        EstimatorChoice::Best => default_of(object, waveguide),
        EstimatorChoice::PaperRatio => paper_ratio(object).and_then(shared),
        EstimatorChoice::Regression => shared(StressStrainRegression),
        EstimatorChoice::Sphere => HertzSphere::new(radius()?, nu).and_then(shared),
        EstimatorChoice::SphereOnWaveguide => {
            on_waveguide(radius()?, nu, waveguide).and_then(shared)
        }
        EstimatorChoice::TabulatedContact => {
            return Err(needs("a table of the ball's contacts"));
        }
        EstimatorChoice::FlatPunch => match object {
            Object::FlatPunch { radius_m, .. } => FlatPunch::new(radius_m, nu).and_then(shared),
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

/// A ball on the layers of a waveguide, or on a rigid flat if the layers are unknown.
fn on_waveguide(
    radius_m: f64,
    poisson_ratio: f64,
    waveguide: Option<&Waveguide>,
) -> Result<SphereOnWaveguide, ElasticityError> {
    let rigid = Waveguide::rigid();
    let guide = waveguide.unwrap_or(&rigid);
    SphereOnWaveguide::new(radius_m, poisson_ratio, guide, Bond::Bonded)
}

/// Stress over strain, counted from the first load, because the paper matches two pressed frames.
fn paper_ratio(object: Object) -> Result<PaperRatio, ElasticityError> {
    let ratio = PaperRatio::default().with_reference(StrainReference::FirstLoad);
    match object.sphere_radius_m() {
        Some(radius_m) => ratio.with_sphere_radius(radius_m),
        None => Ok(ratio),
    }
}

fn shared(estimator: impl ModulusEstimator + 'static) -> Result<SharedEstimator, ElasticityError> {
    Ok(Arc::new(estimator))
}

/// An estimator that adds the object and the guide to loads that lack them.
struct Completed {
    estimator: SharedEstimator,
    bodies: Arc<Bodies>,
}

impl Completed {
    fn of(estimator: SharedEstimator, bodies: Arc<Bodies>) -> SharedEstimator {
        Arc::new(Self { estimator, bodies })
    }

    /// Whether the result uses contacts on a compliant guide but ignores the guide.
    fn ignores_guide(&self) -> bool {
        let counted = self.estimator.needs_strain() || self.estimator.counts_guide();
        self.bodies.guide().is_some() && !counted
    }
}

impl ModulusEstimator for Completed {
    fn estimate(&self, series: &LoadSeries) -> Result<ModulusEstimate, ElasticityError> {
        let mut estimate = match series.bodies() {
            Some(_) => self.estimator.estimate(series)?,
            None => {
                let series = series.clone().with_bodies(Arc::clone(&self.bodies));
                self.estimator.estimate(&series)?
            }
        };
        if self.ignores_guide() {
            estimate.warnings.push(Warning::GuideIgnored);
            estimate.estimator = self.kind();
        }
        Ok(estimate)
    }

    /// The kind of the inner estimator. A law of this crate without the guide gets another name.
    fn kind(&self) -> EstimatorKind {
        match self.estimator.kind() {
            EstimatorKind::Other(name) => EstimatorKind::Other(name),
            _ if self.ignores_guide() => EstimatorKind::GuideIgnored,
            kind => kind,
        }
    }

    fn needs_strain(&self) -> bool {
        self.estimator.needs_strain()
    }

    fn counts_guide(&self) -> bool {
        self.estimator.counts_guide()
    }
}

/// The estimator of a pipeline, given as a value or by name. The object and the guide are added
/// when it is first needed.
#[derive(Clone)]
pub(super) struct EstimatorStage {
    chosen: Chosen,
    /// The completed estimator, shared by clones because a law may hold tables.
    built: Arc<OnceLock<Result<SharedEstimator, PipelineError>>>,
}

#[derive(Clone)]
enum Chosen {
    Given(SharedEstimator),
    Named(EstimatorChoice),
}

impl EstimatorStage {
    pub(super) fn given(estimator: SharedEstimator) -> Self {
        Self {
            chosen: Chosen::Given(estimator),
            built: Arc::default(),
        }
    }

    pub(super) fn named(choice: EstimatorChoice) -> Self {
        Self {
            chosen: Chosen::Named(choice),
            built: Arc::default(),
        }
    }

    /// Discards the completed estimator after a change of object or waveguide.
    pub(super) fn renew(&mut self) {
        self.built = Arc::default();
    }

    pub(super) fn get(
        &self,
        object: Object,
        waveguide: Option<&Waveguide>,
    ) -> Result<SharedEstimator, PipelineError> {
        let build = || {
            let estimator = match &self.chosen {
                Chosen::Given(estimator) => Arc::clone(estimator),
                Chosen::Named(choice) => named(*choice, object, waveguide)?,
            };
            let bodies = Arc::new(Bodies::new(object, waveguide.cloned()));
            Ok(Completed::of(estimator, bodies))
        };
        self.built.get_or_init(build).clone()
    }
}
