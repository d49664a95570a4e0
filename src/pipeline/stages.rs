//! The stages as objects: what the rest of the pipeline asks them, whoever holds them.
use super::contact::ContactStage;
use super::error::PipelineError;
use super::settings::Settings;
use crate::elasticity::strain::StrainMeasure;
use crate::force::ReferenceFrame;
use crate::matching::PointMatcher;
use crate::sfs::{ControlPointSampler, SurfaceReconstruction};
use crate::tps::{TpsError, Warp};
use nalgebra::Point3;
use ndarray::ArrayView2;

/// A warp of space, of whatever kind.
///
/// ```
/// use nalgebra::Point3;
/// use tactile_imaging::{pipeline::BoxedWarp, tps::{AffineModel, RigidModel, WarpModel}};
/// // Corners of a cube that is drawn out to double its height.
/// let corners: Vec<_> = (0..8).map(|k| Point3::new((k & 1) as f64, (k >> 1 & 1) as f64, (k >> 2) as f64)).collect();
/// let drawn: Vec<_> = corners.iter().map(|p| Point3::new(p.x, p.y, 2.0 * p.z)).collect();
/// let affine: BoxedWarp = AffineModel.fit(&corners, &drawn, None)?;
/// let rigid: BoxedWarp = RigidModel.fit(&corners, &drawn, None)?;
/// let stretch = [affine, rigid].map(|warp| warp.jacobian(&corners[0])[(2, 2)]);
/// assert!((stretch[0] - 2.0).abs() < 1e-9 && (stretch[1] - 1.0).abs() < 1e-9);
/// # Ok::<(), tactile_imaging::tps::TpsError>(())
/// ```
pub type BoxedWarp = Box<dyn Warp<f64, 3> + Send + Sync>;

/// The stages as objects: how the rest of the pipeline sees them.
///
/// ```
/// use ndarray::Array2;
/// use tactile_imaging::{force::Polarity, pipeline::{Object, Pipeline, Stages}, sfs::Domain, tps::Warp};
/// # use tactile_imaging::force::CalibrationPair;
/// # let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
/// let pipeline = Pipeline::from_pairs(&pairs, [50e-6; 2], Object::sphere(3e-3))?;
/// let stages: &dyn Stages = &pipeline;
/// assert_eq!((stages.contact().polarity(), stages.settings().control_points), (Polarity::Brighter, 200));
/// // Full brightness under frontal light is level ground; the rim of the disc lies at zero.
/// let disc = Array2::from_shape_fn((20, 20), |(r, c)| (r as f64 - 10.0).hypot(c as f64 - 10.0) < 8.0);
/// let domain = Domain::pixels().with_mask(disc.view());
/// let level = stages.surface().reconstruct(Array2::ones((20, 20)).view(), &domain)?;
/// assert!(level.heights[[10, 10]].abs() < 1e-4);
/// // Points of a dome; the dome grows by 2 %, which is a Green–Lagrange strain of (1.02² − 1)/2.
/// let dome = |(r, c): (usize, usize)| 9.0 - 0.02 * ((r as f64 - 20.0).powi(2) + (c as f64 - 20.0).powi(2));
/// let dome = Array2::from_shape_fn((40, 40), dome);
/// let points = stages.sampler().sample(dome.view(), None, [1.0; 2], 60)?;
/// let grown: Vec<_> = points.iter().map(|p| p * 1.02).collect();
/// let matching = stages.matcher().match_points(&points, &grown)?;
/// assert!((0..60).all(|i| matching.assignment[i] == Some(i)));
/// let warp = stages.fit_warp(&points, &grown, &matching.confidence)?;
/// let gradient = warp.jacobian(&points[30]) - nalgebra::Matrix3::identity();
/// assert!((stages.strain().strain(&gradient)?[(2, 2)] - 0.0202).abs() < 1e-4);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub trait Stages: Send + Sync {
    /// Frame to contact and force.
    fn contact(&self) -> &dyn ContactStage;
    /// Image to surface.
    fn surface(&self) -> &dyn SurfaceReconstruction<f64>;
    /// Surface to control points.
    fn sampler(&self) -> &dyn ControlPointSampler<f64>;
    /// Points to matches.
    fn matcher(&self) -> &dyn PointMatcher<f64, 3>;
    /// Weighted matches to the warp whose gradient is strained.
    ///
    /// # Errors
    /// [`TpsError`].
    fn fit_warp(
        &self,
        sources: &[Point3<f64>],
        targets: &[Point3<f64>],
        weights: &[f64],
    ) -> Result<BoxedWarp, TpsError>;
    /// Displacement gradient to strain.
    fn strain(&self) -> &dyn StrainMeasure<f64>;
    /// The settings.
    fn settings(&self) -> &Settings;
}

/// The reference that the settings ask for, of one or more frames without contact.
pub(super) fn reference_frame(
    stages: &dyn Stages,
    frames: &[ArrayView2<'_, u8>],
) -> Result<ReferenceFrame, PipelineError> {
    let reference = ReferenceFrame::from_frames(frames).map_err(PipelineError::Sensor)?;
    if !stages.settings().flat_field {
        return Ok(reference);
    }
    reference.with_flat_field().map_err(PipelineError::Sensor)
}
