//! The pipeline whose stages are chosen at compile time.
mod options;
mod swaps;

use super::contact::{ContactStage, LightContact};
use super::error::PipelineError;
use super::object::Object;
use super::press::Press;
use super::settings::Settings;
use super::stages::{BoxedWarp, Stages};
use super::strain_spline::StrainSpline;
use crate::elasticity::strain::{GreenLagrange, StrainMeasure};
use crate::force::{CalibrationPair, ReferenceFrame};
use crate::matching::{AnnealedSoftassign, PointMatcher, Search, SoftassignOptions};
use crate::sfs::{
    ControlPointSampler, Eikonal, EquallySpaced, Lighting, Rim, SurfaceReconstruction,
};
use crate::tps::{TpsError, WarpModel};
use nalgebra::Point3;
use ndarray::ArrayView2;
use std::sync::Arc;

/// The paper's pipeline, every stage of which can be replaced in one line.
///
/// | parameter | stage | default |
/// |---|---|---|
/// | `C` | frame to contact and force | [`LightContact`] with a linear calibration |
/// | `R` | image to surface | [`Eikonal`], frontal light, zero height at the rim |
/// | `P` | surface to control points | [`EquallySpaced`] |
/// | `M` | points to matches | [`AnnealedSoftassign`] |
/// | `W` | weighted matches to the warp whose gradient is strained | [`StrainSpline`]: thin-plate, kernel −r, smoothed by blocked cross-validation |
/// | `S` | displacement gradient to strain | [`GreenLagrange`] |
///
/// ```
/// use ndarray::Array2;
/// use tactile_imaging::{Object, Pipeline, force::CalibrationPair};
/// // 10⁵ grey levels in all are 1 N; a pixel is 50 µm wide; the ball has a radius of 3 mm.
/// let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
/// let pipeline = Pipeline::from_pairs(&pairs, [50e-6; 2], Object::sphere(3e-3))?;
/// // Hertz's pressure p₀√(1 − r²/a²), a = 20 pixels = 1 mm: (2π/3) a² p₀ grey levels, 1.005 N for p₀ = 120.
/// let hertz = |peak: f64| Array2::from_shape_fn((64, 64), |(r, c)| {
///     let d = ((r as f64 - 32.0).hypot(c as f64 - 32.0) / 20.0).min(1.0);
///     10 + (peak * (1.0 - d * d).sqrt()).round() as u8
/// });
/// let (reference, frame) = (hertz(0.0), hertz(120.0));
/// let mut press = pipeline.press(reference.view())?;
/// press.add_frame(frame.view());
/// // E = (1 − ν²) 3FR/(4a³), the sensor rigid beside the ball.
/// let expected = 0.75 * 3.0 * 1.005 * 3e-3 / (4.0 * 1e-9);
/// assert!((press.modulus()?.youngs_modulus_pa / expected - 1.0).abs() < 0.02);
/// # Ok::<(), tactile_imaging::pipeline::PipelineError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Pipeline<
    C = LightContact,
    R = Eikonal<f64>,
    P = EquallySpaced,
    M = AnnealedSoftassign,
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
        Ok(Self::new(
            LightContact::from_pairs(pairs, pixel_size_m)?,
            object,
        ))
    }
}

impl<C> Pipeline<C> {
    /// The default stages behind any contact stage; no waveguide, 200 control points.
    ///
    /// ```
    /// use tactile_imaging::pipeline::{DarkContact, Object, Pipeline};
    /// let contact = DarkContact::new(&[(0.0, 0.0), (100.0, 0.5e-3)], [0.1e-3; 2])?;
    /// let pipeline = Pipeline::new(contact, Object::Unknown { poisson_ratio: 0.48 });
    /// assert!(pipeline.settings().object.needs_strain());
    /// # Ok::<(), tactile_imaging::pipeline::PipelineError>(())
    /// ```
    pub fn new(contact: C, object: Object) -> Self {
        let surface = Eikonal::new(Lighting::frontal()).with_rim(Rim::Height(0.0));
        Self {
            contact,
            surface: surface.unwrap_or_else(|_| Eikonal::new(Lighting::frontal())),
            sampler: EquallySpaced::new(),
            // Two loads of one contact lie near each other: one run from where they are.
            matcher: AnnealedSoftassign::new(
                SoftassignOptions::default().with_search(Search::Near),
            ),
            warp: StrainSpline,
            strain: GreenLagrange,
            settings: Settings::new(object),
        }
    }
}

impl<C, R, P, M, W, S> Pipeline<C, R, P, M, W, S> {
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
    ///
    /// ```
    /// use std::sync::Arc;
    /// use tactile_imaging::{Object, Pipeline, force::ReferenceFrame};
    /// # use tactile_imaging::force::CalibrationPair;
    /// # let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
    /// # let hertz = |peak: f64| ndarray::Array2::from_shape_fn((64, 64), |(r, c)| {
    /// #     let d = ((r as f64 - 32.0).hypot(c as f64 - 32.0) / 20.0).min(1.0);
    /// #     10 + (peak * (1.0 - d * d).sqrt()).round() as u8
    /// # });
    /// let pipeline = Pipeline::from_pairs(&pairs, [50e-6; 2], Object::sphere(3e-3))?;
    /// let reference = Arc::new(ReferenceFrame::new(hertz(0.0).view())?);
    /// for (peak, newton) in [(60.0, 0.503), (120.0, 1.005)] {
    ///     let frame = hertz(peak);
    ///     let mut press = pipeline.press_on(Arc::clone(&reference));
    ///     press.add_frame(frame.view());
    ///     let force = press.contact(0)?.and_then(|c| c.force_n).expect("a force");
    ///     assert!((force.value / newton - 1.0).abs() < 0.01);
    /// }
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
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
        self.warp.fit(sources, targets, Some(weights))
    }

    fn strain(&self) -> &dyn StrainMeasure<f64> {
        &self.strain
    }

    fn settings(&self) -> &Settings {
        &self.settings
    }
}
