//! The pipeline: its stages, chosen at compile time or, boxed, at run time, and its settings.
use super::binning::Binning;
use super::choice::EstimatorChoice;
use super::contact::{ContactStage, LightContact};
use super::error::PipelineError;
use super::object::Object;
use super::press::Press;
use super::settings::{Settings, Skips};
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

/// A warp of space, of whatever kind.
///
/// ```
/// use nalgebra::Point3;
/// use tactile_imaging::{pipeline::BoxedWarp, tps::{AffineModel, RigidModel, WarpModel}};
/// // Corners of a cube that is drawn out to double its height.
/// let corners: Vec<_> = (0..8).map(|k| Point3::new((k & 1) as f64, (k >> 1 & 1) as f64, (k >> 2) as f64)).collect();
/// let drawn: Vec<_> = corners.iter().map(|p| Point3::new(p.x, p.y, 2.0 * p.z)).collect();
/// let affine: BoxedWarp = Box::new(AffineModel.fit(&corners, &drawn, None)?);
/// let rigid: BoxedWarp = Box::new(RigidModel.fit(&corners, &drawn, None)?);
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
            matcher: RelaxationMatcher::new(RelaxationOptions::default().search(Search::Near)),
            warp: StrainSpline,
            strain: GreenLagrange,
            settings: Settings::new(object),
        }
    }
}

impl<C, R, P, M, W, S> Pipeline<C, R, P, M, W, S> {
    /// Takes another way from frame to contact and force.
    ///
    /// ```
    /// use tactile_imaging::force::Polarity;
    /// use tactile_imaging::pipeline::{ContactStage, DarkContact, Object, Pipeline};
    /// # use tactile_imaging::force::CalibrationPair;
    /// # let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
    /// let light = Pipeline::from_pairs(&pairs, [50e-6; 2], Object::sphere(3e-3))?.with_control_points(80);
    /// assert_eq!(light.contact().polarity(), Polarity::Brighter);
    /// let dark = light.with_contact(DarkContact::new(&[(0.0, 0.0), (100.0, 0.5e-3)], [0.1e-3; 2])?);
    /// assert_eq!((dark.contact().polarity(), dark.contact().pixel_size_m()), (Polarity::Darker, [0.1e-3; 2]));
    /// assert_eq!(dark.settings().control_points, 80, "the rest stays");
    /// # Ok::<(), tactile_imaging::pipeline::PipelineError>(())
    /// ```
    #[must_use]
    pub fn with_contact<C2: ContactStage>(self, contact: C2) -> Pipeline<C2, R, P, M, W, S> {
        let Self { surface, sampler, matcher, warp, strain, settings, .. } = self;
        Pipeline { contact, surface, sampler, matcher, warp, strain, settings }
    }

    /// Takes another way from image to surface, looking at `input`.
    ///
    /// ```
    /// # use tactile_imaging::{pipeline::Trial, simulate::{CalibrationOptions, Camera, PressOptions}};
    /// # let camera = Camera { shape: [130, 174], pixel_size_m: [172.4e-6; 2], ..Camera::default() };
    /// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationOptions::default())?;
    /// use tactile_imaging::pipeline::SurfaceInput;
    /// use tactile_imaging::sfs::{BrooksHorn, Lighting};
    /// let variational = BrooksHorn::new(Lighting::frontal()).with_occluding_rim(true);
    /// let pipeline = trial.pipeline()?.with_surface(variational, SurfaceInput::Shading);
    /// let mut press = trial.press(&pipeline)?;
    /// let heights = press.surface(0)?.surface.heights.iter().copied().filter(|h| h.is_finite());
    /// // Its heights have mean zero: from the rim to the top they are those of the truth.
    /// let (low, high) = heights.fold((0.0, 0.0), |(low, high): (f64, f64), h| (low.min(h), high.max(h)));
    /// assert!(((high - low) / trial.truth().frames[0].surface_height_m - 1.0).abs() < 0.1);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
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
    ///
    /// ```
    /// # use tactile_imaging::{pipeline::Trial, simulate::{CalibrationOptions, Camera, PressOptions}};
    /// # let camera = Camera { shape: [130, 174], pixel_size_m: [172.4e-6; 2], ..Camera::default() };
    /// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationOptions::default())?;
    /// use tactile_imaging::sfs::Random;
    /// let pipeline = trial.pipeline()?.with_sampler(Random::new(7)).with_control_points(40);
    /// let mut press = trial.press(&pipeline)?;
    /// let points = press.control_points(0)?.to_vec();
    /// assert_eq!(points.len(), 40);
    /// assert_eq!(trial.press(&pipeline)?.control_points(0)?, points, "the seed decides");
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn with_sampler<P2: ControlPointSampler<f64>>(self, sampler: P2) -> Pipeline<C, R, P2, M, W, S> {
        let Self { contact, surface, matcher, warp, strain, settings, .. } = self;
        Pipeline { contact, surface, sampler, matcher, warp, strain, settings }
    }

    /// Takes another matcher.
    ///
    /// ```
    /// # use tactile_imaging::{pipeline::Trial, simulate::{CalibrationOptions, Camera, PressOptions}};
    /// # let camera = Camera { shape: [130, 174], pixel_size_m: [172.4e-6; 2], ..Camera::default() };
    /// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationOptions::default())?;
    /// use tactile_imaging::matching::LinearAssignment;
    /// let pipeline = trial.pipeline()?.with_matcher(LinearAssignment::new()).with_control_points(60);
    /// let mut press = trial.press(&pipeline)?;
    /// let matching = press.matching(1)?;
    /// assert!(matching.assignment.iter().all(Option::is_some), "without a limit to the distance every point has a partner");
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn with_matcher<M2: PointMatcher<f64, 3>>(self, matcher: M2) -> Pipeline<C, R, P, M2, W, S> {
        let Self { contact, surface, sampler, warp, strain, settings, .. } = self;
        Pipeline { contact, surface, sampler, matcher, warp, strain, settings }
    }

    /// Takes another measure of strain.
    ///
    /// ```
    /// # use tactile_imaging::{pipeline::Trial, simulate::{CalibrationOptions, Camera, PressOptions}};
    /// # let camera = Camera { shape: [130, 174], pixel_size_m: [172.4e-6; 2], ..Camera::default() };
    /// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationOptions::default())?;
    /// use tactile_imaging::elasticity::strain::Hencky;
    /// let green = trial.pipeline()?.with_control_points(60);
    /// let hencky = green.clone().with_strain(Hencky);
    /// let e = trial.press(&green)?.strain(1)?.summary.mean[(2, 2)];
    /// let logarithmic = trial.press(&hencky)?.strain(1)?.summary.mean[(2, 2)];
    /// // A stretch λ is (λ² − 1)/2 to Green and Lagrange, ln λ to Hencky.
    /// assert!(logarithmic < e && (logarithmic - 0.5 * (1.0 + 2.0 * e).ln()).abs() < 0.02);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn with_strain<S2: StrainMeasure<f64>>(self, strain: S2) -> Pipeline<C, R, P, M, W, S2> {
        let Self { contact, surface, sampler, matcher, warp, settings, .. } = self;
        Pipeline { contact, surface, sampler, matcher, warp, strain, settings }
    }

    /// Takes another family of warps for the strain.
    ///
    /// ```
    /// # use tactile_imaging::{pipeline::Trial, simulate::{CalibrationOptions, Camera, PressOptions}};
    /// # let camera = Camera { shape: [130, 174], pixel_size_m: [172.4e-6; 2], ..Camera::default() };
    /// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationOptions::default())?;
    /// use tactile_imaging::tps::AffineModel;
    /// let pipeline = trial.pipeline()?.with_warp(AffineModel).with_control_points(60);
    /// let mut press = trial.press(&pipeline)?;
    /// let strain = press.strain(1)?;
    /// assert!(strain.summary.spread.amax() < 1e-9, "one gradient for all points");
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn with_warp<W2: WarpModel<f64, 3>>(self, warp: W2) -> Pipeline<C, R, P, M, W2, S> {
        let Self { contact, surface, sampler, matcher, strain, settings, .. } = self;
        Pipeline { contact, surface, sampler, matcher, warp, strain, settings }
    }

    /// Tells of the sensor's layers: both bodies yield.
    ///
    /// ```
    /// use tactile_imaging::elasticity::contact::{Layer, Waveguide};
    /// use tactile_imaging::pipeline::{Object, Pipeline};
    /// # use tactile_imaging::force::CalibrationPair;
    /// # let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
    /// # let hertz = |peak: f64| ndarray::Array2::from_shape_fn((64, 64), |(r, c)| {
    /// #     let d = ((r as f64 - 32.0).hypot(c as f64 - 32.0) / 20.0).min(1.0);
    /// #     10 + (peak * (1.0 - d * d).sqrt()).round() as u8
    /// # });
    /// let gel = Layer { thickness_m: 10e-3, youngs_modulus_pa: 10e6, poisson_ratio: 0.5 };
    /// let rigid = Pipeline::from_pairs(&pairs, [50e-6; 2], Object::sphere(3e-3))?;
    /// let yielding = rigid.clone().with_waveguide(Waveguide::new(vec![gel])?);
    /// let (reference, frame) = (hertz(0.0), hertz(120.0));
    /// let mut modulus = Vec::new();
    /// for pipeline in [&rigid, &yielding] {
    ///     let mut press = pipeline.press(reference.view())?;
    ///     press.add_frame(frame.view());
    ///     modulus.push(press.modulus()?.youngs_modulus_pa);
    /// }
    /// // Compliances add, both of Poisson's ratio ½: 1/E is smaller by the gel's 1/(10 MPa).
    /// assert!((1.0 / modulus[0] - 1.0 / modulus[1] - 1e-7).abs() < 1e-9);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn with_waveguide(mut self, waveguide: Waveguide<f64>) -> Self {
        self.settings.waveguide = Some(waveguide);
        self
    }

    /// Says what is pressed.
    ///
    /// ```
    /// # use tactile_imaging::pipeline::{Object, Pipeline};
    /// # use tactile_imaging::force::CalibrationPair;
    /// let pairs = [0.0, 1e5, 2e5].map(|value| CalibrationPair::loading(value, 1e-5 * value));
    /// let pipeline = Pipeline::from_pairs(&pairs, [21.55e-6; 2], Object::sphere(3e-3))?;
    /// assert!(!pipeline.settings().object.needs_strain());
    /// let unknown = pipeline.with_object(Object::Unknown { poisson_ratio: 0.5 });
    /// assert!(unknown.settings().object.needs_strain());
    /// # Ok::<(), tactile_imaging::pipeline::PipelineError>(())
    /// ```
    #[must_use]
    pub fn with_object(mut self, object: Object) -> Self {
        self.settings.object = object;
        self
    }

    /// Takes another estimator of the modulus. For one of your own see [`Press::load_states`].
    ///
    /// ```
    /// # use tactile_imaging::pipeline::{EstimatorChoice, Trial};
    /// # use tactile_imaging::simulate::{CalibrationOptions, Camera, PressOptions};
    /// # let camera = Camera { shape: [130, 174], pixel_size_m: [172.4e-6; 2], ..Camera::default() };
    /// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationOptions::default())?;
    /// let ratio = trial.pipeline()?.with_estimator(EstimatorChoice::PaperRatio);
    /// let modulus = trial.press(&ratio)?.modulus()?;
    /// assert_eq!(modulus.estimator.to_string(), "stress over mean strain");
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn with_estimator(mut self, estimator: EstimatorChoice) -> Self {
        self.settings.estimator = estimator;
        self
    }

    /// Sets the number of control points.
    ///
    /// ```
    /// # use tactile_imaging::{pipeline::Trial, simulate::{CalibrationOptions, Camera, PressOptions}};
    /// # let camera = Camera { shape: [130, 174], pixel_size_m: [172.4e-6; 2], ..Camera::default() };
    /// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationOptions::default())?;
    /// let pipeline = trial.pipeline()?.with_control_points(40);
    /// assert_eq!(trial.press(&pipeline)?.control_points(0)?.len(), 40);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn with_control_points(mut self, count: usize) -> Self {
        self.settings.control_points = count;
        self
    }

    /// Sets the width in pixels of the smoothing before the surface stage: odd, 1 for none (even widths count as one more).
    ///
    /// ```
    /// use tactile_imaging::{Object, Pipeline};
    /// let pipeline = Pipeline::new((), Object::sphere(3e-3));
    /// assert_eq!(pipeline.settings().smoothing_px, 5);
    /// assert_eq!(pipeline.with_smoothing(8).settings().smoothing_px, 9);
    /// ```
    #[must_use]
    pub fn with_smoothing(mut self, width_px: usize) -> Self {
        self.settings.smoothing_px = width_px | 1;
        self
    }

    /// Sets the grid of the surface stage (default [`Binning::Auto`] for shading, every pixel for signals).
    ///
    /// ```
    /// # use tactile_imaging::{pipeline::Trial, simulate::{CalibrationOptions, Camera, PressOptions}};
    /// # let camera = Camera { shape: [130, 174], pixel_size_m: [172.4e-6; 2], ..Camera::default() };
    /// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationOptions::default())?;
    /// use tactile_imaging::pipeline::Binning;
    /// let pipeline = trial.pipeline()?.with_binning(Binning::Blocks(2));
    /// let mut press = trial.press(&pipeline)?;
    /// // Blocks of 2 × 2 pixels of 172.4 µm.
    /// assert!((press.surface(0)?.pixel_size_m[0] - 344.8e-6).abs() < 1e-12);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn with_binning(mut self, binning: Binning) -> Self {
        self.settings.binning = binning;
        self
    }

    /// Corrects vignetting by the reference's own brightness or not (default: not); see [`Settings::flat_field`].
    ///
    /// ```
    /// use tactile_imaging::{Object, Pipeline};
    /// # use tactile_imaging::force::CalibrationPair;
    /// # let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
    /// // A lens that darkens stray light and signal alike towards the right: by 11 % at the contact.
    /// let lens = |c: usize| 1.0 - 0.005 * (c as f64 - 47.5);
    /// let press = |peak: f64| ndarray::Array2::from_shape_fn((64, 96), |(r, c)| {
    ///     let d = ((r as f64 - 32.0).hypot(c as f64 - 70.0) / 20.0).min(1.0);
    ///     (lens(c) * (100.0 + peak * (1.0 - d * d).sqrt())).round() as u8
    /// });
    /// let pipeline = Pipeline::from_pairs(&pairs, [50e-6; 2], Object::sphere(3e-3))?;
    /// let (reference, frame) = (press(0.0), press(120.0));
    /// for (flat_field, newton) in [(false, 0.89 * 1.005), (true, 1.005)] {
    ///     let pipeline = pipeline.clone().with_flat_field(flat_field);
    ///     let mut press = pipeline.press(reference.view())?;
    ///     press.add_frame(frame.view());
    ///     let force = press.contact(0)?.and_then(|c| c.force_n).expect("a force");
    ///     assert!((force.value / newton - 1.0).abs() < 0.01);
    /// }
    /// # Ok::<(), tactile_imaging::pipeline::PipelineError>(())
    /// ```
    #[must_use]
    pub fn with_flat_field(mut self, flat_field: bool) -> Self {
        self.settings.flat_field = flat_field;
        self
    }

    /// Sets the relative errors common to all forces (default 0.1 %) and to all lengths (default none). What is negative or
    /// not finite counts as zero.
    ///
    /// ```
    /// use tactile_imaging::{Object, Pipeline};
    /// let pipeline = Pipeline::new((), Object::sphere(3e-3)).with_scale_errors(0.02, 0.005);
    /// assert_eq!((pipeline.settings().force_scale_error, pipeline.settings().length_scale_error), (0.02, 0.005));
    /// assert_eq!(pipeline.with_scale_errors(0.02, f64::NAN).settings().length_scale_error, 0.0);
    /// ```
    #[must_use]
    pub fn with_scale_errors(mut self, force: f64, length: f64) -> Self {
        let valid = |v: f64| if v > 0.0 && v.is_finite() { v } else { 0.0 };
        self.settings.force_scale_error = valid(force);
        self.settings.length_scale_error = valid(length);
        self
    }

    /// Sets what may be left out.
    ///
    /// ```
    /// # use tactile_imaging::{pipeline::Trial, simulate::{CalibrationOptions, Camera, PressOptions}};
    /// # let camera = Camera { shape: [130, 174], pixel_size_m: [172.4e-6; 2], ..Camera::default() };
    /// # let trial = Trial::new(PressOptions { camera, ..PressOptions::default() }, &CalibrationOptions::default())?;
    /// use tactile_imaging::pipeline::{Skips, Stage};
    /// let pipeline = trial.pipeline()?.with_skips(Skips { equal_frames: false, ..Skips::default() });
    /// let mut press = pipeline.press(trial.simulation.reference.view())?;
    /// for _ in 0..2 {
    ///     let frame = press.add_frame(trial.simulation.frames[0].view());
    ///     press.contact(frame)?;
    /// }
    /// assert_eq!(press.report().work(Stage::Contact).runs, 2, "the same image, measured twice");
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
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
