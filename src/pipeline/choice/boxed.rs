//! The default stage behind every name, as an object.
use super::{MatcherChoice, ReconstructionChoice, SamplerChoice, StrainChoice, WarpChoice};
use crate::elasticity::strain::{
    Biot, EulerAlmansi, GreenLagrange, Hencky, Infinitesimal, StrainMeasure,
};
use crate::matching::{
    AnnealedSoftassign, CoherentPointDrift, LinearAssignment, NearestNeighbour, PointMatcher,
    RelaxationLabelling, Search, SoftassignOptions,
};
use crate::pipeline::stages::BoxedWarp;
use crate::pipeline::strain_spline::StrainSpline;
use crate::sfs::{
    BrooksHorn, ControlPointSampler, CurvatureAdaptive, Eikonal, EquallySpaced, Lighting, Random,
    Rim, SfsError, SurfaceReconstruction, TsaiShah,
};
use crate::tps::{AffineModel, FitOptions, R3, RigidModel, Smoothing, TpsError, WarpModel};
use nalgebra::Point3;

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
    ) -> Result<BoxedWarp, TpsError>;
}

impl<W> FitWarp for W
where
    W: WarpModel<f64, 3> + Send + Sync,
{
    fn fit_warp(
        &self,
        sources: &[Point3<f64>],
        targets: &[Point3<f64>],
        weights: &[f64],
    ) -> Result<BoxedWarp, TpsError> {
        self.fit(sources, targets, Some(weights))
    }
}

impl ReconstructionChoice {
    pub(in crate::pipeline) fn boxed(self) -> Result<BoxedReconstruction, SfsError> {
        let light = Lighting::frontal();
        Ok(match self {
            Self::Eikonal => Box::new(Eikonal::new(light).with_rim(Rim::Height(0.0))?),
            Self::TsaiShah => Box::new(TsaiShah::new(light)),
            Self::BrooksHorn => Box::new(BrooksHorn::new(light).with_occluding_rim(true)),
        })
    }
}

impl SamplerChoice {
    pub(in crate::pipeline) fn boxed(self) -> Result<BoxedSampler, SfsError> {
        Ok(match self {
            Self::EquallySpaced => Box::new(EquallySpaced::new()),
            Self::Curvature => Box::new(CurvatureAdaptive::new(4.0)?),
            Self::Random => Box::new(Random::new(0)),
        })
    }
}

impl MatcherChoice {
    pub(in crate::pipeline) fn boxed(self) -> BoxedMatcher {
        match self {
            Self::AnnealedSoftassign => Box::new(AnnealedSoftassign::new(
                SoftassignOptions::default().with_search(Search::Near),
            )),
            Self::RelaxationLabelling => Box::new(RelaxationLabelling::default()),
            Self::CoherentPointDrift => Box::new(CoherentPointDrift::default()),
            Self::LinearAssignment => Box::new(LinearAssignment::default()),
            Self::NearestNeighbour => Box::new(NearestNeighbour::new()),
        }
    }
}

impl WarpChoice {
    pub(in crate::pipeline) fn boxed(self) -> BoxedWarpModel {
        match self {
            Self::ThinPlateSpline => Box::new(StrainSpline),
            // Cross-validation takes no number that could be refused.
            Self::CubicSpline => Box::new(
                FitOptions::new(R3)
                    .with_smoothing(Smoothing::Gcv)
                    .unwrap_or_else(|_| FitOptions::new(R3)),
            ),
            Self::Affine => Box::new(AffineModel),
            Self::Rigid => Box::new(RigidModel),
        }
    }
}

impl StrainChoice {
    pub(in crate::pipeline) fn boxed(self) -> BoxedStrain {
        match self {
            Self::GreenLagrange => Box::new(GreenLagrange),
            Self::EulerAlmansi => Box::new(EulerAlmansi),
            Self::Hencky => Box::new(Hencky),
            Self::Biot => Box::new(Biot),
            Self::Infinitesimal => Box::new(Infinitesimal),
        }
    }
}
