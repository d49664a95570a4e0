//! The main scene: one sphere pressed on the waveguide at several loads.

use ndarray::Array2;

use super::contact::Contact;
use super::contact_law::ContactLaw;
use super::error::SimulateError;
use super::leak::LightLaw;
use super::material::Sphere;
use super::pixel_average::{Disc, Patch};
use super::press_options::{Load, PressOptions};

/// A checked scene that makes frames and knows the truth.
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
    contacts: Vec<Contact>,
    light: LightLaw,
}

impl PressScene {
    /// Checks `options` and solves the contact at every load.
    ///
    /// # Errors
    /// [`SimulateError::OutOfRange`] or [`SimulateError::TooFew`] naming the first field that has no meaning.
    pub fn new(options: PressOptions) -> Result<Self, SimulateError> {
        options.validate()?;
        let contacts = (options.loads.iter())
            .map(|load| {
                Contact::new(
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

    /// What the scene was made from.
    pub fn options(&self) -> &PressOptions {
        &self.options
    }

    /// Grey levels per pascal.
    pub(crate) fn grey_per_pascal(&self) -> f64 {
        self.light.grey_per_pascal
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
    /// use tactile_simulate::{Camera, PressOptions, PressScene};
    /// let camera = Camera::default().coarser(16);
    /// let scene = PressScene::new(PressOptions { camera, ..PressOptions::default() })?;
    /// let light = scene.expected_frame(1);
    /// let frames: Vec<_> = (0..50).map(|repeat| scene.frame(1, repeat)).collect();
    /// let at = [32, 43]; // the middle of the contact
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

    /// The same sensor with another object under one load.
    pub(super) fn with_press(
        &self,
        object: Sphere,
        law: ContactLaw,
        load: Load,
    ) -> Result<Self, SimulateError> {
        self.with_object(object, law, vec![load])
    }

    /// Another object on the same sensor, with the same light, camera and centre: a calibration's balls, for instance.
    ///
    /// ```
    /// use tactile_simulate::{Camera, ContactLaw, Elastic, Load, PressOptions, PressScene, Sphere};
    /// let camera = Camera::default().coarser(16);
    /// let scene = PressScene::new(PressOptions { camera, ..PressOptions::default() })?;
    /// let ball = Sphere { radius_m: 10e-3, material: Elastic::RIGID };
    /// let other = scene.with_object(ball, ContactLaw::Hertz, vec![Load::normal(0.5)])?;
    /// assert_eq!(other.truth(0).grey_per_pascal, scene.truth(0).grey_per_pascal);
    /// assert_eq!(other.truth(0).contact.sphere_radius_m, 10e-3);
    /// # Ok::<(), tactile_simulate::SimulateError>(())
    /// ```
    ///
    /// # Errors
    /// [`SimulateError`] for an object or loads without meaning.
    pub fn with_object(
        &self,
        object: Sphere,
        law: ContactLaw,
        loads: Vec<Load>,
    ) -> Result<Self, SimulateError> {
        let changed = Self::new(PressOptions {
            object,
            law,
            loads,
            ..self.options.clone()
        })?;
        Ok(Self {
            light: self.light,
            ..changed
        })
    }

    /// From pressure to light.
    pub(super) fn light(&self) -> &LightLaw {
        &self.light
    }

    /// Contact of load `load`.
    pub(super) fn contact(&self, load: usize) -> &Contact {
        &self.contacts[load]
    }

    /// The contact's disc on the image plane.
    pub(super) fn disc(&self, load: usize) -> Disc {
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

    /// Blurred light of the contact in grey levels above the background; none without force.
    pub(super) fn leaked_light(&self, load: usize) -> Option<Patch> {
        let (disc, camera) = (self.disc(load), &self.options.camera);
        if disc.radius_m == 0.0 {
            return None;
        }
        let (plane, contact) = (camera.plane(), &self.contacts[load]);
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
