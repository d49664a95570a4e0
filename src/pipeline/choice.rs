//! Stages by name: what a configuration may say, and the default stage behind every name.
use super::strain_spline::StrainSpline;
use crate::elasticity::strain::{Biot, EulerAlmansi, GreenLagrange, Hencky, Infinitesimal, StrainMeasure};
use crate::matching::{
    CoherentPointDrift, DenseRelaxation, LinearAssignment, NearestNeighbour, PointMatcher, RelaxationMatcher,
    RelaxationOptions, Search,
};
use crate::sfs::{
    BrooksHorn, ControlPointSampler, CurvatureAdaptive, Eikonal, EquallySpaced, Lighting, Random, Rim,
    SfsError, SurfaceReconstruction, TsaiShah,
};
use crate::tps::{AffineModel, FitOptions, R3, RigidModel, Smoothing, TpsError, WarpModel};
use nalgebra::Point3;
use std::fmt;

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

/// An enum whose variants have names in configurations; the first is the default.
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

            /// The name in configurations.
            ///
            /// ```
            #[doc = concat!("use tactile_imaging::pipeline::", stringify!($name), ";")]
            #[doc = concat!("let choice: ", stringify!($name), " = \"", $text, "\".parse()?;")]
            #[doc = concat!("assert_eq!(choice.name(), \"", $text, "\");")]
            /// # Ok::<(), tactile_imaging::pipeline::UnknownStage>(())
            /// ```
            #[must_use]
            pub fn name(self) -> &'static str {
                match self { Self::$first => $text, $(Self::$variant => $other),+ }
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
    /// Image to surface, under frontal light. Pentland's method needs oblique light: give it with its light to
    /// [`BoxedPipeline::with_surface`](super::BoxedPipeline::with_surface).
    ///
    /// ```
    /// use tactile_imaging::pipeline::ReconstructionChoice;
    /// assert_eq!("tsai-shah".parse(), Ok(ReconstructionChoice::TsaiShah));
    /// let error = "tsai".parse::<ReconstructionChoice>().unwrap_err().to_string();
    /// assert!(error.starts_with("stage `reconstruction` must be one of \"eikonal\""));
    /// ```
    ReconstructionChoice, "reconstruction":
    /// [`Eikonal`], zero height at the rim.
    Eikonal = "eikonal",
    /// [`TsaiShah`].
    TsaiShah = "tsai-shah",
    /// [`BrooksHorn`].
    BrooksHorn = "brooks-horn",
}

choice! {
    /// Surface to control points.
    ///
    /// ```
    /// use tactile_imaging::pipeline::SamplerChoice;
    /// assert_eq!(SamplerChoice::default().name(), "equally-spaced");
    /// ```
    SamplerChoice, "sampler":
    /// [`EquallySpaced`].
    EquallySpaced = "equally-spaced",
    /// [`CurvatureAdaptive`] of emphasis 4.
    Curvature = "curvature",
    /// [`Random`] from the seed 0.
    Random = "random",
}

choice! {
    /// Points to matches.
    ///
    /// ```
    /// use tactile_imaging::pipeline::MatcherChoice;
    /// assert!(MatcherChoice::ALL.iter().all(|m| m.name().parse() == Ok(*m)));
    /// ```
    MatcherChoice, "matcher":
    /// [`RelaxationMatcher`], searching near by.
    Relaxation = "relaxation",
    /// [`DenseRelaxation`]: the paper's method as printed.
    DenseRelaxation = "dense-relaxation",
    /// [`CoherentPointDrift`].
    CoherentPointDrift = "coherent-point-drift",
    /// [`LinearAssignment`].
    LinearAssignment = "linear-assignment",
    /// [`NearestNeighbour`].
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
    /// [`StrainSpline`]: thin-plate, kernel −r, smoothed by blocked cross-validation.
    ThinPlateSpline = "thin-plate-spline",
    /// The spline of kernel r³, smoothed by cross-validation.
    CubicSpline = "cubic-spline",
    /// [`AffineModel`].
    Affine = "affine",
    /// [`RigidModel`].
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
    /// [`GreenLagrange`].
    GreenLagrange = "green-lagrange",
    /// [`EulerAlmansi`].
    EulerAlmansi = "euler-almansi",
    /// [`Hencky`].
    Hencky = "hencky",
    /// [`Biot`].
    Biot = "biot",
    /// [`Infinitesimal`].
    Infinitesimal = "infinitesimal",
}

/// A way from image to surface, of whatever kind.
///
/// ```
/// use tactile_imaging::{pipeline::BoxedReconstruction, sfs::{Domain, Eikonal, Lighting, Rim}};
/// let surface: BoxedReconstruction = Box::new(Eikonal::new(Lighting::frontal()).with_rim(Rim::Height(0.0))?);
/// // Inside a disc of 15 pixels, n·s = 1/√2 everywhere: a cone of slope 1.
/// let inside = |(r, c): (usize, usize)| (r as f64 - 20.0).hypot(c as f64 - 20.0) < 15.0;
/// let (mask, image) = (ndarray::Array2::from_shape_fn((41, 41), inside), ndarray::Array2::from_elem((41, 41), 0.5_f64.sqrt()));
/// let found = surface.reconstruct(image.view(), &Domain::pixels().with_mask(mask.view()))?;
/// assert!((found.heights[[20, 20]] - 15.0).abs() < 1.5);
/// # Ok::<(), tactile_imaging::sfs::SfsError>(())
/// ```
pub type BoxedReconstruction = Box<dyn SurfaceReconstruction<f64> + Send + Sync>;
/// A choice of control points, of whatever kind.
///
/// ```
/// use tactile_imaging::{pipeline::BoxedSampler, sfs::{EquallySpaced, Random}};
/// let samplers: [BoxedSampler; 2] = [Box::new(EquallySpaced::new()), Box::new(Random::new(1))];
/// let flat = ndarray::Array2::<f64>::zeros((9, 9));
/// assert!(samplers.iter().all(|s| s.sample(flat.view(), None, [1.0; 2], 5).unwrap().len() == 5));
/// ```
pub type BoxedSampler = Box<dyn ControlPointSampler<f64> + Send + Sync>;
/// A matcher, of whatever kind.
///
/// ```
/// use nalgebra::Point3;
/// use tactile_imaging::{matching::NearestNeighbour, pipeline::BoxedMatcher};
/// let matcher: BoxedMatcher = Box::new(NearestNeighbour::new());
/// let points = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]].map(Point3::from);
/// assert_eq!(matcher.match_points(&points, &points).unwrap().assignment, [Some(0), Some(1)]);
/// ```
pub type BoxedMatcher = Box<dyn PointMatcher<f64, 3> + Send + Sync>;
/// A measure of strain, of whatever kind.
///
/// ```
/// use tactile_imaging::{elasticity::strain::Hencky, pipeline::BoxedStrain};
/// let strain: BoxedStrain = Box::new(Hencky);
/// assert!(strain.name().contains("Hencky"));
/// ```
pub type BoxedStrain = Box<dyn StrainMeasure<f64> + Send + Sync>;
/// A family of warps, of whatever kind.
///
/// ```
/// use nalgebra::Point3;
/// use tactile_imaging::{pipeline::BoxedWarpModel, tps::AffineModel};
/// let warp: BoxedWarpModel = Box::new(AffineModel);
/// let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(Point3::from);
/// let doubled = corners.map(|p| p * 2.0);
/// let fitted = warp.fit_warp(&corners, &doubled, &[1.0; 4])?;
/// assert!((fitted.apply(&Point3::new(1.0, 1.0, 1.0)) - Point3::new(2.0, 2.0, 2.0)).norm() < 1e-9);
/// # Ok::<(), tactile_imaging::tps::TpsError>(())
/// ```
pub type BoxedWarpModel = Box<dyn FitWarp>;

/// A family of warps whose warps are boxed: [`WarpModel`] for objects. Every model whose warps can cross threads is one.
///
/// ```
/// use nalgebra::Point3;
/// use tactile_imaging::pipeline::FitWarp;
/// use tactile_imaging::tps::AffineModel;
/// let model: Box<dyn FitWarp> = Box::new(AffineModel);
/// let corners = [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., 1.]].map(Point3::from);
/// let doubled = corners.map(|p| p * 2.0);
/// let warp = model.fit_warp(&corners, &doubled, &[1.0; 4])?;
/// assert!((warp.apply(&Point3::new(1.0, 1.0, 1.0)) - Point3::new(2.0, 2.0, 2.0)).norm() < 1e-12);
/// # Ok::<(), tactile_imaging::tps::TpsError>(())
/// ```
pub trait FitWarp: Send + Sync {
    /// The warp that takes sources to targets, by weight.
    ///
    /// # Errors
    /// [`TpsError`].
    fn fit_warp(
        &self,
        sources: &[Point3<f64>],
        targets: &[Point3<f64>],
        weights: &[f64],
    ) -> Result<super::BoxedWarp, TpsError>;
}

impl<W> FitWarp for W
where
    W: WarpModel<f64, 3> + Send + Sync,
    W::Warp: Send + Sync + 'static,
{
    fn fit_warp(
        &self,
        sources: &[Point3<f64>],
        targets: &[Point3<f64>],
        weights: &[f64],
    ) -> Result<super::BoxedWarp, TpsError> {
        Ok(Box::new(self.fit(sources, targets, Some(weights))?))
    }
}

impl ReconstructionChoice {
    pub(super) fn boxed(self) -> Result<BoxedReconstruction, SfsError> {
        let light = Lighting::frontal();
        Ok(match self {
            Self::Eikonal => Box::new(Eikonal::new(light).with_rim(Rim::Height(0.0))?),
            Self::TsaiShah => Box::new(TsaiShah::new(light)),
            Self::BrooksHorn => Box::new(BrooksHorn::new(light)),
        })
    }
}

impl SamplerChoice {
    pub(super) fn boxed(self) -> Result<BoxedSampler, SfsError> {
        Ok(match self {
            Self::EquallySpaced => Box::new(EquallySpaced::new()),
            Self::Curvature => Box::new(CurvatureAdaptive::new(4.0)?),
            Self::Random => Box::new(Random::new(0)),
        })
    }
}

impl MatcherChoice {
    pub(super) fn boxed(self) -> BoxedMatcher {
        match self {
            Self::Relaxation => {
                Box::new(RelaxationMatcher::new(RelaxationOptions::default().search(Search::Near)))
            }
            Self::DenseRelaxation => Box::new(DenseRelaxation::default()),
            Self::CoherentPointDrift => Box::new(CoherentPointDrift::default()),
            Self::LinearAssignment => Box::new(LinearAssignment::default()),
            Self::NearestNeighbour => Box::new(NearestNeighbour::new()),
        }
    }
}

impl WarpChoice {
    pub(super) fn boxed(self) -> BoxedWarpModel {
        match self {
            Self::ThinPlateSpline => Box::new(StrainSpline),
            Self::CubicSpline => Box::new(FitOptions::new(R3).smoothing(Smoothing::Gcv)),
            Self::Affine => Box::new(AffineModel),
            Self::Rigid => Box::new(RigidModel),
        }
    }
}

impl StrainChoice {
    pub(super) fn boxed(self) -> BoxedStrain {
        match self {
            Self::GreenLagrange => Box::new(GreenLagrange),
            Self::EulerAlmansi => Box::new(EulerAlmansi),
            Self::Hencky => Box::new(Hencky),
            Self::Biot => Box::new(Biot),
            Self::Infinitesimal => Box::new(Infinitesimal),
        }
    }
}
