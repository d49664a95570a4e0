//! The main scene: one sphere pressed on the layered waveguide at several loads, with its options,
//! its frames, and the truth for each stage of a measurement.

use crate::camera::Camera;
use crate::contact::{ContactModel, SimulatedContact};
use crate::error::{SimulateError, at_least, finite, not_negative, positive, within};
use crate::light::{Illumination, LightLaw, Response, pressure_patch};
use crate::materials::{Elastic, ElasticSphere, LightGuide};
use crate::pixel_average::{Disc, PixelPatch};
use nalgebra::{Matrix3, Point3};
use ndarray::Array2;

/// A validated scene that generates frames and their truth.
///
/// ```
/// use tactile_simulate::{Camera, PressOptions, PressScene};
///
/// let camera = Camera::default().coarser(4);
/// let scene = PressScene::new(PressOptions { camera, ..PressOptions::default() })?;
/// let made = scene.simulate();
/// assert_eq!(made.frames.len(), 2);
/// assert_eq!(made.truth[0].contact.force_n, 0.7);
/// assert_eq!(scene.options().loads[0].force_n, 0.7);
/// # Ok::<(), tactile_simulate::SimulateError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct PressScene {
    options: PressOptions,
    contacts: Vec<SimulatedContact>,
    pub(crate) light: LightLaw,
}

impl PressScene {
    /// Validates `options` and solves the contact at each load.
    ///
    /// # Errors
    /// [`SimulateError::OutOfRange`] or [`SimulateError::TooFew`] with the name of the first
    /// invalid field.
    pub fn new(options: PressOptions) -> Result<Self, SimulateError> {
        options.validate()?;
        let contacts = (options.loads.iter())
            .map(|load| {
                SimulatedContact::new(
                    &options.object,
                    &options.waveguide,
                    &options.law,
                    load.force_n,
                )
            })
            .collect::<Result<Vec<_>, _>>()?;
        let largest_pressure_pa = contacts
            .iter()
            .map(|c| c.peak_pressure_pa)
            .fold(0.0, f64::max);
        let response = options.response;
        let grey_per_pascal = options
            .gain
            // Gain for the light at the peak rather than the pressure: a response that saturates
            // needs a higher gain.
            .grey_per_pascal(largest_pressure_pa * response.light(1.0));
        let light = LightLaw {
            response,
            grey_per_pascal,
            largest_pressure_pa,
        };
        Ok(Self {
            options,
            contacts,
            light,
        })
    }

    /// The options of the scene.
    pub fn options(&self) -> &PressOptions {
        &self.options
    }

    /// An exposure without contact. Each `repeat` has its own noise.
    pub fn reference(&self, repeat: u32) -> Array2<u8> {
        self.options
            .camera
            .expose_reference(self.options.seed, repeat)
    }

    /// An exposure of load `load`. Each `repeat` has its own noise.
    ///
    /// # Panics
    /// If there is no such load.
    pub fn frame(&self, load: usize, repeat: u32) -> Array2<u8> {
        let light = self.expected_frame(load);
        self.options
            .camera
            .expose_load(light.view(), self.options.seed, load, repeat)
    }

    /// Expected grey levels of load `load`, before noise and rounding. Pass them to
    /// [`Camera::expose`](crate::Camera::expose) to generate many exposures of the same light.
    ///
    /// ```
    /// use tactile_simulate::{Camera, PressOptions, PressScene};
    /// let camera = Camera::default().coarser(16);
    /// let scene = PressScene::new(PressOptions { camera, ..PressOptions::default() })?;
    /// let light = scene.expected_frame(1);
    /// let frames: Vec<_> = (0..50).map(|repeat| scene.frame(1, repeat)).collect();
    /// let at = [32, 43]; // the centre of the contact
    /// let mean = frames.iter().map(|frame| f64::from(frame[at])).sum::<f64>() / 50.0;
    /// // Photon noise of 15 000 electrons at 255 grey levels; read noise of half a level.
    /// let sd = (light[at] * 255.0 / 15e3 + 0.25).sqrt();
    /// assert!((mean - light[at]).abs() < 5.0 * sd / 50_f64.sqrt());
    /// assert_ne!(scene.reference(0), scene.reference(1), "another exposure, other noise");
    /// # Ok::<(), tactile_simulate::SimulateError>(())
    /// ```
    ///
    /// # Panics
    /// If there is no such load.
    pub fn expected_frame(&self, load: usize) -> Array2<f64> {
        let leaked = self.leaked_light(load);
        self.options
            .camera
            .compose(leaked.as_slice(), &self.options.loads[load].illumination)
    }

    /// Another object on the same sensor, with the same light, camera and centre, for example the
    /// balls of a calibration.
    ///
    /// ```
    /// use tactile_simulate::{
    ///     Camera, ContactModel, Elastic, ElasticSphere, PressLoad, PressOptions, PressScene,
    /// };
    /// let camera = Camera::default().coarser(16);
    /// let scene = PressScene::new(PressOptions { camera, ..PressOptions::default() })?;
    /// let ball = ElasticSphere { radius_m: 10e-3, material: Elastic::RIGID };
    /// let other = scene.with_object(ball, ContactModel::Hertz, vec![PressLoad::normal(0.5)])?;
    /// assert_eq!(other.truth(0).grey_per_pascal, scene.truth(0).grey_per_pascal);
    /// assert_eq!(other.truth(0).contact.sphere_radius_m, 10e-3);
    /// # Ok::<(), tactile_simulate::SimulateError>(())
    /// ```
    ///
    /// # Errors
    /// [`SimulateError`] for an invalid object or invalid loads.
    pub fn with_object(
        &self,
        object: ElasticSphere,
        law: ContactModel,
        loads: Vec<PressLoad>,
    ) -> Result<Self, SimulateError> {
        let changed = Self::new(PressOptions {
            object,
            law,
            loads,
            ..self.options.clone()
        })?;
        Ok(Self {
            // Otherwise a gain by peak grey level would be changed by the pressure of the other
            // object.
            light: self.light,
            ..changed
        })
    }

    /// The disc of the contact on the image plane.
    fn disc(&self, load: usize) -> Disc {
        let options = &self.options;
        let middle = options.camera.centre_px(options.centre_px);
        let pixel_size_m = options.camera.pixel_size_m;
        let shear = options.loads[load].shear_n;
        let centre_px = std::array::from_fn(|k| {
            middle[k] + shear[k] / options.shear_stiffness_n_per_m[k] / pixel_size_m[k]
        });
        Disc {
            centre_px,
            radius_m: self.contacts[load].contact_radius_m,
            pixel_size_m,
        }
    }

    /// Blurred light of the contact in grey levels above the background. `None` without force.
    fn leaked_light(&self, load: usize) -> Option<PixelPatch> {
        let (disc, camera) = (self.disc(load), &self.options.camera);
        if disc.radius_m == 0.0 {
            return None;
        }
        let (plane, contact) = (camera.plane(), &self.contacts[load]);
        // The blur adds light from its reach around the frame, so the window is extended by it.
        let mut patch = if plane.is_flat() {
            let window = disc.window(camera.shape, camera.blur_reach());
            self.light.patch(contact, &disc, window)
        } else {
            let window = disc.bent_window(plane, camera.shape, camera.blur_reach());
            self.light.bent_patch(contact, &disc, plane, window)
        };
        camera.blur(&mut patch);
        Some(patch)
    }
}

/// Number of grey levels per pascal.
///
/// ```
/// use tactile_simulate::{Camera, Gain, PressLoad, PressOptions, PressScene};
/// let camera = Camera::default().coarser(16);
/// let scene = |force_n, gain| {
///     PressScene::new(PressOptions {
///         camera,
///         gain,
///         loads: vec![PressLoad::normal(force_n)],
///         ..Default::default()
///     })
/// };
/// let first = scene(1.2, Gain::PeakGrey(200.0))?;
/// let peak_pa = first.truth(0).contact.peak_pressure_pa;
/// assert!((first.truth(0).grey_per_pascal * peak_pa - 200.0).abs() < 1e-9);
/// let same_sensor = scene(0.3, Gain::GreyPerPascal(first.truth(0).grey_per_pascal))?;
/// let light = |scene: &PressScene| scene.truth(0).integrated_pixel_value;
/// assert!(
///     (light(&first) / light(&same_sensor) - 4.0).abs() < 1e-9,
///     "light proportional to force"
/// );
/// # Ok::<(), tactile_simulate::SimulateError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum Gain {
    /// Grey levels above the background at the peak pressure of the largest load (before
    /// vignetting).
    PeakGrey(f64),
    /// A fixed number of grey levels per pascal. Use it to share one calibration among scenes.
    GreyPerPascal(f64),
}

impl Gain {
    /// Grey levels per pascal in a scene whose brightest point has the light of `largest_pa`. 0 if
    /// a peak is requested and nothing is lit.
    pub(crate) fn grey_per_pascal(self, largest_pa: f64) -> f64 {
        match self {
            Self::GreyPerPascal(gain) => gain,
            Self::PeakGrey(grey) if largest_pa > 0.0 => grey / largest_pa,
            Self::PeakGrey(_) => 0.0,
        }
    }

    pub(crate) fn validate(self) -> Result<(), SimulateError> {
        match self {
            Self::PeakGrey(value) | Self::GreyPerPascal(value) => not_negative("gain", value),
        }
    }
}

/// One state of load.
///
/// ```
/// use tactile_simulate::{Camera, PressLoad, PressOptions, PressScene};
/// let camera = Camera::default().coarser(16);
/// let loads = vec![
///     PressLoad::normal(0.7),
///     PressLoad {
///         shear_n: [0.28, 0.0],
///         ..PressLoad::normal(0.7)
///     },
/// ];
/// let scene = PressScene::new(PressOptions {
///     camera,
///     loads,
///     ..PressOptions::default()
/// })?;
/// let [x, sheared] = [0, 1].map(|k| scene.truth(k).centre_px[0]);
/// let moved_m = (sheared - x) * camera.pixel_size_m[0];
/// assert!((moved_m - 0.7e-3).abs() < 1e-12, "0.28 N over 400 N/m");
/// # Ok::<(), tactile_simulate::SimulateError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PressLoad {
    /// Normal force in newtons.
    pub force_n: f64,
    /// Shear force (x, y) in newtons. It displaces the contact by the force over
    /// [`PressOptions::shear_stiffness_n_per_m`].
    pub shear_n: [f64; 2],
    /// Illumination, relative to the reference frame.
    pub illumination: Illumination,
}

impl PressLoad {
    /// A normal force without shear, with unchanged illumination.
    pub fn normal(force_n: f64) -> Self {
        Self {
            force_n,
            shear_n: [0.0; 2],
            illumination: Illumination::default(),
        }
    }
}

/// Description of a press, validated by [`PressScene::new`](crate::PressScene::new).
///
/// ```
/// use tactile_simulate::{Camera, Elastic, PressLoad, PressOptions, PressScene, ElasticSphere};
/// let options = PressOptions {
///     object: ElasticSphere { radius_m: 20e-3, material: Elastic::CL2003X },
///     loads: vec![PressLoad::normal(0.2), PressLoad::normal(0.4)],
///     camera: Camera::default().coarser(16),
///     seed: 7,
///     ..PressOptions::default()
/// };
/// let made = PressScene::new(options.clone())?.simulate();
/// assert!(
///     made.truth
///         .iter()
///         .all(|t| t.contact.contact_radius_m < 0.3 * 20e-3),
///     "inside Hertz's range"
/// );
/// assert_eq!(
///     PressScene::new(options)?.simulate().frames,
///     made.frames,
///     "one seed, the same bits"
/// );
/// # Ok::<(), tactile_simulate::SimulateError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PressOptions {
    /// The object.
    pub object: ElasticSphere,
    /// The waveguide.
    pub waveguide: LightGuide,
    /// Source of pressure, radius and indentation at each force.
    pub law: ContactModel,
    /// Loads, one frame each.
    pub loads: Vec<PressLoad>,
    /// Centre (x, y) of the contact without shear, in pixels. `None` for the centre of the frame.
    pub centre_px: Option<[f64; 2]>,
    /// K_x, K_y of F_x = K_x u_x, F_y = K_y u_y in newtons per metre.
    pub shear_stiffness_n_per_m: [f64; 2],
    /// Camera, lens and stray light.
    pub camera: Camera,
    /// Response of the light to pressure.
    pub response: Response,
    /// Grey levels per pascal.
    pub gain: Gain,
    /// Seed of the noise.
    pub seed: u64,
}

impl Default for PressOptions {
    /// The paper's experiment (§5): a CL2000X sphere of 3 mm radius at 0.7 N and 1.2 N. The
    /// brightest pixel is expected at 15 + 200 of 255 grey levels: 40 levels, twenty times its
    /// noise, remain before saturation.
    ///
    /// Hertz's a/R is 1.09 and 1.30 there, far outside small contact. For scenes inside Hertz's
    /// range, use a larger sphere or smaller loads.
    fn default() -> Self {
        Self {
            object: ElasticSphere {
                radius_m: 3e-3,
                material: Elastic::CL2000X,
            },
            waveguide: LightGuide::default(),
            law: ContactModel::Hertz,
            loads: vec![PressLoad::normal(0.7), PressLoad::normal(1.2)],
            centre_px: None,
            shear_stiffness_n_per_m: [400.0; 2],
            camera: Camera::default(),
            response: Response::Linear,
            gain: Gain::PeakGrey(200.0),
            seed: 1,
        }
    }
}

impl PressOptions {
    fn validate(&self) -> Result<(), SimulateError> {
        self.object.validate()?;
        self.waveguide.validate()?;
        self.camera.validate()?;
        self.response.validate()?;
        self.law.validate()?;
        at_least("loads", self.loads.len(), 1)?;
        // The load number takes 16 bits of the number of its noise stream, and 0 is the reference
        // frame.
        within("loads", self.loads.len() as f64, 1.0, 65534.0)?;
        for load in &self.loads {
            not_negative("the force in N", load.force_n)?;
            load.illumination.validate()?;
            for k in 0..2 {
                finite("shear_n", load.shear_n[k])?;
                positive("shear_stiffness_n_per_m", self.shear_stiffness_n_per_m[k])?;
                finite("centre_px", self.centre_px.map_or(0.0, |c| c[k]))?;
            }
        }
        self.gain.validate()
    }
}

/// The frames of a scene with their truth.
///
/// ```
/// use tactile_simulate::{Camera, PressOptions, PressScene};
/// let camera = Camera::default().coarser(16);
/// let made = PressScene::new(PressOptions { camera, ..PressOptions::default() })?.simulate();
/// let sum = |frame: &ndarray::Array2<u8>| frame.iter().map(|&v| f64::from(v)).sum::<f64>();
/// let light = made
///     .frames
///     .iter()
///     .map(|frame| sum(frame) - sum(&made.reference))
///     .collect::<Vec<_>>();
/// assert!(
///     (light[1] / light[0] / (1.2 / 0.7) - 1.0).abs() < 0.02,
///     "light proportional to force"
/// );
/// assert_eq!(made.youngs_modulus_pa, 103e3);
/// # Ok::<(), tactile_simulate::SimulateError>(())
/// ```
#[derive(Debug, Clone)]
pub struct PressSimulation {
    /// The frame without contact.
    pub reference: Array2<u8>,
    /// One frame per load.
    pub frames: Vec<Array2<u8>>,
    /// Truth of each frame.
    pub truth: Vec<PressTruth>,
    /// Size of a pixel in metres, x and y.
    pub pixel_size_m: [f64; 2],
    /// Young's modulus of the object in pascals, which a measurement should find.
    pub youngs_modulus_pa: f64,
}

impl PressScene {
    /// The frame without contact, and the frames and truth of all loads.
    pub fn simulate(&self) -> PressSimulation {
        let loads = 0..self.options().loads.len();
        PressSimulation {
            reference: self.reference(0),
            frames: loads.clone().map(|k| self.frame(k, 0)).collect(),
            truth: loads.map(|k| self.truth(k)).collect(),
            pixel_size_m: self.options().camera.pixel_size_m,
            youngs_modulus_pa: self.options().object.material.youngs_modulus_pa,
        }
    }
}

/// The truth of one frame.
///
/// ```
/// use tactile_simulate::{Camera, PressOptions, PressScene};
/// let camera = Camera::default().coarser(16);
/// let scene = PressScene::new(PressOptions { camera, ..PressOptions::default() })?;
/// let (truth, later) = (scene.truth(0), scene.truth(1));
/// let pixel_m2 = camera.pixel_size_m.iter().product::<f64>();
/// assert!((truth.pressure_pa().sum() * pixel_m2 - 0.7).abs() < 1e-9, "the force");
/// let middle = [32, 43];
/// assert_eq!(truth.apparent_height_m()[middle], truth.contact.contact_radius_m);
/// let [first, second] = [&truth, &later].map(|t| t.waveguide_height_m()[middle]);
/// assert!(second < first, "pressed deeper");
/// assert_eq!(truth.centre_px, later.centre_px);
/// // The light above the background, over the grey levels per pascal, times the area of a pixel,
/// // is 0.7 N.
/// let seen_n = truth.integrated_pixel_value / truth.grey_per_pascal * pixel_m2;
/// assert!((seen_n / 0.7 - 1.0).abs() < 1e-9);
/// assert!((truth.scaling_to(&later).scale - (1.2_f64 / 0.7).cbrt()).abs() < 1e-12);
/// # Ok::<(), tactile_simulate::SimulateError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct PressTruth {
    /// Force, contact radius, pressure and indentation.
    pub contact: SimulatedContact,
    /// The load of the frame.
    pub load: PressLoad,
    /// Centre (x, y) of the contact in pixels.
    pub centre_px: [f64; 2],
    /// Centroid (x, y) of the pressure inside the frame, by pixel averages. It is the centre within
    /// about 1e-5 px, unless the edge of the frame cuts the contact. NaN if nothing is visible.
    pub centroid_px: [f64; 2],
    /// The force inside the frame, in newtons.
    pub visible_force_n: f64,
    /// Sum over the frame of leaked light in grey levels, without blur, lens, noise and clipping:
    /// (grey/Pa)·F/pixel area for a linear response.
    pub integrated_pixel_value: f64,
    /// Grey levels per pascal (at small pressure).
    pub grey_per_pascal: f64,
    /// Pixels whose expected grey level exceeds 255.
    pub saturated_pixels: usize,
    /// Size of a pixel in metres, x and y.
    pub pixel_size_m: [f64; 2],
    shape: [usize; 2],
}

impl PressScene {
    /// The truth of load `load`.
    ///
    /// # Panics
    /// If there is no such load.
    pub fn truth(&self, load: usize) -> PressTruth {
        let (contact, options) = (self.contacts[load].clone(), &self.options);
        let disc = self.disc(load);
        let mut truth = PressTruth {
            contact,
            load: options.loads[load],
            centre_px: disc.centre_px,
            centroid_px: [f64::NAN; 2],
            visible_force_n: 0.0,
            integrated_pixel_value: 0.0,
            grey_per_pascal: self.light.grey_per_pascal,
            saturated_pixels: self.saturated_pixels(load),
            pixel_size_m: disc.pixel_size_m,
            shape: options.camera.shape,
        };
        truth.add_moments(&self.light);
        truth
    }

    /// Pixels whose expected grey level exceeds 255. The frame is computed only if there can be
    /// any.
    fn saturated_pixels(&self, load: usize) -> usize {
        let (options, illumination) = (&self.options, self.options.loads[load].illumination);
        let peak = self.contacts[load].peak_pressure_pa;
        let brightest = options.camera.background_grey + self.light.grey_at(peak);
        let lit =
            illumination.level + 0.5 * (illumination.tilt[0].abs() + illumination.tilt[1].abs());
        // Lens and blur only reduce the light at the brightest point.
        if brightest * lit <= 255.0 {
            return 0;
        }
        let light = self.expected_frame(load);
        light.iter().filter(|&&v| v > 255.0).count()
    }
}

impl PressTruth {
    /// Pressure in pascals, averaged over each pixel. Its sum times the pixel area is the visible
    /// force.
    pub fn pressure_pa(&self) -> Array2<f64> {
        let mut field = Array2::zeros(self.shape);
        if self.contact.contact_radius_m > 0.0 {
            let disc = self.disc();
            pressure_patch(&self.contact, &disc, disc.window(self.shape, 0)).add_to(&mut field);
        }
        field
    }

    /// Height of the apparent surface in metres at pixel centres (see
    /// [`SimulatedContact::apparent_height_m`]).
    pub fn apparent_height_m(&self) -> Array2<f64> {
        Array2::from_shape_fn(self.shape, |(row, col)| {
            let [x, y] = self.offset_m(row, col);
            self.contact.apparent_height_m(x.hypot(y))
        })
    }

    /// Vertical displacement in metres of the waveguide's surface at pixel centres, negative under
    /// the object.
    pub fn waveguide_height_m(&self) -> Array2<f64> {
        Array2::from_shape_fn(self.shape, |(row, col)| {
            let [x, y] = self.offset_m(row, col);
            self.contact.waveguide_height_m(x.hypot(y))
        })
    }

    /// Map of the apparent surface from this load to a `later` one.
    pub fn scaling_to(&self, later: &Self) -> SurfaceScaling {
        SurfaceScaling {
            from_centre_m: self.centre_m(),
            to_centre_m: later.centre_m(),
            scale: later.contact.contact_radius_m / self.contact.contact_radius_m,
            height_scale: height_scale(&self.contact, &later.contact),
        }
    }

    /// The centre (x, y) of the contact in metres from the centre of the first pixel.
    fn centre_m(&self) -> [f64; 2] {
        std::array::from_fn(|k| self.centre_px[k] * self.pixel_size_m[k])
    }

    /// Offset of a pixel's centre from that of the contact, in metres.
    fn offset_m(&self, row: usize, col: usize) -> [f64; 2] {
        let at = [col as f64, row as f64];
        std::array::from_fn(|k| (at[k] - self.centre_px[k]) * self.pixel_size_m[k])
    }

    fn disc(&self) -> Disc {
        let radius_m = self.contact.contact_radius_m;
        Disc {
            centre_px: self.centre_px,
            radius_m,
            pixel_size_m: self.pixel_size_m,
        }
    }

    /// Adds force, centroid and integrated pixel value of the visible part.
    fn add_moments(&mut self, light: &LightLaw) {
        if self.contact.contact_radius_m == 0.0 {
            return;
        }
        let disc = self.disc();
        // No margin for the blur, because the truth is the light before it.
        let window = disc.window(self.shape, 0);
        let pressure = pressure_patch(&self.contact, &disc, window);
        let (mut sum, mut sum_x, mut sum_y) = (0.0, 0.0, 0.0);
        for ((r, c), &v) in pressure.values.indexed_iter() {
            sum += v;
            sum_x += v * c as f64;
            sum_y += v * r as f64;
        }
        if sum > 0.0 {
            // Moments are summed within the window, where the coordinates are small, and shifted
            // afterwards.
            let [row0, col0] = pressure.origin;
            self.centroid_px = [sum_x / sum + col0 as f64, sum_y / sum + row0 as f64];
        }
        self.visible_force_n = sum * self.pixel_size_m[0] * self.pixel_size_m[1];
        self.integrated_pixel_value = light.patch(&self.contact, &disc, window).values.sum();
    }
}

/// The map from the apparent surface of one load to that of another: a scaling about the centre of
/// the contact.
///
/// The surface read from a press follows Hertz's law approximately: a hemisphere with the contact
/// radius, which grows by (F₂/F₁)^⅓ for any modulus of the object. Its strain does not depend on
/// the modulus. At finite strain the surface grows less along z than laterally.
///
/// ```
/// use nalgebra::Point3;
/// use tactile_simulate::SurfaceScaling;
/// let map = SurfaceScaling {
///     from_centre_m: [5e-3, 5e-3],
///     to_centre_m: [6e-3, 5e-3],
///     scale: 1.2,
///     height_scale: 1.1,
/// };
/// let moved = map.apply(&Point3::new(7e-3, 5e-3, 1e-3));
/// assert!((moved - Point3::new(8.4e-3, 5e-3, 1.1e-3)).norm() < 1e-15);
/// let strain = map.green_lagrange_strain();
/// assert!(
///     (strain[(0, 0)] - 0.22).abs() < 1e-15 && (strain[(2, 2)] - 0.105).abs() < 1e-15,
///     "½(s² − 1)"
/// );
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct SurfaceScaling {
    /// Centre (x, y) of the first contact in metres from the centre of the first pixel.
    pub from_centre_m: [f64; 2],
    /// Centre (x, y) of the second contact.
    pub to_centre_m: [f64; 2],
    /// a₂/a₁, (F₂/F₁)^⅓ under Hertz's law.
    pub scale: f64,
    /// Growth of the apparent heights, by least squares over the contact. It is a₂/a₁ under Hertz's
    /// law.
    pub height_scale: f64,
}

impl SurfaceScaling {
    /// The point of the second surface that corresponds to a point of the first.
    pub fn apply(&self, point: &Point3<f64>) -> Point3<f64> {
        let [x, y] = std::array::from_fn(|k| {
            self.to_centre_m[k] + self.scale * (point[k] - self.from_centre_m[k])
        });
        Point3::new(x, y, self.height_scale * point.z)
    }

    /// The Green–Lagrange strain of the map, ½(s² − 1) along each axis.
    pub fn green_lagrange_strain(&self) -> Matrix3<f64> {
        let along = [self.scale, self.scale, self.height_scale];
        // As a product, because s² − 1 loses digits at small strain.
        Matrix3::from_diagonal(&along.map(|s| 0.5 * (s - 1.0) * (s + 1.0)).into())
    }
}

/// The factor k of z₂(ρ) = k z₁(ρ) at equal ρ = r/a, by least squares over the discs.
fn height_scale(from: &SimulatedContact, to: &SimulatedContact) -> f64 {
    const RINGS: i32 = 32;
    let (mut product, mut square) = (0.0, 0.0);
    for ring in 0..RINGS {
        // Rings of equal area have equal weights.
        let rho = ((f64::from(ring) + 0.5) / f64::from(RINGS)).sqrt();
        let [first, second] = [from, to].map(|c| c.apparent_height_m(rho * c.contact_radius_m));
        product += first * second;
        square += first * first;
    }
    product / square
}
