//! The main scene: one sphere pressed on the waveguide at several loads.

use ndarray::Array2;

use super::contact::Contact;
use super::error::SimulateError;
use super::material::Sphere;
use super::pixel_average::{Disc, Patch, Profile};
use super::press_options::{Gain, Load, PressOptions};
use super::truth::PressTruth;

/// A checked scene that makes frames and knows the truth.
///
/// ```
/// use tactile_imaging::simulate::{Camera, PressOptions, PressScene};
///
/// let camera = Camera { shape: [260, 348], pixel_size_m: [86.2e-6; 2], ..Camera::default() };
/// let scene = PressScene::new(PressOptions { camera, ..PressOptions::default() })?;
/// let made = scene.simulate();
/// assert_eq!(made.frames.len(), 2);
/// assert_eq!(made.truth[0].contact.force_n, 0.7);
/// # Ok::<(), tactile_imaging::simulate::SimulateError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct PressScene {
    options: PressOptions,
    contacts: Vec<Contact>,
    grey_per_pascal: f64,
    peak_pressure_pa: f64,
}

/// The frames of a scene and their truth.
///
/// ```
/// use tactile_imaging::simulate::{Camera, PressOptions, PressScene};
/// let camera = Camera { shape: [65, 87], pixel_size_m: [345e-6; 2], ..Camera::default() };
/// let made = PressScene::new(PressOptions { camera, ..PressOptions::default() })?.simulate();
/// let sum = |frame: &ndarray::Array2<u8>| frame.iter().map(|&v| f64::from(v)).sum::<f64>();
/// let light = made.frames.iter().map(|frame| sum(frame) - sum(&made.reference)).collect::<Vec<_>>();
/// assert!((light[1] / light[0] / (1.2 / 0.7) - 1.0).abs() < 0.02, "light in proportion to force");
/// assert_eq!(made.youngs_modulus_pa, 103e3);
/// # Ok::<(), tactile_imaging::simulate::SimulateError>(())
/// ```
#[derive(Debug, Clone)]
pub struct PressSimulation {
    /// The frame without contact.
    pub reference: Array2<u8>,
    /// One frame per load.
    pub frames: Vec<Array2<u8>>,
    /// The truth of each frame.
    pub truth: Vec<PressTruth>,
    /// Size of a pixel in metres, x and y.
    pub pixel_size_m: [f64; 2],
    /// Young's modulus of the object in pascal: what a measurement should find.
    pub youngs_modulus_pa: f64,
}

impl PressScene {
    /// Checks `options` and solves the contact at every load.
    ///
    /// # Errors
    /// [`SimulateError::OutOfRange`] or [`SimulateError::TooFew`] naming the first field that has no meaning.
    pub fn new(options: PressOptions) -> Result<Self, SimulateError> {
        options.validate()?;
        let contact =
            |l: &Load| Contact::new(&options.object, &options.waveguide, options.law, l.force_n);
        let contacts: Vec<Contact> = options.loads.iter().map(contact).collect();
        let peak_pressure_pa = contacts
            .iter()
            .map(|c| c.peak_pressure_pa)
            .fold(0.0, f64::max);
        let grey_per_pascal = match options.gain {
            Gain::GreyPerPascal(gain) => gain,
            Gain::PeakGrey(_) if peak_pressure_pa == 0.0 => 0.0,
            Gain::PeakGrey(grey) => grey / (peak_pressure_pa * (1.0 - options.response.droop())),
        };
        Ok(Self {
            options,
            contacts,
            grey_per_pascal,
            peak_pressure_pa,
        })
    }

    /// What the scene was made from.
    pub fn options(&self) -> &PressOptions {
        &self.options
    }

    /// Grey levels per pascal.
    pub fn grey_per_pascal(&self) -> f64 {
        self.grey_per_pascal
    }

    /// κ/p_max of the response g·p·(1 − κ p/p_max), in 1/Pa.
    ///
    /// ```
    /// use std::f64::consts::PI;
    /// use tactile_imaging::simulate::{Camera, PressOptions, PressScene, Response};
    /// let camera = Camera { shape: [65, 87], pixel_size_m: [345e-6; 2], ..Camera::default() };
    /// let response = Response::Quadratic { droop: 0.2 };
    /// let scene = PressScene::new(PressOptions { camera, response, ..PressOptions::default() })?;
    /// let contact = scene.truth(0).contact;
    /// // ∫ p² dS = π a² p₀²/2: what the bend takes from the force's light.
    /// let squared = 0.5 * PI * (contact.contact_radius_m * contact.peak_pressure_pa).powi(2);
    /// let seen_n = contact.force_n - scene.droop_per_pascal() * squared;
    /// let light = scene.grey_per_pascal() * seen_n / camera.pixel_area_m2();
    /// assert!((scene.truth(0).integrated_pixel_value / light - 1.0).abs() < 1e-9);
    /// # Ok::<(), tactile_imaging::simulate::SimulateError>(())
    /// ```
    pub fn droop_per_pascal(&self) -> f64 {
        if self.peak_pressure_pa == 0.0 {
            0.0
        } else {
            self.options.response.droop() / self.peak_pressure_pa
        }
    }

    /// The frame without contact, and the frames and truth of every load.
    pub fn simulate(&self) -> PressSimulation {
        let loads = 0..self.contacts.len();
        PressSimulation {
            reference: self.reference(0),
            frames: loads.clone().map(|k| self.frame(k, 0)).collect(),
            truth: loads.map(|k| self.truth(k)).collect(),
            pixel_size_m: self.options.camera.pixel_size_m,
            youngs_modulus_pa: self.options.object.material.youngs_modulus_pa,
        }
    }

    /// An exposure without contact; each `repeat` has its own noise.
    pub fn reference(&self, repeat: u32) -> Array2<u8> {
        self.options
            .camera
            .expose_reference(self.options.seed, repeat)
    }

    /// An exposure of load `load`; each `repeat` has its own noise.
    ///
    /// # Panics
    /// If there is no such load.
    pub fn frame(&self, load: usize, repeat: u32) -> Array2<u8> {
        let light = self.expected_frame(load);
        self.options
            .camera
            .expose_load(light.view(), self.options.seed, load, repeat)
    }

    /// Expected grey levels of load `load`, before noise and rounding. Pass it to [`Camera::expose`](super::Camera::expose) to draw many
    /// exposures of the same light.
    ///
    /// ```
    /// use tactile_imaging::simulate::{Camera, PressOptions, PressScene};
    /// let camera = Camera { shape: [65, 87], pixel_size_m: [345e-6; 2], ..Camera::default() };
    /// let scene = PressScene::new(PressOptions { camera, ..PressOptions::default() })?;
    /// let light = scene.expected_frame(1);
    /// let frames: Vec<_> = (0..50).map(|repeat| scene.frame(1, repeat)).collect();
    /// let at = [32, 43]; // the middle of the contact
    /// let mean = frames.iter().map(|frame| f64::from(frame[at])).sum::<f64>() / 50.0;
    /// let sd = scene.options().camera.noise_sd_grey(light[at]);
    /// assert!((mean - light[at]).abs() < 5.0 * sd / 50_f64.sqrt());
    /// assert_ne!(scene.reference(0), scene.reference(1), "another exposure, other noise");
    /// # Ok::<(), tactile_imaging::simulate::SimulateError>(())
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

    /// The truth of load `load`.
    ///
    /// # Panics
    /// If there is no such load.
    pub fn truth(&self, load: usize) -> PressTruth {
        PressTruth::new(self, load)
    }

    /// The same waveguide, camera, light and centre with another object and other loads.
    pub(super) fn with_object(
        &self,
        object: Sphere,
        loads: Vec<Load>,
    ) -> Result<Self, SimulateError> {
        let changed = Self::new(PressOptions {
            object,
            loads,
            ..self.options.clone()
        })?;
        Ok(Self {
            grey_per_pascal: self.grey_per_pascal,
            peak_pressure_pa: self.peak_pressure_pa,
            ..changed
        })
    }

    /// Contact of load `load`.
    pub(super) fn contact(&self, load: usize) -> &Contact {
        &self.contacts[load]
    }

    /// The contact's disc on the image plane.
    pub(super) fn disc(&self, load: usize) -> Disc {
        let options = &self.options;
        let middle = options
            .centre_px
            .unwrap_or_else(|| options.camera.middle_px());
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

    /// Blurred light of the contact in grey levels above the background; none without force.
    pub(super) fn leaked_light(&self, load: usize) -> Option<Patch> {
        let (disc, camera) = (self.disc(load), &self.options.camera);
        if disc.radius_m == 0.0 {
            return None;
        }
        let window = disc.window(camera.shape, camera.blur_reach());
        let mut patch = disc.average(Profile::Hemisphere, window);
        let peak = self.contacts[load].peak_pressure_pa;
        patch
            .values
            .map_inplace(|v| *v *= self.grey_per_pascal * peak);
        let droop = self.droop_per_pascal();
        if droop > 0.0 {
            let square = disc.average(Profile::Paraboloid, window);
            patch
                .values
                .scaled_add(-self.grey_per_pascal * droop * peak * peak, &square.values);
        }
        camera.blur(&mut patch);
        Some(patch)
    }
}
