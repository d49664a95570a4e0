//! Names of stages in configurations, and the stage for each name.
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

/// A name that does not exist for this kind of stage.
///
/// ```
/// use tactile_imaging::pipeline::{ReconstructionChoice, UnknownStage};
/// let error: UnknownStage = "taylor".parse::<ReconstructionChoice>().unwrap_err();
/// assert_eq!(error.found, "taylor");
/// assert!(error.to_string().contains("tsai-shah"));
/// ```
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("stage `{stage}` must be {expected}, found \"{found}\"")]
#[non_exhaustive]
pub struct UnknownStage {
    /// The stage.
    pub stage: &'static str,
    /// The valid names.
    pub expected: &'static str,
    /// The name given.
    pub found: String,
}

/// An enum whose variants have names in configurations. The first variant is the default.
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
            /// All variants, the default first.
            pub const ALL: &[Self] = &[Self::$first, $(Self::$variant),+];
            /// The valid names as text.
            pub const EXPECTED: &str = concat!("one of \"", $text, "\"", $(", \"", $other, "\""),+);

            /// The name in configurations, as written by [`Display`](fmt::Display).
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
    /// From an image to a surface, under frontal light. For other light use
    /// [`Pipeline::with_surface`](super::Pipeline::with_surface).
    ///
    /// ```
    /// use tactile_imaging::pipeline::ReconstructionChoice;
    /// assert_eq!("tsai-shah".parse(), Ok(ReconstructionChoice::TsaiShah));
    /// let error = "tsai".parse::<ReconstructionChoice>().unwrap_err().to_string();
    /// assert!(error.starts_with("stage `reconstruction` must be one of \"eikonal\""));
    /// ```
    ReconstructionChoice, "reconstruction":
    /// [`Eikonal`](crate::sfs::Eikonal), with height zero at the contour of the fitted profile.
    Eikonal = "eikonal",
    /// [`TsaiShah`](crate::sfs::TsaiShah): fast, but its heights are much too low on the fine
    /// frames of a whole contact.
    TsaiShah = "tsai-shah",
}

choice! {
    /// From a surface to control points.
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
    /// From points to matches.
    ///
    /// ```
    /// use tactile_imaging::pipeline::MatcherChoice;
    /// assert!(MatcherChoice::ALL.iter().all(|m| m.to_string().parse() == Ok(*m)));
    /// ```
    MatcherChoice, "matcher":
    /// [`AnnealedSoftassign`](crate::matching::AnnealedSoftassign), searching nearby.
    AnnealedSoftassign = "annealed-softassign",
    /// [`RelaxationLabelling`](crate::matching::RelaxationLabelling): the paper's method, with the
    /// factor γ of both edges.
    RelaxationLabelling = "relaxation-labelling",
    /// Like `RelaxationLabelling`, with the γ of the model's edge alone, as printed in (18).
    PrintedLabelling = "printed-labelling",
    /// [`CoherentPointDrift`](crate::matching::CoherentPointDrift).
    CoherentPointDrift = "coherent-point-drift",
    /// [`LinearAssignment`](crate::matching::LinearAssignment).
    LinearAssignment = "linear-assignment",
    /// [`NearestNeighbour`](crate::matching::NearestNeighbour).
    NearestNeighbour = "nearest-neighbour",
}

choice! {
    /// From matches to the warp whose gradient gives the strain.
    ///
    /// ```
    /// use tactile_imaging::pipeline::WarpChoice;
    /// assert_eq!(WarpChoice::Affine.to_string(), "affine");
    /// ```
    WarpChoice, "warp":
    /// [`AffineModel::General`](crate::tps::AffineModel::General). A finer model would fit the
    /// errors of reconstructed surfaces, which neighbouring points share.
    Affine = "affine",
    /// The thin-plate spline in space with kernel −r, smoothed by generalised cross-validation.
    ThinPlateSpline = "thin-plate-spline",
    /// The spline with kernel r³, smoothed by cross-validation.
    CubicSpline = "cubic-spline",
    /// The interpolating spline with kernel r² log r, as printed in (21).
    PrintedSpline = "printed-spline",
    /// [`AffineModel::Rigid`](crate::tps::AffineModel::Rigid).
    Rigid = "rigid",
}

choice! {
    /// From a displacement gradient to strain.
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
    /// From loads to the modulus.
    ///
    /// ```
    /// use tactile_imaging::pipeline::EstimatorChoice;
    /// assert_eq!("paper-ratio".parse(), Ok(EstimatorChoice::PaperRatio));
    /// assert_eq!(EstimatorChoice::default().to_string(), "best");
    /// ```
    EstimatorChoice, "estimator":
    /// The default for the object. For a ball it is
    /// [`SphereOnWaveguide`](crate::elasticity::modulus::SphereOnWaveguide), on a rigid flat if no
    /// layers are known. A layer and a cone have their own laws. For all others it is
    /// [`PaperRatio`](crate::elasticity::modulus::PaperRatio).
    Best = "best",
    /// [`PaperRatio`](crate::elasticity::modulus::PaperRatio): stress over strain, equation (31).
    PaperRatio = "paper-ratio",
    /// [`StressStrainRegression`](crate::elasticity::modulus::StressStrainRegression) over three
    /// loads or more.
    Regression = "regression",
    /// [`HertzSphere`](crate::elasticity::modulus::HertzSphere) with the waveguide's layers in
    /// series: for small contacts on deep layers, and only for a ball.
    Sphere = "sphere",
    /// [`SphereOnWaveguide`](crate::elasticity::modulus::SphereOnWaveguide). Only for a ball, on
    /// the waveguide's layers or a rigid flat.
    SphereOnWaveguide = "sphere-on-waveguide",
    /// [`TabulatedContact`](crate::elasticity::modulus::TabulatedContact). Only for a ball with a
    /// table of its contacts.
    TabulatedContact = "tabulated-contact",
    /// [`BondedLayer`](crate::elasticity::modulus::BondedLayer) by its integral equation. Only for
    /// a layer.
    BondedLayer = "bonded-layer",
    /// [`Cone`](crate::elasticity::modulus::Cone). Only for a cone, with depths.
    Cone = "cone",
    /// [`FlatPunch`](crate::elasticity::modulus::FlatPunch). Only for a flat-ended cylinder, with
    /// depths (such as those of a depth table).
    FlatPunch = "flat-punch",
}

/// The default reconstruction: frontal light, and height zero on the sub-pixel contour of the
/// fitted contact profile.
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

/// The default matcher. Two loads of one contact are near each other, so one run from their
/// positions is enough.
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

/// Options of a spline whose smoothing is chosen by generalised cross-validation.
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

/// The stage for each step, by name. Names that are not given keep their defaults. With the feature
/// `serde` a table such as `reconstruction = "tsai-shah"` can be read.
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
    /// From an image to a surface.
    pub reconstruction: ReconstructionChoice,
    /// From a surface to control points.
    pub sampler: SamplerChoice,
    /// From points to matches.
    pub matcher: MatcherChoice,
    /// From matches to a warp.
    pub warp: WarpChoice,
    /// From a displacement gradient to strain.
    pub strain: StrainChoice,
    /// From loads to the modulus.
    pub estimator: EstimatorChoice,
}

impl StagesConfig {
    /// The stages of the paper as printed: the surface of Tsai and Shah, equally spaced control
    /// points, labelling by (13)–(20), the spline of (21)–(24), Green–Lagrange strain, and the
    /// modulus of (31).
    ///
    /// The labelling is dense: several seconds for 100 points, minutes for 200.
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
