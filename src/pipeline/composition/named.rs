//! The stage behind every name of a configuration.
use crate::elasticity::strain::{
    Biot, EulerAlmansi, GreenLagrange, Hencky, Infinitesimal, StrainMeasure,
};
use crate::matching::{
    AnnealedSoftassign, CoherentPointDrift, LinearAssignment, NearestNeighbour, PointMatcher,
    RelaxationLabelling, Search,
};
use crate::pipeline::choice::{
    IntegratorChoice, MatcherChoice, ReconstructionChoice, SamplerChoice, StrainChoice, WarpChoice,
};
use crate::pipeline::error::PipelineError;
use crate::sfs::{
    BoundaryCondition, BrooksHorn, ContactSampler, ControlPointSampler, CosinePoisson,
    CurvatureAdaptive, Eikonal, EquallySpaced, FrankotChellappa, Lighting, MaskedLeastSquares,
    Random, SlopeIntegrator, SurfaceReconstruction, TsaiShah,
};
use crate::tps::{AffineModel, FitOptions, R3, Smoothing, StrainSpline, WarpModel};
use std::sync::Arc;

/// How much denser [`SamplerChoice::Curvature`] samples where the surface bends: between even spacing (1) and points at the rim alone.
const CURVATURE_EMPHASIS: f64 = 4.0;

/// The default reconstruction: frontal light, height zero on the sub-pixel contour of the profile fitted to the contact.
pub(super) fn eikonal() -> Result<Eikonal<f64>, PipelineError> {
    Eikonal::new(Lighting::default())
        .with_boundary(BoundaryCondition::Height(0.0))
        .map(|eikonal| eikonal.with_fitted_profile(true))
        .map_err(PipelineError::SurfaceOptions)
}

pub(super) fn reconstruction(
    choice: ReconstructionChoice,
) -> Result<Arc<dyn SurfaceReconstruction<f64> + Send + Sync>, PipelineError> {
    let light = Lighting::default();
    Ok(match choice {
        ReconstructionChoice::Eikonal => Arc::new(eikonal()?),
        ReconstructionChoice::TsaiShah => Arc::new(TsaiShah::new(light)),
        ReconstructionChoice::BrooksHorn => {
            Arc::new(BrooksHorn::new(light).with_occluding_boundary(true))
        }
    })
}

/// The integrator of a name; `None` for the reconstruction's own.
pub(super) fn integrator(
    choice: IntegratorChoice,
) -> Option<Arc<dyn SlopeIntegrator<f64> + Send + Sync>> {
    match choice {
        IntegratorChoice::OfReconstruction => None,
        IntegratorChoice::FrankotChellappa => Some(Arc::new(FrankotChellappa)),
        IntegratorChoice::CosinePoisson => Some(Arc::new(CosinePoisson)),
        IntegratorChoice::MaskedLeastSquares => Some(Arc::new(MaskedLeastSquares::default())),
    }
}

pub(super) fn sampler(
    choice: SamplerChoice,
) -> Result<Arc<dyn ControlPointSampler<f64> + Send + Sync>, PipelineError> {
    Ok(match choice {
        SamplerChoice::Contact => Arc::new(ContactSampler),
        SamplerChoice::EquallySpaced => Arc::new(EquallySpaced),
        SamplerChoice::Curvature => Arc::new(
            CurvatureAdaptive::new(CURVATURE_EMPHASIS).map_err(PipelineError::SurfaceOptions)?,
        ),
        SamplerChoice::Random => Arc::new(Random { seed: 0 }),
    })
}

/// The default matcher. Two loads of one contact lie near each other: one run from where they are.
pub(super) fn near_by() -> AnnealedSoftassign {
    AnnealedSoftassign::default().with_search(Search::Near)
}

pub(super) fn matcher(choice: MatcherChoice) -> Arc<dyn PointMatcher<3> + Send + Sync> {
    match choice {
        MatcherChoice::AnnealedSoftassign => Arc::new(near_by()),
        MatcherChoice::RelaxationLabelling => Arc::new(RelaxationLabelling::default()),
        MatcherChoice::CoherentPointDrift => Arc::new(CoherentPointDrift::default()),
        MatcherChoice::LinearAssignment => Arc::new(LinearAssignment::default()),
        MatcherChoice::NearestNeighbour => Arc::new(NearestNeighbour::default()),
    }
}

pub(super) fn warp(
    choice: WarpChoice,
) -> Result<Arc<dyn WarpModel<f64, 3> + Send + Sync>, PipelineError> {
    Ok(match choice {
        WarpChoice::ThinPlateSpline => Arc::new(StrainSpline),
        WarpChoice::CubicSpline => {
            let options = FitOptions::new(R3).with_smoothing(Smoothing::Gcv);
            Arc::new(options.map_err(PipelineError::WarpOptions)?)
        }
        WarpChoice::Affine => Arc::new(AffineModel::General),
        WarpChoice::Rigid => Arc::new(AffineModel::Rigid),
    })
}

pub(super) fn strain(choice: StrainChoice) -> Arc<dyn StrainMeasure + Send + Sync> {
    match choice {
        StrainChoice::GreenLagrange => Arc::new(GreenLagrange),
        StrainChoice::EulerAlmansi => Arc::new(EulerAlmansi),
        StrainChoice::Hencky => Arc::new(Hencky),
        StrainChoice::Biot => Arc::new(Biot),
        StrainChoice::Infinitesimal => Arc::new(Infinitesimal),
    }
}
