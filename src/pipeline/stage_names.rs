//! The names of stages in configurations, and the stage behind every name.
use super::error::PipelineError;
use crate::elasticity::strain::{
    Biot, EulerAlmansi, GreenLagrange, Hencky, Infinitesimal, StrainMeasure,
};
use crate::matching::labelling::Compatibility;
use crate::matching::{
    AnnealedSoftassign, CoherentPointDrift, LinearAssignment, NearestNeighbour, PointMatcher,
    RelaxationLabelling, Search,
};
use crate::sfs::{
    BoundaryCondition, ContactSampler, ControlPointSampler, Eikonal, EquallySpaced, Lighting,
    SurfaceReconstruction, TsaiShah,
};
use crate::tps::{AffineModel, FitOptions, Kernel, NegR, R2LogR, R3, Smoothing, WarpModel};
use std::fmt;
use std::sync::Arc;

/// A name that no stage of this kind has.
///
/// ```
/// use tactile_imaging::pipeline::{ReconstructionChoice, UnknownStage};
/// let error: UnknownStage = "taylor".parse::<ReconstructionChoice>().unwrap_err();
/// assert_eq!(error.found, "taylor");
/// assert!(error.to_string().contains("tsai-shah"));
/// ```
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("stage `{stage}` must be {expected}, found \"{found}\"")]
pub struct UnknownStage {
    /// The stage.
    pub stage: &'static str,
    /// The names that it knows.
    pub expected: &'static str,
    /// The name given.
    pub found: String,
}

/// An enum whose variants have names in configurations. The first is the default.
macro_rules! choice {
    ($(#[$meta:meta])* $name:ident, $stage:literal:
        $(#[$one:meta])* $first:ident = $text:literal, $($(#[$more:meta])* $variant:ident = $other:literal),+ $(,)?) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
        #[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
        #[non_exhaustive]
        pub enum $name {
            $(#[$one])*
            #[default]
            #[cfg_attr(feature = "serde", serde(rename = $text))]
            $first,
            $($(#[$more])* #[cfg_attr(feature = "serde", serde(rename = $other))] $variant,)+
        }

        impl $name {
            /// All of them, the default first.
            pub const ALL: &[Self] = &[Self::$first, $(Self::$variant),+];
            /// The names, as a sentence says them.
            pub const EXPECTED: &str = concat!("one of \"", $text, "\"", $(", \"", $other, "\""),+);

            /// The name in configurations. [`Display`](fmt::Display) writes it.
            pub(crate) fn name(self) -> &'static str {
                match self { Self::$first => $text, $(Self::$variant => $other),+ }
            }
        }

        impl From<$name> for &'static str {
            fn from(choice: $name) -> Self {
                choice.name()
            }
        }

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.pad(self.name())
            }
        }

        impl std::str::FromStr for $name {
            type Err = UnknownStage;

            fn from_str(name: &str) -> Result<Self, UnknownStage> {
                let unknown = || UnknownStage { stage: $stage, expected: Self::EXPECTED, found: name.into() };
                Self::ALL.iter().copied().find(|choice| choice.name() == name).ok_or_else(unknown)
            }
        }
    };
}

choice! {
    /// Image to surface, under frontal light. Methods under another light go to
    /// [`Pipeline::with_surface`](super::Pipeline::with_surface).
    ///
    /// ```
    /// use tactile_imaging::pipeline::ReconstructionChoice;
    /// assert_eq!("tsai-shah".parse(), Ok(ReconstructionChoice::TsaiShah));
    /// let error = "tsai".parse::<ReconstructionChoice>().unwrap_err().to_string();
    /// assert!(error.starts_with("stage `reconstruction` must be one of \"eikonal\""));
    /// ```
    ReconstructionChoice, "reconstruction":
    /// [`Eikonal`](crate::sfs::Eikonal), zero height at the contour of the fitted profile.
    Eikonal = "eikonal",
    /// [`TsaiShah`](crate::sfs::TsaiShah): quick, and much too low on the fine frames of a whole
    /// contact.
    TsaiShah = "tsai-shah",
}

choice! {
    /// Surface to control points.
    ///
    /// ```
    /// use tactile_imaging::pipeline::SamplerChoice;
    /// assert_eq!(SamplerChoice::default().to_string(), "contact");
    /// ```
    SamplerChoice, "sampler":
    /// [`ContactSampler`](crate::sfs::ContactSampler): equally spaced up to the sub-pixel contour
    /// of the contact.
    Contact = "contact",
    /// [`EquallySpaced`](crate::sfs::EquallySpaced).
    EquallySpaced = "equally-spaced",
}

choice! {
    /// Points to matches.
    ///
    /// ```
    /// use tactile_imaging::pipeline::MatcherChoice;
    /// assert!(MatcherChoice::ALL.iter().all(|m| m.to_string().parse() == Ok(*m)));
    /// ```
    MatcherChoice, "matcher":
    /// [`AnnealedSoftassign`](crate::matching::AnnealedSoftassign), searching near by.
    AnnealedSoftassign = "annealed-softassign",
    /// [`RelaxationLabelling`](crate::matching::RelaxationLabelling): the paper's method, with the
    /// factor γ of both edges.
    RelaxationLabelling = "relaxation-labelling",
    /// The same with the γ of the model's edge alone, as (18) is printed.
    PrintedLabelling = "printed-labelling",
    /// [`CoherentPointDrift`](crate::matching::CoherentPointDrift).
    CoherentPointDrift = "coherent-point-drift",
    /// [`LinearAssignment`](crate::matching::LinearAssignment).
    LinearAssignment = "linear-assignment",
    /// [`NearestNeighbour`](crate::matching::NearestNeighbour).
    NearestNeighbour = "nearest-neighbour",
}

choice! {
    /// Matches to the warp whose gradient is strained.
    ///
    /// ```
    /// use tactile_imaging::pipeline::WarpChoice;
    /// assert_eq!(WarpChoice::Affine.to_string(), "affine");
    /// ```
    WarpChoice, "warp":
    /// [`AffineModel::General`](crate::tps::AffineModel::General): errors of reconstructed surfaces,
    /// which neighbours share, pass for anything finer.
    Affine = "affine",
    /// The thin-plate spline in space, kernel −r, smoothed by generalised cross-validation.
    ThinPlateSpline = "thin-plate-spline",
    /// The spline of kernel r³, smoothed by cross-validation.
    CubicSpline = "cubic-spline",
    /// The interpolating spline of kernel r² log r, as (21) is printed.
    PrintedSpline = "printed-spline",
    /// [`AffineModel::Rigid`](crate::tps::AffineModel::Rigid).
    Rigid = "rigid",
}

choice! {
    /// Displacement gradient to strain.
    ///
    /// ```
    /// use tactile_imaging::pipeline::StrainChoice;
    /// assert_eq!("hencky".parse(), Ok(StrainChoice::Hencky));
    /// ```
    StrainChoice, "strain":
    /// [`GreenLagrange`](crate::elasticity::strain::GreenLagrange).
    GreenLagrange = "green-lagrange",
    /// [`EulerAlmansi`](crate::elasticity::strain::EulerAlmansi).
    EulerAlmansi = "euler-almansi",
    /// [`Hencky`](crate::elasticity::strain::Hencky).
    Hencky = "hencky",
    /// [`Biot`](crate::elasticity::strain::Biot).
    Biot = "biot",
    /// [`Infinitesimal`](crate::elasticity::strain::Infinitesimal).
    Infinitesimal = "infinitesimal",
}

choice! {
    /// Loads to the modulus.
    ///
    /// ```
    /// use tactile_imaging::pipeline::EstimatorChoice;
    /// assert_eq!("paper-ratio".parse(), Ok(EstimatorChoice::PaperRatio));
    /// assert_eq!(EstimatorChoice::default().to_string(), "best");
    /// ```
    EstimatorChoice, "estimator":
    /// The default for the object:
    /// [`SphereOnWaveguide`](crate::elasticity::modulus::SphereOnWaveguide) for a ball, on a rigid
    /// flat where no layers are known, the law of its shape for a layer and a cone, else
    /// [`PaperRatio`](crate::elasticity::modulus::PaperRatio).
    Best = "best",
    /// [`PaperRatio`](crate::elasticity::modulus::PaperRatio): stress over strain, equation (31).
    PaperRatio = "paper-ratio",
    /// [`StressStrainRegression`](crate::elasticity::modulus::StressStrainRegression) over three
    /// loads or more.
    Regression = "regression",
    /// [`HertzSphere`](crate::elasticity::modulus::HertzSphere), the waveguide's layers in series:
    /// small contacts on deep layers. A ball alone.
    Sphere = "sphere",
    /// [`SphereOnWaveguide`](crate::elasticity::modulus::SphereOnWaveguide). A ball alone, on the
    /// waveguide's layers or a rigid flat.
    SphereOnWaveguide = "sphere-on-waveguide",
    /// [`TabulatedContact`](crate::elasticity::modulus::TabulatedContact). A ball alone, and with a
    /// table of its contacts.
    TabulatedContact = "tabulated-contact",
    /// [`BondedLayer`](crate::elasticity::modulus::BondedLayer) by its integral equation. A layer
    /// alone.
    BondedLayer = "bonded-layer",
    /// [`Cone`](crate::elasticity::modulus::Cone). A cone alone, and from depths.
    Cone = "cone",
    /// [`FlatPunch`](crate::elasticity::modulus::FlatPunch). A flat-ended cylinder alone, and from
    /// depths (a depth table's).
    FlatPunch = "flat-punch",
}

/// The default reconstruction: frontal light, height zero on the sub-pixel contour of the profile
/// fitted to the contact.
pub(super) fn eikonal() -> Result<Eikonal<f64>, PipelineError> {
    Eikonal::new(Lighting::default())
        .with_boundary(BoundaryCondition::Height(0.0))
        .map(|eikonal| eikonal.with_fitted_profile(true))
        .map_err(PipelineError::SurfaceOptions)
}

impl ReconstructionChoice {
    pub(super) fn build(
        self,
    ) -> Result<Arc<dyn SurfaceReconstruction<f64> + Send + Sync>, PipelineError> {
        let light = Lighting::default();
        Ok(match self {
            Self::Eikonal => Arc::new(eikonal()?),
            Self::TsaiShah => Arc::new(TsaiShah::new(light)),
        })
    }
}

impl SamplerChoice {
    pub(super) fn build(self) -> Arc<dyn ControlPointSampler<f64> + Send + Sync> {
        match self {
            Self::Contact => Arc::new(ContactSampler),
            Self::EquallySpaced => Arc::new(EquallySpaced),
        }
    }
}

/// The default matcher. Two loads of one contact lie near each other: one run from where they are.
pub(super) fn near_by() -> AnnealedSoftassign {
    AnnealedSoftassign::default().with_search(Search::Near)
}

impl MatcherChoice {
    pub(super) fn build(self) -> Arc<dyn PointMatcher<3> + Send + Sync> {
        match self {
            Self::AnnealedSoftassign => Arc::new(near_by()),
            Self::RelaxationLabelling => Arc::new(RelaxationLabelling::default()),
            Self::PrintedLabelling => {
                Arc::new(RelaxationLabelling::default().with_compatibility(Compatibility::Printed))
            }
            Self::CoherentPointDrift => Arc::new(CoherentPointDrift::default()),
            Self::LinearAssignment => Arc::new(LinearAssignment::default()),
            Self::NearestNeighbour => Arc::new(NearestNeighbour::default()),
        }
    }
}

/// A spline as smooth as generalised cross-validation finds it.
fn smooth<K: Kernel>(kernel: K) -> Result<FitOptions<K>, PipelineError> {
    let options = FitOptions::new(kernel).with_smoothing(Smoothing::Gcv);
    options.map_err(PipelineError::WarpOptions)
}

impl WarpChoice {
    pub(super) fn build(self) -> Result<Arc<dyn WarpModel<3> + Send + Sync>, PipelineError> {
        Ok(match self {
            Self::ThinPlateSpline => Arc::new(smooth(NegR)?),
            Self::CubicSpline => Arc::new(smooth(R3)?),
            Self::PrintedSpline => Arc::new(FitOptions::new(R2LogR)),
            Self::Affine => Arc::new(AffineModel::General),
            Self::Rigid => Arc::new(AffineModel::Rigid),
        })
    }
}

impl StrainChoice {
    pub(super) fn build(self) -> Arc<dyn StrainMeasure + Send + Sync> {
        match self {
            Self::GreenLagrange => Arc::new(GreenLagrange),
            Self::EulerAlmansi => Arc::new(EulerAlmansi),
            Self::Hencky => Arc::new(Hencky),
            Self::Biot => Arc::new(Biot),
            Self::Infinitesimal => Arc::new(Infinitesimal),
        }
    }
}

/// Which stage to take for each step, by name. What is not said is the default. With the feature
/// `serde` a table such as `reconstruction = "tsai-shah"` is one.
///
/// ```
/// use tactile_imaging::pipeline::{MatcherChoice, StagesConfig, StrainChoice};
/// let config = StagesConfig { strain: StrainChoice::Hencky, ..StagesConfig::default() };
/// assert_eq!(config.matcher, MatcherChoice::AnnealedSoftassign);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
pub struct StagesConfig {
    /// Image to surface.
    pub reconstruction: ReconstructionChoice,
    /// Surface to control points.
    pub sampler: SamplerChoice,
    /// Points to matches.
    pub matcher: MatcherChoice,
    /// Matches to a warp.
    pub warp: WarpChoice,
    /// Displacement gradient to strain.
    pub strain: StrainChoice,
    /// Loads to the modulus.
    pub estimator: EstimatorChoice,
}

impl StagesConfig {
    /// The stages of the paper as printed: Tsai and Shah's surface, equally spaced control points,
    /// labelling by (13)–(20), the spline of (21)–(24), Green–Lagrange strain, and the modulus of
    /// (31).
    ///
    /// The labelling is dense: some seconds for 100 points, minutes for 200.
    ///
    /// ```
    /// use tactile_imaging::pipeline::{EstimatorChoice, StagesConfig};
    /// let printed = StagesConfig::as_printed();
    /// assert_eq!(printed.estimator, EstimatorChoice::PaperRatio);
    /// ```
    #[must_use]
    pub fn as_printed() -> Self {
        Self {
            reconstruction: ReconstructionChoice::TsaiShah,
            sampler: SamplerChoice::EquallySpaced,
            matcher: MatcherChoice::PrintedLabelling,
            warp: WarpChoice::PrintedSpline,
            strain: StrainChoice::GreenLagrange,
            estimator: EstimatorChoice::PaperRatio,
        }
    }
}
