//! What a measurement of a simulated press should find, stage by stage.

use nalgebra::{Matrix3, Point3};
use ndarray::Array2;

use super::contact::Contact;
use super::leak::{LightLaw, pressure_patch};
use super::pixel_average::Disc;
use super::press::PressScene;
use super::press_options::Load;

/// The truth of one frame.
///
/// ```
/// use tactile_simulate::{Camera, PressOptions, PressScene};
/// let camera = Camera::default().coarser(16);
/// let scene = PressScene::new(PressOptions { camera, ..PressOptions::default() })?;
/// let (truth, later) = (scene.truth(0), scene.truth(1));
/// assert!((truth.pressure_pa().sum() * camera.pixel_size_m.iter().product::<f64>() - 0.7).abs() < 1e-9, "the force");
/// let middle = [32, 43];
/// assert_eq!(truth.apparent_height_m()[middle], truth.contact.contact_radius_m);
/// assert!(later.waveguide_height_m()[middle] < truth.waveguide_height_m()[middle], "pressed deeper");
/// assert_eq!(truth.centre_px, later.centre_px);
/// // The light above the background, over the grey levels of a pascal, times the area of a pixel: 0.7 N.
/// let seen_n = truth.integrated_pixel_value / truth.grey_per_pascal * camera.pixel_size_m.iter().product::<f64>();
/// assert!((seen_n / 0.7 - 1.0).abs() < 1e-9);
/// assert!((truth.scaling_to(&later).scale - (1.2_f64 / 0.7).cbrt()).abs() < 1e-12);
/// # Ok::<(), tactile_simulate::SimulateError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct PressTruth {
    /// Force, contact radius, pressure, indentation.
    pub contact: Contact,
    /// The load that made it.
    pub load: Load,
    /// Centre (x, y) of the contact in pixels.
    pub centre_px: [f64; 2],
    /// Centroid (x, y) of the pressure that lies in the frame, by pixel averages: the centre to some 1e-5 px, unless
    /// the contact is cut by the frame's edge. NaN when nothing is visible.
    pub centroid_px: [f64; 2],
    /// The force that acts inside the frame, in newton.
    pub visible_force_n: f64,
    /// Sum over the frame of leaked light in grey levels, without blur, lens, noise and clipping: (grey/Pa)·F/pixel area
    /// for a linear response.
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
        PressTruth::new(self, load)
    }
}

impl PressTruth {
    fn new(scene: &PressScene, load: usize) -> Self {
        let (contact, options) = (scene.contact(load).clone(), scene.options());
        let disc = scene.disc(load);
        let mut truth = Self {
            contact,
            load: options.loads[load],
            centre_px: disc.centre_px,
            centroid_px: [f64::NAN; 2],
            visible_force_n: 0.0,
            integrated_pixel_value: 0.0,
            grey_per_pascal: scene.grey_per_pascal(),
            saturated_pixels: saturated_pixels(scene, load),
            pixel_size_m: disc.pixel_size_m,
            shape: options.camera.shape,
        };
        truth.add_moments(scene.light());
        truth
    }

    /// Pressure in pascal, averaged over each pixel; its sum times the pixel's area is the visible force.
    pub fn pressure_pa(&self) -> Array2<f64> {
        let mut field = Array2::zeros(self.shape);
        if self.contact.contact_radius_m > 0.0 {
            let disc = self.disc();
            pressure_patch(&self.contact, &disc, disc.window(self.shape, 0)).add_to(&mut field);
        }
        field
    }

    /// Height of the apparent surface in metres at pixel centres (see [`Contact::apparent_height_m`]).
    pub fn apparent_height_m(&self) -> Array2<f64> {
        Array2::from_shape_fn(self.shape, |(row, col)| {
            let [x, y] = self.offset_m(row, col);
            self.contact.apparent_height_m(x.hypot(y))
        })
    }

    /// Vertical displacement in metres of the waveguide's surface at pixel centres, negative under the object.
    pub fn waveguide_height_m(&self) -> Array2<f64> {
        Array2::from_shape_fn(self.shape, |(row, col)| {
            let [x, y] = self.offset_m(row, col);
            self.contact.waveguide_height_m(x.hypot(y))
        })
    }

    /// How the apparent surface moves from this load to a `later` one.
    pub fn scaling_to(&self, later: &Self) -> SurfaceScaling {
        SurfaceScaling {
            from_centre_m: self.centre_m(),
            to_centre_m: later.centre_m(),
            scale: later.contact.contact_radius_m / self.contact.contact_radius_m,
            height_scale: height_scale(&self.contact, &later.contact),
        }
    }

    /// The contact's centre (x, y) in metres from the first pixel's centre.
    pub(crate) fn centre_m(&self) -> [f64; 2] {
        std::array::from_fn(|k| self.centre_px[k] * self.pixel_size_m[k])
    }

    /// A pixel's centre relative to the contact's, in metres.
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

    /// Force, centroid and integrated pixel value of what the frame shows.
    fn add_moments(&mut self, light: &LightLaw) {
        if self.contact.contact_radius_m == 0.0 {
            return;
        }
        let disc = self.disc();
        let window = disc.window(self.shape, 0);
        let pressure = pressure_patch(&self.contact, &disc, window);
        let (mut sum, mut sum_x, mut sum_y) = (0.0, 0.0, 0.0);
        for ((r, c), &v) in pressure.values.indexed_iter() {
            sum += v;
            sum_x += v * c as f64;
            sum_y += v * r as f64;
        }
        if sum > 0.0 {
            let [row0, col0] = pressure.origin;
            self.centroid_px = [sum_x / sum + col0 as f64, sum_y / sum + row0 as f64];
        }
        self.visible_force_n = sum * self.pixel_size_m[0] * self.pixel_size_m[1];
        self.integrated_pixel_value = light.patch(&self.contact, &disc, window).values.sum();
    }
}

/// Pixels whose expected grey level exceeds 255; the frame is made only where one can.
fn saturated_pixels(scene: &PressScene, load: usize) -> usize {
    let (options, illumination) = (scene.options(), scene.options().loads[load].illumination);
    let peak = scene.contact(load).peak_pressure_pa;
    let brightest = options.camera.background_grey + scene.light().grey_at(peak);
    let lit = illumination.level + 0.5 * (illumination.tilt[0].abs() + illumination.tilt[1].abs());
    if brightest * lit <= 255.0 {
        return 0;
    }
    scene
        .expected_frame(load)
        .iter()
        .filter(|&&v| v > 255.0)
        .count()
}

/// The map that takes the apparent surface of one load to that of another: it scales about the contact's centre.
///
/// The surface read from a press follows Hertz's law, or nearly: a hemisphere of the contact's radius, which grows by (F₂/F₁)^⅓ whatever the
/// object's modulus. Its strain says nothing about the modulus. At finite strain the surface grows less along z than across.
///
/// ```
/// use nalgebra::Point3;
/// use tactile_simulate::SurfaceScaling;
/// let map = SurfaceScaling { from_centre_m: [5e-3, 5e-3], to_centre_m: [6e-3, 5e-3], scale: 1.2, height_scale: 1.1 };
/// let moved = map.apply(&Point3::new(7e-3, 5e-3, 1e-3));
/// assert!((moved - Point3::new(8.4e-3, 5e-3, 1.1e-3)).norm() < 1e-15);
/// let strain = map.green_lagrange_strain();
/// assert!((strain[(0, 0)] - 0.22).abs() < 1e-15 && (strain[(2, 2)] - 0.105).abs() < 1e-15, "½(s² − 1)");
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct SurfaceScaling {
    /// Centre (x, y) of the first contact in metres from the first pixel's centre.
    pub from_centre_m: [f64; 2],
    /// Centre (x, y) of the second contact.
    pub to_centre_m: [f64; 2],
    /// a₂/a₁, (F₂/F₁)^⅓ under Hertz's law.
    pub scale: f64,
    /// Growth of the apparent heights, by least squares over the contact: a₂/a₁ under Hertz's law.
    pub height_scale: f64,
}

impl SurfaceScaling {
    /// Where a point of the first surface lies on the second.
    pub fn apply(&self, point: &Point3<f64>) -> Point3<f64> {
        let [x, y] = std::array::from_fn(|k| {
            self.to_centre_m[k] + self.scale * (point[k] - self.from_centre_m[k])
        });
        Point3::new(x, y, self.height_scale * point.z)
    }

    /// The Green–Lagrange strain of the map, ½(s² − 1) along each axis.
    pub fn green_lagrange_strain(&self) -> Matrix3<f64> {
        let along = [self.scale, self.scale, self.height_scale];
        Matrix3::from_diagonal(&along.map(|s| 0.5 * (s - 1.0) * (s + 1.0)).into())
    }
}

/// k of z₂(ρ) = k z₁(ρ) at equal ρ = r/a, by least squares over the discs.
fn height_scale(from: &Contact, to: &Contact) -> f64 {
    const RINGS: i32 = 32;
    let (mut product, mut square) = (0.0, 0.0);
    for ring in 0..RINGS {
        let rho = ((f64::from(ring) + 0.5) / f64::from(RINGS)).sqrt();
        let [first, second] = [from, to].map(|c| c.apparent_height_m(rho * c.contact_radius_m));
        product += first * second;
        square += first * first;
    }
    product / square
}
