//! Another stage in the place of one.
use super::Pipeline;
use crate::elasticity::strain::StrainMeasure;
use crate::matching::PointMatcher;
use crate::pipeline::binning::Binning;
use crate::pipeline::contact::ContactStage;
use crate::pipeline::surface::SurfaceInput;
use crate::sfs::{ControlPointSampler, SurfaceReconstruction};
use crate::tps::WarpModel;

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
        let Self {
            surface,
            sampler,
            matcher,
            warp,
            strain,
            settings,
            ..
        } = self;
        Pipeline {
            contact,
            surface,
            sampler,
            matcher,
            warp,
            strain,
            settings,
        }
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
        let Self {
            contact,
            sampler,
            matcher,
            warp,
            strain,
            mut settings,
            ..
        } = self;
        settings.surface_input = input;
        if input == SurfaceInput::Signal {
            settings.smoothing_px = 1;
            settings.binning = Binning::Blocks(1);
        }
        Pipeline {
            contact,
            surface,
            sampler,
            matcher,
            warp,
            strain,
            settings,
        }
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
    pub fn with_sampler<P2: ControlPointSampler<f64>>(
        self,
        sampler: P2,
    ) -> Pipeline<C, R, P2, M, W, S> {
        let Self {
            contact,
            surface,
            matcher,
            warp,
            strain,
            settings,
            ..
        } = self;
        Pipeline {
            contact,
            surface,
            sampler,
            matcher,
            warp,
            strain,
            settings,
        }
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
    pub fn with_matcher<M2: PointMatcher<f64, 3>>(
        self,
        matcher: M2,
    ) -> Pipeline<C, R, P, M2, W, S> {
        let Self {
            contact,
            surface,
            sampler,
            warp,
            strain,
            settings,
            ..
        } = self;
        Pipeline {
            contact,
            surface,
            sampler,
            matcher,
            warp,
            strain,
            settings,
        }
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
        let Self {
            contact,
            surface,
            sampler,
            matcher,
            warp,
            settings,
            ..
        } = self;
        Pipeline {
            contact,
            surface,
            sampler,
            matcher,
            warp,
            strain,
            settings,
        }
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
        let Self {
            contact,
            surface,
            sampler,
            matcher,
            strain,
            settings,
            ..
        } = self;
        Pipeline {
            contact,
            surface,
            sampler,
            matcher,
            warp,
            strain,
            settings,
        }
    }
}
