//! The pipeline: its stages, chosen at compile time or, boxed, at run time, and its settings.
use super::binning::Binning;
use super::contact::{ContactStage, LightContact};
use super::error::PipelineError;
use super::object::Object;
use super::press::Press;
use super::strain_spline::StrainSpline;
use super::surface::SurfaceInput;
use crate::elasticity::contact::Waveguide;
use crate::elasticity::strain::{GreenLagrange, StrainMeasure};
use crate::force::{CalibrationPair, ReferenceFrame};
use crate::matching::{PointMatcher, RelaxationMatcher, RelaxationOptions, Search};
use crate::sfs::{ControlPointSampler, Eikonal, EquallySpaced, Lighting, Rim, SurfaceReconstruction};
use crate::tps::{TpsError, Warp, WarpModel};
use nalgebra::Point3;
use ndarray::ArrayView2;
use std::sync::Arc;

/// Control points on each surface where nothing else is asked for: the paper's number.
pub const DEFAULT_CONTROL_POINTS: usize = 200;

/// What the pipeline may leave out. Each skip leaves the results the same; each can be turned off.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Skips {
    /// Frames that equal an earlier frame bit for bit take over its results.
    pub equal_frames: bool,
    /// Surfaces are reconstructed inside the contact's box alone.
    pub outside_contact: bool,
}

impl Default for Skips {
    fn default() -> Self {
        Self { equal_frames: true, outside_contact: true }
    }
}

/// What a pipeline knows beside its stages.
#[derive(Clone, Debug)]
pub struct Settings {
    /// What is pressed.
    pub object: Object,
    /// The sensor's layers; `None`: rigid beside the object.
    pub waveguide: Option<Waveguide<f64>>,
    /// Number of control points on each surface; the paper's 200 by default.
    pub control_points: usize,
    /// What of the frame the surface stage looks at.
    pub surface_input: SurfaceInput,
    /// Width in pixels (odd) of the box that smooths the signal, twice along each axis, before the surface stage; 1 for
    /// none. Where the surface is nearly level its slope √(1/I² − 1) turns noise of the shading I into height.
    pub smoothing_px: usize,
    /// Grid of the surface stage.
    pub binning: Binning,
    /// Whether differences are divided by the brightness that the reference has there: vignetting then costs no force. Right
    /// where stray light and signal come through the same lens, and the calibration was taken in the frame's middle.
    pub flat_field: bool,
    /// Relative error common to all forces beside the calibration's scatter. Light that is uneven over the frame reads
    /// contacts of another size than the calibration's with another gain.
    pub force_scale_error: f64,
    /// Relative error common to all lengths: that of the pixel size.
    pub length_scale_error: f64,
    /// What may be left out.
    pub skips: Skips,
}

/// A warp of space, of whatever kind.
pub type BoxedWarp = Box<dyn Warp<f64, 3> + Send + Sync>;

/// The stages as objects: how the rest of the pipeline sees them.
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

/// The paper's pipeline, every stage of which can be replaced in one line.
///
/// | parameter | stage | default |
/// |---|---|---|
/// | `C` | frame to contact and force | [`LightContact`] with a linear calibration |
/// | `R` | image to surface | [`Eikonal`], frontal light, zero height at the rim |
/// | `P` | surface to control points | [`EquallySpaced`] |
/// | `M` | points to matches | [`RelaxationMatcher`] |
/// | `W` | weighted matches to the warp whose gradient is strained | [`StrainSpline`]: thin-plate, kernel −r, smoothed by blocked cross-validation |
/// | `S` | displacement gradient to strain | [`GreenLagrange`] |
#[derive(Clone, Debug)]
pub struct Pipeline<
    C = LightContact,
    R = Eikonal<f64>,
    P = EquallySpaced,
    M = RelaxationMatcher,
    W = StrainSpline,
    S = GreenLagrange,
> {
    contact: C,
    surface: R,
    sampler: P,
    matcher: M,
    warp: W,
    strain: S,
    settings: Settings,
}

impl Pipeline {
    /// The default pipeline for a sensor calibrated with pairs of integrated pixel value and force.
    ///
    /// # Errors
    /// [`PipelineError::Calibration`] and [`PipelineError::Sensor`].
    pub fn from_pairs(
        pairs: &[CalibrationPair<f64>],
        pixel_size_m: [f64; 2],
        object: Object,
    ) -> Result<Self, PipelineError> {
        Ok(Self::new(LightContact::from_pairs(pairs, pixel_size_m)?, object))
    }
}

impl<C> Pipeline<C> {
    /// The default stages behind any contact stage; no waveguide, 200 control points.
    pub fn new(contact: C, object: Object) -> Self {
        let surface = Eikonal::new(Lighting::frontal()).with_rim(Rim::Height(0.0));
        Self {
            contact,
            surface: surface.unwrap_or_else(|_| Eikonal::new(Lighting::frontal())),
            sampler: EquallySpaced::new(),
            // Two loads of one contact lie near each other: one run from where they are.
            matcher: RelaxationMatcher::new(RelaxationOptions::default().search(Search::Near)),
            warp: StrainSpline,
            strain: GreenLagrange,
            settings: Settings {
                object,
                waveguide: None,
                control_points: DEFAULT_CONTROL_POINTS,
                surface_input: SurfaceInput::Shading,
                smoothing_px: 5,
                binning: Binning::default(),
                flat_field: false,
                force_scale_error: 1e-3,
                length_scale_error: 0.0,
                skips: Skips::default(),
            },
        }
    }
}

impl<C, R, P, M, W, S> Pipeline<C, R, P, M, W, S> {
    /// Takes another way from frame to contact and force.
    #[must_use]
    pub fn with_contact<C2: ContactStage>(self, contact: C2) -> Pipeline<C2, R, P, M, W, S> {
        let Self { surface, sampler, matcher, warp, strain, settings, .. } = self;
        Pipeline { contact, surface, sampler, matcher, warp, strain, settings }
    }

    /// Takes another way from image to surface, looking at `input`.
    #[must_use]
    pub fn with_surface<R2: SurfaceReconstruction<f64>>(
        self,
        surface: R2,
        input: SurfaceInput,
    ) -> Pipeline<C, R2, P, M, W, S> {
        let Self { contact, sampler, matcher, warp, strain, mut settings, .. } = self;
        settings.surface_input = input;
        if input == SurfaceInput::Signal {
            settings.smoothing_px = 1;
            settings.binning = Binning::Blocks(1);
        }
        Pipeline { contact, surface, sampler, matcher, warp, strain, settings }
    }

    /// Takes another choice of control points.
    #[must_use]
    pub fn with_sampler<P2: ControlPointSampler<f64>>(self, sampler: P2) -> Pipeline<C, R, P2, M, W, S> {
        let Self { contact, surface, matcher, warp, strain, settings, .. } = self;
        Pipeline { contact, surface, sampler, matcher, warp, strain, settings }
    }

    /// Takes another matcher.
    #[must_use]
    pub fn with_matcher<M2: PointMatcher<f64, 3>>(self, matcher: M2) -> Pipeline<C, R, P, M2, W, S> {
        let Self { contact, surface, sampler, warp, strain, settings, .. } = self;
        Pipeline { contact, surface, sampler, matcher, warp, strain, settings }
    }

    /// Takes another measure of strain.
    #[must_use]
    pub fn with_strain<S2: StrainMeasure<f64>>(self, strain: S2) -> Pipeline<C, R, P, M, W, S2> {
        let Self { contact, surface, sampler, matcher, warp, settings, .. } = self;
        Pipeline { contact, surface, sampler, matcher, warp, strain, settings }
    }

    /// Takes another family of warps for the strain.
    #[must_use]
    pub fn with_warp<W2: WarpModel<f64, 3>>(self, warp: W2) -> Pipeline<C, R, P, M, W2, S> {
        let Self { contact, surface, sampler, matcher, strain, settings, .. } = self;
        Pipeline { contact, surface, sampler, matcher, warp, strain, settings }
    }

    /// Tells of the sensor's layers: both bodies yield.
    #[must_use]
    pub fn with_waveguide(mut self, waveguide: Waveguide<f64>) -> Self {
        self.settings.waveguide = Some(waveguide);
        self
    }

    /// Sets the number of control points.
    #[must_use]
    pub fn with_control_points(mut self, count: usize) -> Self {
        self.settings.control_points = count;
        self
    }

    /// Sets the width in pixels of the smoothing before the surface stage: odd, 1 for none (even widths count as one more).
    #[must_use]
    pub fn with_smoothing(mut self, width_px: usize) -> Self {
        self.settings.smoothing_px = width_px | 1;
        self
    }

    /// Sets the grid of the surface stage (default [`Binning::Auto`] for shading, every pixel for signals).
    #[must_use]
    pub fn with_binning(mut self, binning: Binning) -> Self {
        self.settings.binning = binning;
        self
    }

    /// Corrects vignetting by the reference's own brightness or not (default: not); see [`Settings::flat_field`].
    #[must_use]
    pub fn with_flat_field(mut self, flat_field: bool) -> Self {
        self.settings.flat_field = flat_field;
        self
    }

    /// Sets the relative errors common to all forces (default 0.1 %) and to all lengths (default none). What is negative or
    /// not finite counts as zero.
    #[must_use]
    pub fn with_scale_errors(mut self, force: f64, length: f64) -> Self {
        let valid = |v: f64| if v > 0.0 && v.is_finite() { v } else { 0.0 };
        self.settings.force_scale_error = valid(force);
        self.settings.length_scale_error = valid(length);
        self
    }

    /// Sets what may be left out.
    #[must_use]
    pub fn with_skips(mut self, skips: Skips) -> Self {
        self.settings.skips = skips;
        self
    }

    /// The settings.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// The contact stage.
    pub fn contact(&self) -> &C {
        &self.contact
    }
}

impl<C, R, P, M, W, S> Pipeline<C, R, P, M, W, S>
where
    Self: Stages,
{
    /// Starts a press: add frames, then ask for what you want.
    ///
    /// # Errors
    /// [`PipelineError::Sensor`] for a reference without pixels, or too dark for the flat field that was asked for.
    pub fn press<'a>(&'a self, reference: ArrayView2<'_, u8>) -> Result<Press<'a>, PipelineError> {
        Press::new(self, reference)
    }

    /// Starts a press on a reference made before; see [`Press::with_reference`].
    pub fn press_on(&self, reference: Arc<ReferenceFrame>) -> Press<'_> {
        Press::with_reference(self, reference)
    }
}

impl<C, R, P, M, W, S> Stages for Pipeline<C, R, P, M, W, S>
where
    C: ContactStage,
    R: SurfaceReconstruction<f64> + Send + Sync,
    P: ControlPointSampler<f64> + Send + Sync,
    M: PointMatcher<f64, 3> + Send + Sync,
    W: WarpModel<f64, 3> + Send + Sync,
    W::Warp: Send + Sync + 'static,
    S: StrainMeasure<f64> + Send + Sync,
{
    fn contact(&self) -> &dyn ContactStage {
        &self.contact
    }

    fn surface(&self) -> &dyn SurfaceReconstruction<f64> {
        &self.surface
    }

    fn sampler(&self) -> &dyn ControlPointSampler<f64> {
        &self.sampler
    }

    fn matcher(&self) -> &dyn PointMatcher<f64, 3> {
        &self.matcher
    }

    fn fit_warp(
        &self,
        sources: &[Point3<f64>],
        targets: &[Point3<f64>],
        weights: &[f64],
    ) -> Result<BoxedWarp, TpsError> {
        Ok(Box::new(self.warp.fit(sources, targets, Some(weights))?))
    }

    fn strain(&self) -> &dyn StrainMeasure<f64> {
        &self.strain
    }

    fn settings(&self) -> &Settings {
        &self.settings
    }
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
